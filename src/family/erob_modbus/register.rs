//! A register, or two that make one number of 32 bits: its words on the wire.

use std::fmt;

use arrayvec::ArrayVec;
use takt_wire::erob_can::parameter::{Access, Parameter, Unit, ValueError, Values};

/// A register, or two that make one number of 32 bits: the high word has the lower address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// Its address as it is on the wire; that of the high word where there are two.
    pub address: u16,
    /// Its name.
    pub name: &'static str,
    /// What may be done with it.
    pub access: Access,
    /// Its width and its sign.
    pub number: Number,
    /// The unit of its number on the wire.
    pub unit: Unit,
    /// Which numbers it takes, or shows.
    pub values: Values,
    /// What else must be known of it; empty if nothing.
    pub note: &'static str,
}

/// How a number is written into registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// 16 bits without a sign.
    Word,
    /// 16 bits with a sign.
    SignedWord,
    /// 32 bits without a sign.
    Double,
    /// 32 bits with a sign.
    SignedDouble,
}

impl Number {
    /// Number of registers.
    pub const fn words(self) -> u16 {
        match self {
            Self::Word | Self::SignedWord => 1,
            Self::Double | Self::SignedDouble => 2,
        }
    }

    /// The least and the greatest number.
    pub const fn range(self) -> (i64, i64) {
        match self {
            Self::Word => (0, u16::MAX as i64),
            Self::SignedWord => (i16::MIN as i64, i16::MAX as i64),
            Self::Double => (0, u32::MAX as i64),
            Self::SignedDouble => (i32::MIN as i64, i32::MAX as i64),
        }
    }
}

impl Register {
    /// The words of a value, the high one first.
    ///
    /// # Errors
    /// The register does not take the value.
    pub fn encode(&self, value: i64) -> Result<ArrayVec<u16, 2>, ValueError<Self>> {
        self.check(value)?;
        let mut words = ArrayVec::new();
        if self.number.words() == 2 {
            words.push((value >> 16) as u16);
        }
        words.push(value as u16);
        Ok(words)
    }

    /// The value of words; `None` if their number is wrong.
    pub fn decode(&self, words: &[u16]) -> Option<i64> {
        match (self.number, words) {
            (Number::Word, [word]) => Some((*word).into()),
            (Number::SignedWord, [word]) => Some(word.cast_signed().into()),
            (Number::Double, [high, low]) => Some(double(*high, *low).into()),
            (Number::SignedDouble, [high, low]) => Some(double(*high, *low).cast_signed().into()),
            _ => None,
        }
    }
}

impl fmt::Display for Register {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (0x{:04X})", self.name, self.address)
    }
}

const fn double(high: u16, low: u16) -> u32 {
    (high as u32) << 16 | low as u32
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::registers;
    use super::*;

    proptest! {
        #[test]
        fn every_value_that_a_register_takes_is_read_as_it_was_written(
            register in prop::sample::select(&registers::ALL[..]), value in any::<i64>(), is_small: bool,
        ) {
            let value = if is_small { value % 0x2_0000 } else { value % 0x2_0000_0000 };
            match register.encode(value) {
                Ok(words) => prop_assert_eq!(register.decode(&words), Some(value)),
                Err(error) => prop_assert_eq!(error, ValueError { parameter: register, value }),
            }
        }
    }
}
