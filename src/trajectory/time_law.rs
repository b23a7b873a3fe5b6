//! How fast a group goes along a path: speed override, pause and resumption.
//!
//! A new rate is reached by a ramp: the rate is a polynomial of the third degree of the time, so that the acceleration of every
//! axis stays continuous and its jerk bounded. The ramp is checked against every limit of every axis by the chain rule: with the
//! path `q(s)` and the path time `s(t)`
//!
//! ```text
//! velocity = q' s'     acceleration = q'' s'² + q' s''     jerk = q''' s'³ + 3 q'' s' s'' + q' s'''
//! ```
//!
//! Bounds of each are computed for intervals of time, which are halved until the bounds keep the limits. So what passes keeps them
//! everywhere, not only at samples. Of the ramps that pass the one is taken that ends first. Where the axes are near a limit of
//! their own, a ramp may have to begin later.

use std::sync::Arc;

use takt_rt::{AxisLimits, PathTime, Polynomial, TimeLawPhase};

use super::check;
use super::error::{BrokenLimit, axis_name};
use super::{Path, Trajectory};

/// Room for rounding, relative to the limit: half of what the guard has.
const TOLERANCE: f64 = 0.5e-6;
/// The shortest ramp, and the factor from one to the next longer one.
const SHORTEST_RAMP_S: f64 = 0.01;
const LONGER: f64 = 1.2;
/// The longest ramp.
const LONGEST_RAMP_S: f64 = 20.0;
/// From one beginning of a ramp to the next one that is tried.
const LATER_S: f64 = 0.02;
/// The most that a ramp begins later.
const LATEST_S: f64 = 5.0;
/// Intervals that are looked at to judge one ramp.
const INTERVALS_AT_MOST: usize = 4_000;
/// The shortest interval that is halved, in seconds.
const SHORTEST_INTERVAL_S: f64 = 2e-5;

/// Why the rate of a trajectory cannot be changed.
#[derive(Clone, Copy, Debug, PartialEq, bitcode::Encode, bitcode::Decode, thiserror::Error)]
#[non_exhaustive]
pub enum RateError {
    /// A rate is a finite number from 0 on.
    #[error("{rate} is not a rate: 1 is as written, 0 pauses")]
    NotARate {
        /// What was given.
        rate: f64,
    },
    /// The trajectory is over by then.
    #[error("the trajectory is over")]
    Over,
    /// At this rate a limit is broken on the way to a point.
    #[error("{}", limit_words(*rate, *point, &axis_name(&[], *axis), *broken))]
    Limit {
        /// The rate.
        rate: f64,
        /// The point of the path, counted from 0.
        point: usize,
        /// The axis.
        axis: usize,
        /// The limit.
        broken: BrokenLimit,
    },
    /// No ramp to this rate keeps the limits before the trajectory is over.
    #[error("no change to the rate {rate} keeps the limits here")]
    NoRamp {
        /// The rate.
        rate: f64,
    },
}

fn limit_words(rate: f64, point: usize, axis: &str, broken: BrokenLimit) -> String {
    format!("at the rate {rate}, {axis} breaks its limit of {broken} on the way to point {point}")
}

impl RateError {
    /// The text, with the axis by its name. `axes` are the names of those that the trajectory is for, in their order.
    pub fn naming(&self, axes: &[&str]) -> String {
        match *self {
            Self::Limit { rate, point, axis, broken } => {
                limit_words(rate, point, &axis_name(axes, axis), broken)
            }
            _ => self.to_string(),
        }
    }
}

impl Trajectory {
    /// How far along its path the group is so long after the beginning, and how fast it goes along it.
    pub(crate) fn path_time(&self, at_s: f64) -> PathTime {
        self.view().path_time(at_s)
    }

    /// The same path from `at_s` after the beginning of this one on, at another rate as soon as the limits allow it: 1 as it was
    /// written, 0 pauses. It begins in exactly the state that this one has then.
    ///
    /// # Errors
    /// See [`RateError`].
    pub fn at_rate(&self, at_s: f64, rate: f64, limits: &[AxisLimits]) -> Result<Self, RateError> {
        if !(rate.is_finite() && rate >= 0.0) {
            return Err(RateError::NotARate { rate });
        }
        if at_s >= self.duration_s {
            return Err(RateError::Over);
        }
        let law = self.law_from(at_s);
        let now = path_time(&law, 0.0);
        if rate > 1.0 {
            self.path.check_rate(now.path_s, rate, limits)?;
        }
        if now.rate == rate && law.len() == 1 {
            return Ok(Self::with_law(Arc::clone(&self.path), law));
        }
        let (begins_s, ramp_s) = self.first_ramp(&law, rate, limits).ok_or(RateError::NoRamp { rate })?;
        let ramp = ramp(begins_s, path_time(&law, begins_s), rate, ramp_s);
        let end = ramp.at(begins_s + ramp_s);
        let before =
            law.into_iter().filter(|phase| phase.from_s < begins_s || begins_s > 0.0 && phase.from_s <= 0.0);
        let constant = TimeLawPhase::constant(begins_s + ramp_s, end.path_s, rate);
        let law = before.filter(|phase| phase.from_s < begins_s).chain([ramp, constant]).collect();
        Ok(Self::with_law(Arc::clone(&self.path), law))
    }

