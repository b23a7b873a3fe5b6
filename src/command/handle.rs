//! What commands and observes a running controller, wherever it runs.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use takt_rt::{
    AxisLimits, Frame, GroupSnapshot, Nanoseconds, OperationMode, Phase, RequestId, RequestTarget, Snapshot,
    StopCategory,
};

use super::axis_properties::AxisProperties;
use super::backend::Backend;
use super::error::{CommandError, MotionError, Stopped, WaitError};
use super::lease_holder::LeaseHolder;
use super::motion::{self, MotionId, MoveOptions, TrajectoryProgress};
use super::requests::{Command, Reply};
use crate::telemetry::{LoopTiming, Machine};
use crate::trajectory::TrajectoryPoint;

/// Commands and observes a running controller, or one of its groups, from any thread. Clones are cheap and equal.
///
/// `B` is where the controller runs: [`takt::Handle`](crate::Handle) is that of the own process, a `Client` of `takt-remote` has one of
/// another process, and an [`AnyHandle`] is either. Values of axes come in the order of the configuration, or in that of the group. Units
/// are rad, rad/s, N·m (m, m/s, N) and seconds.
///
/// No command waits for a lock that another thread could hold, with two exceptions: clients that push points of a stream wait for
/// each other, and so do commands of trajectories. To a controller in another process, each command waits for its answer.
/// [`Handle::stop`] waits for nothing, so it may also be called in a signal handler.
pub struct Handle<B: Backend + ?Sized = dyn Backend> {
    backend: Arc<B>,
    target: RequestTarget,
}

/// A handle of a controller of this process or of another one.
pub type AnyHandle = Handle<dyn Backend>;

impl<B: Backend + ?Sized> Clone for Handle<B> {
    fn clone(&self) -> Self {
        Self { backend: Arc::clone(&self.backend), target: self.target }
    }
}

impl<B: Backend + ?Sized> fmt::Debug for Handle<B> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (machine, target) = (&self.machine().name, self.target);
        formatter.debug_struct("Handle").field("machine", machine).field("target", &target).finish()
    }
}

impl<B: Backend + 'static> From<Handle<B>> for AnyHandle {
    fn from(handle: Handle<B>) -> Self {
        Self { backend: handle.backend, target: handle.target }
    }
}

/// Its axes, and what they are doing.
impl<B: Backend + ?Sized> Handle<B> {
    /// All axes of a controller.
    pub const fn new(backend: Arc<B>) -> Self {
        Self { backend, target: RequestTarget::All }
    }

    /// Where the controller runs.
    pub const fn backend(&self) -> &Arc<B> {
        &self.backend
    }

    /// Whose axes it commands: all of the controller, or those of a group.
    pub const fn target(&self) -> RequestTarget {
        self.target
    }

    /// The same for other axes of the controller.
    pub fn of(&self, target: RequestTarget) -> Self {
        Self { backend: Arc::clone(&self.backend), target }
    }

    /// The group with this name in the configuration. What is asked of it concerns no other group. The drives in profile velocity and
    /// profile torque are commanded by [`Handle::velocity`] and [`Handle::torque`] of any handle: the axis names its group.
    ///
    /// # Errors
    /// [`CommandError::NoSuchGroup`].
    pub fn group(&self, name: &str) -> Result<Self, CommandError> {
        let groups = &self.machine().groups;
        let found = (0..).zip(groups).find(|(_, group)| *group == name);
        let (number, _) = found
            .ok_or_else(|| CommandError::NoSuchGroup { name: name.to_owned(), groups: groups.clone() })?;
        Ok(self.of(RequestTarget::Group(number)))
    }

    /// The numbers of its axes, in the order in which it is commanded: that of the configuration, or that of the group.
    pub fn axis_numbers(&self) -> Vec<usize> {
        self.backend.axes_of(self.target)
    }

    /// What the configuration says of an axis of the controller.
    pub fn axis_properties(&self, axis: usize) -> Option<AxisProperties> {
        self.backend.axis_properties(axis)
    }

    /// The limits of an axis of the controller, in rad (m), seconds and N·m (N).
    pub fn limits(&self, axis: usize) -> Option<AxisLimits> {
        self.axis_properties(axis).map(|axis| axis.limits)
    }

    /// The names and units of the machine, for texts about events and states.
    pub fn machine(&self) -> &Machine {
        self.backend.machine()
    }

