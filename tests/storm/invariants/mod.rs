//! What holds after every cycle, whatever has been asked for and whatever has broken.

mod motion;
mod origins;
mod phases;
mod power;
mod releases;
mod set_points;
mod stops;
mod streams;

use takt::config::Config;
use takt::sim::Observation;
use takt_rt::{CycleRecord, Event, Snapshot};

use crate::client::RecentRequests;
use crate::concern::Concern;
use crate::wire::SentValues;

use phases::Phases;
use power::Power;
use releases::Releases;
use set_points::SetPoints;
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
    /// What was sent to the drives, an entry an axis.
    pub sent: &'a [SentValues],
    /// What is true of the drives, an axis each.
    pub truth: &'a [Observation],
    /// The events of the cycle.
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
    set_points: Vec<SetPoints>,
    power: Power,
    phases: Phases,
    stops: Stops,
    releases: Releases,
}

impl Invariants {
    pub fn new(config: &Config) -> Self {
        let set_points = config.axes.iter().map(|axis| SetPoints::new(config, axis));
        Self {
            set_points: set_points.collect(),
            power: Power::new(config.axes.len()),
            phases: Phases::default(),
            stops: Stops::new(config.axes.len()),
            releases: Releases::new(config.axes.len()),
        }
    }

    /// Looks at a cycle.
    pub fn check(&mut self, seen: &Seen<'_>) -> Result<(), String> {
        for (axis, set_points) in self.set_points.iter_mut().enumerate() {
            set_points
                .check(seen, axis)
                .map_err(|wrong| format!("{}: {wrong}", seen.config.axes[axis].name))?;
        }
        origins::check(seen)?;
        motion::check(seen)?;
        streams::check(seen)?;
        self.stops.check(seen)?;
        self.releases.check(seen)?;
        self.power.check(seen)?;
        self.phases.check(seen)
    }
}
