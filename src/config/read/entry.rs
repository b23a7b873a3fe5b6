//! One value of the file: where it stands, what it should be, and the problem if it is something else.

use std::cell::RefCell;
use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeArray, DeInteger, DeTable, DeValue};

use crate::config::error::{Problem, line_of};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantity::{Quantity, QuantityError, Short};
use crate::config::spelling;

/// The problems found so far. Reading goes on after one, so that a person hears of all of them at once.
pub struct Problems<'a> {
    text: &'a str,
    /// Where relative paths begin.
    directory: PathBuf,
    found: RefCell<Vec<Problem>>,
}

impl<'a> Problems<'a> {
    pub fn new(source_name: &str, text: &'a str) -> Self {
        let directory = Path::new(source_name).parent().unwrap_or(Path::new("")).to_owned();
        Self { text, directory, found: RefCell::default() }
    }

    pub fn report(&self, kind: ProblemKind, span: Range<usize>) {
        self.found.borrow_mut().push(Problem { kind, span: Some(span), first_line: None });
    }

    /// Reports what contradicts something earlier in the file.
    pub fn report_against(&self, kind: ProblemKind, span: Range<usize>, first: Range<usize>) {
        let first_line = Some(line_of(self.text, first.start));
        self.found.borrow_mut().push(Problem { kind, span: Some(span), first_line });
    }

    pub fn is_empty(&self) -> bool {
        self.found.borrow().is_empty()
    }

    pub fn into_vec(self) -> Vec<Problem> {
        self.found.into_inner()
    }
}

/// The values that a quantity or number may have.
#[derive(Clone, Copy)]
pub enum Bounds {
    /// From here to here, both included.
    Between(f64, f64),
    /// Above zero, and finite.
    Positive,
    /// Zero or above, and finite.
    NotNegative,
    /// Above zero; infinity means without a limit.
    PositiveOrInfinite,
    /// Above zero up to and with one.
    Share,
    /// Any finite number.
    Finite,
}

impl Bounds {
    fn contain(self, value: f64) -> bool {
        match self {
            Self::Between(low, high) => (low..=high).contains(&value),
            Self::Positive => value > 0.0 && value.is_finite(),
            Self::NotNegative => value >= 0.0 && value.is_finite(),
            Self::PositiveOrInfinite => value > 0.0,
            Self::Share => value > 0.0 && value <= 1.0,
            Self::Finite => value.is_finite(),
        }
    }

    fn show(self, show: impl Fn(f64) -> String) -> String {
        match self {
            Self::Between(low, high) => format!("{} to {}", show(low), show(high)),
            Self::Positive => format!("above {}", show(0.0)),
            Self::NotNegative => format!("{} or above", show(0.0)),
            Self::PositiveOrInfinite => format!("above {}, or inf for no limit", show(0.0)),
            Self::Share => format!("above {} up to {}", show(0.0), show(1.0)),
            Self::Finite => "any finite number".to_owned(),
        }
    }
}

/// One value with its place.
#[derive(Clone)]
pub struct Entry<'a> {
    pub path: String,
    pub span: Range<usize>,
    value: &'a DeValue<'a>,
    problems: &'a Problems<'a>,
}

impl<'a> Entry<'a> {
    pub fn new(path: String, value: &'a Spanned<DeValue<'a>>, problems: &'a Problems<'a>) -> Self {
        Self { path, span: value.span(), value: value.get_ref(), problems }
    }

    pub fn report(&self, kind: ProblemKind) {
        self.problems.report(kind, self.span.clone());
    }

    pub fn report_range(&self, value: String, allowed: String) {
        self.report(ProblemKind::OutOfRange { key: self.path.clone(), value, allowed });
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
        self.report(ProblemKind::WrongType { key: self.path.clone(), expected, found });
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
        Some(self.problems.directory.join(self.text()?))
    }

