//! The second-order problem in closed form: take a rate from one value to another and cover a distance on the way.
//!
//! It is used twice. For the trapezoid, the rate is the velocity and the slope is the acceleration. For the third-order
//! planning to a velocity, everything is one order lower: the rate is the acceleration, the slope is the jerk, and the
//! "distance" is the change of the velocity.
//!
//! ```text
//!   rate                  cruise at the rate v              The direct motion is the single slope from start to target.
//!     v |        ________________                            A cruise outside of start and target is a detour.
//!       |       /                \
//!       |      / slope max        \ slope min
//!       |     /                    \ target
//!       | start
//!       +-----------------------------------> time
//! ```
//!
//! For a given duration, every rate on the way grows with the cruise rate `v`, and so does the distance. So there is exactly one
//! `v` for each distance that can be reached. Compared with the direct motion, a detour to a rate `v` above both ends
//! adds the distance `(v² − high²)/h`. There `high` is the larger rate of both ends, and `h = 2AB/(A + B)` is the harmonic
//! mean of the slopes `A` up and `B` down. All code below follows from this equation.
//!
//! To avoid waiting for divisions, everything is multiplied by `h`. A distance becomes a square of a rate, its *area*. A time
//! becomes the change of the rate in that time at slope `h`. Only the results are divided again.

use super::choice::{larger, select, smaller};
use super::profile::Profile;

/// A difference up to this, relative to the sizes of a problem, is rounding.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// The limits of the slope, with which the rate changes.
#[derive(Clone, Copy)]
pub(super) struct Slopes {
    max: f64,
    min: f64,
    /// The harmonic mean `h` of both magnitudes.
    mean: f64,
    inverse_mean: f64,
    /// The times that a change of the rate takes upwards and downwards, relative to the time at the mean slope. Their sum
    /// is 2.
    rise: f64,
    fall: f64,
}

/// The problem: cover a distance while the rate goes from one value to another.
///
/// Its methods are inlined. Otherwise the compiler loads in pairs what the caller has just stored number by number. The
/// processor then waits until everything is in the cache, which takes a third of the time of a plan.
#[derive(Clone, Copy)]
pub(super) struct SecondOrder {
    /// The distance times the mean slope.
    pub(super) area: f64,
    /// An area up to this size is rounding.
    pub(super) rounding: f64,
    /// The rate at the start, within its limits.
    pub(super) start: f64,
    /// The rate at the end, within its limits.
    pub(super) target: f64,
    /// The largest rate, positive.
    pub(super) rate_max: f64,
    /// The smallest rate, negative.
    pub(super) rate_min: f64,
    pub(super) slopes: Slopes,
}

/// A cruise at a constant rate, between a slope to this rate and a slope away from it.
#[derive(Clone, Copy)]
pub(super) struct Cruise {
    rate: f64,
    /// How long the cruise lasts, times the mean slope.
    duration: f64,
}

/// Three phases of constant slope: to the cruise, the cruise, and away from it.
#[derive(Clone, Copy)]
pub(super) struct ThreePhases {
    pub(super) durations: [f64; 3],
    pub(super) slopes: [f64; 3],
}

/// The fastest motion, and the blocked interval of longer durations.
#[derive(Clone, Copy)]
pub(super) struct Fastest {
    pub(super) cruise: Cruise,
    pub(super) duration: f64,
    pub(super) blocked: Option<(f64, f64)>,
}

impl Fastest {
    /// Notes in a profile, which has only its first phases so far, how short it can be, and which durations are blocked.
    /// Returns the shortest duration, in s.
    #[inline(always)]
    pub(super) fn note_in(&self, profile: &mut Profile) -> f64 {
        let begun_s = profile.duration_s();
        let shortest_s = begun_s + self.duration;
        profile.set_minimum_duration(shortest_s);
        if let Some((after, before)) = self.blocked {
            profile.block(begun_s + after, begun_s + before);
        }
        shortest_s
    }
}

/// The direct motion: a single slope from start to target.
struct Direct {
    duration: f64,
    /// By how much the wanted area exceeds that of the direct motion.
    excess: f64,
    /// The larger rate of start and target.
    high: f64,
    /// The smaller rate of start and target.
    low: f64,
}

impl Slopes {
    /// The same slope upwards and downwards.
    #[inline(always)]
    pub(super) fn symmetric(slope: f64) -> Self {
        Self { max: slope, min: -slope, mean: slope, inverse_mean: 1.0 / slope, rise: 1.0, fall: 1.0 }
    }

    /// A positive and a negative slope.
    #[inline(always)]
    pub(super) fn asymmetric(max: f64, min: f64) -> Self {
        let share = 2.0 / (max - min);
        let (rise, fall) = (-min * share, max * share);
        Self { max, min, mean: max * rise, inverse_mean: 0.5 * (max - min) / (-max * min), rise, fall }
    }

    /// The factor from a distance to its area.
    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// The area that is covered while this rate is built up or reduced at the smaller slope.
    #[inline(always)]
    pub(super) fn area_to_rate(&self, rate: f64) -> f64 {
        rate * rate * larger(self.rise, self.fall)
    }

    /// The slope for a change of the rate in this direction.
    #[inline(always)]
    fn towards(&self, change: f64) -> f64 {
        select(change < 0.0, self.min, self.max)
    }

    /// The time that this change of the rate takes.
    #[inline(always)]
    fn time(&self, change: f64) -> f64 {
        larger(change * self.rise, -change * self.fall)
    }
}

