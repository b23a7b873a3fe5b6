//! A port with one fault.

use std::collections::VecDeque;
use std::sync::Arc;

use takt_rt::{BusHealth, BusPort, BusState, Frame, Nanoseconds, ReceiveBatch, Received};

use super::effect::{DelayPlace, Effect, FrameEffect, InterfaceEffect, corrupted};
use super::foreign::ForeignStation;
use super::injectable::{Delivery, DriveEffect, InjectError, Injectable};
use super::scenario::ScenarioFault;
use super::selection::{Direction, Selector};
use super::trigger::TriggerTimes;
use super::window::{Edge, FaultProgress, WindowTimer};

/// Capacity for the frames that one call can make of the frames passed to it.
const MAX_OUTGOING: usize = 256;
/// Capacity for delayed frames, and for frames that have arrived but are not yet taken.
const CAPACITY: usize = 1024;
/// Batches taken from the inner port in one call at most.
const MAX_BATCHES: usize = 32;

/// A port with one fault. Outside the fault's window everything passes unchanged. Faults compose by nesting: the
/// innermost is nearest to the wire.
///
/// Every call checks the time, so a fault begins and ends with a call of the cycle. All memory is allocated at
/// construction; a frame that finds no room is lost and counted as an overrun.
pub struct FaultyPort<P> {
    port: P,
    timer: WindowTimer,
    selector: Selector,
    effect: Effect,
    foreign_station: Option<ForeignStation>,
    /// The frames of one call, each with the index of the frame that it was made of.
    outgoing: Vec<(usize, Frame)>,
    batch: Vec<Frame>,
    /// Delayed frames to send, each with its due time.
    delayed_tx: VecDeque<(Nanoseconds, Frame)>,
    incoming: Box<ReceiveBatch>,
    /// Delayed frames that were received, each with the time at which it can be taken.
    delayed_rx: VecDeque<(Nanoseconds, Received)>,
    arrived: VecDeque<Received>,
    unconfirmed: usize,
    /// Positions of the frames to shuffle.
    places: Vec<usize>,
    /// What the fault adds to the port's counters.
    added: BusHealth,
}

/// What happens to a selected frame.
enum FrameAction {
    Pass(Frame, usize),
    Shuffle,
    Delay(Nanoseconds, DelayPlace),
    Drop,
    Refuse,
}

impl<P: Injectable> FaultyPort<P> {
    /// Wraps `port`. The fault waits for a time in `triggers` and records its state in `progress`.
    pub fn new(
        port: P,
        fault: &ScenarioFault,
        trigger_times: Arc<TriggerTimes>,
        progress: Arc<FaultProgress>,
    ) -> Self {
        let foreign_station = match fault.effect {
            Effect::Foreign(frames) => Some(ForeignStation::new(frames)),
            _ => None,
        };
        Self {
            port,
            timer: WindowTimer::new(fault.window, trigger_times, progress),
            selector: Selector::new(fault.selection.clone()),
            effect: fault.effect,
            foreign_station,
            outgoing: Vec::with_capacity(MAX_OUTGOING),
            batch: Vec::with_capacity(MAX_OUTGOING),
            delayed_tx: VecDeque::with_capacity(CAPACITY),
            incoming: Box::default(),
            delayed_rx: VecDeque::with_capacity(CAPACITY),
            arrived: VecDeque::with_capacity(CAPACITY),
            unconfirmed: 0,
            places: Vec::with_capacity(CAPACITY),
            added: BusHealth::default(),
        }
    }

    /// The inner port.
    pub fn inner_mut(&mut self) -> &mut P {
        &mut self.port
    }

    /// Begins or ends the fault when it is time, and sends the frames that are due.
    fn advance(&mut self, now_ns: Nanoseconds) {
        match self.timer.poll(now_ns) {
            Edge::None => {}
            Edge::Began => self.begin(now_ns),
            Edge::Ended => self.end(),
        }
        while let Some((due_ns, frame)) =
            self.delayed_tx.front().copied().filter(|(due_ns, _)| *due_ns <= now_ns)
        {
            self.delayed_tx.pop_front();
            if self.port.send(due_ns, &[frame]) == 0 {
                self.added.tx_overruns += 1;
            }
        }
        self.release_delayed(now_ns);
        if self.timer.is_active() {
            self.send_foreign_frames(now_ns);
        }
    }

