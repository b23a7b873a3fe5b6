//! What holds after every cycle, whatever has been asked for and whatever has broken.

mod independence;
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
use takt_rt::{CycleRecord, Event, GroupSnapshot, Phase, Snapshot};

use crate::client::RecentRequests;
use crate::concern::Concern;
use crate::wire::SentValues;

use independence::Independence;
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
    /// The group of each axis.
    pub groups: &'a [usize],
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
    /// What had been asked for before it, an entry a group.
    pub asked: &'a [RecentRequests],
    /// True if callbacks command torques and impedances, so that a joint in cyclic torque need not be on its set-point.
    pub are_torques_commanded: bool,
    /// True if anything else is wrong than that the machine has too little time.
    pub has_faults: bool,
}

impl Seen<'_> {
    /// The group of an axis after the cycle.
    pub fn group_of(&self, axis: usize) -> &GroupSnapshot {
        &self.snapshot.groups()[self.groups[axis]]
    }

    /// What the group of an axis did in the cycle, as recorded.
    pub fn phase_of(&self, axis: usize) -> Phase {
        self.record.groups()[self.groups[axis]].phase
    }

    /// The events that concern a group.
    pub fn events_of(&self, group: usize) -> impl Iterator<Item = &Event> {
        self.events.iter().filter(move |event| event.group == Some(group as u8))
    }
}

pub struct Invariants {
    set_points: Vec<SetPoints>,
    power: Power,
    phases: Vec<Phases>,
    stops: Vec<Stops>,
    releases: Releases,
    independence: Independence,
}

impl Invariants {
    pub fn new(config: &Config) -> Self {
        let groups = 0..config.groups.len().max(1);
        let set_points = (0..config.axes.len()).map(|axis| SetPoints::new(config, axis));
        Self {
            set_points: set_points.collect(),
            power: Power::new(config),
            phases: groups.clone().map(|group| Phases::new(config, group)).collect(),
            stops: groups.map(|group| Stops::new(config, group)).collect(),
            releases: Releases::new(config.axes.len()),
            independence: Independence::new(config),
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
        self.independence.check(seen)?;
        self.stops.iter_mut().try_for_each(|stops| stops.check(seen))?;
        self.releases.check(seen)?;
        self.power.check(seen)?;
        self.phases.iter_mut().try_for_each(|phases| phases.check(seen))
    }
}
