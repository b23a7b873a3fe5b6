//! Third order: jerk-limited motions after L. Berscheid and T. Kröger, "Jerk-limited Real-time Trajectory Generation
//! with Arbitrary Target States", RSS 2021 (`otg.md` sections 1 to 4).
//!
//! [`brake`] brings the start inside the limits, [`step1`] finds the fastest motion and the blocked durations,
//! [`step2`] a motion of given duration. In place of the paper's enumeration of profile types, both follow families
//! of motions ([`crossing`], [`passage`]) between points known in closed form, see there.
//!
//! The bound on the work of one axis: step 1 searches at most three roots in each of two crossings and five in each of two passages,
//! step 2 no more than three, and a search evaluates its function at most [`roots::EVALUATIONS_MAX`] times. Everything else is
//! in closed form.

mod brake;
mod crossing;
mod drift;
mod motion;
mod passage;
pub(super) mod roots;
mod step1;
mod step2;
mod turn;

use super::choice::larger;
use super::error::PlanError;
use super::problem::{Limits, Problem, State};
use super::profile::Profile;
use super::ramp::{Ramp, Slopes, Stretches};
use super::synchronisation::Return;
use motion::{Scale, Shape};
use step1::Edges;
use step2::Slower;

pub(super) use turn::stop_turning;

/// Relative to the sizes of a problem, differences up to this are rounding.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// The most searches for a root when one axis is planned: step 1 for the fastest motion, and once more where the duration of
/// the other axes is next to a blocked interval.
#[cfg(test)]
pub(super) const SEARCHES_MAX: u32 = 2 * (2 * 3 + 2 * 5);

/// Relative to a duration, being this near to a blocked interval is to be on its edge.
const EDGE: f64 = 3e-11;

/// The rest of a problem behind the brake.
struct Inside {
    edges: Edges,
    scale: Scale,
    brake_s: f64,
}

impl Inside {
    fn of(problem: &Problem, manner: Return, profile: &mut Profile) -> Result<Self, PlanError> {
        let Problem { start, target, limits } = problem;
        let reached = match manner {
            Return::Fastest => brake::brake(start, limits, profile),
            Return::Settled => brake::settle(start, limits, profile),
        };
        let scale = Scale::of(limits);
        let distance = target.position - reached.position;
        let motion = scale.motion(&reached, distance, target, limits);
        let mut edges = Edges::of(&motion);
        // A rounding error beside the direct motion must not turn into a detour.
        edges.round(ROUNDING * (reached.position.abs() + target.position.abs()) / scale.distance);
        let representable = scale.distance > 0.0
            && scale.distance.is_finite()
            && distance.is_finite()
            && motion.distance.is_finite();
        if representable {
            Ok(Self { edges, scale, brake_s: profile.duration_s() })
        } else {
            Err(PlanError::NotRepresentable { axis: 0 })
        }
    }

    fn drive(&self, shape: &Shape, jerk_max: f64, profile: &mut Profile) {
        let durations_s = shape.durations.map(|duration| duration * self.scale.time_s);
        profile.shift_all(profile.reached(), &durations_s, &shape.jerks.map(|jerk| jerk * jerk_max));
    }
}

/// The fastest profile to the target state, with its blocked intervals. Its phases are left out where it lasts less than
/// `least_s`.
pub(super) fn fastest_position(
    problem: &Problem,
    manner: Return,
    least_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let inside = Inside::of(problem, manner, profile)?;
    let ways = inside.edges.ways();
    let Some((fastest, others)) = ways.split_first() else {
        return Err(PlanError::NotRepresentable { axis: 0 });
    };
    // What rounding takes from no time at all must not make it less.
    let duration_s = |duration: f64| inside.brake_s + larger(duration, 0.0) * inside.scale.time_s;
    let fastest_s = duration_s(fastest.duration);
    profile.set_minimum_duration(fastest_s);
    if fastest_s < least_s {
        profile.leave_open(fastest_s)?;
    } else {
        inside.drive(&inside.edges.shape(fastest), problem.limits.jerk_max, profile);
        profile.finish_at(problem.target, fastest_s)?;
    }
    for pair in others.chunks_exact(2) {
        if let [after, before] = pair {
            let rounding = ROUNDING * (1.0 + after.duration);
            profile.block(duration_s(after.duration + rounding), duration_s(before.duration));
        }
    }
    Ok(())
}

