//! The alarms of a YZ-AIM, object 260E (manual IIb.3), and how to clear each.

use std::fmt;

use crate::words;
use crate::words::Words;

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
    /// 20h: the heartbeat of the master timed out.
    CommunicationLost,
    /// A code that the manual does not list.
    Other(u16),
}

/// How to clear an alarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clearing {
    /// Controlword bit 7, or 2601h = 1.
    Reset,
    /// The multi-turn zero procedure.
    Zero,
    /// A heartbeat from the master.
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

    /// The alarm's code.
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

    /// The alarm with its code.
    pub fn words(self) -> Words {
        let name = Words::bilingual(self.bilingual());
        match self {
            Self::None => words!("alarm {name}", name),
            _ => words!("alarm {code}h ({name})", code = format!("{:02X}", self.code()), name),
        }
    }

    /// Its name in English and in Chinese.
    const fn bilingual(self) -> (&'static str, &'static str) {
        match self {
            Self::None => ("none", "无"),
            Self::Battery => ("battery power lost, multi-turn position lost", "电池断电，多圈位置丢失"),
            Self::BlockedRotor => ("blocked rotor", "堵转"),
            Self::LossOfSpeed => ("loss of speed (stall)", "失速"),
            Self::OverVoltage => ("over-voltage, above 52 V", "过压，高于 52 V"),
            Self::CommunicationLost => ("communication lost (heartbeat timeout)", "通信丢失（心跳超时）"),
            Self::Other(_) => ("not described", "手册未说明"),
        }
    }

    /// How to clear it. The manual does not cover over-voltage and unknown codes; a reset is tried.
    pub const fn clearing(self) -> Clearing {
        match self {
            Self::Battery => Clearing::Zero,
            Self::CommunicationLost => Clearing::Heartbeat,
            _ => Clearing::Reset,
        }
    }

    /// The remedy for people; `None` without an alarm.
    pub const fn advice(self) -> Option<&'static str> {
        Some(match self {
            Self::None => return None,
            Self::Battery => {
                "check the battery, move the axis to its zero, then use `clear-fault --yes` to set the multi-turn zero"
            }
            Self::BlockedRotor => "free the shaft, then `clear-fault`",
            Self::LossOfSpeed => "reduce the load or the acceleration, then `clear-fault`",
            Self::OverVoltage => {
                "lower the supply or fit a discharge module, then `clear-fault`; if it stays, power-cycle the drive"
            }
            Self::CommunicationLost => "use `clear-fault`: it sends the heartbeat that the drive waits for",
            Self::Other(_) => "`clear-fault` tries a reset; if it stays, power-cycle the drive",
        })
    }
}

impl fmt::Display for Alarm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            alarm => write!(f, "{:02X}h ({})", alarm.code(), alarm.bilingual().0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_converts_to_an_alarm_and_back() {
        for code in 0..=0x40 {
            assert_eq!(Alarm::of(code).code(), code);
        }
        assert_eq!(Alarm::of(0x12).to_string(), "12h (blocked rotor)");
        assert_eq!(Alarm::of(0x10).clearing(), Clearing::Zero);
        assert_eq!(Alarm::of(0x20).clearing(), Clearing::Heartbeat);
    }
}
