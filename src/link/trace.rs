//! A bus port that copies every frame, and every change of the bus state, to another thread.
//!
//! Every bus is traced in every run, because the black box records its frames. So the cost in the real-time thread matters.
//! A frame of up to eight bytes travels as 24 bytes instead of the 88 that the longest frame takes; a longer one as
//! several pieces.

use arrayvec::ArrayVec;
use takt_rt::{
    BusHealth, BusPort, BusState, Frame, FrameKind, Id, MAX_BUSES, Nanoseconds, Outgoing, ReceiveBatch,
};

use crate::channels::{Consumer, Producer, ring};

/// A frame that passed a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TracedFrame {
    /// When it was handed to the interface, or had completely arrived.
    pub at_ns: Nanoseconds,
    /// True if it was sent; otherwise it was received.
    pub is_sent: bool,
    /// The frame.
    pub frame: Frame,
}

/// The state of a bus from one instant on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TracedHealth {
    /// The time of the last frames before the change was seen.
    pub at_ns: Nanoseconds,
    /// The state and counters that were seen.
    pub health: BusHealth,
}

/// What a port has answered beside its frames, as far as it is out of the ordinary. A replay needs it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bitcode::Encode, bitcode::Decode)]
pub struct PortMark {
    /// The time for which the port was asked.
    pub at_ns: Nanoseconds,
    /// What it has answered.
    pub answer: PortAnswer,
}

/// An answer of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bitcode::Encode, bitcode::Decode)]
pub enum PortAnswer {
    /// The frames behind this mark were handed over at this time, up to the next mark.
    Received,
    /// So many own frames had not been seen on the wire.
    Unconfirmed(u64),
    /// It took only so many of the frames that it was given.
    Taken(u64),
    /// The state of the bus was this from now on.
    State(BusState),
}

/// What comes out of a [`Trace`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traced {
    /// A frame.
    Frame(TracedFrame),
    /// A mark between frames.
    Mark(PortMark),
}

/// What a piece is of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum PieceOf {
    Sent,
    Received,
    /// Marks: the number is in the bytes.
    Delivery,
    Unconfirmed,
    Taken,
    State,
}

/// Up to eight bytes of a frame, with the header that is needed to put the frame together again; or a mark.
#[derive(Clone, Copy)]
struct Piece {
    at_ns: Nanoseconds,
    bytes: u64,
    id: Id,
    kind: FrameKind,
    length: u8,
    /// Counted from 0.
    number: u8,
    of: PieceOf,
}

const PIECE_BYTES: usize = size_of::<u64>();

/// Changes of the bus state that the trace holds. Each has the cumulative counters, so that a dropped one loses nothing.
const HEALTH_CHANGES: usize = 64;

/// Wraps a port: everything it sends and receives is also copied to a [`Trace`]. A full trace drops and counts.
pub struct TracedPort<P> {
    port: P,
    pieces: Producer<Piece>,
    changes: Producer<TracedHealth>,
    told: BusHealth,
    /// The state that the last mark has told.
    marked: BusState,
    now_ns: Nanoseconds,
}

/// The other end: the frames of one bus, in the order in which they passed the port.
pub struct Trace {
    name: String,
    pieces: Consumer<Piece>,
    changes: Consumer<TracedHealth>,
    /// The beginning of a frame of which there are more pieces.
    begun: Option<Piece>,
    payload: [u8; Frame::MAX_BYTES],
    broken: u64,
}

/// Wraps `port` and makes a trace for `capacity` frames of up to eight bytes, which candump logs show under `name` (an
/// interface's name: white space in it becomes `_`).
pub fn traced<P: BusPort>(port: P, name: &str, capacity: usize) -> (TracedPort<P>, Trace) {
    let (piece_in, piece_out) = ring(capacity);
    let (change_in, change_out) = ring(HEALTH_CHANGES);
    let name = name.split_whitespace().collect::<Vec<_>>().join("_");
    let port = TracedPort {
        port,
        pieces: piece_in,
        changes: change_in,
        told: BusHealth::default(),
        marked: BusState::default(),
        now_ns: 0,
    };
    let payload = [0; Frame::MAX_BYTES];
    (port, Trace { name, pieces: piece_out, changes: change_out, begun: None, payload, broken: 0 })
}

impl Trace {
    /// The name of the bus.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Takes the oldest frame, and passes over the marks before it.
    pub fn take(&mut self) -> Option<TracedFrame> {
        loop {
            if let Traced::Frame(frame) = self.take_any()? {
                return Some(frame);
            }
        }
    }

    /// Takes the oldest frame or mark.
    pub fn take_any(&mut self) -> Option<Traced> {
        loop {
            let piece = self.pieces.pop()?;
            let at_ns = piece.at_ns;
            let mark = |answer| Some(Traced::Mark(PortMark { at_ns, answer }));
            let is_sent = match piece.of {
                PieceOf::Sent => true,
                PieceOf::Received => false,
                PieceOf::Delivery => return mark(PortAnswer::Received),
                PieceOf::Unconfirmed => return mark(PortAnswer::Unconfirmed(piece.bytes)),
                PieceOf::Taken => return mark(PortAnswer::Taken(piece.bytes)),
                PieceOf::State => return mark(PortAnswer::State(state_of(piece.bytes))),
            };
            if let Some(frame) = self.put_together(&piece) {
                return Some(Traced::Frame(TracedFrame { at_ns, is_sent, frame }));
            }
        }
    }

