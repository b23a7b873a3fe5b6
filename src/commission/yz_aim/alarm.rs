//! The alarms of a YZ-AIM, object 260E (manual IIb.3), and how each is cleared.

use std::fmt;

/// An alarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alarm {
    /// 0
    None,
    /// 10h: the multi-turn position is lost. The motor keeps running.
    Battery,
    /// 12h
    BlockedRotor,
    /// 14h
    LossOfSpeed,
    /// 15h
    OverVoltage,
    /// 20h: the master's heartbeat has ceased.
    CommunicationLost,
    /// A code that the manual does not list.
    Other(u16),
}

/// How an alarm is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clearing {
    /// Controlword bit 7, or 2601h = 1.
    Reset,
    /// The multi-turn zero procedure.
    Zero,
    /// A heartbeat of the master.
    Heartbeat,
}

impl Alarm {
    /// The alarm with this code.
    pub const fn of(code: u16) -> Self {
        match code {
            0 => Self::None,
            0x10 => Self::Battery,
            0x12 => Self::BlockedRotor,
            0x14 => Self::LossOfSpeed,
            0x15 => Self::OverVoltage,
            0x20 => Self::CommunicationLost,
            code => Self::Other(code),
        }
    }

    /// Its code.
    pub const fn code(self) -> u16 {
        match self {
            Self::None => 0,
            Self::Battery => 0x10,
            Self::BlockedRotor => 0x12,
            Self::LossOfSpeed => 0x14,
            Self::OverVoltage => 0x15,
            Self::CommunicationLost => 0x20,
            Self::Other(code) => code,
        }
    }

    const fn words(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Battery => "battery power lost, multi-turn position lost",
            Self::BlockedRotor => "blocked rotor",
            Self::LossOfSpeed => "loss of speed (stall)",
            Self::OverVoltage => "over-voltage, above 52 V",
            Self::CommunicationLost => "communication lost (heartbeat timeout)",
            Self::Other(_) => "not described",
        }
    }

    /// How it is cleared. For over-voltage and for unknown codes the manual does not say: a reset is tried.
    pub const fn clearing(self) -> Clearing {
        match self {
            Self::Battery => Clearing::Zero,
            Self::CommunicationLost => Clearing::Heartbeat,
            _ => Clearing::Reset,
        }
    }

    /// What people do about it; `None` for no alarm.
    pub const fn advice(self) -> Option<&'static str> {
        Some(match self {
            Self::None => return None,
            Self::Battery => {
                "check the battery, move the axis to its zero, then `clear-fault --yes` does the multi-turn zero anew"
            }
            Self::BlockedRotor => "free the shaft, then `clear-fault`",
            Self::LossOfSpeed => "reduce the load or the acceleration, then `clear-fault`",
            Self::OverVoltage => {
                "lower the supply or fit a discharge module, then `clear-fault`; if it stays, power-cycle the drive"
            }
            Self::CommunicationLost => "`clear-fault` sends the heartbeat that the drive waits for",
            Self::Other(_) => "`clear-fault` tries a reset; if it stays, power-cycle the drive",
        })
    }
}

impl fmt::Display for Alarm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            alarm => write!(f, "{:02X}h ({})", alarm.code(), alarm.words()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_alarm_comes_back_from_its_code() {
        for code in 0..=0x40 {
            assert_eq!(Alarm::of(code).code(), code);
        }
        assert_eq!(Alarm::of(0x12).to_string(), "12h (blocked rotor)");
        assert_eq!(Alarm::of(0x10).clearing(), Clearing::Zero);
        assert_eq!(Alarm::of(0x20).clearing(), Clearing::Heartbeat);
    }
}
