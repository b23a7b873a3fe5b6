//! The port of a bus, replayed.

use std::collections::VecDeque;

use arrayvec::ArrayVec;
use bitcode::{Decode, Encode};
use takt_rt::{
    BusHealth, BusPort, BusState, Frame, FrameError, FrameKind, Id, Nanoseconds, ReceiveBatch, Received,
};

use super::pop_front_if;
use crate::link::trace::{PortAnswer, PortMark};

/// Answer of a port.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub enum PortEntry {
    /// A frame that it has handed over.
    Received(ReceivedFrame),
    /// An answer other than the usual one.
    Mark(PortMark),
}

/// A frame without the zeros behind its payload.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct ReceivedFrame {
    at_ns: Nanoseconds,
    id: Id,
    kind: FrameKind,
    length: u8,
    payload: ArrayVec<u8, { Frame::MAX_BYTES }>,
}

impl From<Received> for ReceivedFrame {
    fn from(Received { frame, at_ns }: Received) -> Self {
        let payload = frame.payload().iter().copied().collect();
        Self { at_ns, id: frame.id(), kind: frame.kind(), length: frame.length() as u8, payload }
    }
}

impl ReceivedFrame {
    /// The frame as it was received.
    ///
    /// # Errors
    /// No bus carries it.
    pub fn received(&self) -> Result<Received, FrameError> {
        let frame = match self.kind {
            FrameKind::Data => Frame::data(self.id, &self.payload),
            FrameKind::Remote => Frame::remote(self.id, self.length),
            FrameKind::Fd => Frame::fd(self.id, &self.payload, false),
            FrameKind::FdBitRateSwitch => Frame::fd(self.id, &self.payload, true),
        };
        frame.map(|frame| Received { frame, at_ns: self.at_ns })
    }
}

impl PortEntry {
    /// When the frame was received; for a mark, the time for which the port was asked.
    pub const fn at_ns(&self) -> Nanoseconds {
        match self {
            Self::Received(received) => received.at_ns,
            Self::Mark(mark) => mark.at_ns,
        }
    }

    /// Returns `false` for a frame that no bus carries.
    pub fn is_valid(&self) -> bool {
        match self {
            Self::Received(received) => received.id.is_valid() && received.received().is_ok(),
            Self::Mark(_) => true,
        }
    }
}

/// A port that answers as it did, found by the time for which it is asked.
#[derive(Clone, Debug, Default)]
pub struct ReplayPort {
    /// With the time at which each was handed over.
    received: VecDeque<(Nanoseconds, Received)>,
    unconfirmed: VecDeque<(Nanoseconds, usize)>,
    taken: VecDeque<(Nanoseconds, usize)>,
    states: VecDeque<(Nanoseconds, BusState)>,
    state: BusState,
    now_ns: Nanoseconds,
    /// When the frames behind the last mark were handed over.
    handed_over_ns: Nanoseconds,
    /// What has been sent since the last look.
    pub sent: Vec<Frame>,
}

/// What a port has shown, when a replay begins in the middle of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Encode, Decode)]
pub struct PortState {
    /// The state of the bus.
    pub state: BusState,
    /// The time for which the port was last asked for frames.
    pub now_ns: Nanoseconds,
}

impl ReplayPort {
    /// Adds the next entry of the journal.
    pub fn add(&mut self, entry: &PortEntry) {
        match *entry {
            PortEntry::Received(ref frame) => {
                let received = frame.received().into_iter();
                self.received.extend(received.map(|received| (self.handed_over_ns, received)));
            }
            PortEntry::Mark(PortMark { at_ns, answer }) => match answer {
                PortAnswer::Received => self.handed_over_ns = at_ns,
                PortAnswer::Unconfirmed(count) => self.unconfirmed.push_back((at_ns, count as usize)),
                PortAnswer::Taken(count) => self.taken.push_back((at_ns, count as usize)),
                PortAnswer::State(state) => self.states.push_back((at_ns, state)),
            },
        }
    }

    /// What it has shown so far.
    pub fn shown(&self) -> PortState {
        PortState { state: self.state, now_ns: self.now_ns }
    }

    /// Goes on from what a port has shown.
    pub fn resume(&mut self, PortState { state, now_ns }: PortState) {
        (self.state, self.now_ns) = (state, now_ns);
    }

    /// The entries that it has not used yet, as [`ReplayPort::add`] takes them.
    pub fn unused(&self) -> Vec<PortEntry> {
        let mark = |at_ns, answer| PortEntry::Mark(PortMark { at_ns, answer });
        let mut entries = Vec::new();
        for &(at_ns, received) in &self.received {
            entries.extend([mark(at_ns, PortAnswer::Received), PortEntry::Received(received.into())]);
        }
        entries.extend(
            self.unconfirmed.iter().map(|&(at_ns, count)| mark(at_ns, PortAnswer::Unconfirmed(count as u64))),
        );
        entries.extend(self.taken.iter().map(|&(at_ns, count)| mark(at_ns, PortAnswer::Taken(count as u64))));
        entries.extend(self.states.iter().map(|&(at_ns, state)| mark(at_ns, PortAnswer::State(state))));
        entries.push(mark(self.handed_over_ns, PortAnswer::Received));
        entries
    }
}

/// What was answered at a time. Answers for earlier times, for which nobody has asked, are passed over.
fn answer_at(answers: &mut VecDeque<(Nanoseconds, usize)>, now_ns: Nanoseconds) -> Option<usize> {
    while answers.front().is_some_and(|(at_ns, _)| *at_ns < now_ns) {
        answers.pop_front();
    }
    pop_front_if(answers, |(at_ns, _)| *at_ns == now_ns).map(|(_, answer)| answer)
}

impl BusPort for ReplayPort {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        let taken = answer_at(&mut self.taken, now_ns).unwrap_or(frames.len()).min(frames.len());
        self.sent.extend(frames.iter().take(taken));
        taken
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        self.now_ns = now_ns;
        while !batch.is_full()
            && let Some((_, received)) = pop_front_if(&mut self.received, |(at_ns, _)| *at_ns <= now_ns)
        {
            batch.push(received);
        }
    }

    fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
        answer_at(&mut self.unconfirmed, now_ns).unwrap_or(0)
    }

    fn health(&mut self) -> BusHealth {
        while let Some((_, state)) = pop_front_if(&mut self.states, |(at_ns, _)| *at_ns <= self.now_ns) {
            self.state = state;
        }
        BusHealth { state: self.state, ..BusHealth::default() }
    }
}