    /// Takes the oldest change of the bus' state or of its counters of errors and overruns.
    pub fn take_health(&mut self) -> Option<TracedHealth> {
        self.changes.pop()
    }

    /// Frames that found no room, or not for all of their pieces.
    pub fn dropped(&self) -> u64 {
        self.pieces.dropped() + self.broken
    }

    /// The frame that this piece completes.
    fn put_together(&mut self, piece: &Piece) -> Option<Frame> {
        let from = usize::from(piece.number) * PIECE_BYTES;
        let is_next = match self.begun.take() {
            None => piece.number == 0,
            // The rest of a frame is pushed right behind its beginning, or not at all.
            Some(begun) => piece.number == begun.number + 1 || piece.number == 0,
        };
        let room = self.payload.get_mut(from..from + PIECE_BYTES);
        let (true, Some(room)) = (is_next, room) else {
            self.broken += 1;
            return None;
        };
        room.copy_from_slice(&piece.bytes.to_le_bytes());
        let length = usize::from(piece.length);
        if from + PIECE_BYTES < length {
            self.begun = Some(*piece);
            return None;
        }
        let payload = self.payload.get(..length)?;
        match piece.kind {
            FrameKind::Data => Frame::data(piece.id, payload),
            FrameKind::Remote => Frame::remote(piece.id, piece.length),
            FrameKind::Fd => Frame::fd(piece.id, payload, false),
            FrameKind::FdBitRateSwitch => Frame::fd(piece.id, payload, true),
        }
        .ok()
    }
}

/// The state with this number.
fn state_of(number: u64) -> BusState {
    let states = [BusState::ErrorActive, BusState::ErrorPassive, BusState::BusOff, BusState::Down];
    states.into_iter().find(|state| *state as u64 == number).unwrap_or_default()
}

impl<P> TracedPort<P> {
    fn mark(&mut self, at_ns: Nanoseconds, of: PieceOf, bytes: u64) -> bool {
        self.pieces.push(Piece {
            at_ns,
            bytes,
            id: Id::canopen(0, 0),
            kind: FrameKind::Data,
            length: 0,
            number: 0,
            of,
        })
    }

    fn trace(&mut self, at_ns: Nanoseconds, of: PieceOf, frame: &Frame) {
        let mut piece = Piece {
            at_ns,
            bytes: frame.first_word(),
            id: frame.id(),
            kind: frame.kind(),
            length: frame.length() as u8,
            number: 0,
            of,
        };
        if !self.pieces.push(piece) || frame.length() <= PIECE_BYTES {
            return;
        }
        for bytes in frame.payload().chunks(PIECE_BYTES).skip(1) {
            let mut word = [0; PIECE_BYTES];
            word.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
            piece.number += 1;
            piece.bytes = u64::from_le_bytes(word);
            if !self.pieces.push(piece) {
                return;
            }
        }
    }
}

impl<P> TracedPort<P> {
    fn trace_sent(&mut self, now_ns: Nanoseconds, frames: &[Frame], taken: usize) {
        for frame in frames.iter().take(taken) {
            self.trace(now_ns, PieceOf::Sent, frame);
        }
        if taken < frames.len() {
            self.mark(now_ns, PieceOf::Taken, taken as u64);
        }
    }

    /// The port within.
    pub fn inner_mut(&mut self) -> &mut P {
        &mut self.port
    }
}

