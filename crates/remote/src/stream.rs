//! The stream of a controller in another process.

use std::time::Duration;

use takt::command::{RunningController, StreamError};
use takt_rt::{AxisPoint, Nanoseconds, RequestTarget, StreamReport};

use crate::client::Client;
use crate::shown::now_ns;

/// Hands points to the stream of a controller in another process, from any thread. It has the calls of a
/// [`StreamHandle`](takt::StreamHandle), with the same meaning. Each call waits for the answer of the other process.
#[derive(Clone, Debug)]
pub struct ClientStream {
    client: Client,
    target: RequestTarget,
}

impl Client {
    /// See [`Handle::stream`](takt::Handle::stream).
    pub fn stream(&self) -> ClientStream {
        ClientStream::new(self.clone(), RequestTarget::All)
    }
}

impl ClientStream {
    pub(super) const fn new(client: Client, target: RequestTarget) -> Self {
        Self { client, target }
    }

    /// The present time on the clock of the stamps: `CLOCK_MONOTONIC`, which all processes of the computer share.
    pub fn now_ns() -> Nanoseconds {
        now_ns()
    }

    /// See [`StreamHandle::push`](takt::StreamHandle::push).
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn push<P: Copy + Into<AxisPoint>>(&self, at_ns: Nanoseconds, axes: &[P]) -> Result<(), StreamError> {
        let axes: Vec<AxisPoint> = axes.iter().map(|axis| (*axis).into()).collect();
        self.client.push_point(self.target, at_ns, &axes)
    }

    /// See [`StreamHandle::push_now`](takt::StreamHandle::push_now).
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn push_now<P: Copy + Into<AxisPoint>>(&self, axes: &[P]) -> Result<(), StreamError> {
        self.push(now_ns(), axes)
    }

    /// See [`StreamHandle::push_chunk`](takt::StreamHandle::push_chunk). A chunk of more than about 150 points of six axes goes in parts, so
    /// that after an error the parts before may have been taken.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn push_chunk<P: Copy + Into<AxisPoint>, A: AsRef<[P]>>(
        &self,
        from_ns: Nanoseconds,
        interval: Duration,
        points: &[A],
    ) -> Result<(), StreamError> {
        let entries = |axes: &A| axes.as_ref().iter().map(|axis| (*axis).into()).collect();
        let points: Vec<Vec<AxisPoint>> = points.iter().map(entries).collect();
        self.client.push_chunk(self.target, from_ns, interval, &points)
    }

    /// See [`StreamHandle::report`](takt::StreamHandle::report).
    pub fn report(&self) -> StreamReport {
        self.client.stream_report(self.target)
    }

    /// How far the set-points are behind the stamps now.
    pub fn lag(&self) -> Duration {
        Duration::from_nanos(self.report().counts.lag_ns)
    }
}
