//! From points to polynomials, an axis at a time.
//!
//! | given | between the points |
//! | --- | --- |
//! | positions | the spline of the third degree whose velocity and acceleration are continuous |
//! | and velocities | without a jerk limit cubic Hermite: the acceleration steps at the points. With one a step of the acceleration would break it: so the acceleration at a point is the mean of the two that cubic Hermite has there, and the polynomials are of the fifth degree |
//! | and accelerations | Hermite of the fifth degree |
//!
//! Of all motions through the points, the spline has the least squared acceleration. At both ends it is given the velocity and
//! the acceleration that are wanted there, by a polynomial of the fifth degree: so a trajectory begins and ends without a step.

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
    /// Whether the acceleration must not step.
    pub is_jerk_limited: bool,
}

/// The polynomials from each point to the next, in the time since the point.
pub(super) fn interpolate(knots: &Knots<'_>) -> Vec<Polynomial> {
    match (knots.velocities, knots.accelerations) {
        (Some(velocities), Some(accelerations)) => quintics(knots, velocities, accelerations),
        (Some(velocities), None) if knots.is_jerk_limited => {
            let mut accelerations = mean_accelerations(knots, velocities);
            set_ends(&mut accelerations, knots.start.acceleration, knots.end.acceleration);
            quintics(knots, velocities, &accelerations)
        }
        (Some(velocities), None) => cubics(knots, velocities),
        (None, _) => {
            let velocities = spline_velocities(knots);
            let mut accelerations = mean_accelerations(knots, &velocities);
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

impl Interval {
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

/// At each point the mean of the accelerations of the polynomials of the third degree on both sides of it. Those of the spline
/// are the same.
fn mean_accelerations(knots: &Knots<'_>, velocities: &[f64]) -> Vec<f64> {
    let sides: Vec<(f64, f64)> = intervals(knots)
        .zip(velocities.windows(2))
        .map(|(interval, v)| interval.cubic_accelerations(v[0], v[1]))
        .collect();
    let between = sides.windows(2).map(|pair| 0.5 * (pair[0].1 + pair[1].0));
    [0.0].into_iter().chain(between).chain([0.0]).collect()
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
        }
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
        fn every_choice_goes_through_the_points_without_a_step_of_velocity_or_acceleration(
            steps in prop::collection::vec((0.01f64..2.0, -1.0f64..1.0, -1.0f64..1.0), 2..30),
            kind in 0..3,
        ) {
            let mut times = vec![0.0];
            times.extend(steps.iter().scan(0.0, |sum, (step, _, _)| { *sum += step; Some(*sum) }));
            let positions: Vec<f64> = [0.2].into_iter().chain(steps.iter().map(|(_, p, _)| *p)).collect();
            let rates: Vec<f64> = [0.0].into_iter().chain(steps.iter().map(|(_, _, v)| *v)).collect();
            let mut given = knots(&times, &positions, (kind > 0).then_some(&rates[..]));
            given.accelerations = (kind > 1).then_some(&rates[..]);
            let polynomials = interpolate(&given);
            for (index, polynomial) in polynomials.iter().enumerate() {
                let duration_s = times[index + 1] - times[index];
                let end = polynomial.state(duration_s);
                let close = |one: f64, other: f64, scale: f64| (one - other).abs() < 1e-9 * (1.0 + scale);
                prop_assert!(polynomial.state(0.0).position == positions[index]);
                prop_assert!(close(end.position, positions[index + 1], 1.0));
                let next = polynomials.get(index + 1).map_or_else(
                    || State { position: 0.0, velocity: if kind > 0 { *rates.last().unwrap() } else { 0.0 },
                        acceleration: if kind > 1 { *rates.last().unwrap() } else { 0.0 } },
                    |next| next.state(0.0),
                );
                let rate = 10.0 / duration_s;
                prop_assert!(close(end.velocity, next.velocity, rate), "{end:?} {next:?}");
                prop_assert!(close(end.acceleration, next.acceleration, rate * rate), "{end:?} {next:?}");
            }
        }
    }
}
