//! A place for a value: where a rule reports what breaks it.
//!
//! The reader of files makes spots of the keys of a file, and [`Config::validate`](super::Config::validate) makes them of
//! the fields of a configuration. The rules are the same for both.

use std::cell::RefCell;
use std::fmt::Display;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use takt_wire::source_text::LineStarts;

use super::bounds::Bounds;
use super::error::{Location, Problem};
use super::problem_kind::ProblemKind;
use super::quantity::Quantity;

/// The problems found so far. Reading goes on after a problem, so that all of them are shown at once.
pub struct Problems {
    /// Where relative paths begin.
    directory: PathBuf,
    lines: LineStarts,
    found: RefCell<Vec<Problem>>,
}

impl Problems {
    /// No problem yet, in this text of a file.
    pub fn in_text(source_name: &str, text: &str) -> Self {
        let directory = Path::new(source_name).parent().unwrap_or(Path::new("")).to_owned();
        Self { directory, lines: LineStarts::of(text), found: RefCell::default() }
    }

    /// No problem yet, in the fields of a configuration.
    pub fn in_fields() -> Self {
        Self::in_text("", "")
    }

    /// The path of a file that the text names.
    pub fn path_of(&self, name: &str) -> PathBuf {
        self.directory.join(name)
    }

    pub fn report(&self, kind: ProblemKind, span: Range<usize>) {
        self.push(kind, Location::Text { span, first_line: None });
    }

    pub fn is_empty(&self) -> bool {
        self.found.borrow().is_empty()
    }

    pub fn into_vec(self) -> Vec<Problem> {
        self.found.into_inner()
    }

    fn push(&self, kind: ProblemKind, location: Location) {
        self.found.borrow_mut().push(Problem { kind, location });
    }
}

/// A place for a value, with the path of its key.
#[derive(Clone)]
pub struct Spot<'a> {
    /// The path of the key, as in `axis.limits.velocity`.
    pub key: String,
    location: Location,
    problems: &'a Problems,
}

impl<'a> Spot<'a> {
    /// A key of a file.
    pub fn in_text(key: String, span: Range<usize>, problems: &'a Problems) -> Self {
        Self { key, location: Location::Text { span, first_line: None }, problems }
    }

    /// A field of a configuration, in the part that `of` names; an empty text names the whole.
    pub fn field(key: String, of: &str, problems: &'a Problems) -> Self {
        Self { key, location: Location::Field { of: of.to_owned() }, problems }
    }

    pub fn report(&self, kind: ProblemKind) {
        self.problems.push(kind, self.location.clone());
    }

    /// Reports what contradicts something earlier, which begins at `first` of the file.
    pub fn report_against(&self, kind: ProblemKind, first: &Range<usize>) {
        let location = match &self.location {
            Location::Text { span, .. } => Location::Text {
                span: span.clone(),
                first_line: Some(self.problems.lines.line_of(first.start)),
            },
            location => location.clone(),
        };
        self.problems.push(kind, location);
    }

    /// The bytes of the file, from where the spot is in one.
    pub fn span(&self) -> Option<Range<usize>> {
        match &self.location {
            Location::Text { span, .. } => Some(span.clone()),
            Location::Nowhere | Location::Field { .. } => None,
        }
    }

    pub fn report_range(&self, value: String, allowed: String) {
        self.report(ProblemKind::OutOfRange { key: self.key.clone(), value, allowed });
    }

    /// Reports a quantity that is not within its bounds. Returns the value where it is.
    pub fn quantity(&self, value: f64, quantity: Quantity, bounds: Bounds) -> Option<f64> {
        self.bounded(value, bounds, |value| quantity.show(value))
    }

    /// Reports a bare number that is not within its bounds.
    pub fn bounded(&self, value: f64, bounds: Bounds, show: impl Fn(f64) -> String) -> Option<f64> {
        if bounds.contain(value) {
            return Some(value);
        }
        self.report_range(show(value), bounds.show(show));
        None
    }

    /// Reports a duration in ns that is not within bounds in seconds.
    pub fn duration(&self, ns: u64, seconds: RangeInclusive<f64>) -> Option<u64> {
        let bounds = Bounds::Between(*seconds.start(), *seconds.end());
        self.quantity(ns as f64 / 1e9, Quantity::DURATION, bounds).map(|_| ns)
    }

    /// Reports a whole number that is not within its range.
    pub fn integer<T: Copy + Display + TryInto<i64>>(&self, value: T, allowed: &Range<i64>) -> Option<T> {
        let is_allowed = value.try_into().is_ok_and(|value| allowed.contains(&value));
        if !is_allowed {
            self.report_range(value.to_string(), format!("{} to {}", allowed.start, allowed.end - 1));
        }
        is_allowed.then_some(value)
    }
}
