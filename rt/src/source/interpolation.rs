//! The motion between the points of a stream: between two points a polynomial of the fifth degree, whose velocity and
//! acceleration go on at the points without a leap.
//!
//! Velocities and accelerations that a point does not give are estimated from its neighbours, to the second order or better.
//! Whatever is given or estimated is limited by what the positions show, so that the motion between two points keeps their
//! shape: behind a step it does not overshoot, and what stands still stays. The limit of a velocity is that of Huynh ("Accurate
//! monotone cubic interpolation", SIAM J. Numer. Anal. 30, 1993), which flattens no extremum of a smooth motion.

use super::target::PositionPoint;
use crate::guard::AxisLimits;
use crate::plan::State;
use crate::time::NANOSECONDS_PER_SECOND;

/// Points that an interval depends on: its two ends, two points before it, and two behind it.
pub(super) const WINDOW: usize = 6;
/// The place of the point with which the interval begins.
pub(super) const BEGIN: usize = 2;
/// The place of the point with which it ends.
pub(super) const END: usize = BEGIN + 1;

/// How much larger than the second differences around it an acceleration that is given may be.
const ACCELERATION_ROOM: f64 = 1.5;

/// By how much of itself the change of an acceleration may change from one point to the next in a smooth motion.
const UNEVENNESS: f64 = 0.5;

/// The times of the points that an interval depends on, which are the same for every axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    /// The places that are filled: `from..to`.
    from: usize,
    to: usize,
    /// From each point to the next one, in seconds; and one divided by it.
    steps_s: [f64; WINDOW - 1],
    rates: [f64; WINDOW - 1],
    /// One divided by the time from the point before to the point behind.
    span_rates: [f64; WINDOW],
}

impl Window {
    /// The window with points at these times, in the places `from..to`. Both ends of the interval have to be among them, and
    /// no two may be at the same time.
    pub(super) fn new(stamps_ns: &[u64; WINDOW], from: usize, to: usize) -> Self {
        let seconds = |from_ns: u64, to_ns: u64| {
            to_ns.wrapping_sub(from_ns) as i64 as f64 / NANOSECONDS_PER_SECOND as f64
        };
        let [t0, t1, t2, t3, t4, t5] = *stamps_ns;
        let steps_s = [seconds(t0, t1), seconds(t1, t2), seconds(t2, t3), seconds(t3, t4), seconds(t4, t5)];
        let [h0, h1, h2, h3, h4] = steps_s;
        Self {
            from,
            to,
            steps_s,
            rates: steps_s.map(|step_s| 1.0 / step_s),
            span_rates: [0.0, 1.0 / (h0 + h1), 1.0 / (h1 + h2), 1.0 / (h2 + h3), 1.0 / (h3 + h4), 0.0],
        }
    }

    /// The same window with fewer points.
    pub(super) fn narrowed(&self, from: usize, to: usize) -> Self {
        Self { from: self.from.max(from), to: self.to.min(to), ..*self }
    }

    /// The motion of an axis that has no position at the beginning of the interval: with which it arrives at its end.
    pub(super) fn arrival(&self, end: &PositionPoint) -> Piece {
        let velocity = end.velocity.unwrap_or(0.0);
        let end = State { position: end.position, velocity, acceleration: 0.0 };
        let quintic = Quintic { duration_s: self.steps_s[BEGIN], ..Quintic::default() };
        Piece { is_within_jerk: false, quintic, end, arrival: end }
    }

    /// The motion of an axis with these points through the interval.
    pub(super) fn piece(&self, points: &[PositionPoint; WINDOW], limits: &AxisLimits) -> Piece {
        let differences = Differences::of(self, points);
        let (begin, end) = (differences.knot(BEGIN), differences.knot(END));
        let quintic = Quintic::between(&begin, &end, self.steps_s[BEGIN]);
        let velocity = minmod(end.velocity, differences.mean_velocity());
        Piece {
            is_within_jerk: quintic.highest_jerk() <= limits.jerk,
            quintic,
            end,
            arrival: State { velocity, acceleration: 0.0, ..end },
        }
    }
}

