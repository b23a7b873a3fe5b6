//! The error codes of the protocol (eRunner manual, appendix 1). Faults of the drive are read from index 0x001F.

use std::fmt;

/// Why a write or a command was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ErrorCode(pub u16);

impl ErrorCode {
    /// A write or a command that is not allowed while the motor moves.
    pub const MOVING: Self = Self(0x0015);
    /// A write or a command that is not allowed while the motor is enabled.
    pub const ENABLED: Self = Self(0x0016);
    /// The commutation is not complete after power-on.
    pub const NO_COMMUTATION: Self = Self(0x001F);
    /// A start of a motion while the motor is disabled.
    pub const DISABLED: Self = Self(0x0027);
    /// A start of a motion in a motion mode that does not exist.
    pub const NO_MOTION_MODE: Self = Self(0x0030);
    /// A command without its argument.
    pub const ARGUMENT_MISSING: Self = Self(0x0032);
    /// A command with an argument that it does not take.
    pub const ARGUMENT_NOT_TAKEN: Self = Self(0x0033);
    /// The relay is not active yet.
    pub const RELAY_NOT_ACTIVE: Self = Self(0x0056);
    /// A brake command where no brake is in use.
    pub const NO_BRAKE: Self = Self(0x014A);

    /// Every code of the manual.
    pub const ALL: [Self; 9] = [
        Self::MOVING,
        Self::ENABLED,
        Self::NO_COMMUTATION,
        Self::DISABLED,
        Self::NO_MOTION_MODE,
        Self::ARGUMENT_MISSING,
        Self::ARGUMENT_NOT_TAKEN,
        Self::RELAY_NOT_ACTIVE,
        Self::NO_BRAKE,
    ];

    /// The meaning of the code in English and in Chinese; `None` if the manual does not list it.
    pub const fn bilingual(self) -> Option<(&'static str, &'static str)> {
        Some(match self {
            Self::MOVING => ("not allowed while the motor moves", "电机运动时不允许"),
            Self::ENABLED => ("not allowed while the motor is enabled", "电机使能时不允许"),
            Self::NO_COMMUTATION => ("the commutation is not complete after power-on", "上电后换相尚未完成"),
            Self::DISABLED => ("no motion can start while the motor is disabled", "电机未使能时不能开始运动"),
            Self::NO_MOTION_MODE => ("no motion can start in this motion mode", "该运动模式下不能开始运动"),
            Self::ARGUMENT_MISSING => ("the command needs an argument", "该命令需要参数"),
            Self::ARGUMENT_NOT_TAKEN => ("the command takes no argument", "该命令不带参数"),
            Self::RELAY_NOT_ACTIVE => ("the relay is not active yet", "继电器尚未吸合"),
            Self::NO_BRAKE => ("the drive controls no brake", "驱动器未控制制动器"),
            _ => return None,
        })
    }

    /// What the manual advises.
    pub const fn cure(self) -> Option<&'static str> {
        Some(match self {
            Self::MOVING => "stop the motor first",
            Self::ENABLED => "disable the motor first",
            Self::NO_COMMUTATION | Self::RELAY_NOT_ACTIVE => "wait until 8 s after power-on, then try again",
            Self::DISABLED => {
                "enable the motor before the start; if it cannot be enabled, read the error code 0x001F, mend the fault \
                 and enable again"
            }
            Self::NO_MOTION_MODE => "check the motion mode, index 0x008D: 0, 1 or 2",
            Self::ARGUMENT_MISSING => "send the command with its argument, in six bytes",
            Self::ARGUMENT_NOT_TAKEN => "send the command alone, in two bytes",
            Self::NO_BRAKE => {
                "set the brake type \"electromagnetic friction\" in eTunner, page \"set motor\", if there is a brake"
            }
            _ => return None,
        })
    }

    /// Returns `true` if the same request may succeed a little later: within 8 s after power-on.
    pub const fn is_of_power_up(self) -> bool {
        matches!(self, Self::NO_COMMUTATION | Self::RELAY_NOT_ACTIVE)
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error 0x{:04X}", self.0)?;
        self.bilingual().map_or(Ok(()), |(words, _)| write!(f, ", {words}"))
    }
}