    fn begin(&mut self, now_ns: Nanoseconds) {
        match self.effect {
            Effect::Interface(effect) => {
                self.added.errors += u64::from(effect != InterfaceEffect::Down);
            }
            Effect::Drive { node, effect } => {
                if self.port.inject(node, effect, true).is_err() {
                    self.timer.progress().set_impossible();
                }
                if effect.is_event() {
                    self.timer.end(now_ns);
                }
            }
            Effect::Foreign(_) => {
                if let Some(foreign_station) = &mut self.foreign_station {
                    foreign_station.begin(now_ns);
                }
            }
            // Those of a serial line are between its master and the wire: see `LineFaults`.
            Effect::Frames(_) | Effect::Line(_) => {}
        }
    }

    fn end(&mut self) {
        self.unconfirmed = 0;
        if let Effect::Drive { node, effect } = self.effect {
            // A drive that could not get the effect cannot lose it either; the beginning has reported that.
            let _ = self.port.inject(node, effect, false);
        }
    }

    fn send_foreign_frames(&mut self, now_ns: Nanoseconds) {
        let Some(foreign_station) = &mut self.foreign_station else { return };
        while let Some((due_ns, frame)) = foreign_station.next(now_ns) {
            self.timer.progress().count_frame();
            if self.port.send_foreign(due_ns, &frame) == Delivery::ToOthers && self.arrived.len() < CAPACITY {
                self.arrived.push_back(Received { frame, at_ns: due_ns });
            }
        }
        if foreign_station.is_finished() {
            self.timer.end(now_ns);
        }
    }

    /// Returns `true` if the interface is disconnected from its bus.
    fn is_disconnected(&self) -> bool {
        let cuts = matches!(self.effect, Effect::Interface(InterfaceEffect::BusOff | InterfaceEffect::Down));
        cuts && self.timer.is_active()
    }

    /// Decides what happens to a frame.
    fn action(&mut self, now_ns: Nanoseconds, frame: &Frame, direction: Direction) -> FrameAction {
        let Effect::Frames(effect) = self.effect else { return FrameAction::Pass(*frame, 1) };
        let is_possible = direction == Direction::Sent || !effect.is_of_sending();
        if !self.timer.is_active() || !is_possible || !self.selector.picks(frame, direction) {
            return FrameAction::Pass(*frame, 1);
        }
        self.timer.progress().count_frame();
        if self.selector.is_exhausted() && effect != FrameEffect::EchoLoss {
            self.timer.end(now_ns);
        }
        match effect {
            FrameEffect::Drop => FrameAction::Drop,
            FrameEffect::Delay { by_ns, place } => FrameAction::Delay(by_ns, place),
            FrameEffect::Duplicate { copies } => FrameAction::Pass(*frame, 1 + usize::from(copies)),
            FrameEffect::Corrupt { bits, part } => {
                FrameAction::Pass(corrupted(frame, bits, part, |limit| self.selector.below(limit)), 1)
            }
            FrameEffect::Reorder => FrameAction::Shuffle,
            FrameEffect::EchoLoss => {
                self.unconfirmed += 1;
                FrameAction::Pass(*frame, 1)
            }
            FrameEffect::FullQueue => FrameAction::Refuse,
        }
    }

    /// Sends the altered frames, and returns how many of `frames` were taken.
    fn send_altered(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        self.outgoing.clear();
        self.places.clear();
        let mut gone = frames.len();
        for (number, frame) in frames.iter().enumerate() {
            match self.action(now_ns, frame, Direction::Sent) {
                FrameAction::Pass(frame, copies) if self.outgoing.len() + copies <= MAX_OUTGOING => {
                    self.outgoing.extend(std::iter::repeat_n((number, frame), copies));
                    continue;
                }
                FrameAction::Shuffle if self.outgoing.len() < MAX_OUTGOING => {
                    self.places.push(self.outgoing.len());
                    self.outgoing.push((number, *frame));
                    continue;
                }
                FrameAction::Delay(by_ns, _) if self.delayed_tx.len() < CAPACITY => {
                    self.delayed_tx.push_back((now_ns.saturating_add(by_ns), *frame));
                    continue;
                }
                FrameAction::Drop => {
                    self.added.tx_frames += 1;
                    continue;
                }
                FrameAction::Pass(..)
                | FrameAction::Shuffle
                | FrameAction::Delay(..)
                | FrameAction::Refuse => {}
            }
            gone = number;
            self.added.tx_overruns += (frames.len() - number) as u64;
            break;
        }
        for_each_swap(&self.places, &mut self.selector, |a, b| {
            // The indices stay in place, the frames are exchanged.
            let (first, second) = (self.outgoing[a].1, self.outgoing[b].1);
            (self.outgoing[a].1, self.outgoing[b].1) = (second, first);
        });
        self.batch.clear();
        self.batch.extend(self.outgoing.iter().map(|(_, frame)| *frame));
        let taken = if self.batch.is_empty() { 0 } else { self.port.send(now_ns, &self.batch) };
        self.outgoing.get(taken).map_or(gone, |(number, _)| *number)
    }

