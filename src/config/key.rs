//! A key of a configuration: its values, its default and what it is for, in one row of [`keys`](super::keys).

use std::fmt::Write;
use std::ops::Range;

use super::bounds::Bounds;
use super::quantities::Quantities;
use super::quantity::{Quantity, Short};
use super::spot::Spot;

/// A row of the table of keys.
#[derive(Clone, Copy)]
pub struct Key {
    pub name: &'static str,
    pub values: Values,
    /// A word that may stand in place of a value.
    pub word: Option<&'static str>,
    pub shown: Shown,
    /// Explanation; its first line stands behind the key in `configs/reference.toml`, further ones below it.
    pub sentence: &'static str,
}

/// The type and the range of a key.
#[derive(Clone, Copy)]
pub enum Values {
    Boolean,
    /// A text: a name, or the path of a file.
    Text,
    /// Both included.
    Integer(i64, i64),
    Number(Bounds),
    Quantity(Quantity, Bounds),
    /// A quantity that depends on how the axis travels.
    OfAxis(fn(Quantities) -> (Quantity, Bounds)),
    Words(&'static [&'static str]),
    /// A stop category (IEC 60204-1): 0, 1 or 2.
    Category,
    /// A number or a quantity, as a family wants it.
    AnyNumber,
    List(&'static Values),
    OneOrList(&'static Values),
}

/// The value of a key in `configs/reference.toml`.
#[derive(Clone, Copy)]
pub enum Shown {
    /// With its default.
    Default(Literal),
    /// With what its default is in the reference, where that depends on other keys.
    Computed(&'static str),
    /// With an example, since it has no default.
    Example(&'static str),
    /// As a comment, with an example.
    Comment(&'static str),
}

/// A default.
#[derive(Clone, Copy)]
pub enum Literal {
    /// Of a number or a quantity, in SI units.
    Number(f64),
    Integer(i64),
    Boolean(bool),
    Word(&'static str),
}

/// A table of a configuration.
pub struct Table {
    /// As in the file: `[cycle]`, `[[bus]]`; empty before the first table.
    pub header: &'static str,
    pub sentence: &'static str,
    pub keys: &'static [Key],
}

impl Key {
    /// Returns the default of a number, in SI units.
    ///
    /// # Panics
    /// It is no number, or depends on other keys: those that ask are constants.
    pub const fn default_number(&self) -> f64 {
        match self.shown {
            Shown::Default(Literal::Number(number)) => number,
            Shown::Default(Literal::Integer(integer)) => integer as f64,
            _ => panic!("no number"),
        }
    }

    /// Returns the default of a duration, in nanoseconds.
    ///
    /// # Panics
    /// As [`Self::default_number`].
    pub const fn default_ns(&self) -> u64 {
        (self.default_number() * 1e9 + 0.5) as u64
    }

    /// Returns the default of a key that is true or false.
    ///
    /// # Panics
    /// It is not true or false: those that ask are constants.
    pub const fn default_boolean(&self) -> bool {
        match self.shown {
            Shown::Default(Literal::Boolean(value)) => value,
            _ => panic!("neither true nor false"),
        }
    }

    /// Returns the default of a key that is a word.
    ///
    /// # Panics
    /// It is no word: those that ask are constants.
    pub const fn default_word(&self) -> &'static str {
        match self.shown {
            Shown::Default(Literal::Word(word)) => word,
            _ => panic!("no word"),
        }
    }

    /// Returns the allowed whole numbers; none for a key of another type.
    pub fn integers(&self) -> Range<i64> {
        match self.values {
            Values::Integer(low, high) => low..high.saturating_add(1),
            Values::Category => 0..3,
            _ => 0..0,
        }
    }

    /// Returns the bounds of a number or a quantity.
    pub fn bounds(&self) -> Bounds {
        match self.values {
            Values::Number(bounds) | Values::Quantity(_, bounds) => bounds,
            _ => Bounds::Finite,
        }
    }

    /// Returns the quantity and its bounds for an axis with these quantities.
    pub fn of(&self, quantities: Quantities) -> (Quantity, Bounds) {
        match self.values {
            Values::OfAxis(of) => of(quantities),
            Values::Quantity(quantity, bounds) => (quantity, bounds),
            _ => (Quantity::FRACTION, self.bounds()),
        }
    }

    /// Writes its line of the reference, and those below it.
    pub fn write_to(&self, text: &mut String) {
        let (start, literal, is_default) = match self.shown {
            Shown::Default(literal) => ("", self.literal(literal), true),
            Shown::Computed(literal) => ("", literal.to_owned(), true),
            Shown::Example(literal) => ("", literal.to_owned(), false),
            Shown::Comment(literal) => ("# ", literal.to_owned(), false),
        };
        let assignment = format!("{start}{} = {literal}", self.name);
        let (first, rest) = self.sentence.split_once('\n').unwrap_or((self.sentence, ""));
        let parts = [if is_default { "default" } else { "" }, first, &self.range()];
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        let _ = writeln!(text, "{assignment:41} # {}", parts.join("; "));
        for line in rest.lines() {
            let _ = writeln!(text, "# {line}");
        }
    }

    /// Returns the range in words, unless the head of the reference states it.
    fn range(&self) -> String {
        match self.values {
            // Where it is that of the type, it says nothing.
            Values::Integer(low, high) if high < i64::from(i32::MAX) => format!("{low} to {high}"),
            Values::Quantity(Quantity::DURATION, bounds @ Bounds::Between(..)) => bounds.show(show_duration),
            _ => String::new(),
        }
    }

    /// Returns a default as it is written in a file.
    pub fn literal(&self, literal: Literal) -> String {
        match (literal, self.values) {
            (Literal::Boolean(value), _) => value.to_string(),
            (Literal::Integer(integer), _) => integer.to_string(),
            (Literal::Word(word), _) => format!("\"{word}\""),
            (Literal::Number(number), Values::Quantity(Quantity::DURATION, _)) => {
                format!("\"{}\"", show_duration(number))
            }
            (Literal::Number(number), Values::Quantity(quantity, _)) => {
                format!("\"{}\"", quantity.show(number))
            }
            (Literal::Number(number), Values::OfAxis(of)) => {
                format!("\"{} {}\"", Short(number), of(Quantities::ROTARY).0.unit)
            }
            (Literal::Number(number), _) => format!("{number:?}"),
        }
    }
}

/// Returns a duration as it is written in a file.
fn show_duration(seconds: f64) -> String {
    Quantity::DURATION.show(seconds).replace('µ', "u")
}

impl Spot<'_> {
    /// Reports a whole number that a key may not be. Returns the value if it may.
    pub fn integer_of<T>(&self, key: &Key, value: T) -> Option<T>
    where
        T: Copy + std::fmt::Display + TryInto<i64>,
    {
        self.integer(value, &key.integers())
    }

    /// Reports a duration in ns that a key may not be.
    pub fn duration_of(&self, key: &Key, ns: u64) -> Option<u64> {
        self.quantity(ns as f64 / 1e9, Quantity::DURATION, key.bounds()).map(|_| ns)
    }

    /// Reports a bare number that a key may not be.
    pub fn number_of(&self, key: &Key, value: f64) -> Option<f64> {
        self.bounded(value, key.bounds(), |value| Short(value).to_string())
    }

    /// Reports a quantity, of an axis that travels like this, that a key may not be.
    pub fn quantity_of(&self, key: &Key, quantities: Quantities, value: f64) -> Option<f64> {
        let (quantity, bounds) = key.of(quantities);
        self.quantity(value, quantity, bounds)
    }
}
