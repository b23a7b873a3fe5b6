//! Parses command values: a joint value has a unit, a drive value is a plain number.

use crate::config::{Quantity, QuantityError};

use super::target::CommandValue;

/// Why a text is not a valid value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CommandValueError {
    /// It is not a number.
    #[error("`{text}` is no {quantity}: write for example \"{example}\"")]
    NoNumber {
        /// The text as written.
        text: String,
        /// The expected quantity.
        quantity: &'static str,
        /// An example of valid text.
        example: &'static str,
    },
    /// It is not a whole number of drive units.
    #[error("`{text}` is no whole number, as values of the drive are (`--raw`)")]
    NoInteger {
        /// The text as written.
        text: String,
    },
    /// It has no unit.
    #[error(
        "`{text}` has no unit: write for example \"{example}\", or `--raw` for a number in the drive's unit"
    )]
    NoUnit {
        /// The text as written.
        text: String,
        /// An example of valid text.
        example: &'static str,
    },
    /// It has an unknown unit.
    #[error("the unit `{symbol}` is not known: write for example \"{example}\"")]
    UnknownUnit {
        /// The symbol.
        symbol: String,
        /// An example of valid text.
        example: &'static str,
    },
    /// It has the unit of another quantity.
    #[error("`{unit}` is not the unit of {article} {quantity}: write for example \"{example}\"")]
    OtherQuantity {
        /// The unit.
        unit: String,
        /// The article of the quantity: a or an.
        article: &'static str,
        /// The expected quantity.
        quantity: &'static str,
        /// An example of valid text.
        example: &'static str,
    },
}

/// Parses a value.
///
/// # Errors
/// See [`CommandValueError`].
pub fn parse(text: &str, quantity: Quantity, is_raw: bool) -> Result<CommandValue, CommandValueError> {
    if is_raw {
        let number = integer(text).ok_or_else(|| CommandValueError::NoInteger { text: text.to_owned() })?;
        return Ok(CommandValue::Drive(number));
    }
    let Quantity { name, example, .. } = quantity;
    let text_owned = || text.to_owned();
    let value = quantity.parse(text).map_err(|error| match error {
        QuantityError::NoNumber => {
            CommandValueError::NoNumber { text: text_owned(), quantity: name, example }
        }
        QuantityError::NoUnit => CommandValueError::NoUnit { text: text_owned(), example },
        QuantityError::UnknownUnit { symbol } => CommandValueError::UnknownUnit { symbol, example },
        QuantityError::OtherQuantity { unit } => {
            let article = if name.starts_with('a') { "an" } else { "a" };
            CommandValueError::OtherQuantity { unit, article, quantity: name, example }
        }
    })?;
    if value.is_finite() {
        return Ok(CommandValue::Joint(value));
    }
    Err(CommandValueError::NoNumber { text: text_owned(), quantity: name, example })
}

/// A number with a unit that its drive has on the wire, by a table of such units: the symbol, the unit on the wire, and how many of it
/// that are. `None` if the text has none of them.
pub fn in_units_of_drive<U: Copy + PartialEq>(units: &[(&str, U, f64)], unit: U, text: &str) -> Option<i64> {
    let is_of_unit = |letter: char| !letter.is_ascii_digit() && !".+-−_ ".contains(letter);
    let (digits, symbol) = text.split_at(text.find(is_of_unit)?);
    let factor = units.iter().find(|(known, of, _)| *known == symbol.trim() && *of == unit)?.2;
    let number: f64 = digits.trim().replace('−', "-").parse().ok()?;
    Some((number * factor).round() as i64)
}

/// Parses a whole number, decimal or hexadecimal (`0x…`), with optional `_` between digits.
pub fn integer(text: &str) -> Option<i64> {
    let text = text.trim().replace('_', "").replace('−', "-");
    let (is_negative, digits) = text.strip_prefix('-').map_or((false, text.as_str()), |rest| (true, rest));
    let value = match digits.strip_prefix("0x").or(digits.strip_prefix("0X")) {
        Some(hexadecimal) => i64::from_str_radix(hexadecimal, 16).ok()?,
        None if digits.starts_with(|first: char| first.is_ascii_digit()) => digits.parse().ok()?,
        None => return None,
    };
    Some(if is_negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_with_a_unit_is_a_joint_value_and_a_raw_value_is_a_drive_value() {
        let angle = Quantity::ANGLE;
        assert_eq!(parse("1 rad", angle, false), Ok(CommandValue::Joint(1.0)));
        assert_eq!(parse("-1000", angle, true), Ok(CommandValue::Drive(-1000)));
    }

    #[test]
    fn invalid_values_are_refused_with_an_example() {
        let words = |text: &str, is_raw: bool| parse(text, Quantity::ANGLE, is_raw).unwrap_err().to_string();
        assert!(words("5", false).contains("has no unit: write for example \"170 deg\", or `--raw`"));
        assert!(words("5 deg/s", false).contains("`deg/s` is not the unit of an angle"));
        assert!(words("5 furlong", false).contains("`furlong` is not known"));
        assert!(words("five", false).contains("`five` is no angle"));
        assert!(words("inf rad", false).contains("is no angle"));
        assert!(words("1.5", true).contains("is no whole number"));
    }

    #[test]
    fn whole_numbers_are_decimal_or_hexadecimal() {
        assert_eq!(integer("-0x10"), Some(-16));
        assert_eq!(integer("1_000"), Some(1000));
        assert_eq!(integer("--1"), None);
        assert_eq!(integer("1.5"), None);
        assert_eq!(integer(""), None);
    }
}
