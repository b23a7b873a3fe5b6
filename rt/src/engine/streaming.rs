//! A group that follows a stream.

use arrayvec::ArrayVec;

use super::Engine;
use super::group::{Group, GroupContext};
use super::state::{GroupState, Stream};
use super::step::Failure;
use crate::axis::Axis;
use crate::fault::Fault;
use crate::host::HostInterface;
use crate::plan::State;
use crate::record::EventKind;
use crate::source::{AxisTarget, Follow, StreamReport, StreamState, StreamWish};
use crate::stop::Origin;
use crate::time::Nanoseconds;

impl Stream {
    /// What observers see of it.
    pub(super) const fn shown(self) -> StreamState {
        match self {
            Self::Requested | Self::Awaited => StreamState::Awaited,
            Self::Following => StreamState::Following,
            Self::Dry => StreamState::Dry,
        }
    }
}

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// Asks the host what the streams want in the slot that begins at this time, for each group that streams.
    pub(super) fn sample_streams(
        &mut self,
        slot_start_ns: Nanoseconds,
        host: &mut impl HostInterface<AXES, BUSES>,
    ) {
        for group in &mut self.groups {
            let number = group.number;
            let GroupState::Streaming(stream) = &mut group.state else { continue };
            if *stream == Stream::Requested {
                host.begin_stream(number);
                *stream = Stream::Awaited;
            }
            host.stream(number, slot_start_ns, &mut group.stream);
        }
    }
}

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// The next set-points of a stream, which has come so far before this slot.
    pub(super) fn step_stream(&mut self, before: Stream) -> Result<(), Failure> {
        let has_begun = matches!(before, Stream::Following | Stream::Dry);
        match self.group.stream.wish {
            StreamWish::Awaited if !has_begun => self.await_stream(),
            StreamWish::Targets(_) => {
                if !has_begun {
                    self.check_start()?;
                }
                self.enter_stream(Stream::Following);
                self.stream_to(|axis, wish, period_s| axis.streamed(&wanted_of(axis, wish), period_s))
            }
            // A stream that has begun to lead the axes lets them come to rest.
            StreamWish::Awaited | StreamWish::Dry(_) => self.run_dry(before),
        }
    }

    /// The points have run out: the axes come to rest.
    fn run_dry(&mut self, before: Stream) -> Result<(), Failure> {
        if before != Stream::Dry {
            for axis in self.axes.iter_mut() {
                let last = wanted_of(axis, &self.group.stream.wish);
                axis.begin_rest(&last, self.shared.period_s)
                    .map_err(|fault| (Origin::Axis(axis.number()), fault))?;
            }
        }
        self.enter_stream(Stream::Dry);
        self.stream_to(|axis, _, period_s| axis.resting(period_s))
    }

    fn await_stream(&mut self) -> Result<(), Failure> {
        let (cycles, limit) = (self.group.state_cycles, self.shared.enable_timeout_cycles);
        if cycles > limit {
            return Err((Origin::Group, Fault::StreamNotBegun { cycles, limit }));
        }
        self.hold();
        Ok(())
    }

    fn enter_stream(&mut self, stream: Stream) {
        if self.group.state != GroupState::Streaming(stream) {
            self.group.state = GroupState::Streaming(stream);
            self.emit(EventKind::Stream { state: stream.shown() });
        }
    }

    /// A stream that is followed exactly begins where the joints are. To any other one they are led.
    fn check_start(&self) -> Result<(), Failure> {
        let first: ArrayVec<State, AXES> = self
            .axes
            .iter()
            .map(|axis| match wanted_of(axis, &self.group.stream.wish) {
                AxisTarget::Position { state, .. } | AxisTarget::Impedance { state, .. } => state,
                // They begin wherever the joint is.
                AxisTarget::Velocity { .. } | AxisTarget::Torque(_) => State::rest(axis.position()),
            })
            .collect();
        self.first_fault(&first, |axis, first| match axis.parameters().follow {
            Follow::Smooth => Ok(()),
            Follow::Exact => axis.check_start(first),
        })
    }

    fn stream_to(
        &mut self,
        next_of: impl Fn(&mut Axis, &StreamWish<AXES>, f64) -> Result<State, Fault>,
    ) -> Result<(), Failure> {
        let wish = &self.group.stream.wish;
        let period_s = self.shared.period_s;
        let mut next: ArrayVec<State, AXES> = ArrayVec::new();
        for axis in self.axes.iter_mut() {
            let is_led = axis.is_enabled() && !axis.is_profile();
            let of_axis = if is_led { next_of(axis, wish, period_s) } else { Ok(axis.set_point()) };
            next.push(of_axis.map_err(|fault| (Origin::Axis(axis.number()), fault))?);
        }
        self.check(&next)?;
        self.take_set_points(&next);
        Ok(())
    }
}

/// What a stream wants of an axis: to stay on its set-point where the stream says nothing.
fn wanted_of<const AXES: usize>(axis: &Axis, wish: &StreamWish<AXES>) -> AxisTarget {
    match wish {
        StreamWish::Awaited => axis.set_point().into(),
        StreamWish::Targets(targets) | StreamWish::Dry(targets) => axis.own(targets),
    }
}

impl<const AXES: usize, const BUSES: usize> Group<AXES, BUSES> {
    /// A group that does not stream has no use for points: those that the end of a stream has overtaken are lost.
    pub(super) fn discard_points(&mut self, host: &mut impl HostInterface<AXES, BUSES>) {
        if matches!(self.state, GroupState::Streaming(_)) {
            return;
        }
        let discarded = host.discard_points(self.number);
        self.stream.counts.points += discarded;
        self.stream.counts.lost_points += discarded;
    }

    /// What observers see of the stream.
    pub(super) fn stream_report(&self) -> StreamReport {
        let state = match self.state {
            GroupState::Streaming(stream) => stream.shown(),
            GroupState::InLoop(_) => StreamState::Callback,
            _ => StreamState::Idle,
        };
        StreamReport { state, counts: self.stream.counts }
    }
}
