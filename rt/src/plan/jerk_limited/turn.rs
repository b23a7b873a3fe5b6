//! Stops that turn around: an axis that still decelerates when it stands still has come less far, and swings back.
//!
//! The more it decelerates there, the shorter the way and the faster and further the swing. So it decelerates by just as
//! much as a position limit asks for: then every other limit is kept if that can be.

use super::super::error::{Limit, PlanError};
use super::super::problem::{Problem, State};
use super::super::profile::{Profile, integrate};
use super::super::ramp::{Ramp, Stretches};
use super::brake::relax;
use super::{drive, velocity_ramp};

/// Halvings of the range of decelerations, which leave out what is less than rounding.
const HALVINGS: u32 = 48;

/// The stop from the start of the problem that turns around at this position limit, or as short behind it as can be.
pub(in super::super) fn stop_turning(
    problem: &Problem,
    limit: Limit,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    turn(problem, limit, profile)?;
    let standstill = profile.reached();
    let ramp = velocity_ramp(&standstill, &State::rest(0.0), &problem.limits)?;
    drive(standstill, &fastest(&ramp), profile);
    profile.finish(State::rest(profile.reached().position))?;
    profile.set_minimum_duration(profile.duration_s());
    Ok(())
}

/// Begins the profile with the way to the standstill before the limit.
fn turn(problem: &Problem, limit: Limit, profile: &mut Profile) -> Result<(), PlanError> {
    let limits = &problem.limits;
    let (sign, end, deceleration_max) = match limit {
        Limit::PositionMin => (-1.0, limits.position_min, limits.acceleration_max),
        _ => (1.0, limits.position_max, -limits.acceleration_min),
    };
    let from = relax(&problem.start, limits, profile);
    let ramp = velocity_ramp(&from, &State::rest(0.0), limits)?;
    let (speed, acceleration) = (sign * from.velocity, sign * from.acceleration);
    // On the arcs of full jerk the speed is `peak − deceleration²/2J`, or that with the other sign.
    let square = acceleration * acceleration;
    let most = libm::sqrt((2.0 * limits.jerk_max * speed + square).max(0.0)).min(deceleration_max);
    let cannot_stop = if acceleration < 0.0 { square - 2.0 * limits.jerk_max * speed } else { 0.0 };
    let least = libm::sqrt(cannot_stop.max(0.0)).min(most);
    let way = |deceleration: f64| fastest(&Ramp { target: -sign * deceleration, ..ramp });
    let is_beyond = |stretches: &Stretches| sign * (arrival(&from, stretches) - end) > 0.0;
    let (mut low, mut high) = (least, most);
    if !is_beyond(&way(most)) {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if is_beyond(&way(middle)) {
                low = middle;
            } else {
                high = middle;
            }
        }
    }
    drive(from, &way(high), profile);
    profile.limit_acceleration(limits.acceleration_min, limits.acceleration_max);
    Ok(())
}

/// The stretches of the fastest way.
fn fastest(ramp: &Ramp) -> Stretches {
    ramp.stretches(ramp.fastest().way)
}

/// Where the stretches lead, seen as phases of constant jerk.
fn arrival(from: &State, stretches: &Stretches) -> f64 {
    let phases = stretches.durations.iter().zip(&stretches.slopes);
    phases.fold(*from, |state, (duration_s, jerk)| integrate(&state, *jerk, duration_s.max(0.0))).position
}