    /// The period of the cycle.
    pub fn period_ns(&self) -> Nanoseconds {
        self.machine().cycle_ns
    }

    /// The present time on the clock of the controller: `CLOCK_MONOTONIC`, which all processes of a computer share; of a
    /// [`VirtualController`](crate::VirtualController), its own. The times of states and events, and the stamps of streams, are on it.
    pub fn now_ns(&self) -> Nanoseconds {
        self.backend.now_ns()
    }

    /// How punctual all cycles since the start were; a few milliseconds old. All times are 0 in virtual time.
    pub fn timing(&self) -> LoopTiming {
        self.backend.timing()
    }

    /// Returns `true` if the run has ended, or the process of the controller, so that every command returns an error that says `Ended`.
    pub fn has_ended(&self) -> bool {
        self.backend.has_ended()
    }

    /// The state of the controller after the newest complete cycle; after the end, the last one. Before the first one, no drive has
    /// reported. It says of each axis from when its feedback is: [`is_stale`](takt_rt::AxisSnapshot::is_stale),
    /// [`feedback_age_ns`](takt_rt::AxisSnapshot::feedback_age_ns).
    pub fn state(&self) -> Snapshot {
        self.look_at_state(Clone::clone)
    }

    /// Shows that state to `look`, without a copy of it where that is possible: a state has twelve kilobytes.
    pub fn look_at_state<T>(&self, mut look: impl FnMut(&Snapshot) -> T) -> T {
        let mut seen = None;
        self.backend.look(&mut |state| seen = Some(look(state)));
        seen.unwrap_or_else(|| look(&Snapshot::default()))
    }

    /// What the group is doing, the time left of its present move, and why it has stopped, after the newest complete cycle: of several
    /// groups, the first one.
    pub fn group_state(&self) -> GroupSnapshot {
        self.look_at_state(|state| groups_in(state, self.target).first().copied().unwrap_or_default())
    }

    /// The fault that has stopped the axes and has not been reset: the first, of several groups.
    pub fn fault(&self) -> Option<Stopped> {
        let first = self.look_at_state(|state| {
            let faults = groups_in(state, self.target).iter().filter_map(|group| group.stop);
            faults.filter(|stop| !stop.is_requested()).min_by_key(|stop| stop.slot)
        });
        first.map(|stop| Stopped::new(stop, self.machine()))
    }

    /// The newest of the stops that the real-time thread has taken, of those that concern the axes. It discards what was asked before.
    pub fn newest_stop(&self) -> RequestId {
        self.backend.newest_stop(self.target)
    }
}

/// Waiting.
impl<B: Backend + ?Sized> Handle<B> {
    /// Waits until `find` finds something in a state. It looks at one state of each cycle, or of each millisecond if the period is
    /// shorter.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_until<T>(
        &self,
        at_most: Duration,
        mut find: impl FnMut(&Snapshot) -> Option<T>,
    ) -> Result<T, WaitError> {
        let mut found = None;
        self.backend.look_until(at_most, &mut |state| {
            found = find(state);
            found.is_some()
        })?;
        found.ok_or(WaitError::Ended)
    }

    /// Waits for a state that is newer than that of `slot`, and returns it. If there is one already, it does not wait. The newest state
    /// is returned: if its slot is not the next one, the caller was too slow, or the loop has missed slots.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn cycle_after(&self, slot: u64, at_most: Duration) -> Result<Snapshot, WaitError> {
        self.backend.cycle_after(slot, at_most)
    }

    /// Waits for the next cycle to be complete, and returns the state after it.
    ///
    /// A thread of the process of the controller wakes 20 µs after the time at which the state is expected, plus the wake-up latency that
    /// the operating system gives it. An ordinary thread on Linux has 50 µs of timer slack beside. To miss no cycle, use
    /// [`Handle::cycle_after`].
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn next_cycle(&self, at_most: Duration) -> Result<Snapshot, WaitError> {
        self.cycle_after(self.look_at_state(|state| state.slot), at_most)
    }

    /// Lets so many cycles pass, and returns the state after them. In real time it waits for them; in virtual time it runs them, as fast
    /// as this machine can.
    ///
    /// # Errors
    /// [`WaitError::Ended`] if the controller has ended before them.
    pub fn advance(&self, cycles: u64) -> Result<Snapshot, WaitError> {
        if self.has_ended() {
            return Err(WaitError::Ended);
        }
        match cycles.checked_sub(1) {
            None => Ok(self.state()),
            Some(others) => {
                let slot = self.look_at_state(|state| state.slot);
                self.cycle_after(slot.saturating_add(others), Duration::MAX)
            }
        }
    }

    /// Waits until each of its groups is in a phase.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_for(&self, phase: Phase, at_most: Duration) -> Result<(), WaitError> {
        self.backend.look_until(at_most, &mut |state| {
            let groups = groups_in(state, self.target);
            !groups.is_empty() && groups.iter().all(|group| group.phase == phase)
        })
    }

    /// Waits until a motion has reached its targets: until the axes are at rest there, or a velocity or torque is reached. The
    /// result is that of this motion, independent of what the group did before and after it. It comes with the cycle in which the
    /// motion ends, however it ends: done, replaced, stopped or refused.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn wait(&self, motion: MotionId, at_most: Duration) -> Result<(), MotionError> {
        match self.wait_until(at_most, |state| self.result_in(state, motion)) {
            Ok(result) => result,
            Err(WaitError::NotInTime) => Err(MotionError::NotInTime),
            Err(WaitError::Ended) => Err(MotionError::Ended),
        }
    }

    /// How a motion has ended; `None` while it is under way. Does not wait.
    pub fn result_of(&self, motion: MotionId) -> Option<Result<(), MotionError>> {
        let has_ended = self.has_ended();
        let result = self.look_at_state(|state| self.result_in(state, motion));
        result.or_else(|| has_ended.then_some(Err(MotionError::Ended)))
    }

    /// How a motion has ended, by a state.
    fn result_in(
        &self,
        state: &Snapshot,
        MotionId { request, target }: MotionId,
    ) -> Option<Result<(), MotionError>> {
        motion::result_in(state, request, self.backend.newest_stop(target), self.machine())
    }
}

