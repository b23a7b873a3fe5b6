//! Trajectories: points with times, checked as a whole before they begin, and carried out exactly.
//!
//! [`Trajectory::new`] makes polynomials from point to point and checks every one of them, by its exact extrema, against every
//! limit of its axis. What passes is handed to the real-time thread, which only samples it. All of this is computation without
//! input and output, on an ordinary thread.
//!
//! ```
//! use takt::trajectory::{Trajectory, TrajectoryConditions, TrajectoryPoint};
//! use takt_rt::{AxisLimits, plan::State};
//!
//! let limits = [AxisLimits {
//!     position_min: -3.0, position_max: 3.0, velocity: 2.0, acceleration: 8.0, deceleration: 8.0, jerk: 100.0, torque: 40.0,
//! }];
//! let start = [State::rest(0.0)];
//! let conditions = TrajectoryConditions { start: &start, limits: &limits, period_s: 0.001 };
//! let point = |time_s, position| TrajectoryPoint { time_s, positions: vec![position], ..Default::default() };
//! let trajectory = Trajectory::new(&[point(1.0, 0.5), point(2.0, 0.2)], &conditions).unwrap();
//! assert_eq!(trajectory.duration_s(), 2.0);
//! let too_fast = Trajectory::new(&[point(0.1, 0.5)], &conditions).unwrap_err();
//! assert!(too_fast.to_string().starts_with("point 0, axis 0: "), "{too_fast}");
//! ```

mod check;
mod error;
mod extrema;
mod interpolation;
mod passing;
mod point;
#[cfg(test)]
mod tests;
mod time_law;
mod waypoints;

use std::sync::Arc;

use takt_rt::plan::State;
use takt_rt::{AxisLimits, Polynomial, TimeLawPhase, TrajectorySample, TrajectoryView, braking_distance};

use interpolation::Knots;

pub(crate) use error::axis_name;
pub use error::{BrokenLimit, PointQuantity, TrajectoryError};
pub use interpolation::Interpolation;
pub use point::{AxisPoints, TrajectoryPoint};
pub use time_law::RateError;

/// By how much a first point at the time 0 may be off the present set-point (rad or m): it is taken for the same.
const SAME_POSITION: f64 = 1e-6;
/// The same for its velocity, relative to the limit; and for its acceleration.
const SAME_RATE: f64 = 1e-6;
/// Largest excursion of the way from rest to the first point, in multiples of the shortest run-up: polynomials do not use the limits to the
/// full.
const EXCURSION: f64 = 2.0;
/// Excursion that is allowed beyond that, in rad (m), and as a share of the range of the axis.
const SMALL_EXCURSION: f64 = 0.01;
const SMALL_SHARE: f64 = 0.01;

/// What a trajectory has to begin from and to keep, an axis each.
#[derive(Clone, Copy, Debug)]
pub struct TrajectoryConditions<'a> {
    /// The set-points when it begins.
    pub start: &'a [State],
    /// The limits.
    pub limits: &'a [AxisLimits],
    /// The period of the cycle, in seconds.
    pub period_s: f64,
}

/// The way of every axis from point to point. It goes on behind the last one at the velocity there.
#[derive(Clone, Debug, Default, PartialEq, bitcode::Encode, bitcode::Decode)]
struct Path {
    axes: usize,
    times_s: Vec<f64>,
    /// For each point a polynomial of each axis.
    polynomials: Vec<Polynomial>,
    /// For each of them the point, of those that were given, to which it leads.
    points: Vec<usize>,
}

/// A trajectory that keeps every limit.
#[derive(Clone, Debug, PartialEq, bitcode::Encode, bitcode::Decode)]
pub struct Trajectory {
    path: Arc<Path>,
    law: Vec<TimeLawPhase>,
    duration_s: f64,
}

