//! Stops that reverse. An axis that still decelerates at its standstill has come less far, and moves back afterwards.
//!
//! The more it decelerates at the standstill, the shorter is its way, and the faster and further it moves back. So it
//! decelerates just as much as the position limit requires. Then it keeps every other limit if that is possible.

use super::super::error::{Limit, PlanError};
use super::super::problem::{Problem, State};
use super::super::profile::{Profile, integrate};
use super::super::second_order::{SecondOrder, ThreePhases};
use super::brake::relax;
use super::velocity::{append, velocity_problem};

/// How often the range of decelerations is halved. After that, the rest is about as small as rounding.
const HALVINGS: u32 = 48;

/// Plans the stop that reverses at this position limit, or as little beyond it as possible.
pub(in super::super) fn reversing_stop(
    problem: &Problem,
    limit: Limit,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    to_standstill(problem, limit, profile)?;
    let standstill = profile.reached();
    let to_rest = velocity_problem(&standstill, &State::rest(0.0), &problem.limits)?;
    append(standstill, &fastest(&to_rest), profile);
    profile.finish(State::rest(profile.reached().position))?;
    profile.set_minimum_duration(profile.duration_s());
    Ok(())
}

/// Begins the profile with the motion to the standstill at the limit.
fn to_standstill(problem: &Problem, limit: Limit, profile: &mut Profile) -> Result<(), PlanError> {
    let limits = &problem.limits;
    let (sign, end, deceleration_max) = match limit {
        Limit::PositionMin => (-1.0, limits.position_min, limits.acceleration_max),
        _ => (1.0, limits.position_max, -limits.acceleration_min),
    };
    let from = relax(&problem.start, limits, profile);
    let to_zero = velocity_problem(&from, &State::rest(0.0), limits)?;
    let (speed, acceleration) = (sign * from.velocity, sign * from.acceleration);
    // In the phases of full jerk the speed is `peak − deceleration²/2J`, or that with the other sign.
    let square = acceleration * acceleration;
    let most = libm::sqrt((2.0 * limits.jerk_max * speed + square).max(0.0)).min(deceleration_max);
    let cannot_stop = if acceleration < 0.0 { square - 2.0 * limits.jerk_max * speed } else { 0.0 };
    let least = libm::sqrt(cannot_stop.max(0.0)).min(most);
    let phases = |deceleration: f64| fastest(&SecondOrder { target: -sign * deceleration, ..to_zero });
    let is_beyond = |phases: &ThreePhases| sign * (final_position(&from, phases) - end) > 0.0;
    let (mut low, mut high) = (least, most);
    if !is_beyond(&phases(most)) {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if is_beyond(&phases(middle)) {
                low = middle;
            } else {
                high = middle;
            }
        }
    }
    append(from, &phases(high), profile);
    profile.limit_acceleration(limits.acceleration_min, limits.acceleration_max);
    Ok(())
}

/// The phases of the fastest motion.
fn fastest(problem: &SecondOrder) -> ThreePhases {
    problem.phases(problem.fastest().cruise)
}

/// The position after these phases of constant jerk.
fn final_position(from: &State, phases: &ThreePhases) -> f64 {
    let phases = phases.durations.iter().zip(&phases.slopes);
    phases.fold(*from, |state, (duration_s, jerk)| integrate(&state, *jerk, duration_s.max(0.0))).position
}
