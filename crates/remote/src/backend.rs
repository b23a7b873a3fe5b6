//! A controller of another process as what a handle stands on.

use std::sync::Arc;
use std::time::Duration;

use takt::command::{
    AxisProperties, Backend, Command, CommandError, EventSource, LeaseHolder, Reply, StreamError, WaitError,
};
use takt::telemetry::{LoopTiming, Machine};
use takt_rt::{AxisPoint, Nanoseconds, RequestId, RequestTarget, Snapshot, StopCategory};

use crate::commands::{Asked, chunk_points};
use crate::connection::Connection;
use crate::events::ShownEvents;
use crate::shown::now_ns;

impl Backend for Connection {
    fn machine(&self) -> &Machine {
        &self.description.machine
    }

    fn axes_of(&self, target: RequestTarget) -> Vec<usize> {
        self.description.axes_of(target)
    }

    fn axis_properties(&self, axis: usize) -> Option<AxisProperties> {
        self.description.axes.get(axis).cloned()
    }

    fn look(&self, look: &mut dyn FnMut(&Snapshot)) {
        look(&self.shown.state().snapshot);
    }

    fn now_ns(&self) -> Nanoseconds {
        now_ns()
    }

    fn timing(&self) -> LoopTiming {
        self.shown.timing()
    }

    fn has_ended(&self) -> bool {
        self.is_over()
    }

    fn newest_stop(&self, target: RequestTarget) -> RequestId {
        self.shown.state().newest_stop(target)
    }

    fn submit(&self, command: Command) -> Result<Reply, CommandError> {
        self.command(command)
    }

    fn stop(&self, target: RequestTarget, category: StopCategory) -> Result<(), CommandError> {
        self.send_stop(target, category)
    }

    fn push(&self, target: RequestTarget, at_ns: Nanoseconds, axes: &[AxisPoint]) -> Result<(), StreamError> {
        self.points(Asked::Point { target, at_ns, axes: axes.to_vec() })
    }

    fn push_chunk(
        &self,
        target: RequestTarget,
        from_ns: Nanoseconds,
        interval: Duration,
        points: &[Vec<AxisPoint>],
    ) -> Result<(), StreamError> {
        // A chunk takes the place of what comes after it, so a part of it is a chunk of its own.
        let each = chunk_points(points.iter().map(Vec::len).max().unwrap_or(0)).max(1);
        let interval_ns = u64::try_from(interval.as_nanos()).unwrap_or(u64::MAX);
        for (part, points) in (0..).zip(points.chunks(each)) {
            let before_ns = interval_ns.saturating_mul(part * each as u64);
            let from_ns = from_ns.saturating_add(before_ns);
            self.points(Asked::Chunk { target, from_ns, interval, points: points.to_vec() })?;
        }
        Ok(())
    }

    fn look_until(
        &self,
        at_most: Duration,
        look: &mut dyn FnMut(&Snapshot) -> bool,
    ) -> Result<(), WaitError> {
        self.await_found(at_most, || look(&self.shown.state().snapshot).then_some(()))
    }

    fn cycle_after(&self, slot: u64, at_most: Duration) -> Result<Snapshot, WaitError> {
        self.await_found(at_most, || {
            let state = self.shown.state().snapshot;
            (state.slot > slot).then_some(state)
        })
    }

    fn events(self: Arc<Self>) -> Box<dyn EventSource> {
        Box::new(ShownEvents::new(self))
    }

    fn lease(&self) -> Option<LeaseHolder> {
        let lease = self.shown.lease();
        let left_ns = lease.until_ns.saturating_sub(now_ns());
        let is_held = lease.process != 0 && left_ns > 0;
        is_held.then_some(LeaseHolder { process: lease.process, expires_in: Duration::from_nanos(left_ns) })
    }
}
