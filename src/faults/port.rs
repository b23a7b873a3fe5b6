//! A port with one fault.

use std::collections::VecDeque;
use std::sync::Arc;

use takt_rt::{BusHealth, BusPort, BusState, Frame, Nanoseconds, ReceiveBatch, Received};

use super::breakable::{Breakable, CannotBreak, DriveTrouble, Heard};
use super::cue::Cues;
use super::effect::{DelayPlace, Effect, FrameEffect, InterfaceEffect, corrupted};
use super::foreign::Foreigner;
use super::scenario::Fault;
use super::selection::{Direction, Selector};
use super::window::{Course, Edge, Timer};

/// Frames that one call can make of those it was handed.
const OUTGOING: usize = 256;
/// Frames that can be held back, and as many that have arrived and wait to be taken.
const HELD: usize = 1024;
/// Batches taken from the port within, in one call.
const BATCHES: usize = 32;

/// A port with one fault. Without it, or before and after, everything passes as it is. Faults compose by wrapping a
/// port again: the innermost is nearest to the wire.
///
/// Time is looked at in every call, so a fault begins and ends with a call of the cycle. All memory is taken at the
/// construction; what finds no room is lost and counted as an overrun.
pub struct FaultyPort<P> {
    port: P,
    timer: Timer,
    selector: Selector,
    effect: Effect,
    foreigner: Option<Foreigner>,
    /// What one call sends, each with the number of the frame that it was made of.
    outgoing: Vec<(usize, Frame)>,
    batch: Vec<Frame>,
    /// Sent frames that are held back, each with the time at which it leaves.
    held: VecDeque<(Nanoseconds, Frame)>,
    incoming: Box<ReceiveBatch>,
    /// Received frames that lie in the machine, each with the time at which it can be taken.
    late: VecDeque<(Nanoseconds, Received)>,
    arrived: VecDeque<Received>,
    unconfirmed: usize,
    /// Places of frames that change them.
    places: Vec<usize>,
    /// What the fault adds to the counters of the port.
    added: BusHealth,
}

/// What becomes of a selected frame.
enum Fate {
    Copies(Frame, usize),
    Moved,
    Late(Nanoseconds, DelayPlace),
    Lost,
    Refused,
}

impl<P: Breakable> FaultyPort<P> {
    /// Wraps `port`. The fault waits for `cues` and tells `course` how it goes.
    pub fn new(port: P, fault: &Fault, cues: Arc<Cues>, course: Arc<Course>) -> Self {
        let foreigner = match fault.effect {
            Effect::Foreign(frames) => Some(Foreigner::new(frames)),
            _ => None,
        };
        Self {
            port,
            timer: Timer::new(fault.window, cues, course),
            selector: Selector::new(fault.selection.clone()),
            effect: fault.effect,
            foreigner,
            outgoing: Vec::with_capacity(OUTGOING),
            batch: Vec::with_capacity(OUTGOING),
            held: VecDeque::with_capacity(HELD),
            incoming: Box::default(),
            late: VecDeque::with_capacity(HELD),
            arrived: VecDeque::with_capacity(HELD),
            unconfirmed: 0,
            places: Vec::with_capacity(HELD),
            added: BusHealth::default(),
        }
    }

    /// The port within.
    pub fn inner_mut(&mut self) -> &mut P {
        &mut self.port
    }

    /// Does what is due.
    fn turn(&mut self, now_ns: Nanoseconds) {
        match self.timer.look(now_ns) {
            Edge::None => {}
            Edge::Began => self.begin(now_ns),
            Edge::Ended => self.end(),
        }
        while let Some((due_ns, frame)) = self.held.front().copied().filter(|(due_ns, _)| *due_ns <= now_ns) {
            self.held.pop_front();
            if self.port.send(due_ns, &[frame]) == 0 {
                self.added.tx_overruns += 1;
            }
        }
        self.release_late(now_ns);
        if self.timer.is_active() {
            self.let_foreigner_speak(now_ns);
        }
    }

    fn begin(&mut self, now_ns: Nanoseconds) {
        match self.effect {
            Effect::Interface(effect) => {
                self.added.errors += u64::from(effect != InterfaceEffect::Down);
            }
            Effect::Drive { node, trouble } => {
                if self.port.trouble(node, trouble, true).is_err() {
                    self.timer.course().was_impossible();
                }
                if trouble.is_event() {
                    self.timer.end(now_ns);
                }
            }
            Effect::Foreign(_) => {
                if let Some(foreigner) = &mut self.foreigner {
                    foreigner.begin(now_ns);
                }
            }
            Effect::Frames(_) => {}
        }
    }