    /// A path with a time law.
    fn with_law(path: Arc<Path>, law: Vec<TimeLawPhase>) -> Self {
        let duration_s = duration_s(&law, path.duration_s());
        Self { path, law, duration_s }
    }

    /// The phases of the time law from this time on, which is 0 in them.
    fn law_from(&self, at_s: f64) -> Vec<TimeLawPhase> {
        let present = self.law.partition_point(|phase| phase.from_s <= at_s).saturating_sub(1);
        let phases = self.law.iter().skip(present);
        phases.map(|phase| TimeLawPhase { from_s: phase.from_s - at_s, ..*phase }).collect()
    }

    /// When the ramp begins and how long it is that ends first of all that keep the limits.
    fn first_ramp(&self, law: &[TimeLawPhase], rate: f64, limits: &[AxisLimits]) -> Option<(f64, f64)> {
        let latest_s = duration_s(law, self.path.duration_s()).min(LATEST_S);
        let mut best: Option<(f64, f64)> = None;
        let mut begins_s = 0.0;
        while begins_s < latest_s && best.is_none_or(|(begin_s, ramp_s)| begins_s < begin_s + ramp_s) {
            let from = path_time(law, begins_s);
            let mut ramp_s = SHORTEST_RAMP_S;
            while ramp_s <= LONGEST_RAMP_S
                && best.is_none_or(|(begin_s, best_s)| begins_s + ramp_s < begin_s + best_s)
            {
                if self.path.keeps_limits(&ramp(0.0, from, rate, ramp_s), ramp_s, limits) {
                    best = Some((begins_s, ramp_s));
                    break;
                }
                ramp_s *= LONGER;
            }
            begins_s += LATER_S;
        }
        best
    }
}

/// The path time at a time of a law.
fn path_time(law: &[TimeLawPhase], at_s: f64) -> PathTime {
    let phase = law.partition_point(|phase| phase.from_s <= at_s).saturating_sub(1);
    law.get(phase).map_or(PathTime { path_s: at_s, rate: 1.0, rate_change: 0.0 }, |phase| phase.at(at_s))
}

/// From this path time to another rate, which stays from then on.
fn ramp(begins_s: f64, from: PathTime, rate: f64, ramp_s: f64) -> TimeLawPhase {
    let PathTime { path_s, rate: first, rate_change } = from;
    let mean = (rate - first) / ramp_s;
    let square = (3.0 * mean - 2.0 * rate_change) / ramp_s;
    let cube = (rate_change - 2.0 * mean) / (ramp_s * ramp_s);
    TimeLawPhase { from_s: begins_s, path_s: [path_s, first, rate_change / 2.0, square / 3.0, cube / 4.0] }
}

/// When the path time reaches the end of the path.
fn duration_s(law: &[TimeLawPhase], end_s: f64) -> f64 {
    let ends = law.iter().skip(1).map(|next| next.from_s).chain([f64::INFINITY]);
    for (phase, to_s) in law.iter().zip(ends) {
        if to_s.is_infinite() {
            let [path_s, rate, ..] = phase.path_s;
            return if path_s >= end_s {
                phase.from_s
            } else if rate > 0.0 {
                phase.from_s + (end_s - path_s) / rate
            } else {
                f64::INFINITY
            };
        }
        if phase.at(to_s).path_s >= end_s {
            let (mut before_s, mut after_s) = (phase.from_s, to_s);
            for _ in 0..60 {
                let middle_s = 0.5 * (before_s + after_s);
                if phase.at(middle_s).path_s >= end_s { after_s = middle_s } else { before_s = middle_s }
            }
            return after_s.max(0.0);
        }
    }
    f64::INFINITY
}