impl Trajectory {
    /// A trajectory through these points, from the present set-points.
    ///
    /// A first point at the time 0 must be where the axes are. With a later one the trajectory goes there first, from the present
    /// position, velocity and acceleration. An axis at rest at this point waits there, and one at rest elsewhere leaves both positions by no
    /// more than twice the shortest run-up to the velocity of the point and 0.01 rad (m) or a hundredth of its range: a first point that is
    /// passed in motion is refused if the axis would swing farther back before it ([`TrajectoryError::Excursion`]). Without velocities the
    /// trajectory ends at rest, and is nowhere beyond the points on both sides of it
    /// ([`Interpolation::Monotone`]).
    ///
    /// # Errors
    /// The first thing that is wrong, with the point and the axis: see [`TrajectoryError`].
    pub fn new(
        points: &[TrajectoryPoint],
        conditions: &TrajectoryConditions<'_>,
    ) -> Result<Self, TrajectoryError> {
        Self::interpolated(points, Interpolation::default(), conditions)
    }

    /// The same, with a choice of how it goes through positions without velocities.
    ///
    /// # Errors
    /// As [`Trajectory::new`].
    pub fn interpolated(
        points: &[TrajectoryPoint],
        interpolation: Interpolation,
        conditions: &TrajectoryConditions<'_>,
    ) -> Result<Self, TrajectoryError> {
        let times_s: Vec<f64> = points.iter().map(|point| point.time_s).collect();
        let columns = point::columns(points, conditions.limits.len())?;
        Self::of_axes(&times_s, &columns, interpolation, conditions)
    }

    /// The same, with the points of each axis beside each other. So one axis may have velocities, and another one none.
    ///
    /// # Errors
    /// As [`Trajectory::new`].
    pub fn of_axes(
        times_s: &[f64],
        axes: &[AxisPoints],
        interpolation: Interpolation,
        conditions: &TrajectoryConditions<'_>,
    ) -> Result<Self, TrajectoryError> {
        check_times(times_s)?;
        check_values(times_s.len(), axes)?;
        let is_from_here = times_s.first().is_some_and(|first_s| *first_s > 0.0);
        let knot_times: Vec<f64> =
            is_from_here.then_some(0.0).into_iter().chain(times_s.iter().copied()).collect();
        let states = axes.iter().zip(conditions.start).zip(conditions.limits).enumerate();
        let mut columns = Vec::with_capacity(axes.len());
        for (axis, ((points, start), limits)) in states {
            let points = if is_from_here {
                with_start(points, start)
            } else {
                check_start(axis, points, start, limits)?;
                continued(points, start)
            };
            columns.push(points);
        }
        let first = usize::from(is_from_here);
        check_points(&knot_times, &columns, conditions.limits, first)?;
        let of_axes: Vec<_> = columns
            .iter()
            .zip(conditions.start)
            .zip(conditions.limits)
            .map(|((points, start), limits)| polynomials(&knot_times, points, interpolation, start, limits))
            .collect();
        let path = Path::new(&knot_times, &of_axes, first);
        path.check(conditions.limits)?;
        for (axis, (points, limits)) in columns.iter().zip(conditions.limits).enumerate() {
            check_end(axis, points, limits, conditions.period_s)?;
        }
        if is_from_here {
            path.check_way_to_first_point(&columns, interpolation, conditions)?;
        }
        Ok(Self::as_written(path))
    }

    fn as_written(path: Path) -> Self {
        let duration_s = path.duration_s();
        Self { path: Arc::new(path), law: vec![TimeLawPhase::constant(0.0, 0.0, 1.0)], duration_s }
    }

    /// The time to the last point, in seconds; infinite if the trajectory pauses.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The time of the last point on the path, in seconds: the duration at the rate 1.
    pub fn path_duration_s(&self) -> f64 {
        self.path.duration_s()
    }

    /// The number of axes.
    pub fn axes(&self) -> usize {
        self.path.axes
    }

    /// Returns `true` if an axis ever leaves its first position.
    pub fn moves(&self, axis: usize) -> bool {
        let stays = |polynomial: &Polynomial| polynomial.0[1..].iter().all(|coefficient| *coefficient == 0.0);
        !self.path.polynomials.iter().skip(axis).step_by(self.path.axes.max(1)).all(stays)
    }

