//! `[axis.limits]` and `[axis.following_error]`.

use takt_wire::printable::printable_path;

use super::entry::Entry;
use super::section::Section;
use super::urdf::DescribedJoint;
use crate::config::defaults;
use crate::config::keys::following_error::{LIMIT, TIME};
use crate::config::keys::limits as limit_keys;
use crate::config::model::{FollowingError, Limits, Travel};
use crate::config::position_unit::PositionUnit;
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::{Counting, Quantities};
use crate::config::quantity::Quantity;
use crate::config::rules;
use crate::config::spot::Spot;
use crate::config::urdf::{UrdfJoint, exceeds};
use crate::config::urdf_limits::{LimitOrigin, UrdfLimits};

/// What was read of the limits of an axis.
pub struct ReadLimits {
    /// `None` where something about them is wrong.
    pub limits: Option<Limits>,
    /// The unit of those of the position.
    pub shown_in: PositionUnit,
    /// Which of them a robot description has.
    pub urdf: Option<UrdfLimits>,
}

/// A limit, `None` where something about it is wrong, and where it is from.
type FromSomewhere<T> = (Option<T>, LimitOrigin);

pub fn limits(
    mut section: Section<'_>,
    q: Quantities,
    travel: Travel,
    counting: Option<&Counting>,
    described: &DescribedJoint<'_>,
) -> ReadLimits {
    let joint = described.joint();
    let says = "lowest and highest position: position = [\"-170 deg\", \"170 deg\"]";
    let entry =
        described.entry(&mut section, "position", says, joint.is_some_and(|joint| joint.position.is_some()));
    let shown_in = entry.as_ref().map_or(PositionUnit::of(travel), |entry| shown_in(entry, travel));
    let (position, position_origin) = position(entry, q, counting, described);

    let says = "highest speed: velocity = \"137 deg/s\"";
    let velocity_described = joint.and_then(|joint| joint.velocity);
    let entry = described.entry(&mut section, "velocity", says, velocity_described.is_some());
    let judge = |spot: &Spot<'_>, value| rules::limits::velocity(spot, value, q, counting);
    let (velocity, velocity_origin) =
        magnitude(entry, q.velocity, judge, described.spot("velocity"), velocity_described, joint);

    section.require(limit_keys::ACCELERATION.name, "highest acceleration: acceleration = \"8 rad/s^2\"");
    let acceleration = section.quantity(&limit_keys::ACCELERATION, q);
    let deceleration = section.keyed(&limit_keys::DECELERATION).map(|entry| entry.quantity(q));
    let jerk = section.keyed(&limit_keys::JERK).map(|entry| entry.quantity(q));

    let says = "highest torque, or force of a linear axis: torque = \"87 Nm\"";
    let effort_described = joint.and_then(|joint| joint.effort);
    let entry = described.entry(&mut section, "torque", says, effort_described.is_some());
    let judge = |spot: &Spot<'_>, value| spot.quantity(value, q.effort, q.ranges.effort);
    let (torque, torque_origin) =
        magnitude(entry, q.effort, judge, described.spot("effort"), effort_described, joint);

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
    let urdf = joint.map(|joint| UrdfLimits {
        file: joint.file.clone(),
        joint: joint.name.clone(),
        position: position_origin,
        velocity: velocity_origin,
        torque: torque_origin,
    });
    ReadLimits { limits, shown_in, urdf }
}

/// The limits of the position: those of the configuration, which may be no wider than those of the joint, or else those of the joint.
fn position(
    entry: Option<Entry<'_>>,
    q: Quantities,
    counting: Option<&Counting>,
    described: &DescribedJoint<'_>,
) -> FromSomewhere<[f64; 2]> {
    let joint = described.joint();
    let of_joint = joint.and_then(|joint| joint.position);
    let is_sound = |spot: &Spot<'_>, range| rules::limits::position_range(spot, range, q, counting);
    let Some(entry) = entry else {
        let Some(((range, origin), spot)) = of_joint.zip(described.spot("position")) else {
            return (None, LimitOrigin::Configuration);
        };
        return (is_sound(&spot, range).then_some(range), origin);
    };
    let range = position_range(&entry, q).filter(|range| is_sound(&entry.spot, *range));
    if let (Some([low, high]), Some(([lowest, highest], _)), Some(joint)) = (range, of_joint, joint)
        && (exceeds(lowest, low, high - low) || exceeds(high, highest, high - low))
    {
        let show = |low, high| format!("{} to {}", q.position.show(low), q.position.show(high));
        report_wider(&entry.spot, show(low, high), show(lowest, highest), joint);
    }
    (range, LimitOrigin::Configuration)
}

/// The limit of a magnitude, by the same rule.
fn magnitude(
    entry: Option<Entry<'_>>,
    quantity: Quantity,
    judge: impl Fn(&Spot<'_>, f64) -> Option<f64>,
    spot_of_joint: Option<Spot<'_>>,
    of_joint: Option<f64>,
    joint: Option<&UrdfJoint>,
) -> FromSomewhere<f64> {
    let Some(entry) = entry else {
        let judged = of_joint.zip(spot_of_joint).and_then(|(value, spot)| judge(&spot, value));
        return (judged, LimitOrigin::Limit);
    };
    let value = entry.unbounded(quantity).and_then(|value| judge(&entry.spot, value));
    if let (Some(value), Some(most), Some(joint)) = (value, of_joint, joint)
        && exceeds(value, most, most)
    {
        report_wider(&entry.spot, quantity.show(value), quantity.show(most), joint);
    }
    (value, LimitOrigin::Configuration)
}

fn report_wider(spot: &Spot<'_>, value: String, allowed: String, joint: &UrdfJoint) {
    let file = printable_path(&joint.file);
    spot.report(ProblemKind::WiderThanUrdf {
        key: spot.key.clone(),
        value,
        allowed,
        joint: joint.name.clone(),
        file,
    });
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
    let limit = section.quantity(&LIMIT, q);
    let time_ns = section.nanoseconds(&TIME);
    section.finish();
    FollowingError {
        limit: limit.unwrap_or(defaults::following_error(travel.unwrap_or(Travel::Rotary))),
        time_ns: time_ns.unwrap_or(const { TIME.default_ns() }),
    }
}
