//! Second order, without a jerk limit: accelerate, cruise, decelerate. It is solved in closed form; see [`SecondOrder`].

use super::choice::{larger, smaller};
use super::error::PlanError;
use super::problem::{Limits, Problem, State};
use super::profile::Profile;
use super::second_order::{SecondOrder, Slopes, ThreePhases};

/// A difference up to this, relative to the sizes of a problem, is rounding.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// Begins the profile with the brake: the velocity returns to its limit. Returns the state behind the brake.
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

/// The second-order problem from this state, which must be within the limits.
#[inline(always)]
fn second_order_problem(start: &State, target: &State, limits: &Limits) -> Result<SecondOrder, PlanError> {
    let slopes = Slopes::asymmetric(limits.acceleration_max, limits.acceleration_min);
    // The state may have gone through many cycles of sampling and planning, each of which rounds.
    let fastest = larger(limits.velocity_max, -limits.velocity_min);
    let places = slopes.mean() * (start.position.abs() + target.position.abs());
    let rounding = ROUNDING * (places + slopes.area_to_rate(fastest));
    if !rounding.is_finite() {
        return Err(PlanError::NotRepresentable { axis: 0 });
    }
    Ok(SecondOrder {
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
fn append(reached: State, phases: &ThreePhases, profile: &mut Profile) {
    profile.accelerate_all(reached, &phases.durations, &phases.slopes);
}

fn target(problem: &Problem) -> State {
    State { acceleration: 0.0, ..problem.target }
}

/// Plans the fastest profile to the target position and velocity, with its blocked interval. A profile shorter than
/// `least_s` gets no phases.
pub(super) fn fastest_position(
    problem: &Problem,
    least_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let start = brake(&problem.start, &problem.limits, profile);
    let core = second_order_problem(&start, &problem.target, &problem.limits)?;
    let fastest = core.fastest();
    let fastest_s = fastest.note_in(profile);
    if fastest_s < least_s {
        return profile.leave_open(fastest_s);
    }
    append(start, &core.phases(fastest.cruise), profile);
    profile.finish_at(target(problem), fastest_s)
}

/// Plans the profile to the target position and velocity that lasts this long.
pub(super) fn position_lasting(
    problem: &Problem,
    duration_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let start = brake(&problem.start, &problem.limits, profile);
    let core = second_order_problem(&start, &problem.target, &problem.limits)?;
    let cruise = core.lasting(duration_s - profile.duration_s());
    append(start, &core.phases(cruise), profile);
    profile.finish_at(target(problem), duration_s)
}

/// Plans the fastest profile to the target velocity, whatever its final position is.
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

/// Plans the profile to the target velocity that lasts this long, with a smaller acceleration than the limit.
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