/// The profile to the target state that lasts this long; the profile holds the fastest one before.
pub(super) fn position_lasting(
    problem: &Problem,
    manner: Return,
    duration_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let edge = profile.blocked().iter().any(|blocked| {
        let rounding_s = EDGE * duration_s;
        (blocked.before_s - duration_s).abs() <= rounding_s
            || (blocked.after_s - duration_s).abs() <= rounding_s
    });
    let inside = Inside::of(problem, manner, profile)?;
    let duration = (duration_s - inside.brake_s) / inside.scale.time_s;
    let jerk_max = problem.limits.jerk_max;
    // Next to a blocked interval the motion is the one on the edge.
    let ways = if edge { inside.edges.ways() } else { Default::default() };
    let apart = |way: &step1::Way| (way.duration - duration).abs();
    match ways.iter().min_by(|one, other| apart(one).total_cmp(&apart(other))) {
        Some(way) => inside.drive(&inside.edges.shape(way), jerk_max, profile),
        None => match inside.edges.lasting(duration) {
            Slower::Plain(shape) => inside.drive(&shape, jerk_max, profile),
            Slower::Mixture { first, second, share } => {
                mix(&inside, &first, &second, share, jerk_max, profile);
            }
        },
    }
    profile.finish_at(problem.target, duration_s)
}

/// Drives `share · first + (1 − share) · second`.
fn mix(inside: &Inside, first: &Shape, second: &Shape, share: f64, jerk_max: f64, profile: &mut Profile) {
    let mut phases = [first, second]
        .map(|shape| shape.durations.iter().zip(&shape.jerks).filter(|(duration, _)| **duration > 0.0));
    let [first, second] = &mut phases;
    let (mut one, mut other) = (first.next(), second.next());
    let (mut one_left, mut other_left) =
        (one.map_or(0.0, |(duration, _)| *duration), other.map_or(0.0, |(duration, _)| *duration));
    while let (Some((_, jerk)), Some((_, other_jerk))) = (one, other) {
        let duration = one_left.min(other_left);
        let mixed = share * jerk + (1.0 - share) * other_jerk;
        profile.shift(duration * inside.scale.time_s, mixed * jerk_max);
        one_left -= duration;
        other_left -= duration;
        if one_left <= 0.0 {
            one = first.next();
            one_left = one.map_or(0.0, |(duration, _)| *duration);
        }
        if other_left <= 0.0 {
            other = second.next();
            other_left = other.map_or(0.0, |(duration, _)| *duration);
        }
    }
}

/// The velocity interface is the second-order problem one order lower. The start must be within the limits of acceleration.
#[inline(always)]
fn velocity_ramp(start: &State, target: &State, limits: &Limits) -> Result<Ramp, PlanError> {
    let slopes = Slopes::symmetric(limits.jerk_max);
    let speeds = slopes.mean() * (start.velocity.abs() + target.velocity.abs());
    let rounding =
        ROUNDING * (speeds + slopes.swing(larger(limits.acceleration_max, -limits.acceleration_min)));
    if !rounding.is_finite() {
        return Err(PlanError::NotRepresentable { axis: 0 });
    }
    Ok(Ramp {
        area: slopes.mean() * (target.velocity - start.velocity),
        rounding,
        start: start.acceleration,
        target: target.acceleration,
        rate_max: limits.acceleration_max,
        rate_min: limits.acceleration_min,
        slopes,
    })
}

#[inline(always)]
fn drive(reached: State, stretches: &Stretches, profile: &mut Profile) {
    profile.shift_all(reached, &stretches.durations, &stretches.slopes);
}

/// The fastest profile to the target velocity and acceleration, wherever that leads. Its phases are left out where it
/// lasts less than `least_s`.
pub(super) fn fastest_velocity(
    problem: &Problem,
    least_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let start = brake::relax(&problem.start, &problem.limits, profile);
    let ramp = velocity_ramp(&start, &problem.target, &problem.limits)?;
    let brake_s = profile.duration_s();
    let fastest = ramp.fastest();
    let fastest_s = brake_s + fastest.duration;
    profile.set_minimum_duration(fastest_s);
    if let Some((after, before)) = fastest.blocked {
        profile.block(brake_s + after, brake_s + before);
    }
    if fastest_s < least_s {
        return profile.leave_open(fastest_s);
    }
    drive(start, &ramp.stretches(fastest.way), profile);
    let position = profile.reached().position;
    profile.finish_at(State { position, ..problem.target }, fastest_s)
}

/// The profile to the target velocity and acceleration that lasts this long.
pub(super) fn velocity_lasting(
    problem: &Problem,
    duration_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let start = brake::relax(&problem.start, &problem.limits, profile);
    let ramp = velocity_ramp(&start, &problem.target, &problem.limits)?;
    let way = ramp.lasting(duration_s - profile.duration_s());
    drive(start, &ramp.stretches(way), profile);
    let position = profile.reached().position;
    profile.finish_at(State { position, ..problem.target }, duration_s)
}
