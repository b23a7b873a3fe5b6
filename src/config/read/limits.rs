//! `[axis.limits]` and `[axis.following_error]`.

use super::entry::Entry;
use super::section::Section;
use crate::config::defaults;
use crate::config::model::{FollowingError, Limits, Travel};
use crate::config::position_unit::PositionUnit;
use crate::config::quantities::{Counting, Quantities};
use crate::config::ranges;
use crate::config::rules;

/// The limits, `None` where something about them is wrong, and the unit of those of the position.
pub fn limits(
    mut section: Section<'_>,
    q: Quantities,
    travel: Travel,
    counting: Option<&Counting>,
) -> (Option<Limits>, PositionUnit) {
    let entry =
        section.require("position", "lowest and highest position: position = [\"-170 deg\", \"170 deg\"]");
    let shown_in = entry.as_ref().map_or(PositionUnit::of(travel), |entry| shown_in(entry, travel));
    let position = entry.and_then(|entry| {
        let range = position_range(&entry, q)?;
        rules::limits::position_range(&entry.spot, range, q, counting).then_some(range)
    });
    let velocity = section
        .require("velocity", "highest speed: velocity = \"137 deg/s\"")
        .and_then(|entry| rules::limits::velocity(&entry.spot, entry.unbounded(q.velocity)?, q, counting));
    let acceleration = section
        .require("acceleration", "highest acceleration: acceleration = \"8 rad/s^2\"")
        .and_then(|entry| entry.quantity(q.acceleration, q.ranges.acceleration));
    let deceleration =
        section.get("deceleration").map(|entry| entry.quantity(q.acceleration, q.ranges.acceleration));
    let jerk = section.get("jerk").map(|entry| entry.quantity(q.jerk, q.ranges.jerk));
    let torque = section
        .require("torque", "highest torque, or force of a linear axis: torque = \"87 Nm\"")
        .and_then(|entry| entry.quantity(q.effort, q.ranges.effort));
    let build = || {
        let [position_min, position_max] = position?;
        Some(Limits {
            position_min,
            position_max,
            velocity: velocity?,
            acceleration: acceleration?,
            deceleration: deceleration.unwrap_or(acceleration)?,
            jerk: jerk.unwrap_or(Some(f64::INFINITY))?,
            torque: torque?,
        })
    };
    let limits = build().filter(|limits| rules::limits::stopping_time(limits, q, |key| section.spot(key)));
    section.finish();
    (limits, shown_in)
}

/// The unit of the first position that is written with one.
fn shown_in(entry: &Entry<'_>, travel: Travel) -> PositionUnit {
    let written = entry.texts().next().map(|text| PositionUnit::written(text, travel));
    written.unwrap_or(PositionUnit::of(travel))
}

fn position_range(entry: &Entry<'_>, q: Quantities) -> Option<[f64; 2]> {
    let list = entry.list()?;
    let [low, high] = list.as_slice() else {
        entry.report_range(
            format!("a list of {}", list.len()),
            "the lowest and the highest position".to_owned(),
        );
        return None;
    };
    let (low, high) = (low.unbounded(q.position), high.unbounded(q.position));
    Some([low?, high?])
}

pub fn following_error(mut section: Section<'_>, q: Quantities, travel: Option<Travel>) -> FollowingError {
    let limit = section.get("limit").and_then(|entry| entry.quantity(q.position, q.ranges.deviation));
    let time_ns = section.get("time").and_then(|entry| entry.nanoseconds(ranges::FOLLOWING_ERROR_TIME_S));
    section.finish();
    FollowingError {
        limit: limit.unwrap_or(defaults::following_error(travel.unwrap_or(Travel::Rotary))),
        time_ns: time_ns.unwrap_or(defaults::FOLLOWING_ERROR_TIME_NS),
    }
}
