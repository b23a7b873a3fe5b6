//! From points to polynomials, an axis at a time.
//!
//! | given | between the points |
//! | --- | --- |
//! | positions | the velocities of F. N. Fritsch and R. E. Carlson, Monotone piecewise cubic interpolation, SIAM J. Numer. Anal. 17 (1980), and then as with velocities: no position is beyond those of the points on both sides of it |
//! | positions, as a spline | the velocities of the spline of the third degree, whose acceleration is continuous, and then as with velocities |
//! | and velocities | without a jerk limit cubic Hermite: the acceleration steps at the points. With one a step of the acceleration would break it: so the acceleration at a point is a mean of the two that cubic Hermite has there, and the polynomials are of the fifth degree |
//! | and accelerations | Hermite of the fifth degree |
//!
//! Of all motions through the points, the spline has the least squared acceleration, and swings beyond the points for it. At both ends a
//! motion through positions is given the velocity and the acceleration that are wanted there, by a polynomial of the fifth degree: so a
//! trajectory begins and ends without a step.
//!
//! # Accelerations that let no axis swing
//! A polynomial of the fifth degree with an acceleration that belongs to a short interval swings far in a long one beside it: the
//! square of its duration is the lever. Therefore the mean is weighted by the squares of the durations. Where the velocities let a
//! position rise or fall throughout an interval, the accelerations at its ends are bounded so that it does: an axis that stands from one
//! point to the next stands still.

use takt_rt::{Polynomial, plan::State};

/// The motion of one axis from point to point.
pub(super) struct Knots<'a> {
    /// The times of the points, each later than the one before.
    pub times_s: &'a [f64],
    /// The positions at the points.
    pub positions: &'a [f64],
    /// The velocities at the points, if they are given.
    pub velocities: Option<&'a [f64]>,
    /// The accelerations at the points, if they are given.
    pub accelerations: Option<&'a [f64]>,
    /// Velocity and acceleration at the first point.
    pub start: State,
    /// Velocity and acceleration at the last point, where they are not given.
    pub end: State,
    /// True if the acceleration must not step.
    pub is_jerk_limited: bool,
    /// Where the velocities are not given, how they are found.
    pub interpolation: Interpolation,
}

/// How a trajectory goes through positions without velocities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// No position is beyond those of the points on both sides of it.
    #[default]
    Monotone,
    /// The acceleration is as smooth and as small as possible; a position may be beyond those of the points on both sides of it.
    Spline,
}

/// The polynomials from each point to the next, in the time since the point.
pub(super) fn interpolate(knots: &Knots<'_>) -> Vec<Polynomial> {
    match (knots.velocities, knots.accelerations) {
        (Some(velocities), Some(accelerations)) => quintics(knots, velocities, accelerations),
        (Some(velocities), None) if knots.is_jerk_limited => {
            let mut accelerations = bounded_accelerations(knots, velocities);
            set_ends(&mut accelerations, knots.start.acceleration, knots.end.acceleration);
            quintics(knots, velocities, &accelerations)
        }
        (Some(velocities), None) => cubics(knots, velocities),
        (None, _) => {
            let (velocities, mut accelerations) = match knots.interpolation {
                Interpolation::Monotone => {
                    let velocities = monotone_velocities(knots);
                    let accelerations = bounded_accelerations(knots, &velocities);
                    (velocities, accelerations)
                }
                Interpolation::Spline => {
                    let velocities = spline_velocities(knots);
                    let accelerations = mean_accelerations(knots, &velocities);
                    (velocities, accelerations)
                }
            };
            set_ends(&mut accelerations, knots.start.acceleration, knots.end.acceleration);
            quintics(knots, &velocities, &accelerations)
        }
    }
}

fn set_ends(values: &mut [f64], first: f64, last: f64) {
    if let Some(value) = values.last_mut() {
        *value = last;
    }
    if let Some(value) = values.first_mut() {
        *value = first;
    }
}

/// From one point to the next.
#[derive(Clone, Copy)]
struct Interval {
    duration_s: f64,
    from: f64,
    way: f64,
}

fn intervals<'a>(knots: &Knots<'a>) -> impl Iterator<Item = Interval> + use<'a> {
    let times = knots.times_s.windows(2);
    times.zip(knots.positions.windows(2)).map(|(times, positions)| Interval {
        duration_s: times[1] - times[0],
        from: positions[0],
        way: positions[1] - positions[0],
    })
}

