//! Plans to a velocity, with the acceleration there, whatever the final position is.
//!
//! This is the second-order problem one order lower: the acceleration is the rate, and the jerk is the slope.

use super::super::choice::larger;
use super::super::error::PlanError;
use super::super::problem::{Limits, Problem, State};
use super::super::profile::Profile;
use super::super::second_order::{SecondOrder, Slopes, ThreePhases};
use super::{ROUNDING, brake};

/// The second-order problem between two states. The start must be within the limits of acceleration.
///
/// # Errors
/// [`PlanError::NotRepresentable`] with axis 0.
#[inline(always)]
pub(super) fn velocity_problem(
    start: &State,
    target: &State,
    limits: &Limits,
) -> Result<SecondOrder, PlanError> {
    let slopes = Slopes::symmetric(limits.jerk_max);
    let speeds = slopes.mean() * (start.velocity.abs() + target.velocity.abs());
    let rounding =
        ROUNDING * (speeds + slopes.area_to_rate(larger(limits.acceleration_max, -limits.acceleration_min)));
    if !rounding.is_finite() {
        return Err(PlanError::NotRepresentable { axis: 0 });
    }
    Ok(SecondOrder {
        area: slopes.mean() * (target.velocity - start.velocity),
        rounding,
        start: start.acceleration,
        target: target.acceleration,
        rate_max: limits.acceleration_max,
        rate_min: limits.acceleration_min,
        slopes,
    })
}

/// Appends phases of constant jerk to the state that was reached.
#[inline(always)]
pub(super) fn append(reached: State, phases: &ThreePhases, profile: &mut Profile) {
    profile.shift_all(reached, &phases.durations, &phases.slopes);
}

/// Plans the fastest profile to the target velocity and acceleration. A profile shorter than `least_s` gets no phases.
///
/// # Errors
/// [`PlanError::NotRepresentable`] with axis 0.
pub(in super::super) fn fastest_velocity(
    problem: &Problem,
    least_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let start = brake::relax(&problem.start, &problem.limits, profile);
    let core = velocity_problem(&start, &problem.target, &problem.limits)?;
    let fastest = core.fastest();
    let fastest_s = fastest.note_in(profile);
    if fastest_s < least_s {
        return profile.leave_open(fastest_s);
    }
    append(start, &core.phases(fastest.cruise), profile);
    let position = profile.reached().position;
    profile.finish_at(State { position, ..problem.target }, fastest_s)
}

/// Plans the profile to the target velocity and acceleration that lasts this long.
///
/// # Errors
/// [`PlanError::NotRepresentable`] with axis 0.
pub(in super::super) fn velocity_lasting(
    problem: &Problem,
    duration_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let start = brake::relax(&problem.start, &problem.limits, profile);
    let core = velocity_problem(&start, &problem.target, &problem.limits)?;
    let cruise = core.lasting(duration_s - profile.duration_s());
    append(start, &core.phases(cruise), profile);
    let position = profile.reached().position;
    profile.finish_at(State { position, ..problem.target }, duration_s)
}
