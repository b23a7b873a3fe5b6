//! Through waypoints without stopping: where the axes pass is given, and when is found here.
//!
//! [`Passing`] finds the velocities and accelerations at the waypoints, and the planner finds the fastest motion from one to the next.
//! Its profiles have phases of constant jerk. So the path is made of polynomials of the third degree, which begin wherever a phase of
//! any axis does.

use takt_rt::plan::Profile;
use takt_rt::{AxisLimits, Polynomial};

use super::check;
use super::error::TrajectoryError;
use super::passing::{Motion, Passing, Unreachable};
use super::{Path, PointQuantity, Trajectory, TrajectoryConditions};

/// So near to one another waypoints are the same, in rad (m).
const SAME: f64 = 1e-9;
/// So near to one another the phases of two axes begin together, in seconds.
const TOGETHER_S: f64 = 1e-12;

impl Trajectory {
    /// A trajectory from the present state of the axes through these waypoints, without stopping, to rest at the last one. Each has one
    /// position (rad or m) for each axis.
    ///
    /// It keeps all limits, and takes nearly the shortest time in which that is possible: a local search finds how the waypoints are
    /// passed. Thirty waypoints of six axes take a tenth of a second to plan. The smaller one of the limits of acceleration and
    /// deceleration holds for both.
    ///
    /// # Errors
    /// [`TrajectoryError`], with the waypoint as the point: a wrong number of values, a waypoint beyond a position limit, or one that cannot
    /// be reached from the present motion within the limits.
    pub fn through(
        waypoints: &[Vec<f64>],
        conditions: &TrajectoryConditions<'_>,
    ) -> Result<Self, TrajectoryError> {
        let (start, limits) = (conditions.start, conditions.limits);
        if waypoints.is_empty() {
            return Err(TrajectoryError::NoPoint);
        }
        for (point, waypoint) in waypoints.iter().enumerate() {
            check_waypoint(point, waypoint, limits)?;
        }
        let different = different(waypoints, conditions);
        let positions: Vec<&[f64]> = different.iter().map(|(_, waypoint)| *waypoint).collect();
        let motions = Passing::search(start, &positions, limits).and_then(Passing::motions);
        let motions = motions.map_err(|Unreachable { waypoint, axis }| TrajectoryError::Unreachable {
            point: different.get(waypoint).map_or(0, |(point, _)| *point),
            axis,
        })?;
        let path = path(&motions, &different, conditions);
        // The planner keeps the limits. What the axes do is checked all the same.
        path.check(limits)?;
        Ok(Self::as_written(path))
    }
}

fn check_waypoint(point: usize, waypoint: &[f64], limits: &[AxisLimits]) -> Result<(), TrajectoryError> {
    let quantity = PointQuantity::Position;
    if waypoint.len() != limits.len() {
        return Err(TrajectoryError::Count { point, quantity, given: waypoint.len(), axes: limits.len() });
    }
    for (axis, (position, limits)) in waypoint.iter().zip(limits).enumerate() {
        if !position.is_finite() {
            return Err(TrajectoryError::NotFinite { point, axis, quantity, value: *position });
        }
        if let Some((broken, value, limit)) = check::position_beyond(*position, limits) {
            return Err(TrajectoryError::Limit { point, axis, broken, time_s: 0.0, value, limit });
        }
    }
    Ok(())
}

/// The waypoints that differ from the one before, with their numbers.
fn different<'a>(
    waypoints: &'a [Vec<f64>],
    conditions: &TrajectoryConditions<'_>,
) -> Vec<(usize, &'a [f64])> {
    let is_at_rest = conditions.start.iter().all(|state| state.velocity == 0.0 && state.acceleration == 0.0);
    let mut last: Vec<f64> = conditions.start.iter().map(|state| state.position).collect();
    let mut different: Vec<(usize, &[f64])> = vec![];
    for (point, waypoint) in waypoints.iter().enumerate() {
        let is_same = last.iter().zip(waypoint).all(|(last, next)| (last - next).abs() <= SAME);
        if !is_same || (different.is_empty() && !is_at_rest) {
            different.push((point, waypoint));
            last.clone_from(waypoint);
        }
    }
    different
}

/// The path of these motions.
fn path(motions: &[Motion], waypoints: &[(usize, &[f64])], conditions: &TrajectoryConditions<'_>) -> Path {
    let mut path = Path { axes: conditions.limits.len(), ..Path::default() };
    let mut begins_s = 0.0;
    for (Motion { duration_s, profiles }, (point, _)) in motions.iter().zip(waypoints) {
        for since_s in phase_starts_s(profiles, *duration_s) {
            path.push(
                begins_s + since_s,
                *point,
                profiles.iter().map(|profile| polynomial(profile, since_s)),
            );
        }
        begins_s += duration_s;
    }
    let rest = |axis: usize| match waypoints.last() {
        Some((_, waypoint)) => waypoint.get(axis).copied().unwrap_or(0.0),
        None => conditions.start.get(axis).map_or(0.0, |state| state.position),
    };
    let point = waypoints.last().map_or(0, |(point, _)| *point);
    path.push(begins_s, point, (0..path.axes).map(|axis| Polynomial::linear(rest(axis), 0.0)));
    path
}

/// When a phase of any axis begins, in seconds after the beginning of the motion; each is later than the one before.
fn phase_starts_s(profiles: &[Profile], duration_s: f64) -> Vec<f64> {
    let starts_s = profiles.iter().flat_map(Profile::phases).map(|phase| phase.start_s);
    let mut starts_s: Vec<f64> = starts_s.filter(|start_s| *start_s < duration_s - TOGETHER_S).collect();
    starts_s.push(0.0);
    starts_s.sort_by(f64::total_cmp);
    starts_s.dedup_by(|next_s, kept_s| *next_s - *kept_s <= TOGETHER_S);
    starts_s
}

/// What an axis does from this time of its profile on, until a phase begins.
fn polynomial(profile: &Profile, since_s: f64) -> Polynomial {
    let present = profile.phases().take_while(|phase| phase.start_s <= since_s + TOGETHER_S).last();
    match present.filter(|phase| since_s < phase.start_s + phase.duration_s) {
        Some(phase) => {
            let state = phase.sample(since_s - phase.start_s);
            Polynomial([state.position, state.velocity, state.acceleration / 2.0, phase.jerk / 6.0, 0.0, 0.0])
        }
        None => Polynomial::linear(profile.end().position, profile.end().velocity),
    }
}
