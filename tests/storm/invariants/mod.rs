//! What holds after every cycle, whatever has been asked for and whatever has broken.

mod course;
mod motion;
mod origins;
mod phases;
mod power;
mod releases;
mod stops;

use takt::config::Config;
use takt::sim::Observation;
use takt_rt::{CycleRecord, Event, Snapshot};

use crate::client::RecentRequests;
use crate::concern::Concern;
use crate::wire::Told;

use course::Course;
use phases::Phases;
use power::Power;
use releases::Releases;
use stops::Stops;

/// Slower than this is rest: rad/s (m/s).
pub const REST: f64 = 2e-3;

/// One cycle, from every side.
pub struct Seen<'a> {
    pub config: &'a Config,
    /// The state that the controller shows after it.
    pub snapshot: &'a Snapshot,
    /// What it has left for the logger.
    pub record: &'a CycleRecord,
    /// What was told to the drives on the wire, an axis each.
    pub told: &'a [Told],
    /// What is true of the drives, an axis each.
    pub truth: &'a [Observation],
    /// What was told to people.
    pub events: &'a [Event],
    /// What cannot be expected of the joints any more, an axis each.
    pub concerns: &'a [Concern],
    /// Whether any fault has begun on a bus, an entry a bus.
    pub troubled_buses: &'a [bool],
    /// Whether a bus cannot carry in time what is asked of it, an entry a bus.
    pub overloaded_buses: &'a [bool],
    /// What had been asked for before it.
    pub asked: RecentRequests,
    /// Whether anything else is wrong than that the machine has too little time.
    pub has_faults: bool,
}

pub struct Invariants {
    courses: Vec<Course>,
    power: Power,
    phases: Phases,
    stops: Stops,
    releases: Releases,
}

impl Invariants {
    pub fn new(config: &Config) -> Self {
        let courses = config.axes.iter().map(|axis| Course::new(config, axis));
        Self {
            courses: courses.collect(),
            power: Power::new(config.axes.len()),
            phases: Phases::default(),
            stops: Stops::new(config.axes.len()),
            releases: Releases::new(config.axes.len()),
        }
    }

    /// Looks at a cycle.
    pub fn check(&mut self, seen: &Seen<'_>) -> Result<(), String> {
        for (axis, course) in self.courses.iter_mut().enumerate() {
            course.check(seen, axis).map_err(|wrong| format!("{}: {wrong}", seen.config.axes[axis].name))?;
        }
        origins::check(seen)?;
        motion::check(seen)?;
        self.stops.check(seen)?;
        self.releases.check(seen)?;
        self.power.check(seen)?;
        self.phases.check(seen)
    }
}
