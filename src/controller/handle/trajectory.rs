//! Trajectories: points with times, along which the speed may be changed, and which may be paused and resumed.

use std::sync::Arc;
use std::time::Duration;

use takt_rt::plan::State;
use takt_rt::{
    AxisLimits, ExecutionStart, MotionState, NANOSECONDS_PER_SECOND, RejectReason, Request, RequestId,
    RequestTarget,
};

use super::trajectories::{Present, TrajectoryState};
use super::{Handle, OwnProcess};
use crate::channels::{GivenTrajectory, GroupAxes};
use crate::command::{Backend, CommandError, MotionId, TrajectoryProgress, needed};
use crate::config::Axis;
use crate::trajectory::{Trajectory, TrajectoryConditions, TrajectoryError};

/// By how much later than now a trajectory takes the place of another one: first, and at most. It must have been computed and handed
/// over by then.
const FIRST_MARGIN_S: f64 = 0.02;
const LONGEST_MARGIN_S: f64 = 1.0;
/// A trajectory that has been granted takes the place of the present one within this time, unless the motion ends before.
const TAKING_OVER: Duration = Duration::from_secs(5);

impl Handle {
    /// As [`Handle::execute`](crate::command::Handle::execute), for a trajectory that `make` makes from where the axes are when it begins. It
    /// is called again if that took too long.
    ///
    /// # Errors
    /// As [`Handle::execute`](crate::command::Handle::execute).
    pub fn execute_with(
        &self,
        make: impl Fn(&TrajectoryConditions<'_>) -> Result<Trajectory, TrajectoryError>,
    ) -> Result<MotionId, CommandError> {
        self.backend().one_group(self.target())?.execute_with(make)
    }
}

/// One group, which a trajectory is for.
pub(super) struct OneGroup<'a> {
    own: &'a OwnProcess,
    number: u8,
    /// The numbers of its axes.
    axes: Vec<usize>,
}

impl OwnProcess {
    /// The one group that is meant.
    pub(super) fn one_group(&self, target: RequestTarget) -> Result<OneGroup<'_>, CommandError> {
        let number = match target {
            RequestTarget::All if self.groups.len() > 1 => {
                return Err(CommandError::SeveralGroups { groups: self.machine.groups.clone() });
            }
            RequestTarget::All => 0,
            RequestTarget::Group(number) => number,
        };
        let group = match self.groups.is_empty() {
            true => RequestTarget::All,
            false => RequestTarget::Group(number),
        };
        Ok(OneGroup { own: self, number, axes: self.axes_of(group) })
    }

    /// The group of a motion.
    pub(super) fn group_of_motion(&self, motion: MotionId) -> Result<OneGroup<'_>, CommandError> {
        self.one_group(match motion.target {
            RequestTarget::All => RequestTarget::Group(0),
            group => group,
        })
    }

    /// How far a trajectory under way is.
    pub(super) fn progress(&self, motion: MotionId) -> Option<TrajectoryProgress> {
        let number = match motion.target {
            RequestTarget::Group(number) => number,
            RequestTarget::All => 0,
        };
        let trajectories = self.trajectories.lock(number);
        let present = self.under_way(&trajectories).filter(|present| present.motion == motion.request)?;
        let trajectory = present.given.trajectory();
        let path_time = trajectory.path_time(present.given.at_s());
        Some(TrajectoryProgress {
            path_s: path_time.path_s,
            of_s: trajectory.path_duration_s(),
            rate: path_time.rate,
        })
    }

    /// The trajectory under way.
    fn under_way(&self, trajectories: &TrajectoryState) -> Option<Present> {
        let present = trajectories.present.as_ref()?;
        let state = self.observer.look(|state| state.motions.of(present.motion));
        (state == Some(MotionState::InProgress)).then(|| present.clone())
    }
}

