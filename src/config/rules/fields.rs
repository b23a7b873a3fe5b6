//! The fields of a configuration, by the paths of their keys.

use std::fmt::Display;

use takt_wire::printable::excerpt;

use crate::config::key::Key;
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::Quantities;
use crate::config::spot::{Problems, Spot};

/// A name of a bus, an axis or a machine.
pub fn name(spot: &Spot<'_>, name: &str) -> bool {
    let is_sound = (1..=32).contains(&name.chars().count())
        && name.chars().all(|c| c.is_alphanumeric() || matches!(c, '-' | '_' | '.'));
    if !is_sound {
        spot.report(ProblemKind::BadName { key: spot.key.clone(), given: excerpt(name) });
    }
    is_sound
}

/// The fields of a part of a configuration, by the paths of their keys in a file.
pub struct Fields<'a> {
    prefix: String,
    /// The element of a list, as in `axes[2] "elbow"`; empty outside of lists.
    of: String,
    problems: &'a Problems,
}

impl<'a> Fields<'a> {
    /// Those of the whole configuration.
    pub fn of(problems: &'a Problems) -> Self {
        Self { prefix: String::new(), of: String::new(), problems }
    }

    pub fn at(&self, key: &str) -> Spot<'a> {
        // `bus.period` is what a field of an axis may be at odds with; it is no field of the axis.
        let key = if key.starts_with("bus.") { key.to_owned() } else { format!("{}{key}", self.prefix) };
        Spot::field(key, &self.of, self.problems)
    }

    /// Checks a whole number by its row.
    pub fn integer<T: Copy + Display + TryInto<i64>>(&self, key: &Key, value: T) -> Option<T> {
        self.at(key.name).integer_of(key, value)
    }

    /// Checks a duration in ns by its row.
    pub fn duration(&self, key: &Key, ns: u64) -> Option<u64> {
        self.at(key.name).duration_of(key, ns)
    }

    /// Checks a bare number by its row.
    pub fn number(&self, key: &Key, value: f64) -> Option<f64> {
        self.at(key.name).number_of(key, value)
    }

    /// Checks a quantity by its row.
    pub fn quantity(&self, key: &Key, quantities: Quantities, value: f64) -> Option<f64> {
        self.at(key.name).quantity_of(key, quantities, value)
    }

    pub fn within(&self, key: &str) -> Self {
        Self { prefix: format!("{}{key}.", self.prefix), of: self.of.clone(), problems: self.problems }
    }

    pub fn element(&self, key: &str, list: &str, index: usize, name: &str) -> Self {
        let name = if name.is_empty() { String::new() } else { format!(" {name:?}") };
        Self {
            prefix: format!("{}{key}.", self.prefix),
            of: format!("{list}[{index}]{name}"),
            problems: self.problems,
        }
    }
}