/// The motion of an axis between two points.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Piece {
    quintic: Quintic,
    is_within_jerk: bool,
    end: State,
    /// How the axis is to arrive at the end if it cannot follow.
    arrival: State,
}

impl Piece {
    /// Where the axis is to be some time after the beginning, how fast, and with what acceleration.
    ///
    /// Where the motion between two points takes more than the limits allow, it cannot be followed, and who tries to meet it
    /// overshoots behind it. There it is the motion with which the axis is to arrive at the next point. Behind the end it
    /// goes on at its velocity.
    pub(super) fn state(&self, time_s: f64, limits: &AxisLimits) -> State {
        let duration_s = self.quintic.duration_s;
        if time_s > duration_s {
            return State { acceleration: 0.0, ..self.end }.after(time_s - duration_s);
        }
        let state = self.quintic.state(time_s.max(0.0));
        let is_within = self.is_within_jerk
            && state.velocity.abs() <= limits.velocity
            && state.acceleration.abs() <= limits.acceleration.max(limits.deceleration);
        if is_within { state } else { self.arrival.after(time_s - duration_s) }
    }
}

/// The polynomial of the fifth degree from one state to another.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
struct Quintic {
    begin: f64,
    duration_s: f64,
    /// One divided by the duration.
    rate: f64,
    /// The coefficients from the first to the fifth power of the time, in units of the duration.
    coefficients: [f64; 5],
}

impl Quintic {
    fn between(begin: &State, end: &State, duration_s: f64) -> Self {
        let h = duration_s;
        let (v0, a0) = (begin.velocity * h, begin.acceleration * h * h);
        let (v1, a1) = (end.velocity * h, end.acceleration * h * h);
        let way = (end.position - begin.position) - v0 - 0.5 * a0;
        let (gain, change) = (v1 - v0 - a0, a1 - a0);
        let coefficients = [
            v0,
            0.5 * a0,
            10.0 * way - 4.0 * gain + 0.5 * change,
            -15.0 * way + 7.0 * gain - change,
            6.0 * way - 3.0 * gain + 0.5 * change,
        ];
        Self { begin: begin.position, duration_s, rate: 1.0 / h, coefficients }
    }

    /// Some time after the beginning.
    fn state(&self, time_s: f64) -> State {
        let [c1, c2, c3, c4, c5] = self.coefficients;
        let (rate, u) = (self.rate, time_s * self.rate);
        let position = u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))));
        let velocity = c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)));
        let acceleration = 2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5));
        State {
            position: self.begin + position,
            velocity: velocity * rate,
            acceleration: acceleration * rate * rate,
        }
    }

    /// The highest jerk on the way.
    fn highest_jerk(&self) -> f64 {
        let [_, _, c3, c4, c5] = self.coefficients;
        let jerk = |u: f64| (6.0 * c3 + u * (24.0 * c4 + u * 60.0 * c5)).abs();
        // Where the parabola has its vertex, if that is on the way.
        let vertex = -0.2 * c4 / c5;
        let inner = if vertex > 0.0 && vertex < 1.0 { jerk(vertex) } else { 0.0 };
        jerk(0.0).max(jerk(1.0)).max(inner) * self.rate * self.rate * self.rate
    }
}

/// The smaller one if both have the same sign, else nothing.
fn minmod(a: f64, b: f64) -> f64 {
    if a * b <= 0.0 {
        0.0
    } else if a.abs() < b.abs() {
        a
    } else {
        b
    }
}

/// The divided differences of the positions of an axis.
struct Differences<'a> {
    window: &'a Window,
    points: &'a [PositionPoint; WINDOW],
    /// From each point to the next one: velocities.
    first: [f64; WINDOW - 1],
    /// At each point between two others: half an acceleration. Elsewhere nothing is known.
    second: [Option<f64>; WINDOW],
}

