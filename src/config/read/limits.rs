//! `[axis.limits]` and `[axis.following_error]`.

use super::entry::{Bounds, Entry};
use super::section::Section;
use super::travel::{Counting, Quantities};
use crate::config::defaults;
use crate::config::model::{FollowingError, Limits, Travel};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantity::Quantity;

pub fn limits(
    mut section: Section<'_>,
    q: Quantities,
    travel: Option<Travel>,
    counting: &Counting,
) -> Option<Limits> {
    let position = section
        .require("position", "lowest and highest position: position = [\"-170 deg\", \"170 deg\"]")
        .and_then(|entry| {
            let (low, high) = position_range(&entry, q)?;
            check_counts(&entry, &[low, high].map(|position| counting.position(position, travel)));
            Some((low, high))
        });
    let velocity = section.require("velocity", "highest speed: velocity = \"137 deg/s\"").and_then(|entry| {
        let velocity = entry.quantity(q.velocity, Bounds::Positive)?;
        check_counts(&entry, &[velocity * counting.counts_per_unit(travel)]);
        Some(velocity)
    });
    let acceleration = section
        .require("acceleration", "highest acceleration: acceleration = \"8 rad/s^2\"")
        .and_then(|entry| entry.quantity(q.acceleration, Bounds::Positive));
    let deceleration =
        section.get("deceleration").map(|entry| entry.quantity(q.acceleration, Bounds::Positive));
    let jerk = section.get("jerk").map(|entry| entry.quantity(q.jerk, Bounds::PositiveOrInfinite));
    let torque = section
        .require("torque", "highest torque, or force of a linear axis: torque = \"87 Nm\"")
        .and_then(|entry| entry.quantity(q.effort, Bounds::Positive));
    section.finish();
    let (position_min, position_max) = position?;
    Some(Limits {
        position_min,
        position_max,
        velocity: velocity?,
        acceleration: acceleration?,
        deceleration: deceleration.unwrap_or(acceleration)?,
        jerk: jerk.unwrap_or(Some(f64::INFINITY))?,
        torque: torque?,
    })
}

fn position_range(entry: &Entry<'_>, q: Quantities) -> Option<(f64, f64)> {
    let list = entry.list()?;
    let [low, high] = list.as_slice() else {
        entry.report_range(
            format!("a list of {}", list.len()),
            "the lowest and the highest position".to_owned(),
        );
        return None;
    };
    let (low, high) = (low.quantity(q.position, Bounds::Finite), high.quantity(q.position, Bounds::Finite));
    let (low, high) = (low?, high?);
    if low < high {
        return Some((low, high));
    }
    entry.report(ProblemKind::EmptyRange { low: q.position.show(low), high: q.position.show(high) });
    None
}

/// A drive counts positions and speeds in 32 bits.
fn check_counts(entry: &Entry<'_>, counts: &[f64]) {
    if let Some(&counts) = counts.iter().find(|counts| counts.abs() > f64::from(i32::MAX)) {
        entry.report(ProblemKind::BeyondCounts { key: entry.path.clone(), counts });
    }
}

pub fn following_error(mut section: Section<'_>, q: Quantities) -> FollowingError {
    let limit = section.get("limit").and_then(|entry| entry.quantity(q.position, Bounds::Positive));
    let time_ns = section.get("time").and_then(|entry| entry.nanoseconds(0.0, 10.0));
    section.finish();
    let default = if q.position == Quantity::ANGLE {
        defaults::FOLLOWING_ERROR_RAD
    } else {
        defaults::FOLLOWING_ERROR_M
    };
    FollowingError {
        limit: limit.unwrap_or(default),
        time_ns: time_ns.unwrap_or(defaults::FOLLOWING_ERROR_TIME_NS),
    }
}

/// Whether a position is within the limits.
pub fn contains(limits: &Limits, position: f64) -> bool {
    (limits.position_min..=limits.position_max).contains(&position)
}

/// The position limits for people.
pub fn show_range(limits: &Limits, q: Quantities) -> String {
    format!("{} to {}", q.position.show(limits.position_min), q.position.show(limits.position_max))
}
