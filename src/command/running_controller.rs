//! A running controller, wherever it runs.

use std::time::Duration;

use takt_rt::{
    Answer, AxisPoint, Event, Frame, GroupSnapshot, Nanoseconds, OperationMode, Phase, RequestId,
    RequestTarget, Rule, Snapshot, StopCategory, StreamReport, StreamState,
};

use super::axis_properties::AxisProperties;
use super::error::{CommandError, MotionError, RecoveryError, Stopped, StreamError, WaitError};
use super::lease_holder::LeaseHolder;
use super::motion::{MotionId, MoveOptions, TrajectoryProgress};
use crate::telemetry::{LoopTiming, Machine};
use crate::trajectory::TrajectoryPoint;

/// Drives that have not reported within this time are brought up again. It covers several reports of the slowest drive.
const REPORTS_WITHIN: Duration = Duration::from_secs(1);

/// A running controller, in this process ([`Handle`](crate::Handle)) or in another one (`Client` of `takt-remote`): the calls that both
/// have, for programs and bindings that hold either.
///
/// `target` says whose axes are meant: all of the controller, or those of one group, by its number in the configuration. Values of axes
/// come in the order of the controller or of the group. Units are rad, rad/s, N·m (m, m/s, N) and seconds.
pub trait RunningController: Send + Sync {
    /// The names and units of the machine, for texts about events and states.
    fn machine(&self) -> &Machine;

    /// The numbers of the axes that a target means, in its order; none for a group that there is not.
    fn axes_of(&self, target: RequestTarget) -> Vec<usize>;

    /// What the configuration says of an axis.
    fn axis_properties(&self, axis: usize) -> Option<AxisProperties>;

    /// The state after the newest complete cycle that is known here.
    fn state(&self) -> Snapshot;

    /// Shows that state to `look`, without a copy of it where that is possible: a state has twelve kilobytes.
    fn look_at_state(&self, look: &mut dyn FnMut(&Snapshot)) {
        look(&self.state());
    }

    /// The present time on the clock of the controller, which states, events and stamps are on: `CLOCK_MONOTONIC`, or virtual time.
    fn now_ns(&self) -> Nanoseconds;

    /// How punctual all cycles since the start were; a few milliseconds old. All times are 0 in virtual time.
    fn timing(&self) -> LoopTiming;

    /// Returns `true` if the controller has ended, or the process that it runs in.
    fn has_ended(&self) -> bool;

    /// The newest of the stops that the real-time thread has taken, of those that concern a target. It discards what was asked before.
    fn newest_stop(&self, target: RequestTarget) -> RequestId;

    /// Waits for a state that is newer than that of `slot`, and returns it.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    fn cycle_after(&self, slot: u64, at_most: Duration) -> Result<Snapshot, WaitError>;

    /// Waits for so many cycles, and returns the state after them. In virtual time it runs them.
    ///
    /// # Errors
    /// [`WaitError::Ended`] if the controller has ended before them.
    fn advance(&self, cycles: u64) -> Result<Snapshot, WaitError>;

