//! How a family of drives uses controlword and statusword where it differs from CiA 402.

use crate::cia402::{DriveState, Goal, controlword, statusword};

/// The meaning of the bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    /// As the standard says.
    #[default]
    Cia402,
    /// YZ-AIM (manual v1.62, 5.04): bits 6, 7, 9, 11, 14 and 15 of the statusword are absent, bit 3 alone is an alarm,
    /// and there is no state machine that the bits would show before the drive is enabled. Set-points are not
    /// acknowledged; bit 5 of the controlword makes every target effective at once.
    YzAim,
}

/// Bits 0, 1, 2, 4 and 5: what an enabled YZ-AIM shows.
const YZ_AIM_ENABLED: u16 = 0x37;
const ALARM: u16 = 0x08;

impl Dialect {
    /// The state that a statusword shows. A YZ-AIM shows no more than enabled, alarm, or neither, which is given as
    /// switch on disabled.
    pub const fn state(self, word: u16) -> DriveState {
        match self {
            Self::Cia402 => DriveState::decode(word),
            Self::YzAim if word & ALARM != 0 => DriveState::Fault,
            Self::YzAim if word & YZ_AIM_ENABLED == YZ_AIM_ENABLED => DriveState::OperationEnabled,
            Self::YzAim => DriveState::SwitchOnDisabled,
        }
    }

    /// The controlword after `last` that leads a drive in `state` towards `goal`. A YZ-AIM does not show how far it has come,
    /// so the next controlword follows from the last one: 06, 07, 0F, and 06 again if the drive is still not enabled.
    #[inline]
    pub const fn controlword(self, state: DriveState, goal: Goal, last: u16) -> u16 {
        match (self, goal, state) {
            (Self::YzAim, Goal::Enabled, DriveState::OperationEnabled) => controlword::ENABLE_OPERATION,
            (Self::YzAim, Goal::Enabled, _) => match last {
                controlword::SHUTDOWN => controlword::SWITCH_ON,
                controlword::SWITCH_ON => controlword::ENABLE_OPERATION,
                _ => controlword::SHUTDOWN,
            },
            _ => state.controlword_towards(goal),
        }
    }

    /// Whether the drive acknowledges set-points of profile position by bit 12.
    pub const fn acknowledges_set_points(self) -> bool {
        matches!(self, Self::Cia402)
    }

    /// Whether a statusword shows that the target of a profile mode is reached.
    pub const fn is_target_reached(self, word: u16) -> bool {
        word & statusword::TARGET_REACHED != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statuswords_of_the_yz_aim_manual_decode_bit_by_bit() {
        let seen = [
            (0x0037, DriveState::OperationEnabled),
            (0x0437, DriveState::OperationEnabled),
            (0x0404, DriveState::SwitchOnDisabled),
            (0x0014, DriveState::SwitchOnDisabled),
            (0x1414, DriveState::SwitchOnDisabled),
            (0x043F, DriveState::Fault),
            (0x0008, DriveState::Fault),
        ];
        for (word, state) in seen {
            assert_eq!(Dialect::YzAim.state(word), state, "{word:#06x}");
        }
    }

    #[test]
    fn a_yz_aim_is_led_up_by_06_07_0f_and_again_if_it_does_not_follow() {
        let next = |last| Dialect::YzAim.controlword(DriveState::SwitchOnDisabled, Goal::Enabled, last);
        assert_eq!([0, 0x06, 0x07, 0x0F].map(next), [0x06, 0x07, 0x0F, 0x06]);
        assert_eq!(Dialect::YzAim.controlword(DriveState::OperationEnabled, Goal::Enabled, 0x0F), 0x0F);
        assert_eq!(Dialect::YzAim.controlword(DriveState::OperationEnabled, Goal::Disabled, 0x0F), 0x06);
        assert_eq!(Dialect::YzAim.controlword(DriveState::OperationEnabled, Goal::NoVoltage, 0x0F), 0x00);
    }

    #[test]
    fn the_standard_is_followed_where_a_drive_follows_it() {
        for state in DriveState::ALL {
            let word = Dialect::Cia402.controlword(state, Goal::Enabled, 0);
            assert_eq!(word, state.controlword_towards(Goal::Enabled));
        }
    }
}
