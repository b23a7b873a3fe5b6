//! One value of the file: its place, what it should be, and the problem if it is something else.

use std::ops::{Deref, Range, RangeInclusive};
use std::path::PathBuf;

use takt_wire::printable::excerpt;
use toml::Spanned;
use toml::de::{DeArray, DeInteger, DeTable, DeValue};

use crate::config::bounds::Bounds;
use crate::config::key::Key;
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::Quantities;
use crate::config::quantity::{Quantity, QuantityError, Short};
use crate::config::rules;
use crate::config::spelling;
use crate::config::spot::{Problems, Spot};

/// One value with its place.
#[derive(Clone)]
pub struct Entry<'a> {
    pub spot: Spot<'a>,
    value: &'a DeValue<'a>,
    problems: &'a Problems,
}

impl<'a> Entry<'a> {
    pub fn new(path: String, value: &'a Spanned<DeValue<'a>>, problems: &'a Problems) -> Self {
        Self { spot: Spot::in_text(path, value.span(), problems), value: value.get_ref(), problems }
    }

    pub fn report(&self, kind: ProblemKind) {
        self.spot.report(kind);
    }

    pub fn report_range(&self, value: String, allowed: String) {
        self.spot.report_range(value, allowed);
    }

    fn wrong_type<T>(&self, expected: &'static str) -> Option<T> {
        let found = match self.value {
            DeValue::String(_) => "a text",
            DeValue::Integer(_) | DeValue::Float(_) => "a number",
            DeValue::Boolean(_) => "true or false",
            DeValue::Datetime(_) => "a date or time",
            DeValue::Array(_) => "a list",
            DeValue::Table(_) => "a table",
        };
        self.report(ProblemKind::WrongType { key: self.spot.key.clone(), expected, found });
        None
    }

