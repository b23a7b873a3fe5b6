//! Second order: accelerate, cruise, decelerate, in closed form (`otg.md` section 2, 7).
//!
//! Write `v` for the velocity of the cruise. For a given duration, every velocity along the way grows with
//! `v`, so the distance does too, and there is exactly one `v` for a distance that can be reached. Compared
//! with the *direct* motion (one ramp from start to target velocity), a detour to a velocity `v` above both
//! adds the distance `k·(v² − high²)`, with `high` the larger of the two velocities and
//! `k = 1/2A + 1/2B` from acceleration `A` and deceleration `B`. Everything below is this equation.
//!
//! The same mathematics one order lower (distance is a velocity, velocity an acceleration, acceleration a
//! jerk) is the third-order velocity interface, so the core speaks of *distance*, *rate* and *slope*.

use super::error::PlanError;
use super::problem::{Problem, State};
use super::profile::Profile;

/// Relative to the sizes of a problem, differences up to this are rounding.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// What a ramp must keep: the rate between a negative and a positive bound, and so its slope.
#[derive(Clone, Copy)]
pub(super) struct Bounds {
    pub(super) rate_max: f64,
    pub(super) rate_min: f64,
    pub(super) slope_max: f64,
    pub(super) slope_min: f64,
}

/// The core problem: cover a distance while the rate goes from one value to another.
#[derive(Clone, Copy)]
pub(super) struct Ramp {
    pub(super) distance: f64,
    /// Distances up to this size are rounding.
    pub(super) rounding: f64,
    pub(super) start: f64,
    pub(super) target: f64,
    pub(super) bounds: Bounds,
}

/// Three stretches of constant slope: towards the cruise, the cruise, away from it.
#[derive(Clone, Copy)]
pub(super) struct Stretches {
    pub(super) durations: [f64; 3],
    pub(super) slopes: [f64; 3],
}

/// The fastest way, and what durations above are impossible.
#[derive(Clone, Copy)]
pub(super) struct Fastest {
    pub(super) stretches: Stretches,
    pub(super) duration: f64,
    pub(super) blocked: Option<(f64, f64)>,
}

/// The direct motion, and what the distance exceeds it by.
struct Direct {
    duration: f64,
    excess: f64,
    high: f64,
    low: f64,
    slope: f64,
}

impl Ramp {
    /// Durations up to this size are rounding: a passage must not be missed for one.
    fn time_rounding(&self) -> f64 {
        let Bounds { slope_max, slope_min, .. } = self.bounds;
        ROUNDING * (self.start.abs() + self.target.abs()) / slope_max.min(-slope_min)
    }

    fn mirrored(&self) -> Self {
        Self {
            distance: -self.distance,
            rounding: self.rounding,
            start: -self.start,
            target: -self.target,
            bounds: Bounds {
                rate_max: -self.bounds.rate_min,
                rate_min: -self.bounds.rate_max,
                slope_max: -self.bounds.slope_min,
                slope_min: -self.bounds.slope_max,
            },
        }
    }

    fn direct(&self) -> Direct {
        let (start, target) = (self.start, self.target);
        let slope = if target >= start { self.bounds.slope_max } else { self.bounds.slope_min };
        let duration = (target - start) / slope;
        let excess = self.distance - 0.5 * (start + target) * duration;
        let (high, low) = (start.max(target), start.min(target));
        // With both rates of one sign, being a rounding error beside the direct motion on the wrong side costs
        // the time to go back and try again. Otherwise it costs the square root of the error: still much for
        // the others, which may be about to pass through their targets. So the error stays in the distance.
        let passing = low.max(-high);
        let lost = passing > 0.0
            && 0.5 * passing * passing > self.rounding * self.bounds.slope_max.max(-self.bounds.slope_min);
        let rounding =
            if lost { self.rounding } else { (self.rounding / 64.0).min(1e-6 * self.distance.abs()) };
        let excess = if excess.abs() <= rounding { 0.0 } else { excess };
        Direct { duration, excess, high, low, slope }
    }

    /// The fastest way. The start must be within the bounds.
    pub(super) fn fastest(&self) -> Fastest {
        let direct = self.direct();
        if direct.excess < 0.0 || (direct.excess == 0.0 && direct.high < 0.0) {
            self.mirrored()
                .fastest_up(&Direct {
                    excess: -direct.excess,
                    high: -direct.low,
                    low: -direct.high,
                    ..direct
                })
                .mirrored()
        } else {
            self.fastest_up(&direct)
        }
    }

    /// The fastest way when the distance is at least that of the direct motion.
    fn fastest_up(&self, direct: &Direct) -> Fastest {
        let Bounds { rate_max, rate_min, slope_max, slope_min } = self.bounds;
        let (up, down) = (1.0 / slope_max, -1.0 / slope_min);
        let k = 0.5 * (up + down);
        let Direct { excess, high, low, .. } = *direct;
        let step = excess / k;
        let peak = libm::sqrt(high * high + step);
        // peak − high without cancellation
        let detour = if high > 0.0 { step / (peak + high) } else { peak - high };
        let room = rate_max - high;
        let (detour, cruise) = if detour <= room {
            (detour, 0.0)
        } else {
            (room, (excess - k * room * (rate_max + high)) / rate_max)
        };
        // The other end of what is possible in a given time dips to a rate below both: for a moment that
        // way is already too long, once it goes backwards it is short enough again. What is rounding beside
        // the direct motion must not block it.
        let almost = (excess + self.rounding) / k;
        let blocked = (low > 0.0 && low * low > almost).then(|| {
            let after =
                direct.duration + 2.0 * k * (low - libm::sqrt(low * low - almost)) + self.time_rounding();
            let dip = libm::sqrt(low * low - step);
            let before = if -dip >= rate_min {
                direct.duration + 2.0 * k * (low + dip)
            } else {
                let backwards = (excess - k * (low - rate_min) * (low + rate_min)) / rate_min;
                direct.duration + 2.0 * k * (low - rate_min) + backwards
            };
            (after, before)
        });
        Fastest {
            stretches: self.stretches(high + detour, cruise),
            duration: direct.duration + 2.0 * k * detour + cruise,
            blocked,
        }
    }