impl SecondOrder {
    /// A duration up to this size is rounding. A target that moves by at speed must not be missed because of it.
    fn time_rounding(&self) -> f64 {
        ROUNDING * (self.start.abs() + self.target.abs()) * larger(self.slopes.rise, self.slopes.fall)
    }

    /// The limits of the rate as seen in this direction, 1 or −1.
    #[inline(always)]
    fn bounds_towards(&self, sign: f64) -> (f64, f64) {
        let (one, other) = (sign * self.rate_max, sign * self.rate_min);
        (larger(one, other), smaller(one, other))
    }

    #[inline(always)]
    fn direct(&self) -> Direct {
        let (start, target) = (self.start, self.target);
        let duration = self.slopes.time(target - start);
        let excess = self.area - 0.5 * (start + target) * duration;
        let (high, low) = (larger(start, target), smaller(start, target));
        // Here rounding decides between the direct motion and a detour. If both rates have one sign, a detour on the wrong
        // side means going back and starting again. Otherwise it costs the square root of the error in time. That is
        // still much for the other axes, which may be about to pass their targets. So the error stays in the area.
        let passing = larger(larger(low, -high), 0.0);
        let rounding = select(
            0.5 * passing * passing * smaller(self.slopes.rise, self.slopes.fall) > self.rounding,
            self.rounding,
            smaller(self.rounding * (1.0 / 64.0), 1e-6 * self.area.abs()),
        );
        let excess = select(excess.abs() <= rounding, 0.0, excess);
        Direct { duration, excess, high, low }
    }

    /// The fastest motion.
    #[inline(always)]
    pub(super) fn fastest(&self) -> Fastest {
        let direct = self.direct();
        // Everything below is seen in the direction of the detour, so that the detour is always upwards.
        let sign = 1.0_f64.copysign(select(direct.excess == 0.0, direct.high, direct.excess));
        let excess = direct.excess.abs();
        let (one, other) = (sign * self.start, sign * self.target);
        let (high, low) = (larger(one, other), smaller(one, other));
        let (rate_max, rate_min) = self.bounds_towards(sign);
        let peak = libm::sqrt(high * high + excess);
        // This is peak − high, without cancellation.
        let detour = excess / positive(peak + high.abs()) + (high.abs() - high);
        let room = rate_max - high;
        let cruise = larger(excess - room * (rate_max + high), 0.0) / rate_max;
        let detour = smaller(detour, room);
        let duration = (direct.duration + 2.0 * detour + cruise) * self.slopes.inverse_mean;
        let cruise = Cruise { rate: sign * (high + detour), duration: cruise };
        // The shortest distance of a given duration has a cruise below both rates. For durations just above the fastest
        // one, that distance is already too long. Once the cruise goes backwards, it is short enough again. The durations
        // between are blocked. A difference from the direct motion that is rounding must not block them.
        let blocked = if low * larger(low, 0.0) > excess + self.rounding {
            Some(self.blocked(rate_min, direct.duration, excess, low))
        } else {
            None
        };
        Fastest { cruise, duration, blocked }
    }

    /// The durations between which every distance is too long. The wanted area exceeds that of the direct motion by less than a
    /// detour down to rate zero takes away.
    fn blocked(&self, rate_min: f64, direct_duration: f64, excess: f64, low: f64) -> (f64, f64) {
        let almost = low - libm::sqrt(low * low - (excess + self.rounding));
        let after = direct_duration + 2.0 * almost + self.time_rounding();
        let reverse = libm::sqrt(low * low - excess);
        let before = if -reverse >= rate_min {
            direct_duration + 2.0 * (low + reverse)
        } else {
            let backwards = (excess - (low - rate_min) * (low + rate_min)) / rate_min;
            direct_duration + 2.0 * (low - rate_min) + backwards
        };
        (after * self.slopes.inverse_mean, before * self.slopes.inverse_mean)
    }

    /// The motion of this duration, which must be possible.
    #[inline(always)]
    pub(super) fn lasting(&self, duration: f64) -> Cruise {
        let Direct { duration: direct_duration, excess, high, low } = self.direct();
        let spare = larger(duration * self.slopes.mean - direct_duration, 0.0);
        // A cruise between the rates of both ends takes all of the spare time. Otherwise the cruise is outside, by a detour of x
        // beyond the nearer end, and the detour takes 2·x of the spare time. It cannot take more than all of it.
        let between = smaller(larger(excess / positive(spare), low), high);
        let (above, below) = (excess - high * spare, low * spare - excess);
        let lacking = larger(larger(above, below), 0.0);
        let cruise = libm::sqrt(larger(spare * spare - 4.0 * lacking, 0.0));
        let detour = smaller(2.0 * lacking / positive(spare + cruise), 0.5 * spare);
        let rate = between + detour.copysign(above);
        Cruise { rate: smaller(larger(rate, self.rate_min), self.rate_max), duration: cruise }
    }

    /// The phases of the motion with this cruise, in the units of the problem.
    #[inline(always)]
    pub(super) fn phases(&self, cruise: Cruise) -> ThreePhases {
        let (towards, away) = (cruise.rate - self.start, self.target - cruise.rate);
        let durations = [self.slopes.time(towards), cruise.duration, self.slopes.time(away)];
        ThreePhases {
            durations: durations.map(|duration| duration * self.slopes.inverse_mean),
            slopes: [self.slopes.towards(towards), 0.0, self.slopes.towards(away)],
        }
    }
}

/// The same number, but at least the smallest positive one, so that it can be divided by.
#[inline(always)]
fn positive(number: f64) -> f64 {
    larger(number, f64::MIN_POSITIVE)
}
