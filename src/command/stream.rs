//! Streams: points stamped with the time that they are meant for, from any thread.

use std::time::Duration;

use arrayvec::ArrayVec;
use takt_rt::{AxisPoint, GroupSnapshot, MAX_AXES, Nanoseconds, StreamReport, StreamState};

use super::backend::Backend;
use super::error::{CommandError, StreamError};
use super::handle::{Handle, groups_in};
use super::requests::Command;

/// Hands points to the stream of a group, or to those of all groups, from any thread. Clones are cheap and equal.
///
/// Stamps are in nanoseconds of the clock that [`StreamHandle::now_ns`] shows. The set-points run behind the stamps by
/// [`lag`](StreamHandle::lag), which depends on the interval of the points, on how late they come, and on the configuration
/// (`[stream] delay`).
///
/// A group follows its points from [`Handle::begin_stream`] on, until a stop or a fault ends its stream. A stream begins empty: at any
/// other time points are refused ([`StreamError::NotStreaming`]), and those that still wait when a stream ends are discarded, and counted
/// among the lost ones. To a controller in another process, each call waits for its answer.
pub struct StreamHandle<B: Backend + ?Sized = dyn Backend>(pub(crate) Handle<B>);

impl<B: Backend + ?Sized> Clone for StreamHandle<B> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<B: Backend + ?Sized> Handle<B> {
    /// Each group begins to follow the points of [`Handle::stream`]. The first one must come within the enable time-out. The axes are led to it
    /// within their limits; where an axis is to `follow = "exact"`, it must be near the joint.
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless the group holds its position and is punctual, and see [`CommandError`].
    pub fn begin_stream(&self) -> Result<(), CommandError> {
        self.done(Command::BeginStream(self.target()))
    }

    /// A handle to stream points for its axes by, in their order, for any thread.
    pub fn stream(&self) -> StreamHandle<B> {
        StreamHandle(self.clone())
    }
}

impl<B: Backend + ?Sized> StreamHandle<B> {
    /// The present time on the clock of the stamps: see [`Handle::now_ns`].
    pub fn now_ns(&self) -> Nanoseconds {
        self.0.now_ns()
    }

    /// Takes a point that is meant for a time: for each axis a position, or an [`AxisPoint`] with more than that, or with something
    /// else: a velocity, a torque, or an impedance. Points may come early, late, and in any order. One with the stamp of another one takes its place.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn push<P: Copy + Into<AxisPoint>>(&self, at_ns: Nanoseconds, axes: &[P]) -> Result<(), StreamError> {
        if axes.len() > MAX_AXES {
            return Err(StreamError::Count { given: axes.len(), axes: self.0.axis_numbers().len() });
        }
        let entries: ArrayVec<AxisPoint, MAX_AXES> = axes.iter().map(|axis| (*axis).into()).collect();
        self.0.backend().push(self.0.target(), at_ns, &entries)
    }

    /// The same as [`StreamHandle::push`] for a point that is meant for now.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn push_now<P: Copy + Into<AxisPoint>>(&self, axes: &[P]) -> Result<(), StreamError> {
        self.push(self.now_ns(), axes)
    }

    /// Takes a chunk: points at equal intervals, the first of which is meant for `from_ns`. It takes the place of every earlier
    /// point from there on. To another process, a chunk of more than about 150 points of six axes goes in parts, so that after an error
    /// the parts before may have been taken.
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
        self.0.backend().push_chunk(self.0.target(), from_ns, interval, &points)
    }

    /// What the stream is doing, how far it is behind the stamps, and how many points have come, came late or were lost. Of the
    /// streams of several groups, it is the first that a group follows.
    pub fn report(&self) -> StreamReport {
        self.0.look_at_state(|state| {
            let groups = groups_in(state, self.0.target());
            let followed = |group: &&GroupSnapshot| group.stream.state != StreamState::Idle;
            let shown = groups.iter().find(followed).or(groups.first());
            shown.map_or(StreamReport::default(), |group| group.stream)
        })
    }

    /// How far the set-points are behind the stamps now.
    pub fn lag(&self) -> Duration {
        Duration::from_nanos(self.report().counts.lag_ns)
    }
}