impl<'a> Differences<'a> {
    fn of(window: &'a Window, points: &'a [PositionPoint; WINDOW]) -> Self {
        let mut first = [0.0; WINDOW - 1];
        for ((first, rate), ends) in first.iter_mut().zip(&window.rates).zip(points.windows(2)) {
            if let [begin, end] = ends {
                *first = (end.position - begin.position) * rate;
            }
        }
        let mut second = [None; WINDOW];
        let rates = window.span_rates.iter().enumerate().skip(1);
        for ((second, (place, rate)), steps) in second.iter_mut().skip(1).zip(rates).zip(first.windows(2)) {
            if let [before, behind] = steps
                && place > window.from
                && place + 1 < window.to
            {
                *second = Some((behind - before) * rate);
            }
        }
        Self { window, points, first, second }
    }

    fn second(&self, place: usize) -> Option<f64> {
        self.second.get(place).copied().flatten()
    }

    /// The state at one of the two ends of the interval.
    fn knot(&self, place: usize) -> State {
        let point = self.points.get(place).copied().unwrap_or_default();
        let (before, here, behind) =
            (self.second(place.wrapping_sub(1)), self.second(place), self.second(place + 1));
        let is_smooth = self.is_smooth(place);
        let velocity = match point.velocity {
            Some(given) => self.limited_velocity(place, given),
            // What is estimated from a smooth motion needs no limit.
            None if is_smooth => self.velocity_estimate(place),
            None => self.limited_velocity(place, self.velocity_estimate(place)),
        };
        let limited = |given: f64| {
            let largest = [before, here, behind].into_iter().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
            let steepest = 2.0 * ACCELERATION_ROOM * largest;
            given.clamp(-steepest, steepest)
        };
        let acceleration = match (point.acceleration, here) {
            (Some(given), _) => limited(given),
            (None, Some(here)) => {
                let estimated = self.acceleration_by_velocities(place).map_or(2.0 * here, limited);
                // One that is alone among its neighbours is a corner, or belongs to a step.
                let bound = match (before, behind) {
                    (Some(before), Some(behind)) => minmod(minmod(before, here), behind),
                    (Some(beside), None) | (None, Some(beside)) => minmod(beside, here),
                    (None, None) => 0.0,
                };
                if is_smooth { estimated } else { minmod(estimated, 4.0 * bound) }
            }
            (None, None) => 0.0,
        };
        State { position: point.position, velocity, acceleration }
    }

    /// The slopes before and behind a point.
    fn slopes(&self, place: usize) -> (Option<f64>, Option<f64>) {
        let slope = |step: usize, is_known: bool| self.first.get(step).copied().filter(|_| is_known);
        let before = slope(place.wrapping_sub(1), place > self.window.from);
        (before, slope(place, place + 1 < self.window.to))
    }

    fn step_s(&self, step: usize) -> f64 {
        self.window.steps_s.get(step).copied().unwrap_or(0.0)
    }

    /// The velocity at a point by the positions around it: of the parabola through three points, corrected by the third
    /// difference as far as it is known.
    fn velocity_estimate(&self, place: usize) -> f64 {
        match self.slopes(place) {
            (Some(before), Some(behind)) => {
                let (before_s, behind_s) = (self.step_s(place - 1), self.step_s(place));
                let parabola = (before * behind_s + behind * before_s) / (before_s + behind_s);
                let third = match (self.third(place - 1), self.third(place)) {
                    (Some(before), Some(behind)) => 0.5 * (before + behind),
                    (Some(third), None) | (None, Some(third)) => third,
                    (None, None) => 0.0,
                };
                parabola - third * before_s * behind_s
            }
            (Some(before), None) => before + self.curvature(place - 1) * self.step_s(place - 1),
            (None, Some(behind)) => behind - self.curvature(place + 1) * self.step_s(place),
            (None, None) => 0.0,
        }
    }

