//! Second order: accelerate, cruise, decelerate, in closed form: see [`Ramp`].

use super::choice::{larger, smaller};
use super::error::PlanError;
use super::problem::{Limits, Problem, State};
use super::profile::Profile;
use super::ramp::{Ramp, Slopes, Stretches};

/// Relative to the sizes of a problem, differences up to this are rounding.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// Begins the profile with the way of the velocity back to its limit, and gives the state behind it.
#[inline]
fn brake(start: &State, limits: &Limits, profile: &mut Profile) -> State {
    let start = State { acceleration: 0.0, ..*start };
    profile.begin(start);
    let velocity = smaller(larger(start.velocity, limits.velocity_min), limits.velocity_max);
    if velocity == start.velocity {
        return start;
    }
    let acceleration =
        if velocity < start.velocity { limits.acceleration_min } else { limits.acceleration_max };
    profile.accelerate((velocity - start.velocity) / acceleration, acceleration);
    State { velocity, ..profile.reached() }
}

/// The problem from this state, which must be within the limits.
#[inline(always)]
fn ramp(start: &State, target: &State, limits: &Limits) -> Result<Ramp, PlanError> {
    let slopes = Slopes::asymmetric(limits.acceleration_max, limits.acceleration_min);
    // The state may have gone through many cycles of sampling and planning.
    let fastest = larger(limits.velocity_max, -limits.velocity_min);
    let places = slopes.mean() * (start.position.abs() + target.position.abs());
    let rounding = ROUNDING * (places + slopes.swing(fastest));
    if !rounding.is_finite() {
        return Err(PlanError::NotRepresentable { axis: 0 });
    }
    Ok(Ramp {
        area: slopes.mean() * (target.position - start.position),
        rounding,
        start: start.velocity,
        target: target.velocity,
        rate_max: limits.velocity_max,
        rate_min: limits.velocity_min,
        slopes,
    })
}

#[inline(always)]
fn drive(reached: State, stretches: &Stretches, profile: &mut Profile) {
    profile.accelerate_all(reached, &stretches.durations, &stretches.slopes);
}

fn target(problem: &Problem) -> State {
    State { acceleration: 0.0, ..problem.target }
}

/// The fastest profile to the target position and velocity, with its blocked interval. Its phases are left out where it
/// lasts less than `least_s`.
pub(super) fn fastest_position(
    problem: &Problem,
    least_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let start = brake(&problem.start, &problem.limits, profile);
    let ramp = ramp(&start, &problem.target, &problem.limits)?;
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
    profile.finish_at(target(problem), fastest_s)
}

/// The profile to the target position and velocity that lasts this long.
pub(super) fn position_lasting(
    problem: &Problem,
    duration_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let start = brake(&problem.start, &problem.limits, profile);
    let ramp = ramp(&start, &problem.target, &problem.limits)?;
    let way = ramp.lasting(duration_s - profile.duration_s());
    drive(start, &ramp.stretches(way), profile);
    profile.finish_at(target(problem), duration_s)
}

/// The fastest profile to the target velocity, wherever that leads.
pub(super) fn fastest_velocity(problem: &Problem, profile: &mut Profile) -> Result<(), PlanError> {
    let Problem { start, target, limits } = problem;
    profile.begin(State { acceleration: 0.0, ..*start });
    let step = target.velocity - start.velocity;
    let acceleration = if step < 0.0 { limits.acceleration_min } else { limits.acceleration_max };
    profile.accelerate(step / acceleration, acceleration);
    let position = profile.reached().position;
    profile.finish(State { position, velocity: target.velocity, acceleration: 0.0 })?;
    profile.set_minimum_duration(profile.duration_s());
    Ok(())
}

/// The profile to the target velocity that lasts this long: with a smaller acceleration.
pub(super) fn velocity_lasting(
    problem: &Problem,
    duration_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let Problem { start, target, .. } = problem;
    profile.begin(State { acceleration: 0.0, ..*start });
    if duration_s > 0.0 {
        profile.accelerate(duration_s, (target.velocity - start.velocity) / duration_s);
    }
    let position = profile.reached().position;
    profile.finish_at(State { position, velocity: target.velocity, acceleration: 0.0 }, duration_s)
}
