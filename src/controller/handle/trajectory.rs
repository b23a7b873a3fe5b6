//! Trajectories: points with times, along which the speed may be changed, and which may be paused and resumed.

use std::sync::Arc;
use std::time::Duration;

use takt_rt::plan::State;
use takt_rt::{
    AxisLimits, ExecutionStart, MotionState, NANOSECONDS_PER_SECOND, RejectReason, Request, RequestId,
    RequestTarget,
};

use super::Handle;
use super::group::GroupHandle;
use super::trajectories::{Present, TrajectoryState};
use crate::channels::{GivenTrajectory, GroupAxes};
use crate::command::{CommandError, MotionId, TrajectoryProgress, needed};
use crate::config::Axis;
use crate::trajectory::{Trajectory, TrajectoryConditions, TrajectoryError, TrajectoryPoint};

/// By how much later than now a trajectory takes the place of another one: first, and at most. It must have been computed and handed
/// over by then.
const FIRST_MARGIN_S: f64 = 0.02;
const LONGEST_MARGIN_S: f64 = 1.0;
/// A trajectory that has been granted takes the place of the present one within this time, unless the motion ends before.
const TAKING_OVER: Duration = Duration::from_secs(5);

impl Handle {
    /// Starts a trajectory through points with times, as ROS' `JointTrajectory` has them: see [`Trajectory::new`]. All of it is checked
    /// before: what breaks a limit anywhere is refused, with the first point, axis and limit.
    ///
    /// While the axes hold, a first point at the time 0 must be where they are; with a later one the trajectory goes there first. If that
    /// point is passed in motion, a way there from rest that would swing far back is refused.
    /// While another trajectory is under way, this one takes its place without a step, 20 ms later or as soon as it is computed: its
    /// first point then needs a time after 0. Returns when the real-time thread has granted it.
    ///
    /// # Errors
    /// [`CommandError::Trajectory`], [`CommandError::Refused`] in any other motion, [`CommandError::SeveralGroups`] where
    /// [`GroupHandle::execute`] is meant, and see [`CommandError`]; nothing has changed then.
    pub fn execute(&self, points: &[TrajectoryPoint]) -> Result<MotionId, CommandError> {
        self.only_group()?.execute(points)
    }

    /// The same, for a trajectory that `make` makes from where the axes are when it begins. It is called again if that took too
    /// long.
    ///
    /// # Errors
    /// As [`Handle::execute`].
    pub fn execute_with(
        &self,
        make: impl Fn(&TrajectoryConditions<'_>) -> Result<Trajectory, TrajectoryError>,
    ) -> Result<MotionId, CommandError> {
        self.only_group()?.execute_with(make)
    }

    /// Starts a trajectory through waypoints, without stopping, to rest at the last one, in nearly the shortest time that the limits
    /// allow. Each waypoint has a position (rad or m) for each axis. It begins where the axes hold, or takes the place of a trajectory
    /// under way as [`Handle::execute`] does. See [`Trajectory::through`].
    ///
    /// # Errors
    /// As [`Handle::execute`].
    pub fn move_through(&self, waypoints: &[Vec<f64>]) -> Result<MotionId, CommandError> {
        self.only_group()?.move_through(waypoints)
    }

    /// Changes the speed along the path of a trajectory: 1 as it was written, 0.5 half as fast. The path stays the same, and all limits
    /// are kept: the change is a ramp that is as short as they allow. Of a trajectory that is paused, it is the speed after
    /// [`Handle::resume`]. Returns when the change begins.
    ///
    /// # Errors
    /// [`CommandError::Rate`] for what the limits do not allow, [`CommandError::NoTrajectory`] if that motion is not a trajectory under way,
    /// and see [`CommandError`]. The trajectory goes on as before then.
    pub fn set_speed(&self, motion: MotionId, rate: f64) -> Result<(), CommandError> {
        self.group_of_motion(motion).change_rate(motion, |present| (rate, present.is_paused))
    }

    /// Brings the axes to rest on the path of a trajectory. Returns when they begin to slow down.
    ///
    /// # Errors
    /// As [`Handle::set_speed`].
    pub fn pause(&self, motion: MotionId) -> Result<(), CommandError> {
        self.group_of_motion(motion).change_rate(motion, |present| (present.rate, true))
    }

    /// Goes on with a trajectory that was paused. Returns when it does.
    ///
    /// # Errors
    /// As [`Handle::set_speed`].
    pub fn resume(&self, motion: MotionId) -> Result<(), CommandError> {
        self.group_of_motion(motion).change_rate(motion, |present| (present.rate, false))
    }

    /// How far a trajectory under way is: the time on its path in seconds, of how many, and the present rate.
    pub fn trajectory_progress(&self, motion: MotionId) -> Option<TrajectoryProgress> {
        let group = self.group_of_motion(motion);
        let trajectories = self.0.trajectories.lock(group.number);
        let present = self.under_way(&trajectories).filter(|present| present.motion == motion.request)?;
        let trajectory = present.given.trajectory();
        let path_time = trajectory.path_time(present.given.at_s());
        Some(TrajectoryProgress {
            path_s: path_time.path_s,
            of_s: trajectory.path_duration_s(),
            rate: path_time.rate,
        })
    }

    fn group_of_motion(&self, motion: MotionId) -> GroupHandle {
        self.group_of_number(match motion.target {
            RequestTarget::Group(number) => number,
            RequestTarget::All => 0,
        })
    }

    /// The trajectory under way.
    fn under_way(&self, trajectories: &TrajectoryState) -> Option<Present> {
        let state = self.state();
        let is_under_way =
            |present: &&Present| state.motions.of(present.motion) == Some(MotionState::InProgress);
        trajectories.present.as_ref().filter(is_under_way).cloned()
    }
}

impl GroupHandle {
    /// As [`Handle::execute`], for the axes of the group in the order of [`GroupHandle::axes`]; errors count them so, too.
    ///
    /// # Errors
    /// See [`Handle::execute`].
    pub fn execute(&self, points: &[TrajectoryPoint]) -> Result<MotionId, CommandError> {
        self.execute_with(|conditions| Trajectory::new(points, conditions))
    }