/// Commanding.
impl<B: Backend + ?Sized> Handle<B> {
    /// Starts a coordinated move of every axis to its target (rad or m), where the axes come to rest. A move in progress is
    /// replanned from the present set-points. A drive in profile position plans its own profile. A drive in profile velocity
    /// or profile torque keeps its velocity or torque.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then, but for [`CommandError::NoReply`].
    pub fn move_to(&self, positions: &[f64]) -> Result<MotionId, CommandError> {
        self.move_with(positions, MoveOptions::default())
    }

    /// The same as [`Handle::move_to`], within fractions of the limits.
    ///
    /// # Errors
    /// As [`Handle::move_to`].
    pub fn move_with(&self, positions: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        self.begun(Command::Move { target: self.target, options, positions: positions.to_vec() })
    }

    /// As [`Handle::move_with`], by a distance (rad or m) from the present set-point of each axis: of an axis in motion, from where it is
    /// to be at this moment.
    ///
    /// # Errors
    /// As [`Handle::move_to`].
    pub fn move_by(&self, distances: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        self.begun(Command::MoveBy { target: self.target, options, distances: distances.to_vec() })
    }

    /// Starts a trajectory through points with times, as ROS' `JointTrajectory` has them: see
    /// [`Trajectory::new`](crate::Trajectory::new). All of it is checked before: what breaks a limit anywhere is refused, with the first
    /// point, axis and limit.
    ///
    /// While the axes hold, a first point at the time 0 must be where they are; with a later one the trajectory goes there first. If that
    /// point is passed in motion, a way there from rest that would swing far back is refused.
    /// While another trajectory is under way, this one takes its place without a step, 20 ms later or as soon as it is computed: its
    /// first point then needs a time after 0. Returns when the real-time thread has granted it.
    ///
    /// # Errors
    /// [`CommandError::Trajectory`], [`CommandError::Refused`] in any other motion, [`CommandError::SeveralGroups`] where
    /// [`Handle::group`] is meant, and see [`CommandError`]; nothing has changed then.
    pub fn execute(&self, points: &[TrajectoryPoint]) -> Result<MotionId, CommandError> {
        self.begun(Command::Execute { target: self.target, points: points.to_vec() })
    }

    /// Starts a trajectory through waypoints, without stopping, to rest at the last one, in nearly the shortest time that the limits
    /// allow. Each waypoint has a position (rad or m) for each axis. It begins where the axes hold, or takes the place of a trajectory
    /// under way as [`Handle::execute`] does. See [`Trajectory::through`](crate::Trajectory::through).
    ///
    /// # Errors
    /// As [`Handle::execute`].
    pub fn move_through(&self, waypoints: &[Vec<f64>]) -> Result<MotionId, CommandError> {
        self.begun(Command::Through { target: self.target, waypoints: waypoints.to_vec() })
    }

