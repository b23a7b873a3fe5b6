//! Trajectories of a fixed number of axes, with `nalgebra` vectors.

use nalgebra::SVector;

use super::error::PlanError;
use super::options::PlanOptions;
use super::problem::{Limits, Problem, State};
use super::profile::{Extrema, Profile};
use super::synchronisation::{stop, synchronised};

/// The state of motion of `AXES` axes. Linear axes use m in place of rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroupState<const AXES: usize> {
    /// Positions, in rad.
    pub position: SVector<f64, AXES>,
    /// Velocities, in rad/s.
    pub velocity: SVector<f64, AXES>,
    /// Accelerations, in rad/s².
    pub acceleration: SVector<f64, AXES>,
}

impl<const AXES: usize> GroupState<AXES> {
    /// The state at rest at these positions, in rad.
    pub fn rest(position: SVector<f64, AXES>) -> Self {
        Self { position, velocity: SVector::zeros(), acceleration: SVector::zeros() }
    }

    fn axes(&self) -> impl Iterator<Item = State> + '_ {
        let rates = self.velocity.iter().zip(self.acceleration.iter());
        self.position.iter().zip(rates).map(|(position, (velocity, acceleration))| State {
            position: *position,
            velocity: *velocity,
            acceleration: *acceleration,
        })
    }
}

/// The trajectory of `AXES` axes from one state to another, within the limits of each axis.
///
/// ```
/// use nalgebra::vector;
/// use takt_rt::plan::{GroupState, Limits, PlanOptions, Trajectory};
/// let start = GroupState::rest(vector![0.0, 0.5]);
/// let target = GroupState::rest(vector![1.0, -0.5]);
/// let limits = [Limits::symmetric(2.0, 8.0, 100.0); 2];
/// let trajectory = Trajectory::plan(&start, &target, &limits, PlanOptions::default()).unwrap();
/// assert_eq!(trajectory.sample(trajectory.duration_s()), target);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trajectory<const AXES: usize> {
    profiles: [Profile; AXES],
    duration_s: f64,
}

/// Why there is no trajectory to the target, and the stop to carry out instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanFailure<const AXES: usize> {
    /// What is wrong, and with which axis.
    pub error: PlanError,
    /// The fastest coordinated stop; `None` if the start or the limits are invalid.
    pub stop: Option<Trajectory<AXES>>,
}

impl<const AXES: usize> core::fmt::Display for PlanFailure<AXES> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.error.fmt(f)
    }
}

impl<const AXES: usize> core::error::Error for PlanFailure<AXES> {}

impl<const AXES: usize> Trajectory<AXES> {
    /// Plans from `start` to `target`; see [`synchronised`].
    ///
    /// # Errors
    /// [`PlanFailure`]: the error of the first axis that has one, and the stop to carry out instead.
    pub fn plan(
        start: &GroupState<AXES>,
        target: &GroupState<AXES>,
        limits: &[Limits; AXES],
        timing: PlanOptions,
    ) -> Result<Self, PlanFailure<AXES>> {
        let rest = Problem {
            start: State::rest(0.0),
            target: State::rest(0.0),
            limits: Limits::symmetric(1.0, 1.0, 1.0),
        };
        let mut problems = [rest; AXES];
        let states = start.axes().zip(target.axes());
        for (problem, ((start, target), limits)) in problems.iter_mut().zip(states.zip(limits)) {
            *problem = Problem { start, target, limits: *limits };
        }
        let mut profiles = [Profile::hold(0.0); AXES];
        match synchronised(&problems, &mut profiles, timing) {
            Ok(duration_s) => Ok(Self { profiles, duration_s }),
            Err(error) => Err(PlanFailure { error, stop: Self::stop(start, limits).ok() }),
        }
    }

    /// Plans the fastest coordinated stop; see [`stop`].
    ///
    /// # Errors
    /// As [`stop`].
    pub fn stop(start: &GroupState<AXES>, limits: &[Limits; AXES]) -> Result<Self, PlanError> {
        let mut starts = [State::rest(0.0); AXES];
        for (state, axis) in starts.iter_mut().zip(start.axes()) {
            *state = axis;
        }
        let mut profiles = [Profile::hold(0.0); AXES];
        let duration_s = stop(&starts, limits, &mut profiles)?;
        Ok(Self { profiles, duration_s })
    }

    /// How long the motion takes, in s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The state `time_s` seconds after the start; see [`Profile::sample`].
    pub fn sample(&self, time_s: f64) -> GroupState<AXES> {
        let mut group = GroupState::<AXES>::rest(SVector::zeros());
        let rates = group.velocity.iter_mut().zip(group.acceleration.iter_mut());
        let axes = group.position.iter_mut().zip(rates);
        for ((position, (velocity, acceleration)), profile) in axes.zip(&self.profiles) {
            let state = profile.sample(time_s);
            (*position, *velocity, *acceleration) = (state.position, state.velocity, state.acceleration);
        }
        group
    }

    /// The exact extrema of every axis, over the whole trajectory.
    pub fn extrema(&self) -> [Extrema; AXES] {
        self.profiles.map(|profile| profile.extrema())
    }

    /// The profile of every axis.
    pub fn profiles(&self) -> &[Profile; AXES] {
        &self.profiles
    }
}
