//! Values as people write them: with a unit for the joint, plain for the drive.

use crate::config::{Quantity, QuantityError};

use super::dictionary::integer;
use super::subject::Amount;

/// Why a text is not the value that was asked for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AmountError {
    /// It is no number.
    #[error("`{text}` is no {quantity}: write for example \"{example}\"")]
    NoNumber {
        /// What was written.
        text: String,
        /// What was asked for.
        quantity: &'static str,
        /// How it could be written.
        example: &'static str,
    },
    /// It is no whole number of drive units.
    #[error("`{text}` is no whole number, as values of the drive are (`--raw`)")]
    NoInteger {
        /// What was written.
        text: String,
    },
    /// It has no unit.
    #[error(
        "`{text}` has no unit: write for example \"{example}\", or `--raw` for a number in the drive's unit"
    )]
    NoUnit {
        /// What was written.
        text: String,
        /// How it could be written.
        example: &'static str,
    },
    /// It has an unknown unit.
    #[error("the unit `{symbol}` is not known: write for example \"{example}\"")]
    UnknownUnit {
        /// The symbol.
        symbol: String,
        /// How it could be written.
        example: &'static str,
    },
    /// It has the unit of another quantity.
    #[error("`{unit}` is not the unit of {article} {quantity}: write for example \"{example}\"")]
    OtherQuantity {
        /// The unit.
        unit: String,
        /// a or an
        article: &'static str,
        /// What was asked for.
        quantity: &'static str,
        /// How it could be written.
        example: &'static str,
    },
}

/// Reads a value.
///
/// # Errors
/// See [`AmountError`].
pub fn parse(text: &str, quantity: Quantity, is_raw: bool) -> Result<Amount, AmountError> {
    if is_raw {
        let number = integer(text).ok_or_else(|| AmountError::NoInteger { text: text.to_owned() })?;
        return Ok(Amount::Drive(number));
    }
    let Quantity { name, example, .. } = quantity;
    let text_owned = || text.to_owned();
    let value = quantity.parse(text).map_err(|error| match error {
        QuantityError::NoNumber => AmountError::NoNumber { text: text_owned(), quantity: name, example },
        QuantityError::NoUnit => AmountError::NoUnit { text: text_owned(), example },
        QuantityError::UnknownUnit { symbol } => AmountError::UnknownUnit { symbol, example },
        QuantityError::OtherQuantity { unit } => {
            let article = if name.starts_with('a') { "an" } else { "a" };
            AmountError::OtherQuantity { unit, article, quantity: name, example }
        }
    })?;
    if value.is_finite() {
        return Ok(Amount::Joint(value));
    }
    Err(AmountError::NoNumber { text: text_owned(), quantity: name, example })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_of_the_joint_with_its_unit_and_of_the_drive_when_raw() {
        let angle = Quantity::ANGLE;
        assert_eq!(parse("1 rad", angle, false), Ok(Amount::Joint(1.0)));
        assert_eq!(parse("-1000", angle, true), Ok(Amount::Drive(-1000)));
    }

    #[test]
    fn what_is_no_value_is_refused_with_an_example() {
        let words = |text: &str, is_raw: bool| parse(text, Quantity::ANGLE, is_raw).unwrap_err().to_string();
        assert!(words("5", false).contains("has no unit: write for example \"170 deg\", or `--raw`"));
        assert!(words("5 deg/s", false).contains("`deg/s` is not the unit of an angle"));
        assert!(words("5 furlong", false).contains("`furlong` is not known"));
        assert!(words("five", false).contains("`five` is no angle"));
        assert!(words("inf rad", false).contains("is no angle"));
        assert!(words("1.5", true).contains("is no whole number"));
    }
}
