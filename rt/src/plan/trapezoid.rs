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
use super::profile::{Profile, select};

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
///
/// Its solutions are inlined, for what a caller has just stored number by number would be loaded in pairs: the processor cannot
/// forward that, and waits until all is in the cache, a third of the time of a plan.
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

    /// The bounds as seen in this direction, 1 or −1.
    #[inline]
    fn bounds_towards(&self, sign: f64) -> Bounds {
        let Bounds { rate_max, rate_min, slope_max, slope_min } = self.bounds;
        Bounds {
            rate_max: larger(sign * rate_max, sign * rate_min),
            rate_min: smaller(sign * rate_max, sign * rate_min),
            slope_max: larger(sign * slope_max, sign * slope_min),
            slope_min: smaller(sign * slope_max, sign * slope_min),
        }
    }

    #[inline]
    fn direct(&self) -> Direct {
        let (start, target) = (self.start, self.target);
        let Bounds { slope_max, slope_min, .. } = self.bounds;
        let sign = libm::copysign(1.0, target - start);
        let slope = sign * larger(sign * slope_max, sign * slope_min);
        let duration = (target - start) / slope;
        let excess = self.distance - 0.5 * (start + target) * duration;
        let (high, low) = (larger(start, target), smaller(start, target));
        // With both rates of one sign, being a rounding error beside the direct motion on the wrong side costs
        // the time to go back and try again. Otherwise it costs the square root of the error: still much for
        // the others, which may be about to pass through their targets. So the error stays in the distance.
        let passing = larger(larger(low, -high), 0.0);
        let rounding = select(
            0.5 * passing * passing > self.rounding * larger(slope_max, -slope_min),
            self.rounding,
            smaller(self.rounding * (1.0 / 64.0), 1e-6 * self.distance.abs()),
        );
        let excess = if excess.abs() <= rounding { 0.0 } else { excess };
        Direct { duration, excess, high, low, slope }
    }

    /// The fastest way. The start must be within the bounds.
    #[inline(always)]
    pub(super) fn fastest(&self) -> Fastest {
        let direct = self.direct();
        // Everything below is as seen in the direction of the detour: in place of downwards it is upwards there.
        let sign = libm::copysign(1.0, if direct.excess == 0.0 { direct.high } else { direct.excess });
        let excess = sign * direct.excess;
        let (one, other) = (sign * self.start, sign * self.target);
        let (high, low) = (larger(one, other), smaller(one, other));
        let bounds = self.bounds_towards(sign);
        let Bounds { rate_max, slope_max, slope_min, .. } = bounds;
        let (up, fall) = (1.0 / slope_max, -1.0 / slope_min);
        let k = 0.5 * (up + fall);
        let step = excess / k;
        let peak = libm::sqrt(high * high + step);
        // peak − high without cancellation
        let detour = select(high > 0.0, step / (peak + high), peak - high);
        let room = rate_max - high;
        let cruise = select(detour > room, (excess - k * room * (rate_max + high)) / rate_max, 0.0);
        let detour = smaller(detour, room);
        let duration = direct.duration + 2.0 * k * detour + cruise;
        let rate = high + detour;
        let stretches = Stretches {
            durations: [(rate - one) * up, cruise, (rate - other) * fall],
            slopes: [sign * slope_max, 0.0, sign * slope_min],
        };
        // The other end of what is possible in a given time dips to a rate below both: for a moment that
        // way is already too long, once it goes backwards it is short enough again. What is rounding beside
        // the direct motion must not block it.
        let almost = (excess + self.rounding) / k;
        let blocked = if low > 0.0 && low * low > almost {
            Some(self.blocked(&bounds, k, direct.duration, excess, low))
        } else {
            None
        };
        Fastest { stretches, duration, blocked }
    }

    /// The durations between which the way is too long, for a distance that exceeds that of the direct motion by less
    /// than a dip to zero takes away.
    fn blocked(&self, bounds: &Bounds, k: f64, direct_duration: f64, excess: f64, low: f64) -> (f64, f64) {
        let almost = (excess + self.rounding) / k;
        let after = direct_duration + 2.0 * k * (low - libm::sqrt(low * low - almost)) + self.time_rounding();
        let dip = libm::sqrt(low * low - excess / k);
        let rate_min = bounds.rate_min;
        let before = if -dip >= rate_min {
            direct_duration + 2.0 * k * (low + dip)
        } else {
            let backwards = (excess - k * (low - rate_min) * (low + rate_min)) / rate_min;
            direct_duration + 2.0 * k * (low - rate_min) + backwards
        };
        (after, before)
    }

    /// The way that takes this long, which must be possible.
    #[inline(always)]
    pub(super) fn lasting(&self, duration: f64) -> Stretches {
        let Direct { duration: direct_duration, excess, high, low, slope } = self.direct();
        let spare = larger(duration - direct_duration, 0.0);
        let (above, below) = (excess - high * spare, low * spare - excess);
        if above > 0.0 || below > 0.0 {
            let base = select(above > 0.0, high, -low);
            self.detour(select(above > 0.0, 1.0, -1.0), spare, base, larger(above, below))
        } else {
            let rate = if spare > 0.0 { (excess / spare).clamp(low, high) } else { self.start };
            Stretches {
                durations: [(rate - self.start) / slope, spare, (self.target - rate) / slope],
                slopes: [slope, 0.0, slope],
            }
        }
    }

    /// By way of a cruise beyond both rates in this direction, 1 or −1, where the outer one is `base`.
    #[inline]
    fn detour(&self, sign: f64, spare: f64, base: f64, lacking: f64) -> Stretches {
        let Bounds { rate_max, slope_max, slope_min, .. } = self.bounds_towards(sign);
        let (up, fall) = (1.0 / slope_max, -1.0 / slope_min);
        let k = 0.5 * (up + fall);
        // The detour by x beyond the base costs 2·k·x of the spare time, and no more than all of it.
        let cruise = libm::sqrt(larger(spare * spare - 4.0 * k * lacking, 0.0));
        let cost = smaller(4.0 * k * lacking / (spare + cruise), spare);
        let rate = smaller(base + 0.5 * cost / k, rate_max);
        Stretches {
            durations: [(rate - sign * self.start) * up, cruise, (rate - sign * self.target) * fall],
            slopes: [sign * slope_max, 0.0, sign * slope_min],
        }
    }
}