    /// Changes the speed along the path of a trajectory: 1 as it was written, 0.5 half as fast. The path stays the same, and all limits
    /// are kept: the change is a ramp that is as short as they allow. 0 is [`Handle::pause`]. Of a trajectory that is paused, it is the
    /// speed after [`Handle::resume`]. Returns when the change begins.
    ///
    /// # Errors
    /// [`CommandError::Rate`] for what the limits do not allow, [`CommandError::NoTrajectory`] if that motion is not a trajectory under way,
    /// and see [`CommandError`]. The trajectory goes on as before then.
    pub fn set_speed(&self, motion: MotionId, rate: f64) -> Result<(), CommandError> {
        self.done(Command::SetSpeed { motion, rate })
    }

    /// Brings the axes to rest on the path of a trajectory. Returns when they begin to slow down.
    ///
    /// # Errors
    /// As [`Handle::set_speed`].
    pub fn pause(&self, motion: MotionId) -> Result<(), CommandError> {
        self.done(Command::Pause(motion))
    }

    /// Goes on with a trajectory that was paused. Returns when it does.
    ///
    /// # Errors
    /// As [`Handle::set_speed`].
    pub fn resume(&self, motion: MotionId) -> Result<(), CommandError> {
        self.done(Command::Resume(motion))
    }

    /// How far a trajectory under way is: the time on its path in seconds, of how many, and the present rate. `None` of any other motion.
    /// It needs no lease.
    ///
    /// # Errors
    /// Of a controller of another process, why it has not said so.
    pub fn trajectory_progress(&self, motion: MotionId) -> Result<Option<TrajectoryProgress>, CommandError> {
        match self.backend.submit(Command::Progress(motion))? {
            Reply::Progress(progress) => Ok(progress),
            _ => Err(CommandError::Unanswered),
        }
    }

    /// Gives a drive in profile velocity a velocity (rad/s or m/s). Unless it is given again within `valid_for`, the group
    /// stops.
    ///
    /// # Errors
    /// As [`Handle::move_to`].
    pub fn velocity(
        &self,
        axis: usize,
        velocity: f64,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        self.begun(Command::Velocity { axis, velocity, valid_for })
    }

    /// Gives a drive in profile torque a torque (N·m or N). Unless it is given again within `valid_for`, the group stops.
    ///
    /// # Errors
    /// As [`Handle::move_to`].
    pub fn torque(&self, axis: usize, torque: f64, valid_for: Duration) -> Result<MotionId, CommandError> {
        self.begun(Command::Torque { axis, torque, valid_for })
    }

    /// Changes the mode of operation of every axis, as far as `modes` of the configuration allow. An axis that is in it already stays.
    ///
    /// The axes keep their places. A drive that takes another mode only while it is disabled must be disabled before
    /// ([`Handle::disable`]), and enabled again after that. [`Handle::wait`] returns when the drives show the new mode. Until then
    /// nothing else is possible but to stop and to disable, which ends the change. Of a stop of category 2, which leaves the change
    /// under way, the wait tells as well. A drive that does not show the mode in time is a fault, which must be reset, and is told its
    /// former mode again.
    ///
    /// With several groups, each changes by itself: see [`Handle::group`].
    ///
    /// ```no_run
    /// # fn example(arm: &takt::Handle) -> takt::Result {
    /// use std::time::Duration;
    /// use takt::{OperationMode, Phase};
    ///
    /// let patience = Duration::from_secs(5);
    /// arm.disable()?;
    /// arm.wait_for(Phase::Disabled, patience)?;
    /// let change = arm.change_mode(OperationMode::CyclicSynchronousVelocity)?;
    /// arm.wait(change, patience)?;
    /// arm.enable()?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`CommandError::Full`], [`CommandError::Ended`]. That the change is refused says [`Handle::wait`].
    pub fn change_mode(&self, mode: OperationMode) -> Result<MotionId, CommandError> {
        self.begun(Command::ChangeMode { target: self.target, mode })
    }

    /// As [`Handle::change_mode`], for one axis. The others of its group hold, or stay disabled, meanwhile.
    ///
    /// # Errors
    /// [`CommandError::NoSuchAxis`], and as [`Handle::change_mode`].
    pub fn change_axis_mode(&self, axis: usize, mode: OperationMode) -> Result<MotionId, CommandError> {
        self.begun(Command::ChangeAxisMode { axis, mode })
    }

