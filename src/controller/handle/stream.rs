//! The points of streams.

use std::cell::OnceCell;

use takt_rt::{AxisPoint, RequestTarget, Snapshot, StreamPoint};

use super::OwnProcess;
use crate::channels::{ChannelError, SentPoint};
use crate::command::{StreamError, StreamHandle, check_point};

impl StreamHandle<OwnProcess> {
    /// Takes points that are stamped already, with an entry for each axis: all of them, or none.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn push_points(&self, points: &[StreamPoint]) -> Result<(), StreamError> {
        let (own, target) = (self.0.backend(), self.0.target());
        let axes = own.axis_count(target);
        own.check_points(target, points.iter().map(|point| point.axes.get(..axes).unwrap_or_default()))?;
        own.hand_over(target, points)
    }
}

impl OwnProcess {
    /// Checks points of a stream that have an entry for each axis of a target.
    pub(super) fn check_points<'a>(
        &self,
        target: RequestTarget,
        points: impl Iterator<Item = &'a [AxisPoint]>,
    ) -> Result<(), StreamError> {
        if self.life.is_ending() {
            return Err(StreamError::Ended);
        }
        let (expected, state) = (self.axis_count(target), OnceCell::new());
        for (number, point) in points.enumerate() {
            if point.len() != expected {
                return Err(StreamError::Count { given: point.len(), axes: expected });
            }
            for (axis, entry) in point.iter().enumerate() {
                self.check((target, number, axis), entry, &state)?;
            }
        }
        Ok(())
    }

    /// Hands points that have been checked over.
    pub(super) fn hand_over<'a, P>(&self, target: RequestTarget, points: &'a [P]) -> Result<(), StreamError>
    where
        &'a P: Into<SentPoint<'a>>,
    {
        let handed = match target {
            RequestTarget::All => self.streamer.push(points),
            RequestTarget::Group(number) => self.streamer.push_to(number, points),
        };
        handed.map_err(|error| match error {
            ChannelError::NotStreaming => StreamError::NotStreaming,
            ChannelError::Full | ChannelError::NoSuchBus { .. } => StreamError::Full,
        })
    }

    fn axis_count(&self, target: RequestTarget) -> usize {
        let group = match target {
            RequestTarget::All => None,
            RequestTarget::Group(number) => self.groups.get(usize::from(number)),
        };
        group.map_or(self.axes.len(), |group| group.axes.len())
    }

    /// Checks an entry of a point by the mode that its axis is in: by the state, where the axis has several.
    fn check(
        &self,
        (target, point, axis): (RequestTarget, usize, usize),
        entry: &AxisPoint,
        state: &OnceCell<Snapshot>,
    ) -> Result<(), StreamError> {
        let number = match target {
            RequestTarget::All => Some(axis),
            RequestTarget::Group(number) => match self.groups.get(usize::from(number)) {
                Some(group) => group.axes.get(axis).copied(),
                // All axes are one group.
                None => Some(axis),
            },
        };
        let Some((number, of_axis)) = number.and_then(|number| Some((number, self.axes.get(number)?))) else {
            return Ok(());
        };
        let shown = || state.get_or_init(|| self.observer.snapshot()).axes.get(number);
        let control = match of_axis.other_modes.is_empty() {
            true => of_axis.control,
            false => shown().map_or(of_axis.control, |shown| Self::present_control(of_axis, shown)),
        };
        check_point(of_axis, &control, entry).map_err(|reason| StreamError::Refused { point, axis, reason })
    }
}
