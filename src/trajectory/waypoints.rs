//! Through waypoints without stopping: where the axes pass is given, and when is found here.
//!
//! The path is the spline of the third degree through the waypoints, with a free point in the first and in the last interval: so
//! it begins and ends at rest without acceleration, and the jerk is constant between points. The times are found by iteration:
//! an interval on which an axis is beyond one of its limits gets longer, and one on which all are far from theirs gets shorter, until
//! on each of them some axis is at some limit. In the end all times are scaled together, so that the limits are kept exactly.

use takt_rt::{AxisLimits, Polynomial};

use super::check;
use super::error::TrajectoryError;
use super::{Path, Trajectory, TrajectoryConditions};

/// Rounds in which the times are made even.
const ROUNDS: usize = 150;
/// How often a point is added in the middle of each interval, after which the times are made even again: so the speed along the path
/// has room to rise, stay and fall between two waypoints.
const REFINEMENTS: usize = 3;
/// The power of an interval's use of its limits by which it gets longer or shorter in a round, and how much at most.
const DAMPING: f64 = 0.5;
const STEP: f64 = 1.5;
/// The part of an interval at whose end the free point of the first and of the last interval lies at first.
const FREE_POINT: f64 = 0.5;
/// So near to one another waypoints are the same, in rad (m).
const SAME: f64 = 1e-9;

impl Trajectory {
    /// A trajectory from rest where the axes are through these waypoints, without stopping, to rest at the last one. Each has one
    /// position (rad or m) for each axis. It is as fast as a spline through them can be within all limits.
    ///
    /// # Errors
    /// [`TrajectoryError`], with the waypoint as the point: a wrong number of values, a waypoint beyond a position limit, or a spline
    /// that leads beyond one between waypoints.
    pub fn through(
        waypoints: &[Vec<f64>],
        conditions: &TrajectoryConditions<'_>,
    ) -> Result<Self, TrajectoryError> {
        let axes = conditions.limits.len();
        let mut positions: Vec<Vec<f64>> =
            vec![conditions.start.iter().map(|state| state.position).collect()];
        let mut numbers = vec![0];
        for (point, waypoint) in waypoints.iter().enumerate() {
            check_waypoint(point, waypoint, axes)?;
            let is_new =
                |last: &Vec<f64>| last.iter().zip(waypoint).any(|(last, next)| (last - next).abs() > SAME);
            if positions.last().is_some_and(is_new) {
                positions.push(waypoint.clone());
                numbers.push(point);
            }
        }
        if waypoints.is_empty() {
            return Err(TrajectoryError::NoPoint);
        }
        for (axis, (start, limits)) in conditions.start.iter().zip(conditions.limits).enumerate() {
            for (value, quantity) in [
                (start.velocity, super::PointQuantity::Velocity),
                (start.acceleration, super::PointQuantity::Acceleration),
            ] {
                if value != 0.0 {
                    return Err(TrajectoryError::Start { axis, quantity, given: 0.0, present: value });
                }
            }
            check_inside(&positions, &numbers, axis, limits)?;
        }
        if positions.len() == 1 {
            let standing: Vec<_> = conditions
                .start
                .iter()
                .map(|state| (vec![], Polynomial::linear(state.position, 0.0)))
                .collect();
            return Ok(Self::as_written(Path::new(vec![0.0], &standing, 1)));
        }
        let mut durations =
            even_durations(&positions, first_durations(&positions, conditions.limits), conditions.limits);
        for _ in 0..REFINEMENTS {
            (positions, durations) = refined(&positions, &durations);
            durations = even_durations(&positions, durations, conditions.limits);
        }
        let path = path(&positions, &durations);
        // Only the position can be beyond its limit still, which no time mends.
        path.check(conditions.limits).map_err(|error| named(error, &numbers))?;
        Ok(Self::as_written(path))
    }
}

fn check_waypoint(point: usize, waypoint: &[f64], axes: usize) -> Result<(), TrajectoryError> {
    let quantity = super::PointQuantity::Position;
    if waypoint.len() != axes {
        return Err(TrajectoryError::Count { point, quantity, given: waypoint.len(), axes });
    }
    match waypoint.iter().enumerate().find(|(_, value)| !value.is_finite()) {
        Some((axis, value)) => Err(TrajectoryError::NotFinite { point, axis, quantity, value: *value }),
        None => Ok(()),
    }
}