    /// Waits until `look` finds in a state what it looks for. It sees one state of each cycle, or of each millisecond if the period is
    /// shorter.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    fn wait_until_seen(
        &self,
        at_most: Duration,
        look: &mut dyn FnMut(&Snapshot) -> bool,
    ) -> Result<(), WaitError>;

    /// The events from now on.
    fn event_source(&self) -> Box<dyn EventSource>;

    /// Starts a coordinated move to these positions.
    ///
    /// # Errors
    /// See [`Handle::move_to`](crate::Handle::move_to); nothing has changed then.
    fn begin_move(
        &self,
        target: RequestTarget,
        positions: &[f64],
        options: MoveOptions,
    ) -> Result<MotionId, CommandError>;

    /// Starts a coordinated move by these distances from the present set-points.
    ///
    /// # Errors
    /// See [`Handle::move_by`](crate::Handle::move_by); nothing has changed then.
    fn begin_move_by(
        &self,
        target: RequestTarget,
        distances: &[f64],
        options: MoveOptions,
    ) -> Result<MotionId, CommandError>;

    /// Starts a trajectory through points with times.
    ///
    /// # Errors
    /// See [`Handle::execute`](crate::Handle::execute); nothing has changed then.
    fn begin_trajectory(
        &self,
        target: RequestTarget,
        points: &[TrajectoryPoint],
    ) -> Result<MotionId, CommandError>;

    /// Starts a trajectory through waypoints.
    ///
    /// # Errors
    /// See [`Handle::move_through`](crate::Handle::move_through); nothing has changed then.
    fn begin_through(&self, target: RequestTarget, waypoints: &[Vec<f64>]) -> Result<MotionId, CommandError>;

    /// Sends a frame that only reads to a device which is none of the configuration's. It needs no lease.
    ///
    /// # Errors
    /// See [`Handle::ask_device`](crate::Handle::ask_device); nothing is sent then.
    fn ask_device(&self, bus: usize, question: Frame) -> Result<(), CommandError>;

    /// Changes the speed along a trajectory under way.
    ///
    /// # Errors
    /// See [`Handle::set_speed`](crate::Handle::set_speed).
    fn set_speed(&self, motion: MotionId, rate: f64) -> Result<(), CommandError>;

    /// Brings the axes to rest on the path of a trajectory under way.
    ///
    /// # Errors
    /// See [`Handle::set_speed`](crate::Handle::set_speed).
    fn pause(&self, motion: MotionId) -> Result<(), CommandError>;

    /// Goes on with a trajectory that was paused.
    ///
    /// # Errors
    /// See [`Handle::set_speed`](crate::Handle::set_speed).
    fn resume(&self, motion: MotionId) -> Result<(), CommandError>;

    /// How far a trajectory under way is; `None` of any other motion.
    ///
    /// # Errors
    /// Of a controller of another process, why it has not said so.
    fn trajectory_progress(&self, motion: MotionId) -> Result<Option<TrajectoryProgress>, CommandError>;

    /// Gives a drive in profile velocity a velocity.
    ///
    /// # Errors
    /// See [`Handle::velocity`](crate::Handle::velocity).
    fn velocity(&self, axis: usize, velocity: f64, valid_for: Duration) -> Result<MotionId, CommandError>;

    /// Gives a drive in profile torque a torque.
    ///
    /// # Errors
    /// See [`Handle::torque`](crate::Handle::torque).
    fn torque(&self, axis: usize, torque: f64, valid_for: Duration) -> Result<MotionId, CommandError>;

    /// Changes the mode of operation of the axes of a target.
    ///
    /// # Errors
    /// See [`Handle::change_mode`](crate::Handle::change_mode).
    fn begin_mode_change(&self, target: RequestTarget, mode: OperationMode)
    -> Result<MotionId, CommandError>;

    /// Changes the mode of operation of one axis.
    ///
    /// # Errors
    /// See [`Handle::change_axis_mode`](crate::Handle::change_axis_mode).
    fn change_axis_mode(&self, axis: usize, mode: OperationMode) -> Result<MotionId, CommandError>;

    /// The axes of a target begin to follow the points of [`RunningController::push_point`].
    ///
    /// # Errors
    /// See [`Handle::begin_stream`](crate::Handle::begin_stream).
    fn begin_streaming(&self, target: RequestTarget) -> Result<(), CommandError>;

    /// Takes a point of a stream, with an entry for each axis, that is meant for a time of `CLOCK_MONOTONIC`.
    ///
    /// # Errors
    /// See [`StreamError`].
    fn push_point(
        &self,
        target: RequestTarget,
        at_ns: Nanoseconds,
        axes: &[AxisPoint],
    ) -> Result<(), StreamError>;

    /// Takes a chunk of a stream: points at equal intervals from a time on, in place of every earlier point from there on.
    ///
    /// # Errors
    /// See [`StreamError`].
    fn push_chunk(
        &self,
        target: RequestTarget,
        from_ns: Nanoseconds,
        interval: Duration,
        points: &[Vec<AxisPoint>],
    ) -> Result<(), StreamError>;

    /// Requests a stop of this category. It waits for nothing, and is never refused.
    ///
    /// # Errors
    /// [`CommandError::Ended`]; of a client also [`CommandError::Lease`] without write permission.
    fn request_stop(&self, target: RequestTarget, category: StopCategory) -> Result<(), CommandError>;

    /// Begins to enable the axes of a target.
    ///
    /// # Errors
    /// See [`Handle::enable`](crate::Handle::enable).
    fn begin_enable(&self, target: RequestTarget) -> Result<(), CommandError>;

    /// Begins to bring the axes of a target to rest and to disable them.
    ///
    /// # Errors
    /// See [`Handle::disable`](crate::Handle::disable).
    fn begin_disable(&self, target: RequestTarget) -> Result<(), CommandError>;

    /// Clears the latched faults of a target.
    ///
    /// # Errors
    /// See [`Handle::reset_faults`](crate::Handle::reset_faults).
    fn clear_faults(&self, target: RequestTarget) -> Result<(), CommandError>;

    /// Begins to bring the drives of a target up again, which must be disabled.
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless they are disabled, and as [`Handle::enable`](crate::Handle::enable).
    fn begin_bring_up(&self, target: RequestTarget) -> Result<(), CommandError>;

    /// Why drives of a target were not brought up again; `None` if they were, or are being brought up.
    ///
    /// # Errors
    /// Of a controller of another process, why it has not said so.
    fn bring_up_failure(&self, target: RequestTarget) -> Result<Option<String>, CommandError>;

    /// How a motion has ended; `None` while it is under way. Does not wait.
    fn result_of(&self, motion: MotionId) -> Option<Result<(), MotionError>>;

    /// Waits until a motion has ended.
    ///
    /// # Errors
    /// See [`MotionError`].
    fn wait(&self, motion: MotionId, at_most: Duration) -> Result<(), MotionError>;

    /// The client of another process that has the lease; `None` if nobody has, and of a controller of this process, which every part of
    /// the program may command.
    fn lease(&self) -> Option<LeaseHolder>;

    /// Takes the lease, or renews it. A controller of this process needs none.
    ///
    /// # Errors
    /// See `Client::take_lease` of `takt-remote`.
    fn take_lease(&self) -> Result<(), CommandError>;

    /// Takes the lease from whoever has it. A controller of this process needs none.
    ///
    /// # Errors
    /// See `Client::take_over` of `takt-remote`.
    fn take_over(&self) -> Result<(), CommandError>;

    /// Gives the lease back.
    ///
    /// # Errors
    /// See `Client::release` of `takt-remote`.
    fn release(&self) -> Result<(), CommandError>;

    /// The period of the cycle.
    fn period_ns(&self) -> Nanoseconds {
        self.machine().cycle_ns
    }

    /// The group with this name in the configuration.
    ///
    /// # Errors
    /// [`CommandError::NoSuchGroup`].
    fn group_named(&self, name: &str) -> Result<RequestTarget, CommandError> {
        let groups = &self.machine().groups;
        let found = (0..).zip(groups).find(|(_, group)| *group == name);
        let (number, _) = found
            .ok_or_else(|| CommandError::NoSuchGroup { name: name.to_owned(), groups: groups.clone() })?;
        Ok(RequestTarget::Group(number))
    }

    /// The fault that has stopped a target and has not been reset: the first, of several groups.
    fn fault_in(&self, target: RequestTarget) -> Option<Stopped> {
        let mut first = None;
        self.look_at_state(&mut |state| {
            let faults = groups_in(state, target).iter().filter_map(|group| group.stop);
            first = faults.filter(|stop| !stop.is_requested()).min_by_key(|stop| stop.slot);
        });
        first.map(|stop| Stopped::new(stop, self.machine()))
    }

    /// What the stream of a target is doing: of several groups, that of the first one that follows its points.
    fn stream_report(&self, target: RequestTarget) -> StreamReport {
        let mut report = StreamReport::default();
        self.look_at_state(&mut |state| {
            let groups = groups_in(state, target);
            let followed = |group: &&GroupSnapshot| group.stream.state != StreamState::Idle;
            let shown = groups.iter().find(followed).or(groups.first());
            report = shown.map_or(report, |group| group.stream);
        });
        report
    }

    /// Brings the drives of a target up again: after one has lost its power or was reset, or after its interface was down. Returns when they
    /// report, disabled. A latched fault stays.
    ///
    /// # Errors
    /// See [`RecoveryError`]. A bring-up that takes longer than `at_most` continues. After one that has failed, the drives stay disabled, and
    /// enabling them is refused ([`RejectReason::NotBroughtUp`](takt_rt::RejectReason::NotBroughtUp)) until a bring-up has succeeded.
    fn bring_up(&self, target: RequestTarget, at_most: Duration) -> Result<(), RecoveryError> {
        self.begin_bring_up(target)?;
        let mut result = None;
        self.wait_until_seen(at_most, &mut |state| {
            result = self.bring_up_result(target, state);
            result.is_some()
        })?;
        result.unwrap_or(Ok(()))
    }

    /// Returns the result of the bring-up of a target that was begun before a state; `None` while it is under way. Does not wait.
    fn bring_up_result(&self, target: RequestTarget, state: &Snapshot) -> Option<Result<(), RecoveryError>> {
        if groups_in(state, target).iter().any(|group| group.phase == Phase::Passive) {
            return None;
        }
        match self.bring_up_failure(target) {
            Ok(Some(words)) => return Some(Err(RecoveryError::NotBroughtUp { words })),
            Ok(None) => {}
            Err(error) => return Some(Err(error.into())),
        }
        let is_confirmed = groups_in(state, target).iter().all(|group| !group.needs_bring_up);
        is_confirmed.then_some(Ok(()))
    }

    /// Takes the groups of a target out of what has stopped them, one after the other: waits until each is still, clears its fault, brings
    /// drives up that do not report any more or whose last bring-up has failed, and enables. Returns when they hold their positions. A group
    /// that is in operation without a fault continues. A stop that comes meanwhile ends it: the group is not enabled then.
    ///
    /// # Errors
    /// See [`RecoveryError`]; the groups that come after that one are as they were.
    fn recover(&self, target: RequestTarget, at_most: Duration) -> Result<(), RecoveryError> {
        let until_ns = self.now_ns().saturating_add(u64::try_from(at_most.as_nanos()).unwrap_or(u64::MAX));
        let groups = u8::try_from(self.machine().groups.len()).unwrap_or(u8::MAX);
        let targets: Vec<RequestTarget> = match target {
            RequestTarget::All if groups > 1 => (0..groups).map(RequestTarget::Group).collect(),
            target => vec![target],
        };
        // A stop that comes while one group recovers ends the recovery of those that follow, too.
        let targets: Vec<_> = targets.into_iter().map(|group| (group, self.newest_stop(group))).collect();
        targets.into_iter().try_for_each(|(group, stop)| {
            self.recover_group(group, stop, Duration::from_nanos(until_ns.saturating_sub(self.now_ns())))
        })
    }

    /// As [`RunningController::recover`], for one group, unless a stop has come after `stop`.
    ///
    /// # Errors
    /// See [`RecoveryError`].
    fn recover_group(
        &self,
        target: RequestTarget,
        stop: RequestId,
        at_most: Duration,
    ) -> Result<(), RecoveryError> {
        let until_ns = self.now_ns().saturating_add(u64::try_from(at_most.as_nanos()).unwrap_or(u64::MAX));
        let rest = || Duration::from_nanos(until_ns.saturating_sub(self.now_ns()));
        let is = |state: &Snapshot, phases: &[Phase]| {
            groups_in(state, target).iter().all(|group| phases.contains(&group.phase))
        };
        let fault = self.fault_in(target);
        let not_overtaken = || match self.newest_stop(target) == stop {
            true => Ok(()),
            false => Err(CommandError::Overtaken),
        };
        if fault.is_none() && is(&self.state(), &[Phase::Holding, Phase::Moving, Phase::Streaming]) {
            return Ok(());
        }
        self.wait_until_seen(rest(), &mut |state| is(state, &[Phase::Holding, Phase::Disabled]))?;
        // A drive that has started anew may report, and is not configured.
        let has_restarted = fault.is_some_and(|stopped| {
            matches!(
                stopped.reason.rule(),
                Rule::UnexpectedBootUp | Rule::NodeLost | Rule::NodeNotOperational
            )
        });
        not_overtaken()?;
        self.clear_faults(target)?;
        if !is(&self.state(), &[Phase::Disabled]) {
            return self.enabled(target, rest());
        }
        let needs_bring_up =
            has_restarted || groups_in(&self.state(), target).iter().any(|group| group.needs_bring_up);
        let axes = self.axes_of(target);
        let is_reporting = |state: &Snapshot| {
            axes.iter().all(|axis| state.axes().get(*axis).is_some_and(|axis| !axis.is_stale()))
        };
        // One report may be missing on a bus that works.
        let are_reporting =
            || self.wait_until_seen(rest().min(REPORTS_WITHIN), &mut |state| is_reporting(state)).is_ok();
        if needs_bring_up || !are_reporting() {
            not_overtaken()?;
            self.bring_up(target, rest())?;
        }
        self.clear_faults(target)?;
        not_overtaken()?;
        self.begin_enable(target)?;
        self.enabled(target, rest())
    }

    /// Waits until every group of a target holds its position, or a fault keeps one from it.
    ///
    /// # Errors
    /// [`RecoveryError::Stopped`], [`RecoveryError::Wait`].
    fn enabled(&self, target: RequestTarget, at_most: Duration) -> Result<(), RecoveryError> {
        let mut fault = None;
        self.wait_until_seen(at_most, &mut |state| {
            let groups = groups_in(state, target);
            let stops = groups.iter().filter_map(|group| group.stop).filter(|stop| !stop.is_requested());
            fault = stops.min_by_key(|stop| stop.slot);
            fault.is_some() || groups.iter().all(|group| group.phase == Phase::Holding)
        })?;
        fault.map_or(Ok(()), |stop| Err(Stopped::new(stop, self.machine()).into()))
    }

    /// Waits until every group of a target is in a phase.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    fn wait_for_phase(
        &self,
        target: RequestTarget,
        phase: Phase,
        at_most: Duration,
    ) -> Result<(), WaitError> {
        self.wait_until_seen(at_most, &mut |state| {
            let groups = groups_in(state, target);
            !groups.is_empty() && groups.iter().all(|group| group.phase == phase)
        })
    }

    /// Waits until a stop that came after `before` has been taken, and every group of a target holds or is off. `before` is the
    /// [`newest_stop`](RunningController::newest_stop) before the stop was asked for.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    fn wait_until_still(
        &self,
        target: RequestTarget,
        before: RequestId,
        at_most: Duration,
    ) -> Result<(), WaitError> {
        let is_still = |phase| matches!(phase, Phase::Holding | Phase::Disabled | Phase::Passive);
        self.wait_until_seen(at_most, &mut |state| {
            let stop = self.newest_stop(target);
            let is_shown = state.answers.of(stop) != Answer::None || state.answers.have_forgotten(stop);
            stop > before && is_shown && groups_in(state, target).iter().all(|group| is_still(group.phase))
        })
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

/// The events of a running controller, wherever it runs. As an iterator it never waits: later events may follow `None`.
pub trait EventSource: Iterator<Item = Event> + Send {
    /// Waits for the next event, for no longer than `at_most`.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`]; [`WaitError::Ended`] if the controller has ended and no event is left.
    fn wait(&mut self, at_most: Duration) -> Result<Event, WaitError>;

    /// How many events were missed because this observer was too slow.
    fn missed(&self) -> u64;
}
