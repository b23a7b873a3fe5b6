//! How simulated buses and joints behave.

use std::ops::RangeInclusive;

use super::Fields;
use super::limits::contains;
use crate::config::bounds::Bounds;
use crate::config::drive_family::DriveFacts;
use crate::config::keys;
use crate::config::model::{Limits, PowerUpState, SimulatedJoint, Simulation};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::Quantities;
use crate::config::spot::Spot;

pub fn validate(simulation: &Simulation, period_ns: u64, fields: &Fields<'_>) {
    fields.at("longest_gap").duration(simulation.longest_gap_ns, longest_gap(period_ns));
}

/// The range of the longest gap, in seconds. The simulated world never pauses within a cycle.
pub fn longest_gap(period_ns: u64) -> RangeInclusive<f64> {
    let period_s = period_ns as f64 / 1e9;
    period_s..=keys::LONGEST_GAP_AT_MOST_S.max(period_s)
}

/// The simulated joint of an axis. Its initial position is judged only where the limits are sound.
pub fn validate_joint(
    joint: &SimulatedJoint,
    q: Quantities,
    limits: Option<&Limits>,
    axis: &str,
    drive: &DriveFacts,
    fields: &Fields<'_>,
) {
    fields.quantity(&keys::simulated::GRAVITY, q, joint.gravity);
    fields.quantity(&keys::simulated::PEAK_TORQUE, q, joint.peak_torque);
    initial_position(&fields.at("initial_position"), joint.initial_position, q, limits, axis);
    power_up(&fields.at("power_up"), drive, joint.power_up);
}

/// Some families may power up operational, where their manuals do not say how they do.
pub fn power_up(spot: &Spot<'_>, drive: &DriveFacts, power_up: PowerUpState) {
    if power_up == PowerUpState::Operational && !drive.may_power_up_operational {
        spot.report(ProblemKind::OutOfRange {
            key: spot.key.clone(),
            value: "\"operational\"".to_owned(),
            allowed: format!("\"pre-operational\", as a drive of the family {} powers up", drive.name),
        });
    }
}

pub fn initial_position(spot: &Spot<'_>, position: f64, q: Quantities, limits: Option<&Limits>, axis: &str) {
    if spot.quantity(position, q.position, Bounds::Finite).is_none() {
        return;
    }
    if let Some(limits) = limits.filter(|limits| !contains(limits, position)) {
        spot.report(ProblemKind::InitialPositionOutsideLimits {
            axis: axis.to_owned(),
            value: q.position.show(position),
            allowed: q.show_range(limits),
        });
    }
}