impl Path {
    /// Checks what is left of the path at a constant rate, by its exact extrema.
    fn check_rate(&self, from_s: f64, rate: f64, limits: &[AxisLimits]) -> Result<(), RateError> {
        for (index, times_s) in self.times_s.windows(2).enumerate().filter(|(_, times_s)| times_s[1] > from_s)
        {
            let polynomials = self.polynomials.iter().skip(index * self.axes);
            for (axis, (polynomial, limits)) in polynomials.zip(limits).enumerate() {
                let mut factor = 1.0 / rate;
                let scaled = polynomial.0.map(|coefficient| {
                    factor *= rate;
                    coefficient * factor
                });
                let duration_s = (times_s[1] - times_s[0]) / rate;
                if let Some(found) = check::violation(&Polynomial(scaled), duration_s, limits) {
                    return Err(RateError::Limit {
                        rate,
                        point: self.point(index),
                        axis,
                        broken: found.broken,
                    });
                }
            }
        }
        Ok(())
    }

    /// Returns `true` if every axis keeps its limits on a phase of a time law that begins at 0, and the rate is never negative.
    fn keeps_limits(&self, phase: &TimeLawPhase, duration_s: f64, limits: &[AxisLimits]) -> bool {
        let mut left = vec![(0.0, duration_s)];
        for _ in 0..INTERVALS_AT_MOST {
            let Some((from_s, to_s)) = left.pop() else { return true };
            match self.bounds_keep_limits(phase, from_s, to_s, limits) {
                IntervalCheck::Kept => {}
                IntervalCheck::Broken => return false,
                IntervalCheck::Open if to_s - from_s < SHORTEST_INTERVAL_S => return false,
                IntervalCheck::Open => {
                    let middle_s = 0.5 * (from_s + to_s);
                    left.extend([(middle_s, to_s), (from_s, middle_s)]);
                }
            }
        }
        false
    }

    fn bounds_keep_limits(
        &self,
        phase: &TimeLawPhase,
        from_s: f64,
        to_s: f64,
        limits: &[AxisLimits],
    ) -> IntervalCheck {
        let law = LawBounds::of(phase, from_s, to_s);
        if law.middle.rate < -TOLERANCE {
            return IntervalCheck::Broken;
        }
        if law.rate.low < -TOLERANCE {
            return IntervalCheck::Open;
        }
        let mut check = IntervalCheck::Kept;
        for (axis, limits) in limits.iter().enumerate().take(self.axes) {
            let (middle, around) = self.derivatives(axis, &law);
            let at_middle = Rates::of(&middle, &law.at_middle());
            if !at_middle.keep(limits) {
                return IntervalCheck::Broken;
            }
            if !Rates::of(&around, &law.around()).keep(limits) {
                check = IntervalCheck::Open;
            }
        }
        check
    }

    /// The first three derivatives of the path of an axis, in the middle of an interval and all over it.
    fn derivatives(&self, axis: usize, law: &LawBounds) -> ([Range; 3], [Range; 3]) {
        let index = |path_s: f64| self.times_s.partition_point(|time_s| *time_s <= path_s).saturating_sub(1);
        let (low, high) = (law.path_s.low, law.path_s.high);
        let of = |point: usize, low: f64, high: f64| {
            let polynomial = self.polynomials.get(point * self.axes + axis).copied().unwrap_or_default();
            let begins_s = self.times_s.get(point).copied().unwrap_or(0.0);
            derivative_bounds(&polynomial, 0.5 * (low + high) - begins_s, 0.5 * (high - low))
        };
        let middle_s = law.middle.path_s;
        let middle = of(index(middle_s), middle_s, middle_s);
        let mut around: Option<[Range; 3]> = None;
        for point in index(low)..=index(high) {
            let ends_s = self.times_s.get(point + 1).copied().unwrap_or(f64::INFINITY);
            let begins_s = self.times_s.get(point).copied().unwrap_or(0.0);
            let part = of(point, low.max(begins_s), high.min(ends_s));
            around = Some(match around {
                None => part,
                Some(other) => std::array::from_fn(|derivative| other[derivative].with(part[derivative])),
            });
        }
        (middle, around.unwrap_or(middle))
    }
}

/// What is known of the limits on an interval.
enum IntervalCheck {
    Kept,
    Broken,
    Open,
}

/// All numbers from one to another one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Range {
    low: f64,
    high: f64,
}

impl Range {
    const fn around(middle: f64, room: f64) -> Self {
        Self { low: middle - room, high: middle + room }
    }

    const fn point(value: f64) -> Self {
        Self::around(value, 0.0)
    }

