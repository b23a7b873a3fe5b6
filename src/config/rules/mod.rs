//! What every value of a configuration must be. Each rule exists once. The reader of files applies it to a key, and
//! [`Config::validate`] to a field.

pub mod axis;
pub mod bit_fields;
pub mod bus;
pub mod converter;
pub mod cycle;
mod fields;
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

pub use fields::{Fields, name};

use super::error::ConfigError;
use super::keys;
use super::model::{Config, StreamDelay};
use super::spot::Problems;

impl Config {
    /// Checks every value by the rules of the reader of files. A configuration that was changed in code needs this; everything
    /// that starts with a configuration calls it first.
    ///
    /// # Errors
    /// Every problem, with the field that it concerns.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let problems = Problems::in_fields();
        let whole = Fields::of(&problems);
        name(&whole.at("name"), &self.name);
        cycle::validate(&self.cycle, &self.missed_slots, &whole.within("cycle"));
        if let StreamDelay::Fixed(delay_ns) = self.stream_delay {
            whole.within("stream").duration(&keys::stream::DELAY, delay_ns);
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
