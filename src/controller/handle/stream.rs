//! Streams: points stamped with the time that they are meant for, from any thread.

use std::cell::OnceCell;
use std::time::Duration;

use arrayvec::ArrayVec;
use takt_rt::{
    AxisPoint, MAX_AXES, Nanoseconds, PointRole, Request, RequestTarget, Snapshot, StreamPoint, StreamReport,
};

use super::{GroupHandle, Handle};
use crate::channels::{ChannelError, SentPoint, chunk};
use crate::command::{CommandError, RunningController, StreamError, check_point};

/// Hands points to the stream of a group, or to those of all groups, from any thread. Clones are cheap and equal.
///
/// Stamps are in nanoseconds of the clock that [`StreamHandle::now_ns`] shows. The set-points run behind the stamps by
/// [`lag`](StreamHandle::lag), which depends on the interval of the points, on how late they come, and on the configuration
/// (`[stream] delay`).
///
/// A group follows its points from [`Handle::begin_stream`] or [`GroupHandle::begin_stream`] on, until a stop or a fault ends its stream.
/// A stream begins empty: at any other time points are refused ([`StreamError::NotStreaming`]), and those that still wait when a stream ends
/// are discarded, and counted among the lost ones.
#[derive(Clone)]
pub struct StreamHandle {
    handle: Handle,
    to: StreamTarget,
}

/// Whose stream gets the points.
#[derive(Clone)]
enum StreamTarget {
    /// A point has an entry for each axis of the controller.
    All,
    /// A point has an entry for each axis of this group, in the order of the group.
    Group { number: u8, axes: usize },
}

/// What a point says of each axis that it is for.
type Entries = ArrayVec<AxisPoint, MAX_AXES>;

impl StreamHandle {
    /// The present time on the clock of the stamps: see [`Handle::now_ns`].
    pub fn now_ns(&self) -> Nanoseconds {
        self.handle.now_ns()
    }