    /// As the real-time thread sees it.
    pub fn view(&self) -> TrajectoryView<'_> {
        TrajectoryView {
            times_s: &self.path.times_s,
            polynomials: &self.path.polynomials,
            axes: self.path.axes,
            law: &self.law,
            duration_s: self.duration_s,
        }
    }

    /// Where the axes are to be so long after the beginning.
    pub fn sample(&self, at_s: f64) -> TrajectorySample {
        self.view().sample(at_s)
    }

    /// Returns `true` if there is a polynomial for each axis at each time. A trajectory that was decoded from bytes need not be such.
    pub(crate) fn is_whole(&self) -> bool {
        let Path { axes, times_s, polynomials, .. } = &*self.path;
        times_s.len().checked_mul(*axes) == Some(polynomials.len())
    }
}

impl Path {
    /// A path of these axes. Behind the last point it goes on as it is there. `first` is the place of the first point that was given:
    /// 1 where the path begins before it, where the axes are.
    fn new(times_s: &[f64], of_axes: &[(Vec<Polynomial>, Polynomial)], first: usize) -> Self {
        let mut path = Self { axes: of_axes.len(), ..Self::default() };
        for (index, time_s) in times_s.iter().enumerate() {
            let polynomials = of_axes.iter().map(|(ways, end)| *ways.get(index).unwrap_or(end));
            path.push(*time_s, (index + 1).min(times_s.len() - 1) - first, polynomials);
        }
        path
    }

    /// Goes on from this time on along these polynomials, to this one of the points that were given.
    fn push(&mut self, from_s: f64, point: usize, polynomials: impl Iterator<Item = Polynomial>) {
        self.times_s.push(from_s);
        self.points.push(point);
        self.polynomials.extend(polynomials);
    }

    /// The point, of those that were given, to which a polynomial leads.
    fn point(&self, index: usize) -> usize {
        self.points.get(index).copied().unwrap_or(0)
    }

    fn duration_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or(0.0)
    }

    /// Checks every polynomial.
    fn check(&self, limits: &[AxisLimits]) -> Result<(), TrajectoryError> {
        for (index, times_s) in self.times_s.windows(2).enumerate() {
            let polynomials = self.polynomials.iter().skip(index * self.axes);
            for (axis, (polynomial, limits)) in polynomials.zip(limits).enumerate() {
                if let Some(found) = check::violation(polynomial, times_s[1] - times_s[0], limits) {
                    let check::Violation { broken, time_s, value, limit } = found;
                    let point = self.point(index);
                    let time_s = times_s[0] + time_s;
                    return Err(TrajectoryError::Limit { point, axis, broken, time_s, value, limit });
                }
            }
        }
        Ok(())
    }

    /// Checks that the way of an axis at rest to the first point turns round no farther out than the run-up to the velocity of that point
    /// needs. The excursion of a polynomial grows with the time before the point. A spline may swing: that is what it is chosen for.
    fn check_way_to_first_point(
        &self,
        axes: &[AxisPoints],
        interpolation: Interpolation,
        conditions: &TrajectoryConditions<'_>,
    ) -> Result<(), TrajectoryError> {
        let duration_s = self.times_s.get(1).copied().unwrap_or(0.0);
        let ways = axes.iter().zip(&self.polynomials).zip(conditions.start.iter().zip(conditions.limits));
        for (axis, ((points, polynomial), (start, limits))) in ways.enumerate() {
            if points.velocities.is_none() && interpolation == Interpolation::Spline {
                continue;
            }
            // An axis that takes over from a motion that is about to end goes as that motion asks.
            let is_at_rest = start.velocity.abs() <= SAME_RATE * limits.velocity
                && start.acceleration.abs() <= SAME_RATE * limits.acceleration;
            if !is_at_rest {
                continue;
            }
            let Some(found) = check::excursion(polynomial, duration_s) else { continue };
            let velocity = polynomial.state(duration_s).velocity;
            if found.distance() > largest_excursion(velocity, limits) {
                let check::Excursion { time_s, position, nearest } = found;
                let point = self.point(0);
                return Err(TrajectoryError::Excursion { point, axis, time_s, position, nearest, velocity });
            }
        }
        Ok(())
    }
}