impl<P: BusPort> BusPort for TracedPort<P> {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        let taken = self.port.send(now_ns, frames);
        self.trace_sent(now_ns, frames, taken);
        taken
    }

    fn send_together(now_ns: Nanoseconds, outgoing: &mut [Outgoing<'_, Self>]) {
        let within = outgoing.iter_mut().map(|entry| Outgoing {
            port: &mut entry.port.port,
            frames: entry.frames,
            taken: entry.taken,
        });
        P::send_together(now_ns, &mut within.take(MAX_BUSES).collect::<ArrayVec<_, MAX_BUSES>>());
        for entry in outgoing {
            entry.port.trace_sent(now_ns, entry.frames, *entry.taken);
        }
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        let before = batch.len();
        self.port.receive(now_ns, batch);
        self.now_ns = now_ns;
        if batch.len() > before {
            self.mark(now_ns, PieceOf::Delivery, 0);
        }
        for received in batch.iter().skip(before) {
            self.trace(received.at_ns, PieceOf::Received, &received.frame);
        }
    }

    fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
        let unconfirmed = self.port.unconfirmed(now_ns);
        if unconfirmed > 0 {
            self.mark(now_ns, PieceOf::Unconfirmed, unconfirmed as u64);
        }
        unconfirmed
    }

    fn health(&mut self) -> BusHealth {
        let health = self.port.health();
        if health.state != self.marked && self.mark(self.now_ns, PieceOf::State, health.state as u64) {
            self.marked = health.state;
        }
        let of_interest =
            |health: &BusHealth| (health.state, health.errors, health.tx_overruns, health.rx_overruns);
        if of_interest(&health) != of_interest(&self.told)
            && self.changes.push(TracedHealth { at_ns: self.now_ns, health })
        {
            self.told = health;
        }
        health
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::Received;

    /// Takes two frames at a time, and has received one frame at each instant.
    struct Narrow;

    impl BusPort for Narrow {
        fn send(&mut self, _now_ns: Nanoseconds, frames: &[Frame]) -> usize {
            frames.len().min(2)
        }

        fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
            batch.push(Received { frame: frame(0xFF), at_ns: now_ns - 1 });
        }

        fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
            now_ns as usize
        }

        fn health(&mut self) -> BusHealth {
            BusHealth { state: BusState::ErrorPassive, errors: 3, ..BusHealth::default() }
        }
    }

    fn frame(byte: u8) -> Frame {
        Frame::of(Id::canopen(0x200, 1), [byte])
    }

    #[test]
    fn what_the_port_took_and_brought_is_traced_in_order_and_nothing_else() {
        let (mut port, mut trace) = traced(Narrow, "arm left", 8);
        assert_eq!(port.send(100, &[frame(1), frame(2), frame(3)]), 2);
        let mut batch = ReceiveBatch::new();
        batch.push(Received { frame: frame(0xEE), at_ns: 0 });
        port.receive(200, &mut batch);
        assert_eq!(batch.len(), 2);
        let seen: Vec<_> = std::iter::from_fn(|| trace.take()).collect();
        let expected = [(100, true, frame(1)), (100, true, frame(2)), (199, false, frame(0xFF))];
        assert_eq!(seen, expected.map(|(at_ns, is_sent, frame)| TracedFrame { at_ns, is_sent, frame }));
        assert_eq!((trace.name(), trace.dropped()), ("arm_left", 0));
    }

    #[test]
    fn a_full_trace_drops_and_counts_and_the_port_works_on() {
        let (mut port, trace) = traced(Narrow, "can0", 3);
        assert_eq!(port.send(1, &[frame(1), frame(2)]), 2);
        assert_eq!(port.send(2, &[frame(3), frame(4)]), 2);
        assert_eq!(trace.dropped(), 1);
        assert_eq!((port.unconfirmed(7), port.health()), (7, Narrow.health()));
    }

    #[test]
    fn frames_of_every_kind_and_length_come_out_as_they_went_in() {
        let (mut port, mut trace) = traced(Narrow, "can0", 64);
        let bytes: Vec<u8> = (1..=64).collect();
        let id = Id::extended(0x1234_5678).unwrap();
        let long = [0, 7, 8, 12, 24, 64].map(|length| Frame::fd(id, &bytes[..length], length == 24).unwrap());
        let short = [0, 1, 8].map(|length| Frame::data(id, &bytes[..length]).unwrap());
        let remote = Frame::remote(Id::canopen(0x700, 3), 8).unwrap();
        let sent: Vec<Frame> = long.into_iter().chain(short).chain([remote]).collect();
        for pair in sent.chunks(2) {
            port.send(5, pair);
        }
        let seen: Vec<_> = std::iter::from_fn(|| trace.take()).map(|traced| traced.frame).collect();
        assert_eq!((seen, trace.dropped()), (sent, 0));
    }

    #[test]
    fn a_long_frame_that_finds_room_for_its_beginning_only_is_dropped_and_the_next_one_is_whole() {
        let (mut port, mut trace) = traced(Narrow, "can0", 4);
        let long = Frame::fd(Id::canopen(0x200, 1), &[9; 24], false).unwrap();
        port.send(1, &[frame(1), frame(2)]);
        port.send(2, &[long]);
        assert_eq!(trace.take().map(|traced| traced.frame), Some(frame(1)));
        assert_eq!(trace.take().map(|traced| traced.frame), Some(frame(2)));
        port.send(3, &[frame(3)]);
        assert_eq!(trace.take().map(|traced| traced.frame), Some(frame(3)));
        assert_eq!((trace.take(), trace.dropped()), (None, 1));
        port.send(4, &[long]);
        assert_eq!(trace.take().map(|traced| traced.frame), Some(long));
    }

    #[test]
    fn a_change_of_health_is_told_once_with_the_time_of_the_last_frames() {
        let (mut port, mut trace) = traced(Narrow, "can0", 4);
        port.receive(70, &mut ReceiveBatch::new());
        for _ in 0..3 {
            port.health();
        }
        let health = Narrow.health();
        assert_eq!(trace.take_health(), Some(TracedHealth { at_ns: 70, health }));
        assert_eq!(trace.take_health(), None);
    }

    #[test]
    fn the_trace_of_a_short_frame_is_three_words() {
        assert_eq!(size_of::<Piece>(), 24);
    }
}