    /// The way that takes this long, which must be possible.
    pub(super) fn lasting(&self, duration: f64) -> Stretches {
        let direct = self.direct();
        let spare = (duration - direct.duration).max(0.0);
        let Direct { excess, high, low, .. } = direct;
        let k = 0.5 / self.bounds.slope_max - 0.5 / self.bounds.slope_min;
        // The detour by x above `high` (below `low`) costs 2·k·x of the spare time, and no more than all of it.
        let detour = |lacking: f64| {
            let cruise = libm::sqrt((spare * spare - 4.0 * k * lacking).max(0.0));
            let cost = 4.0 * k * lacking / (spare + cruise);
            (0.5 * cost.min(spare) / k, cruise)
        };
        if excess > high * spare {
            let (x, cruise) = detour(excess - high * spare);
            self.stretches((high + x).min(self.bounds.rate_max), cruise)
        } else if excess < low * spare {
            let (x, cruise) = detour(low * spare - excess);
            self.stretches((low - x).max(self.bounds.rate_min), cruise)
        } else {
            let rate = if spare > 0.0 { (excess / spare).clamp(low, high) } else { self.start };
            let slope = direct.slope;
            Stretches {
                durations: [(rate - self.start) / slope, spare, (self.target - rate) / slope],
                slopes: [slope, 0.0, slope],
            }
        }
    }

    /// By way of a cruise at this rate, above both or below both.
    fn stretches(&self, rate: f64, cruise: f64) -> Stretches {
        let Bounds { slope_max, slope_min, .. } = self.bounds;
        let (first, last) =
            if rate >= self.start.max(self.target) { (slope_max, slope_min) } else { (slope_min, slope_max) };
        Stretches {
            durations: [(rate - self.start) / first, cruise, (self.target - rate) / last],
            slopes: [first, 0.0, last],
        }
    }
}

impl Fastest {
    fn mirrored(mut self) -> Self {
        self.stretches.slopes = self.stretches.slopes.map(|slope| -slope);
        self
    }
}

/// Brings the velocity back to its limit, and gives the rest of the problem.
fn brake(problem: &Problem, profile: &mut Profile) -> Result<Ramp, PlanError> {
    let Problem { start, target, limits } = problem;
    profile.begin(State { acceleration: 0.0, ..*start });
    let velocity = start.velocity.clamp(limits.velocity_min, limits.velocity_max);
    if velocity != start.velocity {
        let acceleration =
            if velocity < start.velocity { limits.acceleration_min } else { limits.acceleration_max };
        profile.accelerate((velocity - start.velocity) / acceleration, acceleration);
    }
    let position = profile.reached().position;
    // The state may have gone through many cycles of sampling and planning.
    let weakest = limits.acceleration_max.min(-limits.acceleration_min);
    let fastest = limits.velocity_max.max(-limits.velocity_min);
    let braking_distance = fastest * fastest / weakest;
    let rounding = ROUNDING * (position.abs() + target.position.abs() + braking_distance);
    if !rounding.is_finite() {
        return Err(PlanError::NotRepresentable { axis: 0 });
    }
    Ok(Ramp {
        distance: target.position - position,
        rounding,
        start: velocity,
        target: target.velocity,
        bounds: Bounds {
            rate_max: limits.velocity_max,
            rate_min: limits.velocity_min,
            slope_max: limits.acceleration_max,
            slope_min: limits.acceleration_min,
        },
    })
}

fn drive(stretches: &Stretches, profile: &mut Profile) {
    for (duration_s, acceleration) in stretches.durations.iter().zip(&stretches.slopes) {
        profile.accelerate(*duration_s, *acceleration);
    }
}

fn target(problem: &Problem) -> State {
    State { acceleration: 0.0, ..problem.target }
}

/// The fastest profile to the target position and velocity, with its blocked interval.
pub(super) fn fastest_position(problem: &Problem, profile: &mut Profile) -> Result<(), PlanError> {
    let ramp = brake(problem, profile)?;
    let brake_s = profile.duration_s();
    let fastest = ramp.fastest();
    drive(&fastest.stretches, profile);
    profile.finish_at(target(problem), brake_s + fastest.duration)?;
    profile.set_minimum_duration(profile.duration_s());
    if let Some((after, before)) = fastest.blocked {
        profile.block(brake_s + after, brake_s + before);
    }
    Ok(())
}

/// The profile to the target position and velocity that lasts this long.
pub(super) fn position_lasting(
    problem: &Problem,
    duration_s: f64,
    profile: &mut Profile,
) -> Result<(), PlanError> {
    let ramp = brake(problem, profile)?;
    let stretches = ramp.lasting(duration_s - profile.duration_s());
    drive(&stretches, profile);
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