    fn release_delayed(&mut self, now_ns: Nanoseconds) {
        while let Some((_, received)) =
            self.delayed_rx.front().copied().filter(|(due_ns, _)| *due_ns <= now_ns)
        {
            self.delayed_rx.pop_front();
            self.arrive(received);
        }
    }

    fn arrive(&mut self, received: Received) {
        if self.arrived.len() < CAPACITY {
            self.arrived.push_back(received);
        } else {
            self.added.rx_overruns += 1;
        }
    }

    /// Takes what the inner port has received. Returns whether there was anything.
    fn take_incoming(&mut self, now_ns: Nanoseconds) -> bool {
        self.incoming.clear();
        self.port.receive(now_ns, &mut self.incoming);
        if self.is_disconnected() {
            return !self.incoming.is_empty();
        }
        self.places.clear();
        for index in 0..self.incoming.len() {
            let Some(received) = self.incoming.get(index).copied() else { break };
            match self.action(now_ns, &received.frame, Direction::Received) {
                FrameAction::Pass(frame, copies) => {
                    for _ in 0..copies {
                        self.arrive(Received { frame, ..received });
                    }
                }
                FrameAction::Shuffle => {
                    if self.arrived.len() < CAPACITY {
                        self.places.push(self.arrived.len());
                    }
                    self.arrive(received);
                }
                FrameAction::Delay(by_ns, place) if self.delayed_rx.len() < CAPACITY => {
                    let due_ns = received.at_ns.saturating_add(by_ns);
                    let at_ns = match place {
                        // It arrived in time but was not taken yet.
                        DelayPlace::Machine => received.at_ns,
                        DelayPlace::Bus => due_ns,
                    };
                    self.delayed_rx.push_back((due_ns, Received { at_ns, ..received }));
                }
                FrameAction::Delay(..) => self.added.rx_overruns += 1,
                FrameAction::Drop | FrameAction::Refuse => {}
            }
        }
        for_each_swap(&self.places, &mut self.selector, |a, b| self.arrived.swap(a, b));
        // Some delayed frames may already be due.
        self.release_delayed(now_ns);
        !self.incoming.is_empty()
    }
}

/// Swaps that bring the items at these positions into a random order (Fisher and Yates).
fn for_each_swap(places: &[usize], selector: &mut Selector, mut swap: impl FnMut(usize, usize)) {
    for (index, last) in places.iter().enumerate().skip(1).rev() {
        if let Some(other) = places.get(selector.below(index + 1)) {
            swap(*last, *other);
        }
    }
}

impl<P: Injectable> BusPort for FaultyPort<P> {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        self.advance(now_ns);
        // Like the kernel: frames on an interface that is down do not count as overruns.
        if self.is_disconnected() {
            return 0;
        }
        if let Some(foreign_station) = &mut self.foreign_station {
            frames.iter().for_each(|frame| foreign_station.observe(frame));
        }
        if self.timer.is_active() && matches!(self.effect, Effect::Frames(_)) {
            self.send_altered(now_ns, frames)
        } else {
            self.port.send(now_ns, frames)
        }
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        self.advance(now_ns);
        for _ in 0..MAX_BATCHES {
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
        self.advance(now_ns);
        self.port.unconfirmed(now_ns) + self.delayed_tx.len() + self.unconfirmed
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

impl<P: Injectable> Injectable for FaultyPort<P> {
    fn send_foreign(&mut self, now_ns: Nanoseconds, frame: &Frame) -> Delivery {
        self.port.send_foreign(now_ns, frame)
    }

    fn inject(&mut self, node: u8, effect: DriveEffect, is_present: bool) -> Result<(), InjectError> {
        self.port.inject(node, effect, is_present)
    }
}
