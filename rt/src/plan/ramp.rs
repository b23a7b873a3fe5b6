//! The core of the second order: take a rate to another and cover a distance on the way, in closed form
//! (`otg.md` section 2, 7).
//!
//! Write `v` for the rate of the cruise. For a given duration, every rate along the way grows with `v`, so the distance does
//! too, and there is exactly one `v` for a distance that can be reached. Compared with the *direct* motion (one ramp from
//! start to target), a detour to a rate `v` above both adds the distance `(v² − high²)/h`, with `high` the larger of the two
//! rates and `h = 2AB/(A + B)`, the harmonic mean of the slopes `A` up and `B` down. Everything below is this equation.
//!
//! So that nothing has to wait for a division, all is multiplied by `h`: a distance is then a square of a rate, its *area*, and
//! a time the change of the rate in it at slope `h`. Only what is given away is divided again.
//!
//! The trapezoid is this for the position and its rate, the velocity; the third-order velocity interface is the same one
//! order lower.

use super::choice::{larger, select, smaller};

/// Relative to the sizes of a problem, differences up to this are rounding.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// How fast the rate may change.
#[derive(Clone, Copy)]
pub(super) struct Slopes {
    max: f64,
    min: f64,
    /// The harmonic mean of both magnitudes, and its inverse.
    mean: f64,
    pace: f64,
    /// The times that a change of the rate takes upwards and downwards, in that at the mean slope: their sum is 2.
    rise: f64,
    fall: f64,
}

/// The core problem: cover a distance while the rate goes from one value to another.
///
/// Its solutions are inlined, for what a caller has just stored number by number would be loaded in pairs: the processor cannot
/// forward that, and waits until all is in the cache, a third of the time of a plan.
#[derive(Clone, Copy)]
pub(super) struct Ramp {
    /// The distance times the mean slope.
    pub(super) area: f64,
    /// Areas up to this size are rounding.
    pub(super) rounding: f64,
    /// The rates at both ends; they must be within the bounds.
    pub(super) start: f64,
    pub(super) target: f64,
    /// The bounds of the rate, positive and negative.
    pub(super) rate_max: f64,
    pub(super) rate_min: f64,
    pub(super) slopes: Slopes,
}

/// A ramp to a rate, a cruise at it, and a ramp away from it.
#[derive(Clone, Copy)]
pub(super) struct Way {
    rate: f64,
    /// How long it lasts, times the mean slope.
    cruise: f64,
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
    pub(super) way: Way,
    pub(super) duration: f64,
    pub(super) blocked: Option<(f64, f64)>,
}

/// The direct motion, and what the area exceeds it by.
struct Direct {
    duration: f64,
    excess: f64,
    high: f64,
    low: f64,
}

impl Slopes {
    /// The same slope up and down.
    #[inline(always)]
    pub(super) fn symmetric(slope: f64) -> Self {
        Self { max: slope, min: -slope, mean: slope, pace: 1.0 / slope, rise: 1.0, fall: 1.0 }
    }

    /// These slopes, a positive and a negative one.
    #[inline(always)]
    pub(super) fn asymmetric(max: f64, min: f64) -> Self {
        let share = 2.0 / (max - min);
        let (rise, fall) = (-min * share, max * share);
        Self { max, min, mean: max * rise, pace: 0.5 * (max - min) / (-max * min), rise, fall }
    }

    /// What to multiply a distance by to get its area.
    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// The area in which this rate is built up or reduced, at the smaller slope.
    #[inline(always)]
    pub(super) fn swing(&self, rate: f64) -> f64 {
        rate * rate * larger(self.rise, self.fall)
    }

    /// The slope in the direction of this change of the rate.
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

impl Ramp {
    /// Durations up to this size are rounding: a passage must not be missed for one.
    fn time_rounding(&self) -> f64 {
        ROUNDING * (self.start.abs() + self.target.abs()) * larger(self.slopes.rise, self.slopes.fall)
    }