    fn end(&mut self) {
        self.unconfirmed = 0;
        if let Effect::Drive { node, trouble } = self.effect {
            // What could not be broken cannot be mended either, and has been told of.
            let _ = self.port.trouble(node, trouble, false);
        }
    }

    fn let_foreigner_speak(&mut self, now_ns: Nanoseconds) {
        let Some(foreigner) = &mut self.foreigner else { return };
        while let Some((due_ns, frame)) = foreigner.next(now_ns) {
            self.timer.course().count_frame();
            if self.port.say(due_ns, &frame) == Heard::ByOthers && self.arrived.len() < HELD {
                self.arrived.push_back(Received { frame, at_ns: due_ns });
            }
        }
        if foreigner.is_silent() {
            self.timer.end(now_ns);
        }
    }

    /// Whether the interface is cut off from its bus.
    fn is_cut(&self) -> bool {
        let cuts = matches!(self.effect, Effect::Interface(InterfaceEffect::BusOff | InterfaceEffect::Down));
        cuts && self.timer.is_active()
    }

    /// What becomes of a frame.
    fn fate(&mut self, now_ns: Nanoseconds, frame: &Frame, direction: Direction) -> Fate {
        let Effect::Frames(effect) = self.effect else { return Fate::Copies(*frame, 1) };
        let is_possible = direction == Direction::Sent || !effect.is_of_sending();
        if !self.timer.is_active() || !is_possible || !self.selector.picks(frame, direction) {
            return Fate::Copies(*frame, 1);
        }
        self.timer.course().count_frame();
        if self.selector.is_exhausted() && effect != FrameEffect::EchoLoss {
            self.timer.end(now_ns);
        }
        match effect {
            FrameEffect::Drop => Fate::Lost,
            FrameEffect::Delay { by_ns, place } => Fate::Late(by_ns, place),
            FrameEffect::Duplicate { copies } => Fate::Copies(*frame, 1 + usize::from(copies)),
            FrameEffect::Corrupt { bits, part } => {
                Fate::Copies(corrupted(frame, bits, part, |limit| self.selector.below(limit)), 1)
            }
            FrameEffect::Reorder => Fate::Moved,
            FrameEffect::EchoLoss => {
                self.unconfirmed += 1;
                Fate::Copies(*frame, 1)
            }
            FrameEffect::FullQueue => Fate::Refused,
        }
    }

    /// Sends what has become of `frames`, and returns how many of them are gone.
    fn send_altered(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        self.outgoing.clear();
        self.places.clear();
        let mut gone = frames.len();
        for (number, frame) in frames.iter().enumerate() {
            match self.fate(now_ns, frame, Direction::Sent) {
                Fate::Copies(frame, copies) if self.outgoing.len() + copies <= OUTGOING => {
                    self.outgoing.extend(std::iter::repeat_n((number, frame), copies));
                    continue;
                }
                Fate::Moved if self.outgoing.len() < OUTGOING => {
                    self.places.push(self.outgoing.len());
                    self.outgoing.push((number, *frame));
                    continue;
                }
                Fate::Late(by_ns, _) if self.held.len() < HELD => {
                    self.held.push_back((now_ns.saturating_add(by_ns), *frame));
                    continue;
                }
                Fate::Lost => {
                    self.added.tx_frames += 1;
                    continue;
                }
                Fate::Copies(..) | Fate::Moved | Fate::Late(..) | Fate::Refused => {}
            }
            gone = number;
            self.added.tx_overruns += (frames.len() - number) as u64;
            break;
        }
        for_each_swap(&self.places, &mut self.selector, |a, b| {
            // The places keep their numbers, the frames change.
            let (first, second) = (self.outgoing[a].1, self.outgoing[b].1);
            (self.outgoing[a].1, self.outgoing[b].1) = (second, first);
        });
        self.batch.clear();
        self.batch.extend(self.outgoing.iter().map(|(_, frame)| *frame));
        let taken = if self.batch.is_empty() { 0 } else { self.port.send(now_ns, &self.batch) };
        self.outgoing.get(taken).map_or(gone, |(number, _)| *number)
    }

    fn release_late(&mut self, now_ns: Nanoseconds) {
        while let Some((_, received)) = self.late.front().copied().filter(|(due_ns, _)| *due_ns <= now_ns) {
            self.late.pop_front();
            self.arrive(received);
        }
    }