/// The velocities at the ends of an interval, together, by its mean velocity: up to here a polynomial of the fifth degree without
/// accelerations at the ends rises or falls throughout.
const GENTLE: f64 = 2.5;
/// Room for rounding, relative to the mean velocity.
const ROUNDING: f64 = 1e-9;

impl Interval {
    fn mean(&self) -> f64 {
        self.way / self.duration_s
    }

    /// The accelerations at both ends with which the polynomial of the fifth degree with these velocities rises or falls throughout: no
    /// coefficient of its velocity in the form of Bernstein changes the sign. No bounds where the velocities do not let it.
    fn bounds_of_accelerations(&self, first: f64, last: f64) -> (Bounds, Bounds) {
        let mean = self.mean();
        let (first, last) = (first * mean.signum(), last * mean.signum());
        let room = GENTLE * mean.abs() - first - last;
        let is_against = |velocity: f64| velocity < -ROUNDING * mean.abs();
        if [first, last, room].into_iter().any(is_against) {
            return (Bounds::NONE, Bounds::NONE);
        }
        let [first, last, room] =
            [first, last, room].map(|velocity| 4.0 * velocity.max(0.0) / self.duration_s);
        (Bounds::along(self.way, first, room), Bounds::along(self.way, room, last))
    }

    /// The accelerations at both ends of the polynomial of the third degree with these velocities there.
    fn cubic_accelerations(&self, first: f64, last: f64) -> (f64, f64) {
        let mean = self.way / self.duration_s;
        let at = |near: f64, far: f64| (6.0 * mean - 4.0 * near - 2.0 * far) / self.duration_s;
        (at(first, last), -at(last, first))
    }

    fn cubic(&self, first: f64, last: f64) -> Polynomial {
        let Self { duration_s, from, way } = *self;
        let mean = way / duration_s;
        let c2 = (3.0 * mean - 2.0 * first - last) / duration_s;
        let c3 = (first + last - 2.0 * mean) / (duration_s * duration_s);
        Polynomial([from, first, c2, c3, 0.0, 0.0])
    }

    fn quintic(&self, first: (f64, f64), last: (f64, f64)) -> Polynomial {
        let Self { duration_s: t, from, way } = *self;
        let ((v0, a0), (v1, a1)) = (first, last);
        // What is left of the way, the velocity and the acceleration at the end, each times the duration to be of one unit.
        let p = way - t * (v0 + 0.5 * a0 * t);
        let v = t * (v1 - v0 - a0 * t);
        let a = t * t * (a1 - a0);
        let c3 = 10.0 * p - 4.0 * v + 0.5 * a;
        let c4 = -15.0 * p + 7.0 * v - a;
        let c5 = 6.0 * p - 3.0 * v + 0.5 * a;
        let cube = t * t * t;
        Polynomial([from, v0, 0.5 * a0, c3 / cube, c4 / (cube * t), c5 / (cube * t * t)])
    }
}

fn cubics(knots: &Knots<'_>, velocities: &[f64]) -> Vec<Polynomial> {
    intervals(knots).zip(velocities.windows(2)).map(|(interval, v)| interval.cubic(v[0], v[1])).collect()
}

fn quintics(knots: &Knots<'_>, velocities: &[f64], accelerations: &[f64]) -> Vec<Polynomial> {
    let ends = velocities.windows(2).zip(accelerations.windows(2));
    intervals(knots)
        .zip(ends)
        .map(|(interval, (v, a))| interval.quintic((v[0], a[0]), (v[1], a[1])))
        .collect()
}

/// At each point the mean of the accelerations of the polynomials of the third degree on both sides of it, weighted by the squares of their
/// durations. Those of the spline are the same.
fn mean_accelerations(knots: &Knots<'_>, velocities: &[f64]) -> Vec<f64> {
    let sides: Vec<(f64, (f64, f64))> = intervals(knots)
        .zip(velocities.windows(2))
        .map(|(interval, v)| {
            (interval.duration_s * interval.duration_s, interval.cubic_accelerations(v[0], v[1]))
        })
        .collect();
    let between = sides.windows(2).map(|pair| {
        let ((before_weight, (_, before)), (after_weight, (after, _))) = (pair[0], pair[1]);
        (before_weight * before + after_weight * after) / (before_weight + after_weight)
    });
    [0.0].into_iter().chain(between).chain([0.0]).collect()
}

