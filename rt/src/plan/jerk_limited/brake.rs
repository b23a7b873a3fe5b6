//! The brake: brings the start inside the limits, before the motion to the target is planned.
//!
//! The start is outside if its acceleration or velocity is beyond a limit. It is also outside if the velocity will go beyond its
//! limit even when the jerk takes the acceleration away at once. The paper's brake has at most two phases.

use super::super::choice::{larger, smaller};
use super::super::problem::{Limits, State};
use super::super::profile::Profile;
use super::motion::VelocityStep;

/// Exceeding a limit by this much, relative to the limit, is rounding and needs no brake.
const ROUNDING: f64 = 1e-13;

/// The duration and the jerk of each phase.
type Phases = [(f64, f64); 2];

/// Begins the profile with the fastest brake, and returns the state behind it.
pub(super) fn brake(start: &State, limits: &Limits, profile: &mut Profile) -> State {
    profile.begin(*start);
    let Some(phases) = phases(limits, start.velocity, start.acceleration) else { return *start };
    for (duration_s, jerk) in phases {
        profile.shift(duration_s, jerk);
    }
    profile.limit_acceleration(limits.acceleration_min, limits.acceleration_max);
    profile.reached()
}

/// Begins the profile with a phase that brings the acceleration within its limits, and returns the state behind it.
#[inline]
pub(super) fn relax(start: &State, limits: &Limits, profile: &mut Profile) -> State {
    let Limits { acceleration_min, acceleration_max, jerk_max, .. } = *limits;
    profile.begin(*start);
    let within = smaller(larger(start.acceleration, acceleration_min), acceleration_max);
    if start.acceleration == within {
        return *start;
    }
    let excess = start.acceleration - within;
    profile.shift(excess.abs() / jerk_max, -jerk_max.copysign(excess));
    profile.limit_acceleration(acceleration_min, acceleration_max);
    profile.reached()
}

/// Begins the profile with the brake that ends at the velocity limit with zero acceleration, so that the velocity does not fall
/// below the limit. Returns the state behind it.
pub(super) fn settle(start: &State, limits: &Limits, profile: &mut Profile) -> State {
    let Limits { velocity_max, velocity_min, acceleration_min, acceleration_max, jerk_max, .. } = *limits;
    let relaxed = relax(start, limits, profile);
    let State { velocity, acceleration, .. } = relaxed;
    let behind = velocity + 0.5 * acceleration * acceleration.abs() / jerk_max;
    if behind > velocity_max * (1.0 + ROUNDING) {
        slow_down(velocity - velocity_max, acceleration, -acceleration_min, jerk_max, -1.0, profile);
    } else if behind < velocity_min * (1.0 + ROUNDING) {
        slow_down(velocity_min - velocity, -acceleration, acceleration_max, jerk_max, 1.0, profile);
    } else {
        return relaxed;
    }
    profile.reached()
}

/// Reduces the velocity by `step` and ends with zero acceleration. `sign` is 1 for the mirror image. A positive start
/// acceleration adds to the step.
fn slow_down(step: f64, acceleration: f64, limit: f64, jerk: f64, sign: f64, profile: &mut Profile) {
    let step = VelocityStep::over(jerk * step + 0.5 * acceleration * acceleration, limit);
    profile.shift((step.peak + acceleration) / jerk, sign * jerk);
    profile.shift(step.hold / jerk, 0.0);
    profile.shift(step.peak / jerk, -sign * jerk);
    profile.limit_acceleration(0.0, 0.0);
}

/// The phases that bring this state back inside the limits; `None` if it is inside.
fn phases(limits: &Limits, velocity: f64, acceleration: f64) -> Option<Phases> {
    let half_square = 0.5 * acceleration * acceleration / limits.jerk_max;
    let beyond_max = velocity + if acceleration > 0.0 { half_square } else { 0.0 };
    let beyond_min = velocity - if acceleration < 0.0 { half_square } else { 0.0 };
    let too_fast = beyond_max > limits.velocity_max * (1.0 + ROUNDING);
    let too_slow = beyond_min < limits.velocity_min * (1.0 + ROUNDING);
    let up = Side {
        velocity_max: limits.velocity_max,
        velocity_min: limits.velocity_min,
        acceleration_min: limits.acceleration_min,
        jerk: limits.jerk_max,
    };
    let down = Side {
        velocity_max: -limits.velocity_min,
        velocity_min: -limits.velocity_max,
        acceleration_min: -limits.acceleration_max,
        jerk: limits.jerk_max,
    };
    let mirrored = |phases: Phases| phases.map(|(duration_s, jerk)| (duration_s, -jerk));
    // The limit that the acceleration leads towards comes before the limit that the velocity exceeds already.
    if acceleration >= 0.0 && too_fast || acceleration <= 0.0 && too_fast && !too_slow {
        Some(up.slow_down(velocity, acceleration))
    } else if too_slow {
        Some(mirrored(down.slow_down(-velocity, -acceleration)))
    } else if acceleration > limits.acceleration_max {
        Some([((acceleration - limits.acceleration_max) / limits.jerk_max, -limits.jerk_max), (0.0, 0.0)])
    } else if acceleration < limits.acceleration_min {
        Some([((limits.acceleration_min - acceleration) / limits.jerk_max, limits.jerk_max), (0.0, 0.0)])
    } else {
        None
    }
}

/// The limits, mirrored if needed, so that the velocity is or will be beyond its maximum.
struct Side {
    velocity_max: f64,
    velocity_min: f64,
    acceleration_min: f64,
    jerk: f64,
}

impl Side {
    /// Slows down until the velocity is back at its maximum. It ends earlier where the velocity would otherwise fall below
    /// its minimum later.
    fn slow_down(&self, velocity: f64, acceleration: f64) -> Phases {
        let deceleration_max = -self.acceleration_min;
        let held = |from: f64, deceleration: f64| {
            let lowest = self.velocity_min + 0.5 * deceleration * deceleration / self.jerk;
            ((from - self.velocity_max.max(lowest)) / deceleration).max(0.0)
        };
        if acceleration < self.acceleration_min {
            // The deceleration exceeds its limit already. The first phase reduces it to the limit.
            let excess_s = (self.acceleration_min - acceleration) / self.jerk;
            let then = velocity + 0.5 * (acceleration + self.acceleration_min) * excess_s;
            return [(excess_s, self.jerk), (held(then, deceleration_max), 0.0)];
        }
        // In the phase of negative jerk the velocity is `peak − deceleration²/2J`.
        let peak = velocity + 0.5 * acceleration * acceleration / self.jerk;
        let to_max = libm::sqrt((2.0 * self.jerk * (peak - self.velocity_max)).max(0.0));
        let to_min = libm::sqrt((self.jerk * (peak - self.velocity_min)).max(0.0));
        let wanted = to_max.min(to_min);
        if wanted <= deceleration_max {
            [((wanted + acceleration) / self.jerk, -self.jerk), (0.0, 0.0)]
        } else {
            let then = peak - 0.5 * deceleration_max * deceleration_max / self.jerk;
            [((deceleration_max + acceleration) / self.jerk, -self.jerk), (held(then, deceleration_max), 0.0)]
        }
    }
}
