//! Identifiers and bytes of frames, as expressions of the IDs of a drive.

use takt_rt::Id;

/// An identifier as a sum: `"motor"`, `"master"`, `"motor + 0x100"`, `"32 * motor + 7"`, `"0x7FF"`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IdExpression {
    motors: u32,
    masters: u32,
    plus: u32,
    is_extended: bool,
}

/// A byte of a frame that is always the same for one drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PayloadByte {
    /// For every drive.
    Byte(u8),
    /// The motor ID.
    Motor,
    /// The lower byte of the master ID.
    Master,
}

impl IdExpression {
    /// Reads an expression. `None` if it is none.
    pub fn parse(text: &str, is_extended: bool) -> Option<Self> {
        let mut sum = Self { is_extended, ..Self::default() };
        for term in text.split('+') {
            let (factor, word) = match term.split_once('*') {
                Some((factor, word)) => (number(factor)?, word.trim()),
                None => (1, term.trim()),
            };
            let part = match word {
                "motor" => &mut sum.motors,
                "master" => &mut sum.masters,
                word => {
                    sum.plus = sum.plus.checked_add(factor.checked_mul(number(word)?)?)?;
                    continue;
                }
            };
            *part = part.checked_add(factor)?;
        }
        Some(sum)
    }

    /// Returns `true` if the master ID is part of it.
    pub const fn has_master(&self) -> bool {
        self.masters > 0
    }

    /// The identifier. `None` if it has too many bits.
    pub fn id(&self, motor: u8, master: u16) -> Option<Id> {
        let motor = self.motors.checked_mul(motor.into())?;
        let master = self.masters.checked_mul(master.into())?;
        let value = motor.checked_add(master)?.checked_add(self.plus)?;
        if self.is_extended { Id::extended(value).ok() } else { Id::base(value).ok() }
    }
}

fn number(text: &str) -> Option<u32> {
    let text = text.trim();
    match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(text: &str, is_extended: bool) -> Option<u32> {
        IdExpression::parse(text, is_extended)?.id(5, 0x64).map(Id::value)
    }

    #[test]
    fn identifiers_are_sums_of_the_ids_of_a_drive() {
        assert_eq!(id("motor", false), Some(5));
        assert_eq!(id("master", false), Some(0x64));
        assert_eq!(id("motor + 0x100", false), Some(0x105));
        assert_eq!(id("32*motor + 7", false), Some(167));
        assert_eq!(id("0x7FF", false), Some(0x7FF));
        assert_eq!(id("0x10000 * master + motor", true), Some(0x0064_0005));
    }

    #[test]
    fn what_is_no_sum_and_what_has_too_many_bits_is_refused() {
        for text in ["", "moter", "motor - 1", "motor +", "0xG", "motor * 3", "4294967296"] {
            assert_eq!(IdExpression::parse(text, false), None, "{text}");
        }
        assert_eq!(id("0x800", false), None);
        assert_eq!(id("0x100000000 * motor", true), None);
        assert_eq!(id("0x20000000", true), None);
    }
}