/// The mean accelerations, within the bounds of the intervals on both sides.
fn bounded_accelerations(knots: &Knots<'_>, velocities: &[f64]) -> Vec<f64> {
    let mut accelerations = mean_accelerations(knots, velocities);
    for (index, (interval, v)) in intervals(knots).zip(velocities.windows(2)).enumerate() {
        let (first, last) = interval.bounds_of_accelerations(v[0], v[1]);
        for (acceleration, bounds) in accelerations.iter_mut().skip(index).zip([first, last]) {
            *acceleration = bounds.bounded(*acceleration);
        }
    }
    accelerations
}

/// From which acceleration to which one. 0 is within them.
#[derive(Clone, Copy)]
struct Bounds {
    lowest: f64,
    highest: f64,
}

impl Bounds {
    const NONE: Self = Self { lowest: f64::NEG_INFINITY, highest: f64::INFINITY };

    /// From `-against` to `along` the direction of a way.
    fn along(way: f64, against: f64, along: f64) -> Self {
        if way < 0.0 {
            Self { lowest: -along, highest: against }
        } else {
            Self { lowest: -against, highest: along }
        }
    }

    fn bounded(self, acceleration: f64) -> f64 {
        acceleration.max(self.lowest).min(self.highest)
    }
}

/// The velocities at the points with which no cubic polynomial leaves the range of its points: 0 where the direction turns, otherwise
/// those of the parabola through three points, made smaller where they are too large for the way beside them.
fn monotone_velocities(knots: &Knots<'_>) -> Vec<f64> {
    let intervals: Vec<Interval> = intervals(knots).collect();
    let mut velocities = vec![0.0; intervals.len() + 1];
    for (velocity, pair) in velocities.iter_mut().skip(1).zip(intervals.windows(2)) {
        let (before, after) = (pair[0].mean(), pair[1].mean());
        let (h, k) = (pair[0].duration_s, pair[1].duration_s);
        *velocity = if before * after > 0.0 { (k * before + h * after) / (h + k) } else { 0.0 };
    }
    set_ends(&mut velocities, knots.start.velocity, knots.end.velocity);
    let last = intervals.len();
    for (index, interval) in intervals.iter().enumerate() {
        let most = GENTLE * interval.mean().abs();
        let (first, second) = (velocities[index].abs(), velocities[index + 1].abs());
        if first + second <= most {
            continue;
        }
        // Those at the ends are given.
        let (first, second) = match (index == 0, index + 1 == last) {
            (true, true) => (first, second),
            (true, false) => (first, (most - first).max(0.0)),
            (false, true) => ((most - second).max(0.0), second),
            (false, false) => (most * first / (first + second), most * second / (first + second)),
        };
        for (velocity, size) in velocities.iter_mut().skip(index).zip([first, second]) {
            *velocity = size.copysign(*velocity);
        }
    }
    velocities
}