    pub fn text(&self) -> Option<&'a str> {
        match self.value {
            DeValue::String(text) => Some(text),
            _ => self.wrong_type("a text in quotes"),
        }
    }

    /// The path of a file; a relative one begins at the folder of the configuration.
    pub fn path_from_file(&self) -> Option<PathBuf> {
        Some(self.problems.path_of(self.text()?))
    }

    /// A name of a bus, an axis or a machine.
    pub fn name(&self) -> Option<&'a str> {
        let name = self.text()?;
        rules::name(&self.spot, name).then_some(name)
    }

    pub fn boolean(&self) -> Option<bool> {
        match self.value {
            DeValue::Boolean(value) => Some(*value),
            _ => self.wrong_type("true or false"),
        }
    }

    /// Returns `true` if this is that word, for values that may also be a word (`"off"`, `"measure"`).
    pub fn is_word(&self, word: &str) -> bool {
        matches!(self.value, DeValue::String(text) if text == word)
    }

    /// Returns `true` if this is a number without a unit.
    pub fn is_bare_number(&self) -> bool {
        matches!(self.value, DeValue::Integer(_) | DeValue::Float(_))
    }

    /// Returns `true` if this is a number with a unit of this quantity.
    pub fn is_quantity(&self, quantity: Quantity) -> bool {
        matches!(self.value, DeValue::String(text) if quantity.parse(text).is_ok())
    }

    /// Returns `true` if this is a list.
    pub fn is_list(&self) -> bool {
        matches!(self.value, DeValue::Array(_))
    }

    /// A whole number in a range.
    pub fn integer(&self, allowed: Range<i64>) -> Option<i64> {
        let DeValue::Integer(integer) = self.value else { return self.wrong_type("a whole number") };
        let value = whole(integer);
        if value.is_none() {
            self.report_range(
                excerpt(&integer.to_string()),
                format!("{} to {}", allowed.start, allowed.end - 1),
            );
        }
        self.spot.integer(value?, &allowed)
    }

    /// A bare number.
    pub fn number(&self, bounds: Bounds) -> Option<f64> {
        let value = self.bare().or_else(|| self.wrong_type("a number"))?;
        self.spot.bounded(value, bounds, |value| Short(value).to_string())
    }

    /// A number in SI units, or a text with a number and its unit.
    pub fn quantity(&self, quantity: Quantity, bounds: Bounds) -> Option<f64> {
        self.unbounded(quantity).and_then(|value| self.spot.quantity(value, quantity, bounds))
    }

    /// As [`Entry::quantity`], for rules that check it themselves.
    pub fn unbounded(&self, quantity: Quantity) -> Option<f64> {
        match self.value {
            DeValue::String(text) => self.with_unit(text, quantity),
            _ => self.bare().or_else(|| self.wrong_type("a number or a text with number and unit")),
        }
    }

    /// A duration in whole nanoseconds; the bounds are in seconds.
    pub fn nanoseconds(&self, seconds: RangeInclusive<f64>) -> Option<u64> {
        let bounds = Bounds::Between(*seconds.start(), *seconds.end());
        self.quantity(Quantity::DURATION, bounds).map(|seconds| (seconds * 1e9).round() as u64)
    }

    /// One of these words.
    pub fn choice<T: Copy>(&self, choices: &[(&'static str, T)]) -> Option<T> {
        let given = self.text()?;
        let found = choices.iter().find(|(word, _)| *word == given).map(|(_, value)| *value);
        if found.is_none() {
            let words: Vec<_> = choices.iter().map(|(word, _)| *word).collect();
            let nearest = spelling::nearest(given, words.iter().copied());
            let key = self.spot.key.clone();
            self.report(ProblemKind::UnknownChoice { key, given: excerpt(given), nearest, choices: words });
        }
        found
    }

    pub fn list(&self) -> Option<Vec<Entry<'a>>> {
        let DeValue::Array(list) = self.value else { return self.wrong_type("a list") };
        Some(self.elements(list))
    }

    /// Those elements of a list that are texts; none where this is no list.
    pub fn texts(&self) -> impl Iterator<Item = &'a str> {
        let list = match self.value {
            DeValue::Array(list) => Some(list),
            _ => None,
        };
        list.into_iter().flat_map(|list| list.iter()).filter_map(|element| match element.get_ref() {
            DeValue::String(text) => Some(text.as_ref()),
            _ => None,
        })
    }

    /// The tables of a list of tables.
    pub fn tables(&self) -> Option<Vec<Entry<'a>>> {
        let DeValue::Array(list) = self.value else {
            return self.wrong_type("a list of tables, each headed by its name in [[double brackets]]");
        };
        Some(self.elements(list))
    }

    pub fn table(&self) -> Option<&'a DeTable<'a>> {
        match self.value {
            DeValue::Table(table) => Some(table),
            _ => self.wrong_type("a table"),
        }
    }

    fn elements(&self, list: &'a DeArray<'a>) -> Vec<Entry<'a>> {
        list.iter().map(|value| Self::new(self.spot.key.clone(), value, self.problems)).collect()
    }

    fn bare(&self) -> Option<f64> {
        match self.value {
            DeValue::Integer(integer) => whole(integer).map(|value| value as f64),
            DeValue::Float(float) => float.as_str().parse().ok(),
            _ => None,
        }
    }

    fn with_unit(&self, text: &str, quantity: Quantity) -> Option<f64> {
        let (key, given) = (self.spot.key.clone(), excerpt(text));
        let kind = match quantity.parse(text) {
            Ok(value) => return Some(value),
            Err(QuantityError::NoNumber) => ProblemKind::NotAQuantity { key, given, quantity },
            Err(QuantityError::NoUnit) => ProblemKind::MissingUnit { key, given, quantity },
            Err(QuantityError::UnknownUnit { symbol }) => {
                ProblemKind::UnknownUnit { key, symbol: excerpt(&symbol), quantity }
            }
            Err(QuantityError::OtherQuantity { unit }) => {
                ProblemKind::WrongUnit { key, unit: excerpt(&unit), quantity }
            }
        };
        self.report(kind);
        None
    }
}

/// A value that must be one of those of its row.
pub struct KeyedEntry<'a> {
    entry: Entry<'a>,
    key: &'static Key,
}

impl<'a> Deref for KeyedEntry<'a> {
    type Target = Entry<'a>;

    fn deref(&self) -> &Entry<'a> {
        &self.entry
    }
}

impl<'a> KeyedEntry<'a> {
    pub fn new(entry: Entry<'a>, key: &'static Key) -> Self {
        Self { entry, key }
    }

    pub fn into_entry(self) -> Entry<'a> {
        self.entry
    }

    /// Returns `true` if the word stands here that may stand in place of a value.
    pub fn is_the_word(&self) -> bool {
        self.key.word.is_some_and(|word| self.entry.is_word(word))
    }

    pub fn integer<T: TryFrom<i64>>(&self) -> Option<T> {
        self.entry.integer(self.key.integers()).and_then(|value| T::try_from(value).ok())
    }

    pub fn number(&self) -> Option<f64> {
        self.entry.number(self.key.bounds())
    }

    /// In SI units, of an axis with these quantities where it depends on them.
    pub fn quantity(&self, quantities: Quantities) -> Option<f64> {
        let (quantity, bounds) = self.key.of(quantities);
        self.entry.quantity(quantity, bounds)
    }

    /// A duration in whole nanoseconds.
    pub fn nanoseconds(&self) -> Option<u64> {
        self.quantity(Quantities::ROTARY).map(|seconds| (seconds * 1e9).round() as u64)
    }
}

fn whole(integer: &DeInteger<'_>) -> Option<i64> {
    i64::from_str_radix(integer.as_str(), integer.radix()).ok()
}
