//! The profile modes (CiA 402: PP, PV, PT), in which the drive makes its own way to a target: how a target is handed
//! over and when it has been reached.

use crate::cia402::{controlword, statusword};

/// A target of a profile mode.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum ProfileTarget {
    /// Profile position: rad (m).
    Position(f64),
    /// Profile velocity: rad/s (m/s).
    Velocity(f64),
    /// Profile torque: N·m (N).
    Torque(f64),
}

/// Cycles after a target was set in which the statusword may still tell of the one before: it is sent in one cycle,
/// taken over at the next SYNC, and reported at the one after that.
const STALE_CYCLES: u32 = 3;

/// Where the handshake of profile position stands (CiA 402-2, 8.3.2): bit 4 of the controlword rises, the drive
/// answers with bit 12 of the statusword, both fall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
enum Handshake {
    #[default]
    Idle,
    /// Bit 4 is low until nothing that is still under way can be about the set-point before.
    Clearing,
    Offering,
    Withdrawing,
}

/// The target of a drive in a profile mode, in drive units, on its way to the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct ProfileCommand {
    target_raw: i32,
    handshake: Handshake,
    cycles: u32,
    /// Cycles for which a handshake has been under way and bit 12 has not changed.
    waiting_cycles: u32,
    was_acknowledged: bool,
}

impl ProfileCommand {
    /// The target in drive units.
    pub const fn target_raw(&self) -> i32 {
        self.target_raw
    }

    /// A new target. `needs_handshake` where the drive acknowledges it.
    pub fn set(&mut self, target_raw: i32, needs_handshake: bool) {
        self.target_raw = target_raw;
        if !needs_handshake {
            self.handshake = Handshake::Idle;
            self.cycles = 0;
            return;
        }
        self.cycles = match self.handshake {
            // Without a handshake under way there is nothing to wait for but the drive's bit 12.
            Handshake::Idle => STALE_CYCLES,
            // Not offered yet: the drive never sees the target before.
            Handshake::Clearing => self.cycles,
            Handshake::Offering | Handshake::Withdrawing => 0,
        };
        self.handshake = Handshake::Clearing;
    }

    /// What a drive without torque is given, which needs no handshake: nothing is to move.
    pub fn rest(&mut self, target_raw: i32) {
        *self = Self { target_raw, cycles: STALE_CYCLES, ..Self::default() };
    }

    /// Goes on by one cycle of the drive's bus, with its newest statusword, and gives the bits that the controlword of
    /// an enabled drive in profile position needs beside bits 0 to 3.
    pub fn position_bits(&mut self, word: u16) -> u16 {
        let is_acknowledged = word & statusword::BIT_12 != 0;
        let next = match self.handshake {
            Handshake::Clearing if self.cycles >= STALE_CYCLES && !is_acknowledged => Handshake::Offering,
            Handshake::Offering if is_acknowledged => Handshake::Withdrawing,
            Handshake::Withdrawing if !is_acknowledged => Handshake::Idle,
            same => same,
        };
        self.cycles = if next == self.handshake { self.cycles.saturating_add(1) } else { 0 };
        let is_answered = next == Handshake::Idle || is_acknowledged != self.was_acknowledged;
        self.waiting_cycles = if is_answered { 0 } else { self.waiting_cycles.saturating_add(1) };
        self.was_acknowledged = is_acknowledged;
        self.handshake = next;
        if next == Handshake::Offering { controlword::BIT_4 | controlword::BIT_5 } else { 0 }
    }

    /// Goes on by one cycle of the drive's bus in a mode without a handshake.
    pub fn pass(&mut self) {
        self.cycles = self.cycles.saturating_add(1);
    }

    /// Cycles for which the drive has not answered the handshake; 0 when none is under way.
    pub const fn waiting_cycles(&self) -> u32 {
        self.waiting_cycles
    }

    /// Cycles from setting a target now to the one in which it is offered, if the drive answers as it should.
    pub fn cycles_to_offer(&self) -> u32 {
        if self.handshake == Handshake::Idle { 0 } else { 2 * STALE_CYCLES }
    }

    /// Returns `true` if the drive has the target and says that it has reached it.
    pub fn is_reached(&self, word: u16) -> bool {
        let is_shown = word & statusword::TARGET_REACHED != 0;
        self.handshake == Handshake::Idle && self.cycles >= STALE_CYCLES && is_shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OFFER: u16 = controlword::BIT_4 | controlword::BIT_5;
    const ACKNOWLEDGED: u16 = statusword::BIT_12;

    #[test]
    fn a_set_point_is_offered_until_it_is_acknowledged_and_then_withdrawn() {
        let mut command = ProfileCommand::default();
        command.set(1000, true);
        let words = [0, 0, ACKNOWLEDGED, ACKNOWLEDGED, 0, 0];
        assert_eq!(words.map(|word| command.position_bits(word)), [OFFER, OFFER, 0, 0, 0, 0]);
        assert_eq!(command.waiting_cycles(), 0);
    }

    #[test]
    fn an_acknowledgement_of_the_target_before_is_not_taken_for_this_ones() {
        let mut command = ProfileCommand::default();
        command.set(1000, true);
        for waited in 0..5 {
            assert_eq!(command.position_bits(ACKNOWLEDGED), 0);
            assert_eq!(command.waiting_cycles(), waited);
        }
        assert_eq!(command.position_bits(0), OFFER);
    }

    #[test]
    fn targets_in_every_cycle_are_offered_again_and_again_and_an_answer_is_waited_for_once() {
        // The drive acknowledges an offer one cycle after it was sent, and lets go one cycle after that.
        let run = |answers: bool| {
            let mut command = ProfileCommand::default();
            let (mut word, mut offers, mut longest) = (0, 0, 0);
            for target in 0..100 {
                command.set(target, true);
                let bits = command.position_bits(word);
                word = if answers && bits == OFFER { ACKNOWLEDGED } else { 0 };
                offers += u32::from(bits == OFFER);
                longest = longest.max(command.waiting_cycles());
            }
            (offers, longest)
        };
        let (offers, longest) = run(true);
        assert!(offers >= 15 && longest <= 10, "{offers} {longest}");
        assert_eq!(run(false).1, 100);
    }

    #[test]
    fn target_reached_counts_only_once_it_can_be_about_this_target() {
        let mut command = ProfileCommand::default();
        command.set(7, false);
        assert!(!command.is_reached(statusword::TARGET_REACHED));
        for _ in 0..STALE_CYCLES {
            command.pass();
        }
        assert!(command.is_reached(statusword::TARGET_REACHED));
        assert!(!command.is_reached(0));
    }

    #[test]
    fn a_target_in_the_middle_of_a_handshake_waits_until_the_old_one_cannot_answer_any_more() {
        let mut command = ProfileCommand::default();
        command.set(1, true);
        assert_eq!(command.position_bits(0), OFFER);
        command.set(2, true);
        // The drive has seen the first offer and acknowledges it while bit 4 is low again.
        let words = [0, ACKNOWLEDGED, ACKNOWLEDGED, 0, 0];
        assert_eq!(words.map(|word| command.position_bits(word)), [0, 0, 0, OFFER, OFFER]);
        assert_eq!(command.target_raw(), 2);
    }
}
