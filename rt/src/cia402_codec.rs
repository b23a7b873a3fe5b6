//! How a drive uses controlword and statusword: as CiA 402 says, or with deviations, which are data.

use crate::cia402::{DriveState, Goal, controlword};

/// How a drive uses controlword (object 6040) and statusword (object 6041). The default is what CiA 402 says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Cia402Codec {
    /// Which states a statusword shows.
    pub states: ShownStates,
    /// How the drive takes over a set-point of profile position.
    pub set_points: SetPointTransfer,
    /// The command by which the drive itself brings its joint to rest.
    pub stop: StopCommand,
    /// The ramps of its profile modes.
    pub ramps: ProfileRamps,
    /// What a heartbeat with the NMT state "stopped" says.
    pub stopped_heartbeat: StoppedHeartbeat,
}

/// Which states a statusword shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum ShownStates {
    /// Every state of the standard, by the masks of the standard.
    #[default]
    All,
    /// Operation enabled and fault. Anything else is taken for switch on disabled, so the drive does not show how far it has
    /// come on its way to operation enabled.
    EnabledAndFault {
        /// Bits that are all set in operation enabled.
        enabled: u16,
        /// Bits of which one is set in a fault, whatever the others are.
        fault: u16,
    },
}

/// How a drive takes over a set-point of profile position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum SetPointTransfer {
    /// Bit 4 of the controlword offers it, and bit 12 of the statusword acknowledges it.
    #[default]
    Acknowledged,
    /// It is effective at once while bit 5 of the controlword is set. Nothing is acknowledged.
    Immediate,
}

/// The command by which a drive itself brings its joint to rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum StopCommand {
    /// Quick stop (bit 2 of the controlword is low), by which the drive then takes its torque away.
    #[default]
    QuickStop,
    /// Halt (bit 8 of the controlword), for a drive without quick stop. It keeps the joint in position.
    Halt,
}

/// The ramps of a drive's profile modes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum ProfileRamps {
    /// It speeds up by one (object 6083) and slows down by another (object 6084).
    #[default]
    Separate,
    /// It has one ramp for both.
    Common,
}

/// What a heartbeat with the NMT state "stopped" says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum StoppedHeartbeat {
    /// The node is stopped: it takes no process data.
    #[default]
    Stopped,
    /// The drive has an alarm; it still takes process data.
    Alarm,
}

impl Cia402Codec {
    /// As the standard says.
    pub const STANDARD: Self = Self {
        states: ShownStates::All,
        set_points: SetPointTransfer::Acknowledged,
        stop: StopCommand::QuickStop,
        ramps: ProfileRamps::Separate,
        stopped_heartbeat: StoppedHeartbeat::Stopped,
    };

    /// The state that a statusword shows.
    pub const fn state(&self, word: u16) -> DriveState {
        match self.states {
            ShownStates::All => DriveState::decode(word),
            ShownStates::EnabledAndFault { fault, .. } if word & fault != 0 => DriveState::Fault,
            ShownStates::EnabledAndFault { enabled, .. } if word & enabled == enabled => {
                DriveState::OperationEnabled
            }
            ShownStates::EnabledAndFault { .. } => DriveState::SwitchOnDisabled,
        }
    }

    /// The controlword after `last` that leads a drive in `state` towards `goal`. Where a drive does not show how far it has
    /// come, the next controlword follows from the last one: 06, 07, 0F, and 06 again if the drive is still not enabled.
    #[inline]
    pub const fn controlword(&self, state: DriveState, goal: Goal, last: u16) -> u16 {
        match (self.states, goal, state) {
            (ShownStates::EnabledAndFault { .. }, Goal::Enabled, DriveState::OperationEnabled) => {
                controlword::ENABLE_OPERATION
            }
            (ShownStates::EnabledAndFault { .. }, Goal::Enabled, _) => match last {
                controlword::SHUTDOWN => controlword::SWITCH_ON,
                controlword::SWITCH_ON => controlword::ENABLE_OPERATION,
                _ => controlword::SHUTDOWN,
            },
            _ => state.controlword_towards(goal),
        }
    }

    /// Returns `true` if the drive acknowledges set-points of profile position by bit 12 of the statusword.
    pub const fn acknowledges_set_points(&self) -> bool {
        matches!(self.set_points, SetPointTransfer::Acknowledged)
    }

    /// Returns `true` if the drive has a quick stop.
    pub const fn has_quick_stop(&self) -> bool {
        matches!(self.stop, StopCommand::QuickStop)
    }

    /// The controlword by which an enabled drive itself brings its joint to rest.
    pub const fn stop_word(&self) -> u16 {
        match self.stop {
            StopCommand::QuickStop => controlword::QUICK_STOP,
            StopCommand::Halt => controlword::ENABLE_OPERATION | controlword::HALT,
        }
    }

    /// Returns `true` if a heartbeat with the NMT state "stopped" says that the node is stopped.
    pub const fn is_stopped_by_heartbeat(&self) -> bool {
        matches!(self.stopped_heartbeat, StoppedHeartbeat::Stopped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive that deviates in everything.
    const DEVIATING: Cia402Codec = Cia402Codec {
        states: ShownStates::EnabledAndFault { enabled: 0x37, fault: 0x08 },
        set_points: SetPointTransfer::Immediate,
        stop: StopCommand::Halt,
        ramps: ProfileRamps::Common,
        stopped_heartbeat: StoppedHeartbeat::Alarm,
    };

    #[test]
    fn a_statusword_of_two_states_shows_enabled_by_all_its_bits_and_a_fault_by_any() {
        let seen = [
            (0x0037, DriveState::OperationEnabled),
            (0x0437, DriveState::OperationEnabled),
            (0x0404, DriveState::SwitchOnDisabled),
            (0x0014, DriveState::SwitchOnDisabled),
            (0x043F, DriveState::Fault),
            (0x0008, DriveState::Fault),
        ];
        for (word, state) in seen {
            assert_eq!(DEVIATING.state(word), state, "{word:#06x}");
        }
    }

    #[test]
    fn a_drive_that_does_not_show_its_way_is_enabled_by_06_07_0f_and_again_if_it_does_not_follow() {
        let next = |last| DEVIATING.controlword(DriveState::SwitchOnDisabled, Goal::Enabled, last);
        assert_eq!([0, 0x06, 0x07, 0x0F].map(next), [0x06, 0x07, 0x0F, 0x06]);
        let enabled = |goal| DEVIATING.controlword(DriveState::OperationEnabled, goal, 0x0F);
        assert_eq!([Goal::Enabled, Goal::Disabled, Goal::NoVoltage].map(enabled), [0x0F, 0x06, 0x00]);
    }

    #[test]
    fn the_standard_is_followed_where_a_drive_follows_it() {
        let standard = Cia402Codec::default();
        assert_eq!(standard, Cia402Codec::STANDARD);
        for state in DriveState::ALL {
            for goal in [Goal::NoVoltage, Goal::Disabled, Goal::Enabled, Goal::QuickStop] {
                assert_eq!(standard.controlword(state, goal, 0x07), state.controlword_towards(goal));
            }
            assert_eq!(standard.state(state.statusword_bits()), DriveState::decode(state.statusword_bits()));
        }
        assert!(standard.acknowledges_set_points() && standard.is_stopped_by_heartbeat());
    }

    #[test]
    fn a_drive_without_quick_stop_is_stopped_by_halt_while_it_stays_enabled() {
        assert_eq!((Cia402Codec::default().stop_word(), DEVIATING.stop_word()), (0x02, 0x10F));
    }
}
