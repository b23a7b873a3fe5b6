//! The controlwords (object 6040) that a drive is sent: which one, how long ago, and whether one is due.

use crate::cia402::controlword;

/// Cycles of its bus after which a drive has obeyed a controlword and has said so.
pub(super) const SETTLED_CYCLES: u32 = 4;

/// The controlwords that an axis has sent. Cycles are those of its bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct ControlwordSender {
    /// The last controlword without the bits of its mode of operation: bits 0 to 3 and 7.
    last: u16,
    /// Cycles since it was sent, or sent again.
    age_cycles: u32,
    /// True if a PDO that is sent with controlwords only is due in this cycle.
    is_due: bool,
    /// Cycles since a controlword that leads to operation enabled; `None` when the drive has shown torque since, or when
    /// there was none.
    since_enabling_cycles: Option<u32>,
}

impl ControlwordSender {
    /// Takes the controlword of this cycle. With a spacing, one that has not changed is sent again after so many cycles,
    /// unless `is_kept`: the drive is enabled, as it is to be.
    #[inline]
    pub(super) fn take(&mut self, word: u16, spacing_cycles: u32, is_kept: bool, has_torque: bool) {
        // A drive that is not to be enabled is told so again and again, whatever it seems to show: the frame before may have
        // been lost, and the statusword may have been another node's.
        let is_repeated =
            spacing_cycles > 0 && self.age_cycles >= spacing_cycles.max(SETTLED_CYCLES) && !is_kept;
        self.is_due = word != self.last || is_repeated;
        self.age_cycles = if self.is_due { 0 } else { self.age_cycles.saturating_add(1) };
        self.last = word;
        self.since_enabling_cycles = match word {
            // A drive that has shown torque also shows when it has none any more.
            _ if has_torque => None,
            controlword::SWITCH_ON | controlword::ENABLE_OPERATION => Some(0),
            _ => self.since_enabling_cycles.map(|cycles| cycles.saturating_add(1)),
        };
    }

    /// Takes a controlword that the drive has got by another way than process data.
    pub(super) fn note_by_service(&mut self, word: u16) {
        (self.last, self.age_cycles) = (word, 0);
    }

    /// The last controlword without the bits of its mode of operation.
    pub(super) const fn last(&self) -> u16 {
        self.last
    }

    /// Returns `true` if a PDO that is sent with controlwords only is due in this cycle.
    pub(super) const fn is_due(&self) -> bool {
        self.is_due
    }

    /// Returns `true` if the next step towards operation enabled must wait, because the drive does not show how far it has come.
    pub(super) const fn must_wait(&self, spacing_cycles: u32) -> bool {
        self.last != 0 && self.age_cycles < spacing_cycles
    }

    /// Returns `true` if the drive has been disabled for so long that no older controlword is under way, and no older statusword.
    pub(super) const fn is_disabled_for_long(&self) -> bool {
        self.last == controlword::SHUTDOWN && self.age_cycles >= SETTLED_CYCLES
    }

    /// Returns `true` if the last controlword leads away from operation enabled, or none has been sent. It is one that has left: late ones are
    /// not made.
    pub(super) const fn leads_away(&self) -> bool {
        !matches!(self.last, controlword::SWITCH_ON | controlword::ENABLE_OPERATION)
    }

    /// Returns `true` if a controlword that leads to operation enabled may still be on its way to the drive, or the drive's answer on
    /// its way back.
    pub(super) fn may_be_switching_on(&self) -> bool {
        self.since_enabling_cycles.is_some_and(|cycles| cycles <= SETTLED_CYCLES)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHUTDOWN: u16 = controlword::SHUTDOWN;
    const ENABLE: u16 = controlword::ENABLE_OPERATION;

    #[test]
    fn an_enabling_controlword_may_be_under_way_for_some_cycles_unless_the_drive_has_shown_torque() {
        for has_torque in [false, true] {
            let mut sender = ControlwordSender::default();
            sender.take(ENABLE, 0, false, has_torque);
            assert_eq!(sender.may_be_switching_on(), !has_torque);
            for cycle in 1..10 {
                // Another disabling controlword in between changes nothing.
                let word = if cycle == 2 { controlword::DISABLE_VOLTAGE } else { SHUTDOWN };
                sender.take(word, 0, false, false);
                assert_eq!(sender.may_be_switching_on(), !has_torque && cycle <= SETTLED_CYCLES);
            }
        }
    }

    #[test]
    fn only_a_controlword_that_has_left_leads_a_drive_away_from_operation_enabled() {
        let mut sender = ControlwordSender::default();
        assert!(sender.leads_away(), "nothing has led it there");
        sender.take(ENABLE, 0, true, true);
        assert!(!sender.leads_away());
        // By process data, or by SDO.
        let mut told_by_service = sender;
        sender.take(SHUTDOWN, 0, false, true);
        told_by_service.note_by_service(controlword::DISABLE_VOLTAGE);
        assert!(sender.leads_away() && told_by_service.leads_away());
    }

    #[test]
    fn a_controlword_is_due_when_it_changes_and_again_after_the_spacing_while_the_drive_is_not_enabled() {
        let due = |is_kept: bool| {
            let mut sender = ControlwordSender::default();
            [0; 14].map(|_| {
                sender.take(SHUTDOWN, 6, is_kept, false);
                sender.is_due()
            })
        };
        assert!(due(false).iter().enumerate().all(|(cycle, is_due)| *is_due == (cycle % 7 == 0)));
        assert!(due(true).iter().enumerate().all(|(cycle, is_due)| *is_due == (cycle == 0)));
    }

    #[test]
    fn the_next_step_waits_for_the_spacing_but_the_first_does_not() {
        let mut sender = ControlwordSender::default();
        assert!(!sender.must_wait(3));
        sender.take(SHUTDOWN, 3, false, false);
        for _ in 0..3 {
            assert!(sender.must_wait(3) && !sender.is_disabled_for_long());
            sender.take(SHUTDOWN, 3, false, false);
        }
        assert!(!sender.must_wait(3));
    }
}
