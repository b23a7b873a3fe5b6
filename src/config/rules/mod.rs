//! What every value of a configuration must be. Each rule exists once. The reader of files applies it to a key, and
//! [`Config::validate`] to a field.

pub mod axis;
pub mod bit_fields;
pub mod bus;
pub mod converter;
pub mod cycle;
pub mod group;
pub mod identifiers;
pub mod limits;
pub mod line;
mod loop_stability;
pub mod loops;
pub mod master;
pub mod program;
pub mod realtime;
pub mod simulation;
pub mod telemetry;
#[cfg(target_os = "linux")]
mod this_machine;

use takt_wire::printable::excerpt;

use super::error::ConfigError;
use super::model::{Config, StreamDelay};
use super::problem_kind::ProblemKind;
use super::ranges;
use super::spot::{Problems, Spot};

impl Config {
    /// Checks every value by the rules of the reader of files. A configuration that was changed in code needs this; everything
    /// that starts with a configuration calls it first.
    ///
    /// # Errors
    /// Every problem, with the field that it concerns.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let problems = Problems::in_fields();
        let whole = Fields { prefix: String::new(), of: String::new(), problems: &problems };
        name(&whole.at("name"), &self.name);
        cycle::validate(&self.cycle, &self.missed_slots, &whole.within("cycle"));
        if let StreamDelay::Fixed(delay_ns) = self.stream_delay {
            whole.at("stream.delay").duration(delay_ns, ranges::STREAM_DELAY_S);
        }
        realtime::validate(&self.realtime, self.cycle.period_ns, &whole.within("realtime"));
        master::validate(&self.master, &whole.within("master"));
        telemetry::validate(&self.telemetry, &whole.within("telemetry"));
        simulation::validate(&self.simulation, self.cycle.period_ns, &whole.within("simulation"));
        bus::validate(self, &whole);
        axis::validate(self, &whole);
        group::validate(self, &whole);
        program::validate(self, &whole);
        if problems.is_empty() {
            Ok(())
        } else {
            Err(ConfigError::of_fields(&self.name, problems.into_vec()))
        }
    }
}

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
    fn at(&self, key: &str) -> Spot<'a> {
        // `bus.period` is what a field of an axis may be at odds with; it is no field of the axis.
        let key = if key.starts_with("bus.") { key.to_owned() } else { format!("{}{key}", self.prefix) };
        Spot::field(key, &self.of, self.problems)
    }

    fn within(&self, key: &str) -> Self {
        Self { prefix: format!("{}{key}.", self.prefix), of: self.of.clone(), problems: self.problems }
    }

    fn element(&self, key: &str, list: &str, index: usize, name: &str) -> Self {
        let name = if name.is_empty() { String::new() } else { format!(" {name:?}") };
        Self {
            prefix: format!("{}{key}.", self.prefix),
            of: format!("{list}[{index}]{name}"),
            problems: self.problems,
        }
    }
}
