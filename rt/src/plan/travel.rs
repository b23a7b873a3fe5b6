//! Position limits: what to do where the fastest motion, or the coordinated stop, would leave them.
//!
//! In place of a motion that swings beyond a limit, the axis arrives early and waits, or first stops and then goes to
//! the target from rest. In place of a stop that runs on to be coordinated, it stops as fast as it can, or on a
//! shorter way, on which it still decelerates when the motion turns around.

use super::error::{Limit, PlanError};
use super::problem::{Limits, Problem, State};
use super::profile::Profile;
use super::synchronisation::Return;
use super::{jerk_limited, trapezoid};

/// Relative to the positions, leaving a limit by this much is rounding.
const ROUNDING: f64 = 1e-12;

/// The position limit that the profile leaves, if any. From a start outside of them it may only come back.
pub(super) fn limit_left(problem: &Problem, profile: &Profile) -> Option<Limit> {
    let Problem { start, limits, .. } = problem;
    if limits.position_max == f64::INFINITY && limits.position_min == f64::NEG_INFINITY {
        return None;
    }
    let range = profile.extrema().position;
    let rounding = ROUNDING * (start.position.abs() + range.max.abs() + range.min.abs());
    if range.max > limits.position_max.max(start.position) + rounding {
        Some(Limit::PositionMax)
    } else if range.min < limits.position_min.min(start.position) - rounding {
        Some(Limit::PositionMin)
    } else {
        None
    }
}

/// The fastest stop, or where that leaves a position limit the one that turns around at it: see
/// [`stop`](super::stop) for what it keeps.
pub(super) fn stop_within(start: State, limits: &Limits, profile: &mut Profile) -> Result<(), PlanError> {
    let problem = Problem { start, target: State::rest(start.position), limits: *limits };
    if limits.is_second_order() {
        return trapezoid::fastest_velocity(&problem, profile);
    }
    jerk_limited::fastest_velocity(&problem, 0.0, profile)?;
    if let Some(limit) = limit_left(&problem, profile) {
        jerk_limited::stop_turning(&problem, limit, profile)?;
    }
    Ok(())
}

/// A motion to the target within the position limits that lasts at least this long.
///
/// # Errors
/// The limit that none of the motions keeps, in a [`PlanError::PositionBeyondLimit`] of axis 0.
pub(super) fn motion_within(
    problem: &Problem,
    manner: Return,
    least_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let Problem { start, target, limits } = problem;
    let fastest = |problem: &Problem, profile: &mut Profile| {
        if limits.is_second_order() {
            trapezoid::fastest_position(problem, 0.0, profile)
        } else {
            jerk_limited::fastest_position(problem, manner, 0.0, profile)
        }
    };
    fastest(problem, profile)?;
    let can_wait = target.velocity == 0.0 && (limits.is_second_order() || target.acceleration == 0.0);
    if can_wait && limit_left(problem, profile).is_none() {
        profile.rest_until(least_s);
        return Ok(());
    }
    let possible = profile.possible();
    stop_within(*start, limits, profile)?;
    let speeds = profile.extrema().velocity;
    let (min, max) = (limits.velocity_min.min(start.velocity), limits.velocity_max.max(start.velocity));
    if speeds.max > max * (1.0 + ROUNDING) || speeds.min < min * (1.0 + ROUNDING) {
        // The stop is short enough only because it swings back faster than the axis may go.
        let limit = if start.velocity > 0.0 { Limit::PositionMax } else { Limit::PositionMin };
        return Err(PlanError::PositionBeyondLimit { axis: 0, limit });
    }
    let from = State::rest(profile.end().position);
    let mut second = Profile::hold(0.0);
    fastest(&Problem { start: from, ..*problem }, &mut second)?;
    profile.rest_until(least_s - second.duration_s());
    profile.join(&second);
    if (profile.duration_s() - least_s).abs() <= ROUNDING * least_s {
        profile.finish_at(*target, least_s)?;
    }
    profile.set_possible(possible.0, possible.1);
    match limit_left(problem, profile) {
        Some(limit) => Err(PlanError::PositionBeyondLimit { axis: 0, limit }),
        None => Ok(()),
    }
}