    /// Takes a point that is meant for a time: for each axis a position, or an [`AxisPoint`] with more than that, or with something
    /// else: a velocity, a torque, or an impedance. Points may come early, late, and in any order. One with the stamp of another one takes its place.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn push<P: Copy + Into<AxisPoint>>(&self, at_ns: Nanoseconds, axes: &[P]) -> Result<(), StreamError> {
        let mut entries = ArrayVec::new();
        self.check_entries(0, axes, &mut entries)?;
        self.hand_over(&[SentPoint { at_ns, role: PointRole::Single, axes: &entries }])
    }

    /// The same as [`StreamHandle::push`] for a point that is meant for now.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn push_now<P: Copy + Into<AxisPoint>>(&self, axes: &[P]) -> Result<(), StreamError> {
        self.push(self.now_ns(), axes)
    }

    /// Takes a chunk: points at equal intervals, the first of which is meant for `from_ns`. It takes the place of every earlier
    /// point from there on.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn push_chunk<P: Copy + Into<AxisPoint>, A: AsRef<[P]>>(
        &self,
        from_ns: Nanoseconds,
        interval: Duration,
        points: &[A],
    ) -> Result<(), StreamError> {
        let mut entries = vec![Entries::new(); points.len()];
        for (index, (entries, axes)) in entries.iter_mut().zip(points).enumerate() {
            self.check_entries(index, axes.as_ref(), entries)?;
        }
        let interval_ns = u64::try_from(interval.as_nanos()).unwrap_or(u64::MAX);
        self.hand_over(&chunk(from_ns, interval_ns, &entries))
    }

    /// Takes points that are stamped already, with an entry for each axis: all of them, or none.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn push_points(&self, points: &[StreamPoint]) -> Result<(), StreamError> {
        if self.handle.0.life.is_ending() {
            return Err(StreamError::Ended);
        }
        let state = OnceCell::new();
        for (number, point) in points.iter().enumerate() {
            for (axis, entry) in point.axes.iter().enumerate().take(self.axis_count()) {
                self.check(number, axis, entry, &state)?;
            }
        }
        self.hand_over(points)
    }

    /// What the stream is doing, how far it is behind the stamps, and how many points have come, came late or were lost. Of the
    /// streams of several groups, it is the first that a group follows.
    pub fn report(&self) -> StreamReport {
        self.handle.stream_report(match self.to {
            StreamTarget::All => RequestTarget::All,
            StreamTarget::Group { number, .. } => RequestTarget::Group(number),
        })
    }

    /// How far the set-points are behind the stamps now.
    pub fn lag(&self) -> Duration {
        Duration::from_nanos(self.report().counts.lag_ns)
    }

    fn hand_over<'a, P>(&self, points: &'a [P]) -> Result<(), StreamError>
    where
        &'a P: Into<SentPoint<'a>>,
    {
        let streamer = &self.handle.0.streamer;
        let handed = match self.to {
            StreamTarget::All => streamer.push(points),
            StreamTarget::Group { number, .. } => streamer.push_to(number, points),
        };
        handed.map_err(|error| match error {
            ChannelError::NotStreaming => StreamError::NotStreaming,
            ChannelError::Full | ChannelError::NoSuchBus { .. } => StreamError::Full,
        })
    }

    fn axis_count(&self) -> usize {
        match self.to {
            StreamTarget::All => self.handle.axes().len(),
            StreamTarget::Group { axes, .. } => axes,
        }
    }

    /// Checks the entries of a point, and puts them into `entries`, which is empty.
    fn check_entries<P: Copy + Into<AxisPoint>>(
        &self,
        point: usize,
        axes: &[P],
        entries: &mut Entries,
    ) -> Result<(), StreamError> {
        if self.handle.0.life.is_ending() {
            return Err(StreamError::Ended);
        }
        let expected = self.axis_count();
        if axes.len() != expected {
            return Err(StreamError::Count { given: axes.len(), axes: expected });
        }
        let state = OnceCell::new();
        entries.extend(axes.iter().take(MAX_AXES).map(|entry| (*entry).into()));
        entries.iter().enumerate().try_for_each(|(axis, entry)| self.check(point, axis, entry, &state))
    }

    /// Checks an entry of a point by the mode that its axis is in: by the state, where the axis has several.
    fn check(
        &self,
        point: usize,
        axis: usize,
        entry: &AxisPoint,
        state: &OnceCell<Snapshot>,
    ) -> Result<(), StreamError> {
        let number = match self.to {
            StreamTarget::All => Some(axis),
            StreamTarget::Group { number, .. } => match self.handle.groups().get(usize::from(number)) {
                Some(group) => group.axes.get(axis).copied(),
                // All axes are one group.
                None => Some(axis),
            },
        };
        let Some((number, of_axis)) =
            number.and_then(|number| Some((number, self.handle.axes().get(number)?)))
        else {
            return Ok(());
        };
        let shown = || state.get_or_init(|| self.handle.state()).axes.get(number);
        let control = match of_axis.other_modes.is_empty() {
            true => of_axis.control,
            false => shown().map_or(of_axis.control, |shown| Handle::present_control(of_axis, shown)),
        };
        check_point(of_axis, &control, entry).map_err(|reason| StreamError::Refused { point, axis, reason })
    }
}

impl Handle {
    /// Every group begins to follow the points of [`Handle::stream`]. The first one must come within the enable time-out. The axes are led to it
    /// within their limits; where an axis is to `follow = "exact"`, it must be near the joint.
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless the group holds its position and is punctual, [`CommandError::Full`], [`CommandError::Ended`].
    pub fn begin_stream(&self) -> Result<(), CommandError> {
        self.request(Request::Stream)
    }

    /// A handle to stream points for all axes by, for any thread.
    pub fn stream(&self) -> StreamHandle {
        self.stream_of(RequestTarget::All)
    }

    /// The stream of a target. It allocates nothing.
    pub(super) fn stream_of(&self, target: RequestTarget) -> StreamHandle {
        let to = match target {
            RequestTarget::All => StreamTarget::All,
            RequestTarget::Group(number) => {
                let group = self.groups().get(usize::from(number));
                let axes = group.map_or(self.axes().len(), |group| group.axes.len());
                StreamTarget::Group { number, axes }
            }
        };
        StreamHandle { handle: self.clone(), to }
    }
}

impl GroupHandle {
    /// The group begins to follow the points of [`GroupHandle::stream`]; the other groups go on with what they do.
    ///
    /// # Errors
    /// See [`Handle::begin_stream`].
    pub fn begin_stream(&self) -> Result<(), CommandError> {
        self.handle.request_of(self.target(), Request::Stream)
    }

    /// A handle to stream points for the axes of the group by, in the order of [`GroupHandle::axes`], for any thread.
    pub fn stream(&self) -> StreamHandle {
        self.handle.stream_of(RequestTarget::Group(self.number))
    }
}