fn check_inside(
    positions: &[Vec<f64>],
    numbers: &[usize],
    axis: usize,
    limits: &AxisLimits,
) -> Result<(), TrajectoryError> {
    for (waypoint, point) in positions.iter().zip(numbers) {
        if let Some((broken, value, limit)) =
            waypoint.get(axis).and_then(|position| check::position_beyond(*position, limits))
        {
            return Err(TrajectoryError::Limit { point: *point, axis, broken, time_s: 0.0, value, limit });
        }
    }
    Ok(())
}

/// The error of a path with its free points, by the waypoint that it leads to.
fn named(error: TrajectoryError, numbers: &[usize]) -> TrajectoryError {
    match error {
        TrajectoryError::Limit { point, axis, broken, time_s, value, limit } => {
            // Points of the path before it was refined: start, free point, waypoints but the last, free point, last waypoint.
            let waypoint = (point >> REFINEMENTS).clamp(1, numbers.len() - 1);
            let point = numbers.get(waypoint).copied().unwrap_or(0);
            TrajectoryError::Limit { point, axis, broken, time_s, value, limit }
        }
        error => error,
    }
}

/// Durations of the intervals, with those of the free points, on each of which some axis is at some limit.
fn even_durations(positions: &[Vec<f64>], first: Vec<f64>, limits: &[AxisLimits]) -> Vec<f64> {
    let mut durations = first;
    let mut best = (f64::INFINITY, durations.clone());
    for _ in 0..ROUNDS {
        let uses = uses(&path(positions, &durations), limits);
        let most = uses.iter().fold(0.0, |most: f64, used| most.max(*used));
        // As fast as all of it can be with these proportions.
        let scaled: Vec<f64> = durations.iter().map(|duration_s| duration_s * most).collect();
        let total_s: f64 = scaled.iter().sum();
        if total_s < best.0 {
            best = (total_s, scaled);
        }
        for (duration_s, used) in durations.iter_mut().zip(uses) {
            *duration_s *= used.powf(DAMPING).clamp(1.0 / STEP, STEP);
        }
    }
    best.1
}

/// The same path with a point more in the middle of each interval.
fn refined(positions: &[Vec<f64>], durations: &[f64]) -> (Vec<Vec<f64>>, Vec<f64>) {
    let path = path(positions, durations);
    let mut all: Vec<Vec<f64>> = Vec::with_capacity(2 * durations.len() + 1);
    for (point, duration_s) in durations.iter().enumerate() {
        let polynomials = || path.polynomials.iter().skip(point * path.axes).take(path.axes);
        all.push(polynomials().map(|polynomial| polynomial.0[0]).collect());
        all.push(polynomials().map(|polynomial| polynomial.state(0.5 * duration_s).position).collect());
    }
    all.extend(positions.last().cloned());
    // The second and the last but one are free.
    all.remove(1);
    all.remove(all.len() - 2);
    (all, durations.iter().flat_map(|duration_s| [0.5 * duration_s; 2]).collect())
}

/// By the mean speeds, with a free point in the first and in the last interval.
fn first_durations(positions: &[Vec<f64>], limits: &[AxisLimits]) -> Vec<f64> {
    let between = positions.windows(2).map(|pair| {
        let axes = pair[0].iter().zip(&pair[1]).zip(limits);
        let slowest = axes.map(|((from, to), limits)| {
            let way = (to - from).abs();
            (2.0 * way / limits.velocity)
                .max(2.0 * (way / limits.acceleration.min(limits.deceleration)).sqrt())
        });
        slowest.fold(1e-3, f64::max)
    });
    let mut durations: Vec<f64> = between.collect();
    if let [only] = durations[..] {
        return vec![only * 0.25, only * 0.5, only * 0.25];
    }
    if let Some(last) = durations.pop() {
        durations.extend([last * (1.0 - FREE_POINT), last * FREE_POINT]);
    }
    let first = durations.remove(0);
    durations.splice(0..0, [first * FREE_POINT, first * (1.0 - FREE_POINT)]);
    durations
}

