//! The target of a drive in a profile mode.

use crate::profile::{ProfileCommand, ProfileTarget};
use crate::time::Nanoseconds;

/// A drive that stands before its target for this many times the time that a following error may last does not get
/// there: it needs some of it to begin, and to see that it has arrived.
const STALL_PATIENCE: u32 = 20;

/// A target, and when it expires.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct TimedTarget {
    pub(super) target: ProfileTarget,
    pub(super) valid_until_ns: Nanoseconds,
}

/// The target of a drive in a profile mode, and what becomes of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct ProfileMode {
    pub(super) command: ProfileCommand,
    /// What `command` stands for; `None` before the first target since the drive was enabled.
    target: Option<TimedTarget>,
    /// Slots in which a drive in profile position has stood before its target.
    stalled_cycles: u32,
}

impl ProfileMode {
    pub(super) fn set(&mut self, raw: i32, needs_handshake: bool, target: TimedTarget) {
        self.command.set(raw, needs_handshake);
        self.target = Some(target);
    }

    /// The drive has no torque: nothing is to move.
    pub(super) fn rest(&mut self, target_raw: i32) {
        self.command.rest(target_raw);
        self.target = None;
    }

    /// Goes on by one cycle of the bus in a mode without a handshake.
    pub(super) fn pass(&mut self) {
        self.command.pass();
    }

    /// Goes on by one cycle of the bus. The bits of the controlword for profile position.
    pub(super) fn position_bits(&mut self, statusword: u16) -> u16 {
        self.command.position_bits(statusword)
    }

    /// The target in drive units.
    pub(super) const fn target_raw(&self) -> i32 {
        self.command.target_raw()
    }

    pub(super) fn target(&self) -> Option<ProfileTarget> {
        self.target.map(|timed| timed.target)
    }

    /// The torque that the drive is asked for: N·m (N).
    pub(super) fn torque(&self) -> f64 {
        match self.target() {
            Some(ProfileTarget::Torque(torque)) => torque,
            _ => 0.0,
        }
    }

    pub(super) fn is_moving_on_command(&self) -> bool {
        match self.target() {
            Some(ProfileTarget::Velocity(value) | ProfileTarget::Torque(value)) => value != 0.0,
            _ => false,
        }
    }

    #[inline]
    pub(super) fn expired_ns(&self, now_ns: Nanoseconds) -> Nanoseconds {
        let until = self.target.filter(|_| self.is_moving_on_command()).map(|timed| timed.valid_until_ns);
        until.map_or(0, |until_ns| now_ns.saturating_sub(until_ns))
    }

    pub(super) fn count_stall(&mut self, is_stalled: bool) {
        self.stalled_cycles = if is_stalled { self.stalled_cycles.saturating_add(1) } else { 0 };
    }

    /// Returns `true` if the drive has stood before its target for too long, where a following error may last for so many slots.
    pub(super) const fn is_stalled(&self, following_error_cycles: u32) -> bool {
        let allowed = if following_error_cycles == 0 { 1 } else { following_error_cycles };
        self.stalled_cycles > STALL_PATIENCE.saturating_mul(allowed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_may_stand_before_its_target_for_a_multiple_of_the_time_that_a_following_error_may_last() {
        let stalled = |stalled_cycles| ProfileMode { stalled_cycles, ..ProfileMode::default() };
        assert!(!stalled(STALL_PATIENCE).is_stalled(0) && stalled(STALL_PATIENCE + 1).is_stalled(0));
        assert!(!stalled(60).is_stalled(3) && stalled(61).is_stalled(3));
        // The product is more than 32 bits hold: it is never reached, and does not wrap to a small number.
        for allowed in [u32::MAX / STALL_PATIENCE + 1, u32::MAX] {
            assert!(!stalled(u32::MAX).is_stalled(allowed));
        }
    }

    #[test]
    fn only_a_velocity_or_a_torque_that_is_not_zero_expires() {
        let mut profile = ProfileMode::default();
        for (target, expired_ns) in [
            (ProfileTarget::Velocity(0.5), 30),
            (ProfileTarget::Velocity(0.0), 0),
            (ProfileTarget::Torque(-2.0), 30),
            (ProfileTarget::Position(1.0), 0),
        ] {
            profile.set(0, false, TimedTarget { target, valid_until_ns: 70 });
            assert_eq!(profile.expired_ns(100), expired_ns, "{target:?}");
        }
        profile.rest(0);
        assert_eq!((profile.target(), profile.expired_ns(100)), (None, 0));
    }
}