/// The velocities at the points for which the acceleration is continuous there: three neighbours each make an equation, and
/// those at the ends are given.
fn spline_velocities(knots: &Knots<'_>) -> Vec<f64> {
    let intervals: Vec<Interval> = intervals(knots).collect();
    let mut velocities = vec![0.0; intervals.len() + 1];
    set_ends(&mut velocities, knots.start.velocity, knots.end.velocity);
    let last = intervals.len();
    // Forwards: each velocity as `constant - factor * next one`.
    let (mut constant, mut factor) = (knots.start.velocity, 0.0);
    let mut eliminated = Vec::with_capacity(last.saturating_sub(1));
    for pair in intervals.windows(2) {
        let (before, after) = (pair[0], pair[1]);
        let (h, k) = (before.duration_s, after.duration_s);
        let sum = 3.0 * (k * before.way / h + h * after.way / k);
        let diagonal = 2.0 * (h + k) - k * factor;
        (constant, factor) = ((sum - k * constant) / diagonal, h / diagonal);
        eliminated.push((constant, factor));
    }
    for (point, (constant, factor)) in (1..last).zip(eliminated).rev() {
        velocities[point] = constant - factor * velocities[point + 1];
    }
    velocities
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn knots<'a>(times_s: &'a [f64], positions: &'a [f64], velocities: Option<&'a [f64]>) -> Knots<'a> {
        let rest = State::default();
        Knots {
            times_s,
            positions,
            velocities,
            accelerations: None,
            start: rest,
            end: rest,
            is_jerk_limited: true,
            interpolation: Interpolation::Monotone,
        }
    }

    /// Where the motion is beyond the points on both sides of it, by most.
    fn largest_excursion(times_s: &[f64], positions: &[f64], polynomials: &[Polynomial]) -> f64 {
        let intervals = times_s.windows(2).zip(positions.windows(2)).zip(polynomials);
        let beyond = intervals.flat_map(|((times, ends), polynomial)| {
            let (lowest, highest) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            (0..=200).map(move |step| {
                let position = polynomial.state((times[1] - times[0]) * f64::from(step) / 200.0).position;
                (position - highest).max(lowest - position)
            })
        });
        beyond.fold(0.0, f64::max)
    }

    #[test]
    fn an_axis_that_waits_stands_still_and_then_begins() {
        for is_jerk_limited in [true, false] {
            for (wait_s, velocities) in [(20.0, None), (60.0, None), (10.0, Some([0.0, 0.0, 0.0]))] {
                let (times, positions) = ([0.0, wait_s, wait_s + 1.0], [0.0, 0.0, 0.3]);
                let velocities = velocities.as_ref().map(<[f64; 3]>::as_slice);
                let given = Knots { is_jerk_limited, ..knots(&times, &positions, velocities) };
                let [wait, way] = interpolate(&given)[..] else { panic!() };
                assert_eq!(wait.0, [0.0; 6], "{wait_s} s, {velocities:?}");
                assert!(largest_excursion(&times[1..], &positions[1..], &[way]) < 1e-12);
            }
        }
    }

    #[test]
    fn a_long_interval_beside_a_short_one_does_not_swing_whatever_the_velocities() {
        let (times, positions) = ([0.0, 10.0, 11.0, 21.0], [0.0, 0.01, 0.3, 0.29]);
        for velocities in [[0.0; 4], [0.0, 0.001, 0.0, 0.0], [0.0, 0.002, 0.0, 0.0]] {
            let polynomials = interpolate(&knots(&times, &positions, Some(&velocities)));
            let excursion = largest_excursion(&times, &positions, &polynomials);
            assert!(excursion < 1e-9, "{velocities:?}: {excursion}");
        }
        // These ask for an excursion by themselves: a fifth of the velocity at an end, times the duration.
        for velocities in [[0.0, -0.1, 0.2, 0.0], [0.1, 0.001, 0.001, 0.0]] {
            let polynomials = interpolate(&knots(&times, &positions, Some(&velocities)));
            let excursion = largest_excursion(&times, &positions, &polynomials);
            assert!(excursion < 0.3, "{velocities:?}: {excursion}");
        }
    }

    #[test]
    fn a_spline_is_as_smooth_as_can_be_and_may_swing() {
        let (times, positions) = ([0.0, 1.0, 2.0, 3.0], [0.0, 0.0, 1.0, 1.0]);
        let given = Knots { interpolation: Interpolation::Spline, ..knots(&times, &positions, None) };
        let swinging = largest_excursion(&times, &positions, &interpolate(&given));
        assert!((0.01..0.2).contains(&swinging), "{swinging}");
    }

    #[test]
    fn two_points_make_the_motion_of_least_jerk() {
        let [polynomial] = interpolate(&knots(&[0.0, 2.0], &[1.0, 2.0], None))[..] else { panic!() };
        let middle = polynomial.state(1.0);
        assert!((middle.position - 1.5).abs() < 1e-15 && middle.acceleration.abs() < 1e-15);
        assert!((middle.velocity - 1.875 / 2.0).abs() < 1e-15);
        assert!((polynomial.jerk(0.0) - 60.0 / 8.0).abs() < 1e-14);
    }

    #[test]
    fn given_velocities_without_a_jerk_limit_make_hermite_polynomials_of_the_third_degree() {
        let (times, positions, velocities) = ([0.0, 1.0, 3.0], [0.0, 1.0, 2.0], [0.5, -1.0, 0.25]);
        let given = Knots { is_jerk_limited: false, ..knots(&times, &positions, Some(&velocities)) };
        let polynomials = interpolate(&given);
        assert!(polynomials.iter().all(|polynomial| polynomial.0[4..] == [0.0, 0.0]));
        assert_eq!(polynomials[0].state(0.0).velocity, 0.5);
        assert_eq!(polynomials[1].state(0.0).velocity, -1.0);
        let end = polynomials[1].state(2.0);
        assert!((end.position - 2.0).abs() < 1e-15 && (end.velocity - 0.25).abs() < 1e-15);
    }

    #[test]
    fn velocities_of_a_smooth_motion_give_back_its_accelerations() {
        let times: Vec<f64> = (0..=100).map(|step| 0.01 * f64::from(step)).collect();
        let position = |t: f64| 0.3 * (1.0 - (3.0 * t).cos());
        let positions: Vec<f64> = times.iter().map(|t| position(*t)).collect();
        let velocities: Vec<f64> = times.iter().map(|t| 0.9 * (3.0 * t).sin()).collect();
        let polynomials = interpolate(&knots(&times, &positions, Some(&velocities)));
        for (time, polynomial) in times.iter().zip(&polynomials).skip(1).take(98) {
            let true_acceleration = 2.7 * (3.0 * time).cos();
            assert!((polynomial.state(0.0).acceleration - true_acceleration).abs() < 1e-3);
            assert!((polynomial.state(0.005).position - position(time + 0.005)).abs() < 1e-8);
        }
    }

    proptest! {
        #[test]
        fn a_motion_from_rest_through_positions_is_nowhere_beyond_the_points_on_both_sides_of_it(
            steps in prop::collection::vec((0.01f64..20.0, -1.0f64..1.0), 1..30),
            repeated in 0usize..40,
            is_jerk_limited in any::<bool>(),
        ) {
            let mut times = vec![0.0];
            times.extend(steps.iter().scan(0.0, |sum, (step, _)| { *sum += step; Some(*sum) }));
            let mut positions: Vec<f64> = [0.2].into_iter().chain(steps.iter().map(|(_, p)| *p)).collect();
            if let Some([first, second]) = positions.get_mut(repeated..).and_then(|rest| rest.first_chunk_mut()) {
                *second = *first;
            }
            let given = Knots { is_jerk_limited, ..knots(&times, &positions, None) };
            let excursion = largest_excursion(&times, &positions, &interpolate(&given));
            prop_assert!(excursion < 1e-9, "{excursion}");
        }

        #[test]
        fn every_choice_goes_through_the_points_without_a_step_of_velocity_or_acceleration(
            steps in prop::collection::vec((0.01f64..2.0, -1.0f64..1.0, -1.0f64..1.0), 2..30),
            kind in 0..4,
        ) {
            let mut times = vec![0.0];
            times.extend(steps.iter().scan(0.0, |sum, (step, _, _)| { *sum += step; Some(*sum) }));
            let positions: Vec<f64> = [0.2].into_iter().chain(steps.iter().map(|(_, p, _)| *p)).collect();
            let rates: Vec<f64> = [0.0].into_iter().chain(steps.iter().map(|(_, _, v)| *v)).collect();
            let mut given = knots(&times, &positions, (kind == 1 || kind == 2).then_some(&rates[..]));
            given.accelerations = (kind == 2).then_some(&rates[..]);
            given.interpolation = if kind == 3 { Interpolation::Spline } else { Interpolation::Monotone };
            let polynomials = interpolate(&given);
            for (index, polynomial) in polynomials.iter().enumerate() {
                let duration_s = times[index + 1] - times[index];
                let end = polynomial.state(duration_s);
                let close = |one: f64, other: f64, scale: f64| (one - other).abs() < 1e-9 * (1.0 + scale);
                prop_assert!(polynomial.state(0.0).position == positions[index]);
                prop_assert!(close(end.position, positions[index + 1], 1.0));
                let next = polynomials.get(index + 1).map_or_else(
                    || State { position: 0.0, velocity: if kind == 1 || kind == 2 { *rates.last().unwrap() } else { 0.0 },
                        acceleration: if kind == 2 { *rates.last().unwrap() } else { 0.0 } },
                    |next| next.state(0.0),
                );
                let rate = 10.0 / duration_s;
                prop_assert!(close(end.velocity, next.velocity, rate), "{end:?} {next:?}");
                prop_assert!(close(end.acceleration, next.acceleration, rate * rate), "{end:?} {next:?}");
            }
        }
    }
}