    /// The bounds of the rate as seen in this direction, 1 or −1.
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
        // With both rates of one sign, being a rounding error beside the direct motion on the wrong side costs
        // the time to go back and try again. Otherwise it costs the square root of the error: still much for
        // the others, which may be about to pass through their targets. So the error stays in the area.
        let passing = larger(larger(low, -high), 0.0);
        let rounding = select(
            0.5 * passing * passing * smaller(self.slopes.rise, self.slopes.fall) > self.rounding,
            self.rounding,
            smaller(self.rounding * (1.0 / 64.0), 1e-6 * self.area.abs()),
        );
        let excess = select(excess.abs() <= rounding, 0.0, excess);
        Direct { duration, excess, high, low }
    }

    /// The fastest way.
    #[inline(always)]
    pub(super) fn fastest(&self) -> Fastest {
        let direct = self.direct();
        // Everything below is as seen in the direction of the detour: in place of downwards it is upwards there.
        let sign = 1.0_f64.copysign(select(direct.excess == 0.0, direct.high, direct.excess));
        let excess = direct.excess.abs();
        let (one, other) = (sign * self.start, sign * self.target);
        let (high, low) = (larger(one, other), smaller(one, other));
        let (rate_max, rate_min) = self.bounds_towards(sign);
        let peak = libm::sqrt(high * high + excess);
        // peak − high without cancellation
        let detour = excess / positive(peak + high.abs()) + (high.abs() - high);
        let room = rate_max - high;
        let cruise = larger(excess - room * (rate_max + high), 0.0) / rate_max;
        let detour = smaller(detour, room);
        let duration = (direct.duration + 2.0 * detour + cruise) * self.slopes.pace;
        let way = Way { rate: sign * (high + detour), cruise };
        // The other end of what is possible in a given time dips to a rate below both: for a moment that
        // way is already too long, once it goes backwards it is short enough again. What is rounding beside
        // the direct motion must not block it.
        let blocked = if low * larger(low, 0.0) > excess + self.rounding {
            Some(self.blocked(rate_min, direct.duration, excess, low))
        } else {
            None
        };
        Fastest { way, duration, blocked }
    }

    /// The durations between which the way is too long, for an area that exceeds that of the direct motion by less
    /// than a dip to zero takes away.
    fn blocked(&self, rate_min: f64, direct_duration: f64, excess: f64, low: f64) -> (f64, f64) {
        let almost = low - libm::sqrt(low * low - (excess + self.rounding));
        let after = direct_duration + 2.0 * almost + self.time_rounding();
        let dip = libm::sqrt(low * low - excess);
        let before = if -dip >= rate_min {
            direct_duration + 2.0 * (low + dip)
        } else {
            let backwards = (excess - (low - rate_min) * (low + rate_min)) / rate_min;
            direct_duration + 2.0 * (low - rate_min) + backwards
        };
        (after * self.slopes.pace, before * self.slopes.pace)
    }

    /// The way that takes this long, which must be possible.
    #[inline(always)]
    pub(super) fn lasting(&self, duration: f64) -> Way {
        let Direct { duration: direct_duration, excess, high, low } = self.direct();
        let spare = larger(duration * self.slopes.mean - direct_duration, 0.0);
        // Cruising all of the spare time at this rate is enough if it is between the rates at both ends. Otherwise the cruise is
        // beyond the nearer one: the detour by x costs 2·x of the spare time, and no more than all of it.
        let between = smaller(larger(excess / positive(spare), low), high);
        let (above, below) = (excess - high * spare, low * spare - excess);
        let lacking = larger(larger(above, below), 0.0);
        let cruise = libm::sqrt(larger(spare * spare - 4.0 * lacking, 0.0));
        let detour = smaller(2.0 * lacking / positive(spare + cruise), 0.5 * spare);
        let rate = between + detour.copysign(above);
        Way { rate: smaller(larger(rate, self.rate_min), self.rate_max), cruise }
    }

    /// The stretches of this way, in the units of the problem.
    #[inline(always)]
    pub(super) fn stretches(&self, way: Way) -> Stretches {
        let (towards, away) = (way.rate - self.start, self.target - way.rate);
        let durations = [self.slopes.time(towards), way.cruise, self.slopes.time(away)];
        Stretches {
            durations: durations.map(|duration| duration * self.slopes.pace),
            slopes: [self.slopes.towards(towards), 0.0, self.slopes.towards(away)],
        }
    }
}

/// The same number, but one to divide by if it is zero.
#[inline(always)]
fn positive(number: f64) -> f64 {
    larger(number, f64::MIN_POSITIVE)
}