/// The larger number, in one instruction: what is not a number is found at the end, see [`Profile::finish_at`].
#[inline]
pub(super) fn larger(one: f64, other: f64) -> f64 {
    if one > other { one } else { other }
}

/// The smaller number, in one instruction.
#[inline]
pub(super) fn smaller(one: f64, other: f64) -> f64 {
    if one < other { one } else { other }
}

/// Brings the velocity back to its limit, and gives the rest of the problem.
#[inline(always)]
fn brake(problem: &Problem, profile: &mut Profile) -> Result<Ramp, PlanError> {
    let Problem { start, target, limits } = problem;
    profile.begin(State { acceleration: 0.0, ..*start });
    let mut velocity = start.velocity;
    if velocity > limits.velocity_max || velocity < limits.velocity_min {
        velocity = velocity.clamp(limits.velocity_min, limits.velocity_max);
        let acceleration =
            if velocity < start.velocity { limits.acceleration_min } else { limits.acceleration_max };
        profile.accelerate((velocity - start.velocity) / acceleration, acceleration);
    }
    let position = profile.reached().position;
    // The state may have gone through many cycles of sampling and planning.
    let weakest = smaller(limits.acceleration_max, -limits.acceleration_min);
    let fastest = larger(limits.velocity_max, -limits.velocity_min);
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
    profile.accelerate_all(&stretches.durations, &stretches.slopes);
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
    let ramp = brake(problem, profile)?;
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
    drive(&fastest.stretches, profile);
    profile.finish_at(target(problem), fastest_s)
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