/// Returns the largest distance of the way from rest to a point that is passed at this velocity from both positions. A run-up is a
/// stop that is played backwards.
fn largest_excursion(velocity: f64, limits: &AxisLimits) -> f64 {
    let AxisLimits { acceleration, deceleration, .. } = *limits;
    let backwards = AxisLimits { acceleration: deceleration, deceleration: acceleration, ..*limits };
    let run_up = braking_distance(&backwards, velocity.abs(), 0.0);
    let small = SMALL_EXCURSION.min(SMALL_SHARE * (limits.position_max - limits.position_min));
    EXCURSION * run_up + small
}

fn check_times(times_s: &[f64]) -> Result<(), TrajectoryError> {
    let mut previous: Option<f64> = None;
    for (point, time_s) in times_s.iter().copied().enumerate() {
        if !(time_s.is_finite() && time_s >= 0.0) {
            return Err(TrajectoryError::Time { point, time_s });
        }
        if let Some(previous_s) = previous.filter(|previous_s| time_s <= *previous_s) {
            return Err(TrajectoryError::TimeOrder { point, time_s, previous_s });
        }
        previous = Some(time_s);
    }
    previous.map(drop).ok_or(TrajectoryError::NoPoint)
}

/// Checks that each point has a finite value of each kind that its axis has, the first point first.
fn check_values(points: usize, axes: &[AxisPoints]) -> Result<(), TrajectoryError> {
    for point in 0..points {
        for (axis, of) in axes.iter().enumerate() {
            let has_velocities = of.velocities.is_some() || of.accelerations.is_some();
            for (quantity, values, is_needed) in [
                (PointQuantity::Position, Some(&of.positions), true),
                (PointQuantity::Velocity, of.velocities.as_ref(), has_velocities),
                (PointQuantity::Acceleration, of.accelerations.as_ref(), of.accelerations.is_some()),
            ] {
                match values.and_then(|values| values.get(point)) {
                    None if is_needed => return Err(TrajectoryError::Missing { point, axis, quantity }),
                    Some(value) if !value.is_finite() => {
                        return Err(TrajectoryError::NotFinite { point, axis, quantity, value: *value });
                    }
                    _ => {}
                }
            }
        }
    }
    Ok(())
}

/// Checks what the points say by themselves, and the mean speeds between them: what breaks a limit there breaks it however one
/// goes from point to point, and is the reason for what polynomials do around it. `first` is that of the path.
fn check_points(
    times_s: &[f64],
    axes: &[AxisPoints],
    limits: &[AxisLimits],
    first: usize,
) -> Result<(), TrajectoryError> {
    for (index, time_s) in times_s.iter().copied().enumerate().skip(first) {
        for (axis, (points, limits)) in axes.iter().zip(limits).enumerate() {
            let of =
                |values: &Option<Vec<f64>>| values.as_ref().and_then(|values| values.get(index).copied());
            let position = points.positions.get(index).copied().unwrap_or(0.0);
            let before = index
                .checked_sub(1)
                .and_then(|before| Some((times_s.get(before)?, points.positions.get(before)?)));
            let speed = before.map(|(before_s, before)| (position - before) / (time_s - before_s));
            let found = check::position_beyond(position, limits)
                .or_else(|| check::beyond(of(&points.velocities)?, BrokenLimit::Velocity, limits.velocity))
                .or_else(|| check::beyond(speed?, BrokenLimit::Velocity, limits.velocity))
                .or_else(|| {
                    let steepest = limits.acceleration.max(limits.deceleration);
                    check::beyond(of(&points.accelerations)?, BrokenLimit::Acceleration, steepest)
                });
            if let Some((broken, value, limit)) = found {
                let point = index - first;
                return Err(TrajectoryError::Limit { point, axis, broken, time_s, value, limit });
            }
        }
    }
    Ok(())
}