    fn arrive(&mut self, received: Received) {
        if self.arrived.len() < HELD {
            self.arrived.push_back(received);
        } else {
            self.added.rx_overruns += 1;
        }
    }

    /// Takes what the port within has received. Returns whether there was anything.
    fn take_incoming(&mut self, now_ns: Nanoseconds) -> bool {
        self.incoming.clear();
        self.port.receive(now_ns, &mut self.incoming);
        if self.is_cut() {
            return !self.incoming.is_empty();
        }
        self.places.clear();
        for index in 0..self.incoming.len() {
            let Some(received) = self.incoming.get(index).copied() else { break };
            match self.fate(now_ns, &received.frame, Direction::Received) {
                Fate::Copies(frame, copies) => {
                    for _ in 0..copies {
                        self.arrive(Received { frame, ..received });
                    }
                }
                Fate::Moved => {
                    if self.arrived.len() < HELD {
                        self.places.push(self.arrived.len());
                    }
                    self.arrive(received);
                }
                Fate::Late(by_ns, place) if self.late.len() < HELD => {
                    let due_ns = received.at_ns.saturating_add(by_ns);
                    let at_ns = match place {
                        // It has arrived when it did: nobody has come to take it yet.
                        DelayPlace::Machine => received.at_ns,
                        DelayPlace::Bus => due_ns,
                    };
                    self.late.push_back((due_ns, Received { at_ns, ..received }));
                }
                Fate::Late(..) => self.added.rx_overruns += 1,
                Fate::Lost | Fate::Refused => {}
            }
        }
        for_each_swap(&self.places, &mut self.selector, |a, b| self.arrived.swap(a, b));
        // Some of it may have been late before anybody came for it.
        self.release_late(now_ns);
        !self.incoming.is_empty()
    }
}

/// The swaps that bring what stands in these places into a random order (Fisher and Yates).
fn for_each_swap(places: &[usize], selector: &mut Selector, mut swap: impl FnMut(usize, usize)) {
    for (index, last) in places.iter().enumerate().skip(1).rev() {
        if let Some(other) = places.get(selector.below(index + 1)) {
            swap(*last, *other);
        }
    }
}

impl<P: Breakable> BusPort for FaultyPort<P> {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        self.turn(now_ns);
        // As the kernel's interfaces do: that it is down is the loss, there is no queue that had no room.
        if self.is_cut() {
            return 0;
        }
        if let Some(foreigner) = &mut self.foreigner {
            frames.iter().for_each(|frame| foreigner.overhear(frame));
        }
        if self.timer.is_active() && matches!(self.effect, Effect::Frames(_)) {
            self.send_altered(now_ns, frames)
        } else {
            self.port.send(now_ns, frames)
        }
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        self.turn(now_ns);
        for _ in 0..BATCHES {
            while !batch.is_full()
                && let Some(received) = self.arrived.pop_front()
            {
                batch.push(received);
            }
            if batch.is_full() || !self.take_incoming(now_ns) {
                return;
            }
        }
    }

    fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
        self.turn(now_ns);
        self.port.unconfirmed(now_ns) + self.held.len() + self.unconfirmed
    }

    fn health(&mut self) -> BusHealth {
        let inner = self.port.health();
        let state = match self.effect {
            Effect::Interface(effect) if self.timer.is_active() => match effect {
                InterfaceEffect::BusOff => BusState::BusOff,
                InterfaceEffect::ErrorPassive => BusState::ErrorPassive,
                InterfaceEffect::Down => BusState::Down,
            },
            _ => inner.state,
        };
        BusHealth {
            state,
            tx_frames: inner.tx_frames + self.added.tx_frames,
            rx_frames: inner.rx_frames,
            tx_overruns: inner.tx_overruns + self.added.tx_overruns,
            rx_overruns: inner.rx_overruns + self.added.rx_overruns,
            errors: inner.errors + self.added.errors,
            busy_ns: inner.busy_ns,
        }
    }
}

impl<P: Breakable> Breakable for FaultyPort<P> {
    fn say(&mut self, now_ns: Nanoseconds, frame: &Frame) -> Heard {
        self.port.say(now_ns, frame)
    }

    fn trouble(&mut self, node: u8, trouble: DriveTrouble, is_present: bool) -> Result<(), CannotBreak> {
        self.port.trouble(node, trouble, is_present)
    }
}
