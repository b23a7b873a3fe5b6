//! A comparison as an object.

use serde::Serialize;

use super::Comparison;
use takt::config::Config;
use takt::telemetry::{Machine, words};

/// The result as an object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparisonReport {
    identical: bool,
    cycles: u64,
    compared: u64,
    missing: u64,
    differing: u64,
    first_difference: Option<ReportedDifference>,
    axes: Vec<ReportedAxis>,
    stops: Vec<String>,
    last_motion_s: Pair,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct ReportedDifference {
    slot: u64,
    what: String,
    recorded: String,
    replayed: String,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct ReportedAxis {
    name: String,
    position_difference: f64,
    slot: u64,
    velocity: Pair,
    acceleration: Pair,
    jerk: Pair,
}

/// A value of the recording, and of the replay.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Pair {
    recorded: f64,
    replayed: f64,
}

impl From<(f64, f64)> for Pair {
    fn from((recorded, replayed): (f64, f64)) -> Self {
        Self { recorded, replayed }
    }
}

impl ComparisonReport {
    /// Of a comparison under this configuration.
    pub fn new(comparison: &Comparison, config: &Config, machine: &Machine) -> Self {
        Self {
            identical: comparison.is_identical(),
            cycles: comparison.cycles,
            compared: comparison.compared,
            missing: comparison.missing,
            differing: comparison.differing,
            first_difference: comparison.first.clone().map(|first| ReportedDifference {
                slot: first.slot,
                what: first.what,
                recorded: first.values.0,
                replayed: first.values.1,
            }),
            axes: config
                .axes
                .iter()
                .zip(&comparison.axes)
                .map(|(axis, difference)| ReportedAxis {
                    name: axis.name.clone(),
                    position_difference: difference.position,
                    slot: difference.slot,
                    velocity: difference.velocity.into(),
                    acceleration: difference.acceleration.into(),
                    jerk: difference.jerk.into(),
                })
                .collect(),
            stops: comparison.stops.iter().map(|(_, stop)| words::stop(stop, machine).to_string()).collect(),
            last_motion_s: comparison.last_motion_s.into(),
        }
    }
}