    /// The velocity over all points that are known.
    fn mean_velocity(&self) -> f64 {
        let steps = self.window.from..self.window.to.saturating_sub(1);
        let ways =
            self.first.iter().zip(&self.window.steps_s).map(|(slope, step_s)| (slope * step_s, *step_s));
        let (way, time_s) = ways
            .skip(steps.start)
            .take(steps.len())
            .fold((0.0, 0.0), |sum: (f64, f64), step| (sum.0 + step.0, sum.1 + step.1));
        way / time_s
    }

    /// The third difference over the step behind a point: a sixth of a jerk.
    fn third(&self, step: usize) -> Option<f64> {
        let (before, behind) = (self.second(step)?, self.second(step + 1)?);
        let span_s = self.step_s(step.wrapping_sub(1)) + self.step_s(step) + self.step_s(step + 1);
        Some((behind - before) / span_s)
    }

    /// Returns `true` if the accelerations around a point change evenly, as those of a smooth motion do that is sampled often enough.
    fn is_smooth(&self, place: usize) -> bool {
        let middle = if self.second(place + 1).is_some() { place } else { place - 1 };
        let (Some(before), Some(here), Some(behind)) =
            (self.second(middle.wrapping_sub(1)), self.second(middle), self.second(middle + 1))
        else {
            return false;
        };
        let (first, second) = (here - before, behind - here);
        (second - first).abs() <= UNEVENNESS * first.abs().max(second.abs())
    }

    /// Half the acceleration at a point next to the end of what is known, as far as its neighbour confirms it.
    fn curvature(&self, place: usize) -> f64 {
        let beside = if place == BEGIN { self.second(place - 1) } else { self.second(place + 1) };
        minmod(self.second(place).unwrap_or(0.0), beside.unwrap_or(0.0))
    }

    /// The velocity, as far as the positions confirm it.
    fn limited_velocity(&self, place: usize, velocity: f64) -> f64 {
        let (before, behind) = self.slopes(place);
        let here = self.second(place);
        let confirmed = |beside: Option<f64>| here.zip(beside).map(|(here, beside)| minmod(here, beside));
        let (left, right) =
            (confirmed(self.second(place.wrapping_sub(1))), confirmed(self.second(place + 1)));
        // What is not known on one side is taken from the other one.
        let (left, right) = (left.or(right).unwrap_or(0.0), right.or(left).unwrap_or(0.0));
        let by_before = before.map(|slope| slope + left * self.step_s(place.wrapping_sub(1)));
        let by_behind = behind.map(|slope| slope - right * self.step_s(place));
        let (slope, shown) = match (before.zip(by_before), behind.zip(by_behind)) {
            (Some((before, by_before)), Some((behind, by_behind))) => {
                (minmod(before, behind), minmod(by_before, by_behind))
            }
            (Some(_), None) => {
                let shown = self.velocity_estimate(place);
                (minmod(before.unwrap_or(0.0), shown), shown)
            }
            (None, Some(_)) => {
                let shown = self.velocity_estimate(place);
                (minmod(behind.unwrap_or(0.0), shown), shown)
            }
            (None, None) => (0.0, 0.0),
        };
        let most = (3.0 * slope.abs()).max(1.5 * shown.abs());
        minmod(velocity, most.copysign(shown))
    }

    /// The acceleration at a point by the velocities beside it, where they are given.
    fn acceleration_by_velocities(&self, place: usize) -> Option<f64> {
        let velocity = |place: usize| self.points.get(place)?.velocity;
        let (before, here, behind) = (velocity(place - 1)?, velocity(place)?, velocity(place + 1)?);
        let (Some(slope_before), Some(slope_behind)) = self.slopes(place) else { return None };
        let (before_s, behind_s) = (self.step_s(place - 1), self.step_s(place));
        // At the ends of the two cubic polynomials that have these velocities.
        let by_before = (2.0 * before + 4.0 * here - 6.0 * slope_before) / before_s;
        let by_behind = (6.0 * slope_behind - 4.0 * here - 2.0 * behind) / behind_s;
        Some((by_before * behind_s + by_behind * before_s) / (before_s + behind_s))
    }
}