    /// A name of a bus, an axis or a machine.
    pub fn name(&self) -> Option<&'a str> {
        let name = self.text()?;
        let is_sound = (1..=32).contains(&name.chars().count())
            && name.chars().all(|c| c.is_alphanumeric() || matches!(c, '-' | '_' | '.'));
        if !is_sound {
            self.report(ProblemKind::BadName { key: self.path.clone(), given: name.to_owned() });
        }
        is_sound.then_some(name)
    }

    pub fn boolean(&self) -> Option<bool> {
        match self.value {
            DeValue::Boolean(value) => Some(*value),
            _ => self.wrong_type("true or false"),
        }
    }

    /// Whether this is that word, for values that may also be a word (`"off"`, `"measure"`).
    pub fn is_word(&self, word: &str) -> bool {
        matches!(self.value, DeValue::String(text) if text == word)
    }

    /// Whether this is a number without a unit.
    pub fn is_bare_number(&self) -> bool {
        matches!(self.value, DeValue::Integer(_) | DeValue::Float(_))
    }

    /// Whether this is a list.
    pub fn is_list(&self) -> bool {
        matches!(self.value, DeValue::Array(_))
    }

    /// A whole number in an inclusive range.
    pub fn integer(&self, allowed: Range<i64>) -> Option<i64> {
        let DeValue::Integer(integer) = self.value else { return self.wrong_type("a whole number") };
        let value = whole(integer).filter(|value| allowed.contains(value));
        if value.is_none() {
            self.report_range(integer.to_string(), format!("{} to {}", allowed.start, allowed.end - 1));
        }
        value
    }

    /// A bare number.
    pub fn number(&self, bounds: Bounds) -> Option<f64> {
        let value = self.bare().or_else(|| self.wrong_type("a number"))?;
        self.bounded(value, bounds, |value| Short(value).to_string())
    }

    /// A number in SI units, or a text with a number and its unit.
    pub fn quantity(&self, quantity: Quantity, bounds: Bounds) -> Option<f64> {
        let value = match self.value {
            DeValue::String(text) => self.with_unit(text, quantity)?,
            _ => self.bare().or_else(|| self.wrong_type("a number or a text with number and unit"))?,
        };
        self.bounded(value, bounds, |value| quantity.show(value))
    }

    /// A duration in whole nanoseconds; the bounds are in seconds.
    pub fn nanoseconds(&self, low_s: f64, high_s: f64) -> Option<u64> {
        let seconds = self.quantity(Quantity::DURATION, Bounds::Between(low_s, high_s))?;
        Some((seconds * 1e9).round() as u64)
    }

    /// One of these words.
    pub fn choice<T: Copy>(&self, choices: &[(&'static str, T)]) -> Option<T> {
        let given = self.text()?;
        let found = choices.iter().find(|(word, _)| *word == given).map(|(_, value)| *value);
        if found.is_none() {
            let words: Vec<_> = choices.iter().map(|(word, _)| *word).collect();
            let nearest = spelling::nearest(given, words.iter().copied());
            let key = self.path.clone();
            self.report(ProblemKind::UnknownChoice { key, given: given.to_owned(), nearest, choices: words });
        }
        found
    }

    pub fn list(&self) -> Option<Vec<Entry<'a>>> {
        let DeValue::Array(list) = self.value else { return self.wrong_type("a list") };
        Some(self.elements(list))
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
        list.iter().map(|value| Self::new(self.path.clone(), value, self.problems)).collect()
    }

    fn bare(&self) -> Option<f64> {
        match self.value {
            DeValue::Integer(integer) => whole(integer).map(|value| value as f64),
            DeValue::Float(float) => float.as_str().parse().ok(),
            _ => None,
        }
    }

    fn bounded(&self, value: f64, bounds: Bounds, show: impl Fn(f64) -> String) -> Option<f64> {
        if bounds.contain(value) {
            return Some(value);
        }
        self.report_range(show(value), bounds.show(show));
        None
    }

    fn with_unit(&self, text: &str, quantity: Quantity) -> Option<f64> {
        let (key, given) = (self.path.clone(), text.to_owned());
        let kind = match quantity.parse(text) {
            Ok(value) => return Some(value),
            Err(QuantityError::NoNumber) => ProblemKind::NotAQuantity { key, given, quantity },
            Err(QuantityError::NoUnit) => ProblemKind::MissingUnit { key, given, quantity },
            Err(QuantityError::UnknownUnit { symbol }) => ProblemKind::UnknownUnit { key, symbol, quantity },
            Err(QuantityError::OtherQuantity { unit }) => ProblemKind::WrongUnit { key, unit, quantity },
        };
        self.report(kind);
        None
    }
}

fn whole(integer: &DeInteger<'_>) -> Option<i64> {
    i64::from_str_radix(integer.as_str(), integer.radix()).ok()
}