/// The points of an axis behind its present state.
fn with_start(points: &AxisPoints, start: &State) -> AxisPoints {
    let behind = |first: f64, values: &[f64]| [first].into_iter().chain(values.iter().copied()).collect();
    AxisPoints {
        positions: behind(start.position, &points.positions),
        velocities: points.velocities.as_ref().map(|values| behind(start.velocity, values)),
        accelerations: points.accelerations.as_ref().map(|values| behind(start.acceleration, values)),
    }
}

/// The points of an axis, the first of which is its present state.
fn continued(points: &AxisPoints, start: &State) -> AxisPoints {
    let mut points = points.clone();
    let set = |values: &mut Vec<f64>, first: f64| {
        if let Some(value) = values.first_mut() {
            *value = first;
        }
    };
    set(&mut points.positions, start.position);
    points.velocities.iter_mut().for_each(|values| set(values, start.velocity));
    points.accelerations.iter_mut().for_each(|values| set(values, start.acceleration));
    points
}

/// Checks that the first point is the present state.
fn check_start(
    axis: usize,
    points: &AxisPoints,
    start: &State,
    limits: &AxisLimits,
) -> Result<(), TrajectoryError> {
    let first = |values: &Option<Vec<f64>>, otherwise: f64| {
        values.as_ref().and_then(|values| values.first().copied()).unwrap_or(otherwise)
    };
    let steepest = limits.acceleration.max(limits.deceleration);
    // Without a limit of the jerk the acceleration may step.
    let same_acceleration = if limits.jerk.is_finite() { SAME_RATE * steepest } else { 2.0 * steepest };
    let position = points.positions.first().copied().unwrap_or(start.position);
    for (quantity, given, present, same) in [
        (PointQuantity::Position, position, start.position, SAME_POSITION),
        (
            PointQuantity::Velocity,
            first(&points.velocities, start.velocity),
            start.velocity,
            SAME_RATE * limits.velocity,
        ),
        (
            PointQuantity::Acceleration,
            first(&points.accelerations, start.acceleration),
            start.acceleration,
            same_acceleration,
        ),
    ] {
        if (given - present).abs() > same {
            return Err(TrajectoryError::Start { axis, quantity, given, present });
        }
    }
    Ok(())
}

/// Checks that the last point is at rest, or has room for a stop behind it: the point is passed up to a cycle before the stop
/// begins.
fn check_end(
    axis: usize,
    points: &AxisPoints,
    limits: &AxisLimits,
    period_s: f64,
) -> Result<(), TrajectoryError> {
    let last =
        |values: &Option<Vec<f64>>| values.as_ref().and_then(|values| values.last().copied()).unwrap_or(0.0);
    let (velocity, acceleration) = (last(&points.velocities), last(&points.accelerations));
    if acceleration != 0.0 && limits.jerk.is_finite() {
        return Err(TrajectoryError::EndAcceleration { axis, acceleration });
    }
    if velocity == 0.0 {
        return Ok(());
    }
    let distance = velocity.abs() * period_s + braking_distance(limits, velocity.abs(), 0.0);
    let rest = points.positions.last().copied().unwrap_or(0.0) + distance.copysign(velocity);
    if limits.contain(rest) {
        return Ok(());
    }
    let limit = if velocity > 0.0 { limits.position_max } else { limits.position_min };
    Err(TrajectoryError::NoRoomToStop { axis, rest, limit })
}

/// The polynomials of an axis between its points, and the one behind them.
fn polynomials(
    times_s: &[f64],
    points: &AxisPoints,
    interpolation: Interpolation,
    start: &State,
    limits: &AxisLimits,
) -> (Vec<Polynomial>, Polynomial) {
    let ways = interpolation::interpolate(&Knots {
        times_s,
        positions: &points.positions,
        velocities: points.velocities.as_deref(),
        accelerations: points.accelerations.as_deref(),
        start: *start,
        end: State::default(),
        is_jerk_limited: limits.jerk.is_finite(),
        interpolation,
    });
    let velocity = points.velocities.as_ref().and_then(|values| values.last().copied()).unwrap_or(0.0);
    let position = points.positions.last().copied().unwrap_or(start.position);
    (ways, Polynomial::linear(position, velocity))
}
