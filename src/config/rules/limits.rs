//! The limits of an axis, and the following error.

use takt_rt::PositionCounter;

use super::Fields;
use crate::config::bounds::Bounds;
use crate::config::keys;
use crate::config::model::{FollowingError, Limits};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::{Counting, Quantities};
use crate::config::quantity::Quantity;
use crate::config::spot::Spot;

/// Returns whether the limits are sound, so that what depends on them can be judged.
pub fn validate(limits: &Limits, q: Quantities, counting: Option<&Counting>, fields: &Fields<'_>) -> bool {
    let is_range =
        position_range(&fields.at("position"), [limits.position_min, limits.position_max], q, counting);
    let checks = [
        velocity(&fields.at("velocity"), limits.velocity, q, counting),
        fields.quantity(&keys::limits::ACCELERATION, q, limits.acceleration),
        fields.quantity(&keys::limits::DECELERATION, q, limits.deceleration),
        fields.quantity(&keys::limits::JERK, q, limits.jerk),
        fields.quantity(&keys::limits::TORQUE, q, limits.torque),
    ];
    let are_in_range = checks.iter().all(Option::is_some);
    is_range && are_in_range && stopping_time(limits, q, |key| fields.at(key))
}

/// The lowest position is below the highest, by a count at least, and a drive can count both. The latter is judged where
/// it is known how the drive counts.
pub fn position_range(
    spot: &Spot<'_>,
    [low, high]: [f64; 2],
    q: Quantities,
    counting: Option<&Counting>,
) -> bool {
    let is_finite = [low, high].map(|position| spot.quantity(position, q.position, Bounds::Finite).is_some());
    if is_finite != [true; 2] {
        return false;
    }
    if low >= high {
        spot.report(ProblemKind::EmptyRange { low: q.position.show(low), high: q.position.show(high) });
        return false;
    }
    let Some(counting) = counting else { return true };
    let resolution = 1.0 / counting.counts_per_unit();
    if high - low < resolution {
        let allowed = format!("a range of {} at least, one count of the drive", q.position.show(resolution));
        spot.report_range(format!("a range of {}", q.position.show(high - low)), allowed);
        return false;
    }
    fits_counter(spot, counting.counter, &[low, high].map(|position| counting.position(position)))
}

pub fn velocity(spot: &Spot<'_>, velocity: f64, q: Quantities, counting: Option<&Counting>) -> Option<f64> {
    let velocity = spot.quantity(velocity, q.velocity, q.ranges.velocity)?;
    let counts = counting.map(|counting| velocity * counting.counts_per_unit());
    fits_counter(spot, PositionCounter::BITS_32, counts.as_slice()).then_some(velocity)
}

/// The count at which the joint is at 0, from the position that it has where the drive counts 0.
pub fn zero_counts(spot: &Spot<'_>, position_at_zero_counts: f64, counting: &Counting) -> Option<i32> {
    let position =
        spot.quantity(position_at_zero_counts, Quantities::of(counting.travel).position, Bounds::Finite)?;
    let counts = -(counting.position(position) - counting.position(0.0));
    fits_counter(spot, PositionCounter::BITS_32, &[counts]).then_some(counts.round() as i32)
}

/// A drive counts speeds in 32 bits, and positions by its counter.
fn fits_counter(spot: &Spot<'_>, counter: PositionCounter, counts: &[f64]) -> bool {
    let (lowest, highest) = (counter.lowest(), counter.highest());
    let range = f64::from(lowest)..=f64::from(highest);
    let beyond = counts.iter().find(|counts| !range.contains(*counts));
    if let Some(&counts) = beyond {
        spot.report(ProblemKind::BeyondCounts { key: spot.key.clone(), counts, lowest, highest });
    }
    beyond.is_none()
}

/// A stop from full speed must end within seconds: Ctrl-C and every controlled stop wait for it.
pub fn stopping_time<'a>(limits: &Limits, q: Quantities, at: impl Fn(&'static str) -> Spot<'a>) -> bool {
    let Limits { velocity, deceleration, jerk, .. } = *limits;
    let without_jerk_s = velocity / deceleration;
    let time_s = stopping_time_s(limits);
    if time_s <= keys::STOP_AT_MOST_S {
        return true;
    }
    let (key, value) = if without_jerk_s > keys::STOP_AT_MOST_S {
        let key = if deceleration == limits.acceleration { "acceleration" } else { "deceleration" };
        (key, q.acceleration.show(deceleration))
    } else {
        ("jerk", q.jerk.show(jerk))
    };
    let allowed = format!(
        "what stops the joint from {} within {}, not in {}",
        q.velocity.show(velocity),
        Quantity::DURATION.show(keys::STOP_AT_MOST_S),
        Quantity::DURATION.show(time_s),
    );
    at(key).report_range(value, allowed);
    false
}

/// The shortest time (s) of a stop from the highest speed, from constant speed to rest.
fn stopping_time_s(limits: &Limits) -> f64 {
    let Limits { velocity, deceleration, jerk, .. } = *limits;
    if velocity * jerk >= deceleration * deceleration {
        velocity / deceleration + deceleration / jerk
    } else {
        2.0 * (velocity / jerk).sqrt()
    }
}

pub fn validate_following_error(following_error: &FollowingError, q: Quantities, fields: &Fields<'_>) {
    fields.quantity(&keys::following_error::LIMIT, q, following_error.limit);
    fields.duration(&keys::following_error::TIME, following_error.time_ns);
}

/// Returns `true` if a position is within the limits.
pub fn contains(limits: &Limits, position: f64) -> bool {
    (limits.position_min..=limits.position_max).contains(&position)
}
