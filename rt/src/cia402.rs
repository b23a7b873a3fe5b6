//! The drive state machine of CiA 402 (IEC 61800-7-201): statuswords decoded by mask, controlwords, the way from
//! any state to a wanted one, and the modes of operation.

/// A state of the drive, as the statusword shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub enum DriveState {
    /// The drive initialises itself. Also what is assumed before the first statusword.
    #[default]
    NotReadyToSwitchOn = 0,
    /// Initialised; high power may be absent.
    SwitchOnDisabled = 1,
    /// High power may be switched on.
    ReadyToSwitchOn = 2,
    /// High power is on, no torque.
    SwitchedOn = 3,
    /// Torque is on and set-points are followed.
    OperationEnabled = 4,
    /// The quick-stop ramp runs, or has run and holds.
    QuickStopActive = 5,
    /// A fault has been seen; the drive's own reaction is running.
    FaultReactionActive = 6,
    /// Stopped by a fault; no torque.
    Fault = 7,
    /// A bit pattern that the standard gives no meaning.
    Undefined = 8,
}

impl DriveState {
    /// Its name in CiA 402.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotReadyToSwitchOn => "not ready to switch on",
            Self::SwitchOnDisabled => "switch on disabled",
            Self::ReadyToSwitchOn => "ready to switch on",
            Self::SwitchedOn => "switched on",
            Self::OperationEnabled => "operation enabled",
            Self::QuickStopActive => "quick stop active",
            Self::FaultReactionActive => "fault reaction active",
            Self::Fault => "fault",
            Self::Undefined => "no state of CiA 402",
        }
    }

    /// Every state, in the order of their numbers.
    pub const ALL: [Self; 9] = [
        Self::NotReadyToSwitchOn,
        Self::SwitchOnDisabled,
        Self::ReadyToSwitchOn,
        Self::SwitchedOn,
        Self::OperationEnabled,
        Self::QuickStopActive,
        Self::FaultReactionActive,
        Self::Fault,
        Self::Undefined,
    ];

    /// Decodes a statusword by the masks of the standard: bit 5 (quick stop) counts only where it tells states
    /// apart, and bit 4 and everything from bit 7 up never counts, since drives set those freely.
    pub const fn decode(statusword: u16) -> Self {
        match statusword & 0x6F {
            0x00 | 0x20 => Self::NotReadyToSwitchOn,
            0x40 | 0x60 => Self::SwitchOnDisabled,
            0x21 => Self::ReadyToSwitchOn,
            0x23 => Self::SwitchedOn,
            0x27 => Self::OperationEnabled,
            0x07 => Self::QuickStopActive,
            0x0F | 0x2F => Self::FaultReactionActive,
            0x08 | 0x28 => Self::Fault,
            _ => Self::Undefined,
        }
    }

    /// The bits that show this state in a statusword, to be joined with the freely set ones.
    pub const fn statusword_bits(self) -> u16 {
        match self {
            Self::NotReadyToSwitchOn | Self::Undefined => 0x00,
            Self::SwitchOnDisabled => 0x40,
            Self::ReadyToSwitchOn => 0x21,
            Self::SwitchedOn => 0x23,
            Self::OperationEnabled => 0x27,
            Self::QuickStopActive => 0x07,
            Self::FaultReactionActive => 0x0F,
            Self::Fault => 0x08,
        }
    }

    /// Returns `true` if the drive's power stage drives the motor.
    pub const fn has_torque(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive)
    }

    /// Returns `true` if a fault is present or being reacted to.
    pub const fn is_faulted(self) -> bool {
        matches!(self, Self::Fault | Self::FaultReactionActive)
    }

    /// The state that `command` leads to, by the transitions of the standard (in brackets); the same state when
    /// the command has no effect in it. `fault_reset_edge` tells that bit 7 has just risen: a level does nothing.
    pub const fn after(self, command: Command, fault_reset_edge: bool) -> Self {
        match (self, command) {
            (Self::Fault, _) if fault_reset_edge => Self::SwitchOnDisabled, // 15
            (Self::SwitchOnDisabled, Command::Shutdown) => Self::ReadyToSwitchOn, // 2
            (Self::ReadyToSwitchOn, Command::SwitchOn) => Self::SwitchedOn, // 3
            // 3 and 4 in one step, as the standard allows and drives do.
            (Self::ReadyToSwitchOn | Self::SwitchedOn, Command::EnableOperation) => Self::OperationEnabled,
            (Self::OperationEnabled, Command::SwitchOn) => Self::SwitchedOn, // 5
            (Self::SwitchedOn | Self::OperationEnabled, Command::Shutdown) => Self::ReadyToSwitchOn, // 6, 8
            (Self::ReadyToSwitchOn | Self::SwitchedOn, Command::DisableVoltage | Command::QuickStop) => {
                Self::SwitchOnDisabled // 7, 10
            }
            (Self::OperationEnabled, Command::DisableVoltage) => Self::SwitchOnDisabled, // 9
            (Self::OperationEnabled, Command::QuickStop) => Self::QuickStopActive,       // 11
            (Self::QuickStopActive, Command::DisableVoltage) => Self::SwitchOnDisabled,  // 12
            (Self::QuickStopActive, Command::EnableOperation) => Self::OperationEnabled, // 16
            (state, _) => state,
        }
    }

    /// The controlword that brings a drive one step nearer to `goal`, or holds it there. A fault is reset by the
    /// rising edge of bit 7, so it is the caller who decides when to raise it: here it stays low.
    pub const fn controlword_towards(self, goal: Goal) -> u16 {
        match goal {
            Goal::NoVoltage => controlword::DISABLE_VOLTAGE,
            Goal::QuickStop => match self {
                Self::OperationEnabled | Self::QuickStopActive => controlword::QUICK_STOP,
                _ => controlword::SHUTDOWN,
            },
            Goal::Disabled => match self {
                Self::QuickStopActive => controlword::DISABLE_VOLTAGE,
                _ => controlword::SHUTDOWN,
            },
            Goal::Enabled => match self {
                Self::ReadyToSwitchOn => controlword::SWITCH_ON,
                Self::SwitchedOn | Self::OperationEnabled => controlword::ENABLE_OPERATION,
                Self::QuickStopActive => controlword::DISABLE_VOLTAGE,
                _ => controlword::SHUTDOWN,
            },
        }
    }
}

