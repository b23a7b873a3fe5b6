//! The fault codes of register 0x0060, in words and with their cure.
//!
//! The manual has one of them and refers to a list that is not published with it. The others are read as those of the same module
//! with CANopen firmware (object 603F), which are codes of CiA 402. Nobody has seen them on hardware here.

use std::fmt;

use takt_wire::canopen::emcy;

use crate::family::{erob, error_cure};

/// The family whose codes the others are taken for.
const SAME_MODULE: Option<&str> = Some("erob-canopen");

/// A fault code other than 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FaultCode(pub u16);

impl FaultCode {
    /// No request has come for the communication time-out, register 0x0002.
    pub const COMMUNICATION_TIMEOUT: Self = Self(0x0FA2);
    /// The battery of a multi-turn encoder is empty, or was disconnected.
    pub const MULTI_TURN_BATTERY: Self = Self(0x730F);

    /// No code of the drive: it has refused a setting before it was enabled, or to be enabled, and shows no fault.
    pub const REFUSED: Self = Self(0xFFFF);
    /// No code of the drive: register 0x0002 shows another communication time-out than was written, so that it was not enabled.
    pub const TIMEOUT_NOT_KEPT: Self = Self(0xFFFE);

    /// The meaning of the code.
    pub fn words(self) -> &'static str {
        self.bilingual().0
    }

    /// The meaning of the code in English and in Chinese.
    pub fn bilingual(self) -> (&'static str, &'static str) {
        match self {
            Self::COMMUNICATION_TIMEOUT => ("RS-485 communication time-out", "RS-485 通信超时"),
            Self::MULTI_TURN_BATTERY => erob::BATTERY_LOW,
            Self::REFUSED => ("the drive has refused to be prepared or enabled", "驱动器拒绝准备或使能"),
            Self::TIMEOUT_NOT_KEPT => {
                ("the drive has not kept its communication time-out", "驱动器未保持写入的通信超时")
            }
            Self(code) => emcy::ErrorCode(code).bilingual(),
        }
    }

    /// What clears the fault and its cause.
    pub fn cure(self) -> &'static str {
        match self {
            Self::COMMUNICATION_TIMEOUT => {
                "see why the master was silent, or set a longer time in register 0x0002; then clear the fault"
            }
            Self::MULTI_TURN_BATTERY => {
                "replace the battery, then reset the encoder; this also wipes the count of turns, so the joint's zero must \
                 be set again"
            }
            Self::REFUSED => {
                "see its state with `takt drive … info`, and whether another master commands it; then switch it off and on"
            }
            Self::TIMEOUT_NOT_KEPT => {
                "write another `communication_timeout`, or \"0 ms\" if its firmware has none; without it nothing stops the drive when the \
                 line is cut"
            }
            Self(code) => error_cure(SAME_MODULE, code),
        }
    }
}

impl fmt::Display for FaultCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "fault 0x{:04X}, {} ({})", self.0, self.words(), self.cure())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_code_of_the_manual_is_in_words_and_the_others_are_those_of_the_module() {
        let text = FaultCode::COMMUNICATION_TIMEOUT.to_string();
        assert!(text.starts_with("fault 0x0FA2, RS-485 communication time-out (see why"), "{text}");
        assert_eq!(FaultCode(0x8611).words(), "following error");
        assert!((1..=u16::MAX).all(|code| !FaultCode(code).cure().is_empty()));
    }
}
