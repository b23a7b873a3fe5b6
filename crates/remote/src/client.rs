//! A client of a controller in another process, and what it observes.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use takt::command::{
    AxisProperties, LeaseHolder, MotionError, MotionId, RunningController, Stopped, WaitError, motion,
};
use takt::telemetry::{LoopTiming, Machine};
use takt_rt::{AxisLimits, Nanoseconds, Phase, RequestTarget, Snapshot};

use crate::connection::Connection;
use crate::shown::now_ns;

/// Commands and observes a controller of another process, from any thread. Clones are cheap and equal. It has the calls of a
/// [`Handle`](takt::Handle), with the same meaning and the same errors, but for those of the own process alone: the callbacks in the
/// real-time loop (`in_loop`), functions that make a trajectory (`execute_with`), and what its start has said (`realtime`, `not_written`).
///
/// # Who commands
/// Any number of clients observe. One of them commands: it has the *lease*. The first command takes the lease if nobody has it, and each
/// command renews it. It expires some time after the last one ([`ServeOptions::lease`](crate::ServeOptions)), or when its process ends;
/// then another client may take it. [`Client::take_over`] takes it from a client that still has it; that one gets
/// [`LeaseError::TakenOver`](takt::LeaseError::TakenOver) from then on, until it takes the controller over again itself.
///
/// A lease that expires stops nothing: a move goes on to its end, and a stream runs dry and comes to rest within the limits, as one of the
/// own process does. [`Client::stop`] needs no lease, and waits for nobody.
#[derive(Clone)]
pub struct Client(pub(crate) Arc<Connection>);

impl Client {
    /// The name that it was connected by.
    pub fn name(&self) -> &str {
        &self.0.names.name
    }

    /// The process of the controller.
    pub fn process(&self) -> u32 {
        self.0.shown.process()
    }

    /// How long ago the process of the controller last showed a cycle. It is longer than a few periods if that is paused, or overloaded.
    pub fn silent_for(&self) -> Duration {
        self.0.shown.silent_for()
    }

    /// The names and units of the machine, for texts about events and states.
    pub fn machine(&self) -> &Machine {
        &self.0.description.machine
    }

    /// The limits of an axis, in rad (m), seconds and N·m (N).
    pub fn limits(&self, axis: usize) -> Option<AxisLimits> {
        self.axis_properties(axis).map(|axis| axis.limits)
    }

    /// What the configuration says of an axis.
    pub fn axis_properties(&self, axis: usize) -> Option<AxisProperties> {
        self.0.description.axes.get(axis).cloned()
    }

    /// See [`Handle::period_ns`](takt::Handle::period_ns).
    pub fn period_ns(&self) -> Nanoseconds {
        self.machine().cycle_ns
    }

    /// See [`Handle::now_ns`](takt::Handle::now_ns): all processes of a computer share `CLOCK_MONOTONIC`.
    pub fn now_ns(&self) -> Nanoseconds {
        now_ns()
    }

    /// Who commands; `None` if nobody does.
    pub fn lease(&self) -> Option<LeaseHolder> {
        let lease = self.0.shown.lease();
        let left_ns = lease.until_ns.saturating_sub(now_ns());
        let is_held = lease.process != 0 && left_ns > 0;
        is_held.then_some(LeaseHolder { process: lease.process, expires_in: Duration::from_nanos(left_ns) })
    }

    /// Returns the number of times that the lease has changed hands. If it is another one than before, another client has commanded since
    /// then, or this one has taken the lease.
    pub fn lease_generation(&self) -> u64 {
        self.0.shown.lease().generation
    }

    /// See [`Handle::state`](takt::Handle::state). An ordinary thread shows it to other processes, shortly after it is complete.
    pub fn state(&self) -> Snapshot {
        self.0.shown.state().snapshot
    }

    /// See [`Handle::fault`](takt::Handle::fault).
    pub fn fault(&self) -> Option<Stopped> {
        self.fault_in(RequestTarget::All)
    }

    /// See [`Handle::timing`](takt::Handle::timing).
    pub fn timing(&self) -> LoopTiming {
        self.0.shown.timing()
    }

    /// Returns `true` if the controller has ended, or the process that it ran in: every command returns an error that says `Ended` then.
    pub fn has_ended(&self) -> bool {
        self.0.has_ended()
    }

    /// See [`Handle::next_cycle`](takt::Handle::next_cycle).
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn next_cycle(&self, at_most: Duration) -> Result<Snapshot, WaitError> {
        self.cycle_after(self.state().slot, at_most)
    }

    /// See [`Handle::cycle_after`](takt::Handle::cycle_after).
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn cycle_after(&self, slot: u64, at_most: Duration) -> Result<Snapshot, WaitError> {
        self.wait_until(at_most, |state| (state.slot > slot).then_some(*state))
    }

    /// See [`Handle::advance`](takt::Handle::advance).
    ///
    /// # Errors
    /// [`WaitError::Ended`].
    pub fn advance(&self, cycles: u64) -> Result<Snapshot, WaitError> {
        let state = self.state();
        match cycles.checked_sub(1) {
            _ if self.has_ended() => Err(WaitError::Ended),
            None => Ok(state),
            Some(others) => self.cycle_after(state.slot.saturating_add(others), Duration::MAX),
        }
    }

    /// See [`Handle::wait_for`](takt::Handle::wait_for).
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_for(&self, phase: Phase, at_most: Duration) -> Result<(), WaitError> {
        self.wait_for_phase(RequestTarget::All, phase, at_most)
    }

    /// Waits until `find` finds something in a state. It looks at one state of each cycle.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_until<T>(
        &self,
        at_most: Duration,
        mut find: impl FnMut(&Snapshot) -> Option<T>,
    ) -> Result<T, WaitError> {
        self.0.look_until(at_most, || find(&self.state()))
    }

    /// See [`Handle::wait`](takt::Handle::wait).
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn wait(&self, motion: MotionId, at_most: Duration) -> Result<(), MotionError> {
        match self.0.look_until(at_most, || self.result_in_state(motion)) {
            Ok(result) => result,
            Err(WaitError::NotInTime) => Err(MotionError::NotInTime),
            Err(WaitError::Ended) => Err(MotionError::Ended),
        }
    }

    /// See [`Handle::result_of`](takt::Handle::result_of).
    pub fn result_of(&self, motion: MotionId) -> Option<Result<(), MotionError>> {
        let has_ended = self.has_ended();
        self.result_in_state(motion).or_else(|| has_ended.then_some(Err(MotionError::Ended)))
    }

    fn result_in_state(&self, motion: MotionId) -> Option<Result<(), MotionError>> {
        let state = self.0.shown.state();
        motion::result_in(
            &state.snapshot,
            motion.request(),
            state.newest_stop(motion.target()),
            self.machine(),
        )
    }
}

impl fmt::Debug for Client {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Client")
            .field("name", &self.name())
            .field("process", &self.process())
            .finish()
    }
}