/// Where a drive is to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// Switch on disabled: no voltage on the power stage.
    NoVoltage,
    /// Ready to switch on: no torque, brake applied.
    Disabled,
    /// Operation enabled.
    Enabled,
    /// Brought to rest by the drive itself, which then takes its torque away.
    QuickStop,
}

/// The device control commands, which the standard encodes in bits 0 to 3 of the controlword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// `x110`
    Shutdown,
    /// `0111`
    SwitchOn,
    /// `1111`
    EnableOperation,
    /// `xx0x`
    DisableVoltage,
    /// `x01x`
    QuickStop,
}

impl Command {
    /// Decodes bits 0 to 3 of a controlword.
    pub const fn decode(controlword: u16) -> Self {
        match controlword & 0x0F {
            bits if bits & 0b0010 == 0 => Self::DisableVoltage,
            bits if bits & 0b0100 == 0 => Self::QuickStop,
            bits if bits & 0b0001 == 0 => Self::Shutdown,
            0b0111 => Self::SwitchOn,
            _ => Self::EnableOperation,
        }
    }
}

/// Controlwords (object 6040) and their bits.
pub mod controlword {
    /// Leads to ready to switch on.
    pub const SHUTDOWN: u16 = 0x06;
    /// Leads to switched on.
    pub const SWITCH_ON: u16 = 0x07;
    /// Leads to operation enabled.
    pub const ENABLE_OPERATION: u16 = 0x0F;
    /// Leads to switch on disabled at once.
    pub const DISABLE_VOLTAGE: u16 = 0x00;
    /// Starts the drive's quick-stop ramp.
    pub const QUICK_STOP: u16 = 0x02;
    /// Its rising edge clears a fault.
    pub const FAULT_RESET: u16 = 0x80;
    /// Profile position: new set-point. Interpolated position: interpolate.
    pub const BIT_4: u16 = 0x10;
    /// Profile position: change set immediately.
    pub const BIT_5: u16 = 0x20;
    /// Profile position: the target is relative.
    pub const RELATIVE: u16 = 0x40;
    /// Stops the motion of a profile mode.
    pub const HALT: u16 = 0x100;
}

/// Bits of the statusword (object 6041) beside the state.
pub mod statusword {
    /// A warning is present; drives set it freely.
    pub const WARNING: u16 = 0x80;
    /// The drive obeys the bus.
    pub const REMOTE: u16 = 0x200;
    /// The target is reached.
    pub const TARGET_REACHED: u16 = 0x400;
    /// A software limit is active.
    pub const INTERNAL_LIMIT: u16 = 0x800;
    /// Profile position: set-point acknowledged. Cyclic modes: the drive follows the command value.
    pub const BIT_12: u16 = 0x1000;
    /// Following or homing error, by mode.
    pub const BIT_13: u16 = 0x2000;
}

/// Modes of operation (object 6060).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(i8)]
pub enum OperationMode {
    /// Profile position (PP).
    ProfilePosition = 1,
    /// Velocity mode of frequency converters (VL).
    Velocity = 2,
    /// Profile velocity (PV).
    ProfileVelocity = 3,
    /// Profile torque (PT).
    ProfileTorque = 4,
    /// Homing (HM).
    Homing = 6,
    /// Interpolated position (IP).
    InterpolatedPosition = 7,
    /// Cyclic synchronous position (CSP).
    CyclicSynchronousPosition = 8,
    /// Cyclic synchronous velocity (CSV).
    CyclicSynchronousVelocity = 9,
    /// Cyclic synchronous torque (CST).
    CyclicSynchronousTorque = 10,
}