    /// Requests a stop of this category, and returns at once. A stop is never refused. The real-time thread takes it in its next cycle. It
    /// discards all requests for the same axes that are still waiting, so that they neither delay the stop nor begin after it. It needs no
    /// lease, and is not queued behind any command.
    ///
    /// The call allocates nothing and takes no lock; to another process it makes two system calls or three that do not wait. So no other
    /// thread can hold it up, and it may be called in a signal handler.
    ///
    /// # Errors
    /// [`CommandError::Ended`]; of another process also [`CommandError::Lease`] without write permission, and [`CommandError::NoReply`] if
    /// it has taken none of many stops.
    pub fn stop(&self, category: StopCategory) -> Result<(), CommandError> {
        self.backend.stop(self.target, category)
    }

    /// Begins to bring the axes to rest and to disable them. It discards waiting requests as [`Handle::stop`] does.
    ///
    /// # Errors
    /// [`CommandError::Refused`], [`CommandError::Ended`].
    pub fn disable(&self) -> Result<(), CommandError> {
        self.done(Command::Disable(self.target))
    }

    /// Begins to enable the axes again: after [`Handle::disable`], or after a fault and [`Handle::reset_faults`]. Other groups may be in
    /// motion.
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless the axes are disabled and no fault is latched, [`CommandError::Full`],
    /// [`CommandError::Ended`].
    pub fn enable(&self) -> Result<(), CommandError> {
        self.done(Command::Enable(self.target))
    }

    /// Clears latched faults.
    ///
    /// # Errors
    /// [`CommandError::Refused`] in motion, [`CommandError::Full`], [`CommandError::Ended`].
    pub fn reset_faults(&self) -> Result<(), CommandError> {
        self.done(Command::ResetFaults(self.target))
    }

    /// Sends a frame that only reads to a device on a bus which is none of the configuration's, through the service channel: within its
    /// room in the schedule, one frame in 2 ms, and only while the drives are up. SDO uploads and reads in the protocols of vendors are such
    /// frames. The reply is for whoever listens on the bus. It needs no lease.
    ///
    /// # Errors
    /// [`CommandError::Question`], [`CommandError::Full`], [`CommandError::Ended`]; nothing is sent then.
    pub fn ask_device(&self, bus: usize, question: Frame) -> Result<(), CommandError> {
        self.done(Command::Question { bus, frame: question })
    }

    /// The process that commands a controller of another process; `None` if none does, and of a controller of this process, which every
    /// part of it may command.
    pub fn lease(&self) -> Option<LeaseHolder> {
        self.backend.lease()
    }

    /// Takes the lease, or renews it, without a command. A controller of this process needs none.
    ///
    /// # Errors
    /// [`CommandError::Lease`] if another process has it, or has taken it from this one.
    pub fn take_lease(&self) -> Result<(), CommandError> {
        self.done(Command::Lease { is_taken_over: false })
    }

    /// Takes the lease from whoever has it. What moves goes on.
    ///
    /// # Errors
    /// [`CommandError::Lease`] without write permission, [`CommandError::Ended`].
    pub fn take_over(&self) -> Result<(), CommandError> {
        self.done(Command::Lease { is_taken_over: true })
    }

    /// Gives the lease back, so that another process need not wait for its end.
    ///
    /// # Errors
    /// [`CommandError::Ended`].
    pub fn release(&self) -> Result<(), CommandError> {
        self.done(Command::Release)
    }

    /// Carries out what has no result.
    pub(super) fn done(&self, command: Command) -> Result<(), CommandError> {
        self.backend.submit(command).map(|_| ())
    }

    /// Begins a motion.
    fn begun(&self, command: Command) -> Result<MotionId, CommandError> {
        match self.backend.submit(command)? {
            Reply::Motion(motion) => Ok(motion),
            _ => Err(CommandError::Unanswered),
        }
    }
}

/// The groups of a state that a target means.
pub fn groups_in(state: &Snapshot, target: RequestTarget) -> &[GroupSnapshot] {
    match target {
        RequestTarget::All => state.groups(),
        RequestTarget::Group(number) => {
            let number = usize::from(number);
            state.groups().get(number..=number).unwrap_or_default()
        }
    }
}