    const fn with(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    const fn plus(self, other: Self) -> Self {
        Self { low: self.low + other.low, high: self.high + other.high }
    }

    fn times(self, other: Self) -> Self {
        let products =
            [self.low * other.low, self.low * other.high, self.high * other.low, self.high * other.high];
        let low = products.into_iter().fold(f64::INFINITY, f64::min);
        Self { low, high: products.into_iter().fold(f64::NEG_INFINITY, f64::max) }
    }

    const fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }
}

/// Bounds of the first three derivatives of a polynomial within `room` of a time.
fn derivative_bounds(polynomial: &Polynomial, at_s: f64, room: f64) -> [Range; 3] {
    let [_, c1, c2, c3, c4, c5] = polynomial.0;
    let t = at_s;
    let d1 = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)));
    let d2 = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5));
    let d3 = 6.0 * c3 + t * (24.0 * c4 + t * 60.0 * c5);
    let (d4, d5) = ((24.0 * c4 + t * 120.0 * c5).abs(), (120.0 * c5).abs());
    let w = room;
    [
        Range::around(d1, w * (d2.abs() + w * (d3.abs() / 2.0 + w * (d4 / 6.0 + w * d5 / 24.0)))),
        Range::around(d2, w * (d3.abs() + w * (d4 / 2.0 + w * d5 / 6.0))),
        Range::around(d3, w * (d4 + w * d5 / 2.0)),
    ]
}

/// A phase of a time law on an interval: in its middle, and bounds all over it.
struct LawBounds {
    middle: PathTime,
    middle_jerk: f64,
    path_s: Range,
    rate: Range,
    rate_change: Range,
    jerk: Range,
}

impl LawBounds {
    fn of(phase: &TimeLawPhase, from_s: f64, to_s: f64) -> Self {
        let (at_s, w) = (0.5 * (from_s + to_s), 0.5 * (to_s - from_s));
        let middle = phase.at(phase.from_s + at_s);
        let [_, _, _, c3, c4] = phase.path_s;
        let (middle_jerk, snap) = (6.0 * c3 + 24.0 * c4 * at_s, (24.0 * c4).abs());
        // The rate is not negative, so that the path time rises.
        let (low, high) = (phase.at(phase.from_s + from_s).path_s, phase.at(phase.from_s + to_s).path_s);
        Self {
            middle,
            middle_jerk,
            path_s: Range { low: low.min(high), high: low.max(high) },
            rate: Range::around(
                middle.rate,
                w * (middle.rate_change.abs() + w * (middle_jerk.abs() / 2.0 + w * snap / 6.0)),
            ),
            rate_change: Range::around(middle.rate_change, w * (middle_jerk.abs() + w * snap / 2.0)),
            jerk: Range::around(middle_jerk, w * snap),
        }
    }

    const fn at_middle(&self) -> [Range; 3] {
        [
            Range::point(self.middle.rate),
            Range::point(self.middle.rate_change),
            Range::point(self.middle_jerk),
        ]
    }

    const fn around(&self) -> [Range; 3] {
        [self.rate, self.rate_change, self.jerk]
    }
}

/// What an axis does: bounds by the chain rule.
struct Rates {
    velocity: Range,
    acceleration: Range,
    jerk: Range,
    /// The direction in which the path leads.
    direction: Range,
}

impl Rates {
    fn of([q1, q2, q3]: &[Range; 3], [s1, s2, s3]: &[Range; 3]) -> Self {
        let square = s1.times(*s1);
        let three = Range::point(3.0);
        Self {
            velocity: q1.times(*s1),
            acceleration: q2.times(square).plus(q1.times(*s2)),
            jerk: q3.times(square.times(*s1)).plus(three.times(q2.times(*s1).times(*s2))).plus(q1.times(*s3)),
            direction: *q1,
        }
    }

    fn keep(&self, limits: &AxisLimits) -> bool {
        let room = 1.0 + TOLERANCE;
        let AxisLimits { acceleration: up, deceleration: down, .. } = *limits;
        // How fast the velocity, with its sign, may rise and fall.
        let (rising, falling) = if self.direction.low >= 0.0 {
            (up, down)
        } else if self.direction.high <= 0.0 {
            (down, up)
        } else {
            (up.min(down), up.min(down))
        };
        self.velocity.magnitude() <= limits.velocity * room
            && self.acceleration.high <= rising * room
            && self.acceleration.low >= -falling * room
            && (limits.jerk.is_infinite() || self.jerk.magnitude() <= limits.jerk * room)
    }
}