    /// As [`Handle::execute_with`], for the axes of the group in the order of [`GroupHandle::axes`].
    ///
    /// # Errors
    /// See [`Handle::execute`].
    pub fn execute_with(
        &self,
        make: impl Fn(&TrajectoryConditions<'_>) -> Result<Trajectory, TrajectoryError>,
    ) -> Result<MotionId, CommandError> {
        let stopped = self.newest_asked_stop();
        let mut trajectories = self.handle.0.trajectories.lock(self.number);
        let Some(present) = self.handle.under_way(&trajectories) else {
            let state = self.handle.state();
            let standing = |axis: &usize| state.axes().get(*axis).map(|axis| State::rest(axis.position_set));
            let start: Vec<State> = self.axes.iter().filter_map(standing).collect();
            let trajectory = self.made(&start, &make)?;
            return self.begin(&mut trajectories, trajectory, ExecutionStart::Now, stopped, None);
        };
        let start = |at_s: f64| -> Vec<State> {
            let states = present.given.trajectory().sample(at_s).states;
            self.axes.iter().zip(states).map(|(_, state)| state).collect()
        };
        self.take_over(&mut trajectories, &present, stopped, None, |at_s| self.made(&start(at_s), &make))
    }

    /// As [`Handle::move_through`], for the axes of the group in the order of [`GroupHandle::axes`].
    ///
    /// # Errors
    /// See [`Handle::move_through`].
    pub fn move_through(&self, waypoints: &[Vec<f64>]) -> Result<MotionId, CommandError> {
        self.execute_with(|conditions| Trajectory::through(waypoints, conditions))
    }

    fn made(
        &self,
        start: &[State],
        make: impl Fn(&TrajectoryConditions<'_>) -> Result<Trajectory, TrajectoryError>,
    ) -> Result<Trajectory, CommandError> {
        let limits = self.limits();
        let period_s = self.period_s();
        let trajectory = make(&TrajectoryConditions { start, limits: &limits, period_s })?;
        let moves = |(index, axis): &(usize, &Axis)| axis.control.is_profile() && trajectory.moves(*index);
        match self.own_axes().enumerate().find(moves) {
            Some((_, axis)) => Err(CommandError::WrongMode {
                axis: axis.name.clone(),
                needed: needed::SET_POINTS.to_owned(),
            }),
            None => Ok(trajectory),
        }
    }

    fn change_rate(
        &self,
        MotionId { request: motion, .. }: MotionId,
        wanted: impl Fn(&Present) -> (f64, bool),
    ) -> Result<(), CommandError> {
        let stopped = self.newest_asked_stop();
        let mut trajectories = self.handle.0.trajectories.lock(self.number);
        let present = self.handle.under_way(&trajectories).filter(|present| present.motion == motion);
        let present = present.ok_or(CommandError::NoTrajectory)?;
        let (rate, is_paused) = wanted(&present);
        if !(rate.is_finite() && rate > 0.0) {
            return Err(crate::trajectory::RateError::NotARate { rate }.into());
        }
        let next = Present { rate, is_paused, ..present.clone() };
        let actual = |of: &Present| if of.is_paused { 0.0 } else { of.rate };
        if actual(&next) == actual(&present) {
            trajectories.present = Some(next);
            return Ok(());
        }
        let limits = self.limits();
        let (wanted, of) = (actual(&next), present.given.trajectory());
        self.take_over(&mut trajectories, &present, stopped, Some(&next), |at_s| {
            Ok(of.at_rate(at_s, wanted, &limits)?)
        })?;
        Ok(())
    }

    /// Lets a trajectory take the place of the present one at a cycle that is near, and waits until it has. `same` is for the same motion:
    /// how it goes on.
    fn take_over(
        &self,
        trajectories: &mut TrajectoryState,
        present: &Present,
        stopped: RequestId,
        same: Option<&Present>,
        make: impl Fn(f64) -> Result<Trajectory, CommandError>,
    ) -> Result<MotionId, CommandError> {
        let period_s = self.period_s();
        let mut margin_s = FIRST_MARGIN_S;
        loop {
            let cycles = ((present.given.at_s() + margin_s) / period_s).ceil();
            let trajectory = make(cycles * period_s)?;
            let start = ExecutionStart::After {
                trajectory: present.id,
                cycles: cycles as u64,
                is_same_motion: same.is_some(),
            };
            match self.begin(trajectories, trajectory, start, stopped, same) {
                Err(CommandError::Refused(refused))
                    if refused.refusal.map(|refusal| refusal.reason) == Some(RejectReason::TooLate)
                        && margin_s < LONGEST_MARGIN_S =>
                {
                    margin_s *= 2.0;
                }
                begun => return begun,
            }
        }
    }

    /// Hands a trajectory over, and waits until it is granted and has begun. `stopped` is the newest stop before it was asked for: a later
    /// one discards it.
    fn begin(
        &self,
        trajectories: &mut TrajectoryState,
        trajectory: Trajectory,
        start: ExecutionStart,
        stopped: RequestId,
        same: Option<&Present>,
    ) -> Result<MotionId, CommandError> {
        if self.newest_asked_stop() != stopped {
            return Err(CommandError::Overtaken);
        }
        let giver = &self.handle.0.trajectories.giver;
        self.take_back_discarded(trajectories);
        let given = Arc::new(GivenTrajectory::new(trajectory, GroupAxes::new(self.axes.clone())));
        let id = giver
            .give(self.number, &given)
            .ok_or(CommandError::Full { waiting: trajectories.submitted.len() })?;
        let request = match self.handle.submit(self.target(), Request::Execute { trajectory: id, start }) {
            Ok(request) => request,
            Err(error) => {
                giver.take_back(id);
                return Err(error);
            }
        };
        trajectories.submitted.push((id, request));
        self.handle.wait_for_grant(self.target(), request)?;
        let motion = same.map_or(request, |same| same.motion);
        let (rate, is_paused) = same.map_or((1.0, false), |same| (same.rate, same.is_paused));
        trajectories.present = Some(Present { motion, id, given: Arc::clone(&given), rate, is_paused });
        // Until then nothing else can take the place of the present one. The motion may end before.
        let _ = self.handle.wait_until(TAKING_OVER, |state| {
            let is_under_way = state.motions.of(motion) == Some(MotionState::InProgress);
            (given.at_s() > 0.0 || !is_under_way).then_some(())
        });
        Ok(MotionId { request: motion, target: self.target() })
    }

    /// Takes trajectories back whose requests a stop has discarded.
    fn take_back_discarded(&self, trajectories: &mut TrajectoryState) {
        let state = self.handle.state();
        trajectories.submitted.retain(|(id, request)| {
            let is_discarded = self.handle.is_discarded(self.target(), *request, &state);
            if is_discarded {
                self.handle.0.trajectories.giver.take_back(*id);
            }
            !is_discarded && state.answers.of(*request) == takt_rt::Answer::None
        });
        self.handle.0.trajectories.giver.release();
    }

    fn newest_asked_stop(&self) -> RequestId {
        self.handle.0.clients.newest_asked_stop(self.target())
    }

    fn limits(&self) -> Vec<AxisLimits> {
        self.own_axes().map(|axis| axis.limits).collect()
    }

    fn own_axes(&self) -> impl Iterator<Item = &Axis> {
        self.axes.iter().filter_map(|axis| self.handle.axes().get(*axis))
    }

    /// As the engine computes it.
    fn period_s(&self) -> f64 {
        self.handle.machine().cycle_ns as f64 / NANOSECONDS_PER_SECOND as f64
    }
}
