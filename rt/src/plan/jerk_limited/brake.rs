//! The brake: back inside the limits before anything else (`otg.md` section 2, 1).
//!
//! Outside are an acceleration or a velocity beyond its limit, and an acceleration so large that the velocity will
//! go beyond its limit even when the jerk takes it away at once. The brake has at most two phases.

use super::super::choice::{larger, smaller};
use super::super::problem::{Limits, State};
use super::super::profile::Profile;
use super::motion::Swing;

/// Relative to a limit, being beyond it by this much is rounding and no reason to brake.
const ROUNDING: f64 = 1e-13;

/// Duration and jerk of the phases.
type Phases = [(f64, f64); 2];

/// Begins the profile with the brake, as fast as possible, and gives the state behind it.
pub(super) fn brake(start: &State, limits: &Limits, profile: &mut Profile) -> State {
    profile.begin(*start);
    let Some(phases) = phases(limits, start.velocity, start.acceleration) else { return *start };
    for (duration_s, jerk) in phases {
        profile.shift(duration_s, jerk);
    }
    profile.limit_acceleration(limits.acceleration_min, limits.acceleration_max);
    profile.reached()
}

/// Begins the profile with the way to an acceleration within its limits, and gives the state behind it.
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

/// Begins the profile with the way to the velocity limit that does not go below it, with acceleration zero at its end, and gives
/// the state behind it.
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

/// Down by `step` to acceleration zero, from an acceleration that adds to it when positive.
fn slow_down(step: f64, acceleration: f64, limit: f64, jerk: f64, sign: f64, profile: &mut Profile) {
    let swing = Swing::over(jerk * step + 0.5 * acceleration * acceleration, limit);
    profile.shift((swing.peak + acceleration) / jerk, sign * jerk);
    profile.shift(swing.hold / jerk, 0.0);
    profile.shift(swing.peak / jerk, -sign * jerk);
    profile.limit_acceleration(0.0, 0.0);
}

/// What brings this state back, unless it is inside the limits.
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
    // What the acceleration is about to do comes before what the velocity already is.
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

/// The limits seen from the side on which the velocity is, or will be, beyond its maximum.
struct Side {
    velocity_max: f64,
    velocity_min: f64,
    acceleration_min: f64,
    jerk: f64,
}

impl Side {
    /// Until the velocity is back at its maximum, but not so long that it would then go below its minimum.
    fn slow_down(&self, velocity: f64, acceleration: f64) -> Phases {
        let deceleration_max = -self.acceleration_min;
        let held = |from: f64, deceleration: f64| {
            let lowest = self.velocity_min + 0.5 * deceleration * deceleration / self.jerk;
            ((from - self.velocity_max.max(lowest)) / deceleration).max(0.0)
        };
        if acceleration < self.acceleration_min {
            // Too much already: less at first, down to what may be held.
            let excess_s = (self.acceleration_min - acceleration) / self.jerk;
            let then = velocity + 0.5 * (acceleration + self.acceleration_min) * excess_s;
            return [(excess_s, self.jerk), (held(then, deceleration_max), 0.0)];
        }
        // On the arc of negative jerk the velocity is `peak − deceleration²/2J`.
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