/// How much of its limits each interval uses: 1 if some axis is at some limit, and none is beyond one. All durations times this number
/// bring it to 1.
fn uses(path: &Path, limits: &[AxisLimits]) -> Vec<f64> {
    let intervals = path.times_s.windows(2).enumerate();
    intervals
        .map(|(point, times_s)| {
            let axes = path.polynomials.iter().skip(point * path.axes).zip(limits);
            axes.map(|(polynomial, limits)| {
                check::scale_to_limits(polynomial, times_s[1] - times_s[0], limits)
            })
            .fold(0.0, f64::max)
        })
        .collect()
}

/// The spline with these durations.
fn path(positions: &[Vec<f64>], durations: &[f64]) -> Path {
    let mut times_s = vec![0.0];
    let mut sum_s = 0.0;
    for duration_s in durations {
        sum_s += duration_s;
        times_s.push(sum_s);
    }
    let axes = positions.first().map_or(0, Vec::len);
    let of_axes: Vec<(Vec<Polynomial>, Polynomial)> = (0..axes)
        .map(|axis| {
            let column: Vec<f64> = positions.iter().filter_map(|point| point.get(axis).copied()).collect();
            let last = column.last().copied().unwrap_or(0.0);
            (spline(&column, durations), Polynomial::linear(last, 0.0))
        })
        .collect();
    Path::new(times_s, &of_axes, 1)
}

/// The spline of the third degree through these positions, at rest without acceleration at both ends. There is one more duration than
/// intervals between positions at each end: that of the free point.
fn spline(positions: &[f64], durations: &[f64]) -> Vec<Polynomial> {
    let (h, n) = (durations, durations.len());
    // Positions at all points; those of the free ones follow from the accelerations there.
    let mut q = vec![0.0; n + 1];
    q[0] = positions[0];
    q[2..n - 1].copy_from_slice(&positions[1..positions.len() - 1]);
    q[n] = positions[positions.len() - 1];
    // For each inner point `lower a(k-1) + diagonal a(k) + upper a(k+1) = right`. The free positions are q(1) = q(0) + h(0)²/6 a(1),
    // and the same at the end.
    let mut rows: Vec<[f64; 4]> = Vec::with_capacity(n - 1);
    for k in 1..n {
        let (before, after) = (h[k - 1], h[k]);
        let known = |index: usize| match index {
            1 => q[0],
            index if index == n - 1 => q[n],
            index => q[index],
        };
        let right = 6.0 * ((known(k + 1) - known(k)) / after - (known(k) - known(k - 1)) / before);
        rows.push([before, 2.0 * (before + after), after, right]);
    }
    // What the free positions add to the equations: each appears in its own and in the one beside it.
    let (first, last) = (h[0] * h[0], h[n - 1] * h[n - 1]);
    let count = rows.len();
    rows[0][1] += first * (1.0 / h[0] + 1.0 / h[1]);
    rows[count - 1][1] += last * (1.0 / h[n - 1] + 1.0 / h[n - 2]);
    rows[1][0] -= first / h[1];
    rows[count - 2][2] -= last / h[n - 2];
    let accelerations = solved(&rows);
    let at = |k: usize| if k == 0 || k == n { 0.0 } else { accelerations[k - 1] };
    q[1] = q[0] + first / 6.0 * at(1);
    q[n - 1] = q[n] + last / 6.0 * at(n - 1);
    (0..n)
        .map(|k| {
            let (a0, a1) = (at(k), at(k + 1));
            let velocity = (q[k + 1] - q[k]) / h[k] - h[k] * (2.0 * a0 + a1) / 6.0;
            Polynomial([q[k], velocity, a0 / 2.0, (a1 - a0) / (6.0 * h[k]), 0.0, 0.0])
        })
        .collect()
}

/// Solves equations of three neighbours each: lower, diagonal, upper, right side.
fn solved(rows: &[[f64; 4]]) -> Vec<f64> {
    let mut eliminated: Vec<(f64, f64)> = Vec::with_capacity(rows.len());
    let (mut factor, mut constant) = (0.0, 0.0);
    for [lower, diagonal, upper, right] in rows {
        let pivot = diagonal - lower * factor;
        (factor, constant) = (upper / pivot, (right - lower * constant) / pivot);
        eliminated.push((factor, constant));
    }
    let mut values = vec![0.0; rows.len()];
    let mut next = 0.0;
    for (value, (factor, constant)) in values.iter_mut().zip(eliminated).rev() {
        next = constant - factor * next;
        *value = next;
    }
    values
}
