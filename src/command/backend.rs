//! A running controller, wherever it runs.

use std::sync::Arc;
use std::time::Duration;

use takt_rt::{AxisPoint, Event, Nanoseconds, RequestId, RequestTarget, Snapshot, StopCategory};

use super::axis_properties::AxisProperties;
use super::error::{CommandError, StreamError, WaitError};
use super::lease_holder::LeaseHolder;
use super::requests::{Command, Reply};
use crate::telemetry::{LoopTiming, Machine};

/// What a [`Handle`](super::Handle) stands on: a running controller of this process or of another one.
pub trait Backend: Send + Sync {
    /// The names and units of the machine.
    fn machine(&self) -> &Machine;

    /// The numbers of the axes that a target means, in its order; none for a group that there is not.
    fn axes_of(&self, target: RequestTarget) -> Vec<usize>;

    /// What the configuration says of an axis.
    fn axis_properties(&self, axis: usize) -> Option<AxisProperties>;

    /// Shows the state after the newest complete cycle to `look`: a copy has twelve kilobytes.
    fn look(&self, look: &mut dyn FnMut(&Snapshot));

    /// The present time on the clock of the controller.
    fn now_ns(&self) -> Nanoseconds;

    /// How punctual all cycles since the start were.
    fn timing(&self) -> LoopTiming;

    /// Returns `true` if the controller has ended, or the process that it runs in.
    fn has_ended(&self) -> bool;

    /// The newest of the stops that the real-time thread has taken, of those that concern a target. It discards what was asked before.
    fn newest_stop(&self, target: RequestTarget) -> RequestId;

    /// Carries a command out.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    fn submit(&self, command: Command) -> Result<Reply, CommandError>;

    /// Requests a stop. It waits for nothing, allocates nothing and takes no lock, and is never refused.
    ///
    /// # Errors
    /// [`CommandError::Ended`]; of another process also [`CommandError::Lease`] without write permission.
    fn stop(&self, target: RequestTarget, category: StopCategory) -> Result<(), CommandError>;

    /// Takes a point of a stream, with an entry for each axis.
    ///
    /// # Errors
    /// See [`StreamError`].
    fn push(&self, target: RequestTarget, at_ns: Nanoseconds, axes: &[AxisPoint]) -> Result<(), StreamError>;

    /// Takes points at equal intervals from a time on, in place of every earlier point from there on.
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

    /// Waits until `look` finds in a state what it looks for. It sees one state of each cycle, or of each millisecond if the period is
    /// shorter.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    fn look_until(&self, at_most: Duration, look: &mut dyn FnMut(&Snapshot) -> bool)
    -> Result<(), WaitError>;

    /// Waits for a state that is newer than that of `slot`, and returns it.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    fn cycle_after(&self, slot: u64, at_most: Duration) -> Result<Snapshot, WaitError>;

    /// The events from now on.
    fn events(self: Arc<Self>) -> Box<dyn EventSource>;

    /// The process that has the lease; `None` if none has, and of a controller of this process, which every part of it may command.
    fn lease(&self) -> Option<LeaseHolder>;
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
