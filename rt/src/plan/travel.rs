//! Position limits: what an axis does where its motion, or the coordinated stop, would leave them.
//!
//! - A motion that leaves a limit is replaced: the axis arrives early and waits. If that is not possible, it first stops and
//!   then goes to the target from rest.
//! - A coordinated stop that leaves a limit is replaced by the fastest stop, or by one that reverses at the limit.

use super::error::{Limit, PlanError};
use super::options::Return;
use super::problem::{Limits, Problem, State};
use super::profile::Profile;
use super::{jerk_limited, trapezoid};

/// Leaving a position limit by this much, relative to the positions, is rounding.
const ROUNDING: f64 = 1e-12;

/// The position limit that the profile leaves, if any. A profile that starts outside a limit must not go further out.
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

/// Plans the fastest stop. If it leaves a position limit, plans the stop that reverses at that limit; see
/// [`stop`](super::stop) for what it keeps.
pub(super) fn stop_within(start: State, limits: &Limits, profile: &mut Profile) -> Result<(), PlanError> {
    let problem = Problem { start, target: State::rest(start.position), limits: *limits };
    if limits.is_second_order() {
        return trapezoid::fastest_velocity(&problem, profile);
    }
    jerk_limited::fastest_velocity(&problem, 0.0, profile)?;
    if let Some(limit) = limit_left(&problem, profile) {
        jerk_limited::reversing_stop(&problem, limit, profile)?;
    }
    Ok(())
}

/// Plans a motion to the target within the position limits that lasts at least `least_s`.
///
/// # Errors
/// [`PlanError::PositionBeyondLimit`] with axis 0 and the limit that none of the motions keeps.
pub(super) fn motion_within(
    problem: &Problem,
    return_to_limits: Return,
    least_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let Problem { start, target, limits } = problem;
    let fastest = |problem: &Problem, profile: &mut Profile| {
        if limits.is_second_order() {
            trapezoid::fastest_position(problem, 0.0, profile)
        } else {
            jerk_limited::fastest_position(problem, return_to_limits, 0.0, &mut None, profile)
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
        // The stop keeps the position limit, but it moves back faster than the velocity limit allows.
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