impl OneGroup<'_> {
    /// See [`Handle::execute_with`].
    pub(super) fn execute_with(
        &self,
        make: impl Fn(&TrajectoryConditions<'_>) -> Result<Trajectory, TrajectoryError>,
    ) -> Result<MotionId, CommandError> {
        let stopped = self.newest_asked_stop();
        let mut trajectories = self.own.trajectories.lock(self.number);
        let Some(present) = self.own.under_way(&trajectories) else {
            let state = self.own.observer.snapshot();
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

    /// Another speed of a trajectory under way.
    pub(super) fn set_speed(&self, motion: MotionId, rate: f64) -> Result<(), CommandError> {
        // The speed before is the one after a resume.
        if rate == 0.0 {
            return self.set_paused(motion, true);
        }
        self.change_rate(motion, |present| (rate, present.is_paused))
    }

    /// Pauses a trajectory under way, or goes on with it.
    pub(super) fn set_paused(&self, motion: MotionId, is_paused: bool) -> Result<(), CommandError> {
        self.change_rate(motion, |present| (present.rate, is_paused))
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
        let mut trajectories = self.own.trajectories.lock(self.number);
        let present = self.own.under_way(&trajectories).filter(|present| present.motion == motion);
        let present = present.ok_or(CommandError::NoTrajectory)?;
        let (rate, is_paused) = wanted(&present);
        if !(rate.is_finite() && rate > 0.0) {
            return Err(crate::trajectory::RateError::NotARate { rate }.into());
        }
        let next = Present { rate, is_paused, ..present.clone() };
        let actual = |of: &Present| if of.is_paused { 0.0 } else { of.rate };
        let limits = self.limits();
        if actual(&next) == actual(&present) {
            if next.is_paused {
                // What the limits do not allow is refused now, so that a resume can be carried out.
                present.given.trajectory().at_rate(present.given.at_s(), rate, &limits)?;
            }
            trajectories.present = Some(next);
            return Ok(());
        }
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
        let giver = &self.own.trajectories.giver;
        self.take_back_discarded(trajectories);
        let given = Arc::new(GivenTrajectory::new(trajectory, GroupAxes::new(self.axes.clone())));
        let id = giver
            .give(self.number, &given)
            .ok_or(CommandError::Full { waiting: trajectories.submitted.len() })?;
        let request = match self.own.hand_in(self.target(), Request::Execute { trajectory: id, start }) {
            Ok(request) => request,
            Err(error) => {
                giver.take_back(id);
                return Err(error);
            }
        };
        trajectories.submitted.push((id, request));
        self.own.wait_for_grant(self.target(), request)?;
        let motion = same.map_or(request, |same| same.motion);
        let (rate, is_paused) = same.map_or((1.0, false), |same| (same.rate, same.is_paused));
        trajectories.present = Some(Present { motion, id, given: Arc::clone(&given), rate, is_paused });
        // Until then nothing else can take the place of the present one. The motion may end before.
        let _ = self.own.wait_until(TAKING_OVER, |state| {
            let is_under_way = state.motions.of(motion) == Some(MotionState::InProgress);
            (given.at_s() > 0.0 || !is_under_way).then_some(())
        });
        Ok(MotionId { request: motion, target: self.target() })
    }

    /// Takes trajectories back whose requests a stop has discarded.
    fn take_back_discarded(&self, trajectories: &mut TrajectoryState) {
        let state = self.own.observer.snapshot();
        trajectories.submitted.retain(|(id, request)| {
            let is_discarded = self.own.is_discarded(self.target(), *request, &state);
            if is_discarded {
                self.own.trajectories.giver.take_back(*id);
            }
            !is_discarded && state.answers.of(*request) == takt_rt::Answer::None
        });
        self.own.trajectories.giver.release();
    }

    /// Whom its requests are for.
    fn target(&self) -> RequestTarget {
        self.own.asked(RequestTarget::Group(self.number))
    }

    fn newest_asked_stop(&self) -> RequestId {
        self.own.clients.newest_asked_stop(self.target())
    }

    fn limits(&self) -> Vec<AxisLimits> {
        self.own_axes().map(|axis| axis.limits).collect()
    }

    fn own_axes(&self) -> impl Iterator<Item = &Axis> {
        self.axes.iter().filter_map(|axis| self.own.axes.get(*axis))
    }

    /// As the engine computes it.
    fn period_s(&self) -> f64 {
        self.own.machine.cycle_ns as f64 / NANOSECONDS_PER_SECOND as f64
    }
}