impl OperationMode {
    /// Its name in CiA 402.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ProfilePosition => "profile position",
            Self::Velocity => "velocity",
            Self::ProfileVelocity => "profile velocity",
            Self::ProfileTorque => "profile torque",
            Self::Homing => "homing",
            Self::InterpolatedPosition => "interpolated position",
            Self::CyclicSynchronousPosition => "cyclic synchronous position",
            Self::CyclicSynchronousVelocity => "cyclic synchronous velocity",
            Self::CyclicSynchronousTorque => "cyclic synchronous torque",
        }
    }

    /// Every mode, in the order of their numbers.
    pub const ALL: [Self; 9] = [
        Self::ProfilePosition,
        Self::Velocity,
        Self::ProfileVelocity,
        Self::ProfileTorque,
        Self::Homing,
        Self::InterpolatedPosition,
        Self::CyclicSynchronousPosition,
        Self::CyclicSynchronousVelocity,
        Self::CyclicSynchronousTorque,
    ];

    /// The mode with this number in 6060, if there is one.
    pub fn from_number(number: i8) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| *mode as i8 == number)
    }

    /// The bit that announces this mode in the supported drive modes (object 6502).
    pub const fn supported_bit(self) -> u32 {
        1 << (self as i8 - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statuswords_seen_on_hardware_decode_to_their_states() {
        let seen = [
            (0x1250, DriveState::SwitchOnDisabled),
            (0x12D0, DriveState::SwitchOnDisabled),
            (0x1231, DriveState::ReadyToSwitchOn),
            (0x12B1, DriveState::ReadyToSwitchOn),
            (0x1233, DriveState::SwitchedOn),
            (0x12B3, DriveState::SwitchedOn),
            (0x12B7, DriveState::OperationEnabled),
            (0x1637, DriveState::OperationEnabled),
            (0x16B7, DriveState::OperationEnabled),
            (0x1208, DriveState::Fault),
            (0x1288, DriveState::Fault),
        ];
        for (word, state) in seen {
            assert_eq!(DriveState::decode(word), state, "{word:#06x}");
        }
    }

    #[test]
    fn every_statusword_decodes_as_the_masks_of_the_standard_say() {
        for word in 0..=u16::MAX {
            let expected = match (word & 0x4F, word & 0x6F) {
                (0x00, _) => DriveState::NotReadyToSwitchOn,
                (0x40, _) => DriveState::SwitchOnDisabled,
                (_, 0x21) => DriveState::ReadyToSwitchOn,
                (_, 0x23) => DriveState::SwitchedOn,
                (_, 0x27) => DriveState::OperationEnabled,
                (_, 0x07) => DriveState::QuickStopActive,
                (0x0F, _) => DriveState::FaultReactionActive,
                (0x08, _) => DriveState::Fault,
                _ => DriveState::Undefined,
            };
            assert_eq!(DriveState::decode(word), expected, "{word:#06x}");
        }
    }

    #[test]
    fn the_bits_of_a_state_decode_to_it() {
        for state in DriveState::ALL.into_iter().filter(|state| *state != DriveState::Undefined) {
            assert_eq!(DriveState::decode(state.statusword_bits()), state);
        }
    }

    #[test]
    fn every_controlword_decodes_as_the_command_table_says() {
        for word in 0..=u16::MAX {
            let bit = |n: u16| word >> n & 1 == 1;
            let expected = match (bit(3), bit(2), bit(1), bit(0)) {
                (_, _, false, _) => Command::DisableVoltage,
                (_, false, true, _) => Command::QuickStop,
                (_, true, true, false) => Command::Shutdown,
                (false, true, true, true) => Command::SwitchOn,
                (true, true, true, true) => Command::EnableOperation,
            };
            assert_eq!(Command::decode(word), expected, "{word:#06x}");
        }
    }

    #[test]
    fn from_every_state_but_a_fault_the_way_leads_to_every_goal() {
        let goals = [
            (Goal::Enabled, DriveState::OperationEnabled),
            (Goal::Disabled, DriveState::ReadyToSwitchOn),
            (Goal::NoVoltage, DriveState::SwitchOnDisabled),
        ];
        for start in DriveState::ALL {
            if start.is_faulted() || matches!(start, DriveState::NotReadyToSwitchOn | DriveState::Undefined) {
                continue;
            }
            for (goal, reached) in goals {
                let mut state = start;
                for _ in 0..5 {
                    state = state.after(Command::decode(state.controlword_towards(goal)), false);
                }
                // With no voltage wanted and none there yet, "disable voltage" leaves the drive where it is.
                assert_eq!(state, reached, "from {start:?} to {goal:?}");
            }
        }
    }

    #[test]
    fn a_fault_is_left_by_a_rising_edge_only() {
        let word = controlword::FAULT_RESET;
        assert_eq!(DriveState::Fault.after(Command::decode(word), false), DriveState::Fault);
        assert_eq!(DriveState::Fault.after(Command::decode(word), true), DriveState::SwitchOnDisabled);
        assert_eq!(DriveState::Fault.controlword_towards(Goal::Enabled) & controlword::FAULT_RESET, 0);
    }

    #[test]
    fn modes_are_known_by_their_numbers() {
        assert_eq!(OperationMode::from_number(8), Some(OperationMode::CyclicSynchronousPosition));
        assert_eq!(OperationMode::from_number(5), None);
        assert_eq!(OperationMode::InterpolatedPosition.supported_bit(), 0x40);
    }
}
