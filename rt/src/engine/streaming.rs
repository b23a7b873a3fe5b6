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
            group.stream = host.stream(number, slot_start_ns);
        }
    }
}

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// The next set-points of a stream, which has come so far before this slot.
    pub(super) fn step_stream(&mut self, before: Stream) -> Result<(), Failure> {
        let wish = self.group.stream.wish;
        match &wish {
            StreamWish::Awaited if matches!(before, Stream::Requested | Stream::Awaited) => {
                self.await_stream()
            }
            // Whoever has begun to lead the axes lets them come to rest.
            StreamWish::Awaited => self.run_dry(before, |axis| AxisTarget::Position(axis.set_point())),
            StreamWish::Targets(targets) => {
                if matches!(before, Stream::Requested | Stream::Awaited) {
                    self.check_start(targets)?;
                }
                self.enter_stream(Stream::Following);
                self.stream_to(|axis, period_s| axis.streamed(&axis.own(targets), period_s))
            }
            StreamWish::Dry(last) => self.run_dry(before, |axis| axis.own(last)),
        }
    }

    /// The points have run out: the axes come to rest.
    fn run_dry(&mut self, before: Stream, last_of: impl Fn(&Axis) -> AxisTarget) -> Result<(), Failure> {
        if before != Stream::Dry {
            for axis in self.axes.iter_mut() {
                let last = last_of(axis);
                axis.begin_rest(&last, self.shared.period_s);
            }
        }
        self.enter_stream(Stream::Dry);
        self.stream_to(Axis::resting)
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
    fn check_start(&self, targets: &[AxisTarget; AXES]) -> Result<(), Failure> {
        let first: ArrayVec<State, AXES> = self
            .axes
            .iter()
            .map(|axis| {
                let AxisTarget::Position(first) = axis.own(targets);
                first
            })
            .collect();
        self.first_fault(&first, |axis, first| match axis.parameters().follow {
            Follow::Smooth => Ok(()),
            Follow::Exact => axis.check_start(first),
        })
    }

    fn stream_to(&mut self, next_of: impl Fn(&Axis, f64) -> Result<State, Fault>) -> Result<(), Failure> {
        let period_s = self.shared.period_s;
        let mut next: ArrayVec<State, AXES> = ArrayVec::new();
        for axis in self.axes.iter() {
            let is_led = axis.is_enabled() && !axis.is_profile();
            let of_axis = if is_led { next_of(axis, period_s) } else { Ok(axis.set_point()) };
            next.push(of_axis.map_err(|fault| (Origin::Axis(axis.number()), fault))?);
        }
        self.check(&next)?;
        self.take_set_points(&next);
        Ok(())
    }
}

impl<const AXES: usize, const BUSES: usize> Group<AXES, BUSES> {
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
