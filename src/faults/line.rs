//! Faults of a serial line: what becomes of the requests and replies on it.

use std::collections::VecDeque;
use std::sync::Arc;

use takt_rt::Nanoseconds;

use super::effect::{LineEffect, Part};
use super::selection::{Direction, Selection, Selector};
use super::trigger::TriggerTimes;
use super::window::{FaultProgress, Window, WindowTimer};

/// The faults of a serial line, between its master and the wire. The first one of the file is nearest to the wire.
///
/// A request is what the master hands over at once. A reply is what arrives from then until the next request.
#[derive(Debug, Default)]
pub struct LineFaults {
    faults: Vec<LineFault>,
}

impl LineFaults {
    pub(super) const fn new(faults: Vec<LineFault>) -> Self {
        Self { faults }
    }

    /// Begins and ends the faults. It is called before the others, in every turn of the master.
    pub fn advance(&mut self, now_ns: Nanoseconds) {
        for fault in &mut self.faults {
            fault.timer.poll(now_ns);
        }
    }

    /// Returns `true` if the line is gone.
    pub fn is_gone(&self) -> bool {
        self.faults.iter().any(LineFault::is_gone)
    }

    /// What goes onto the wire now: the request of the master, if there is one, and those that were held back.
    pub fn send(&mut self, now_ns: Nanoseconds, request: Option<Vec<u8>>) -> Vec<Vec<u8>> {
        let requests = request.into_iter().collect();
        self.faults.iter_mut().rev().fold(requests, |requests, fault| fault.send(now_ns, requests))
    }

    /// What the master receives now: of the bytes that have arrived, and of those that were held back.
    pub fn receive(&mut self, now_ns: Nanoseconds, bytes: Vec<u8>) -> Vec<u8> {
        self.faults.iter_mut().fold(bytes, |bytes, fault| fault.receive(now_ns, bytes))
    }
}

/// One fault of a line.
#[derive(Debug)]
pub(super) struct LineFault {
    effect: LineEffect,
    timer: WindowTimer,
    selector: Selector,
    /// Requests, and bytes of replies, that are held back, each with its due time.
    held_requests: VecDeque<(Nanoseconds, Vec<u8>)>,
    held_replies: VecDeque<(Nanoseconds, Vec<u8>)>,
    /// The address of the last request, 0 before the first.
    asked: u8,
    reply: ReplyFate,
}

/// What becomes of the reply to the last request. It is decided with the first byte, and holds for the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ReplyFate {
    Undecided,
    Untouched,
    Affected {
        /// True if its first byte, which is the address, has passed.
        has_begun: bool,
        /// Bits that are still to be inverted.
        bits_left: u8,
    },
}

impl LineFault {
    pub fn new(
        effect: LineEffect,
        window: Window,
        selection: Selection,
        trigger_times: Arc<TriggerTimes>,
        progress: Arc<FaultProgress>,
    ) -> Self {
        Self {
            effect,
            timer: WindowTimer::new(window, trigger_times, progress),
            selector: Selector::new(selection),
            held_requests: VecDeque::new(),
            held_replies: VecDeque::new(),
            asked: 0,
            reply: ReplyFate::Undecided,
        }
    }

    fn is_gone(&self) -> bool {
        self.effect == LineEffect::Gone && self.timer.is_active()
    }

    /// Returns `true` if the next request, or the reply to the last one, is affected.
    fn affects(&mut self, now_ns: Nanoseconds, direction: Direction) -> bool {
        let is_affected = self.timer.is_active() && self.selector.picks_message(self.asked, direction);
        if is_affected {
            self.timer.progress().count_frame();
            if self.selector.is_exhausted() {
                self.timer.end(now_ns);
            }
        }
        is_affected
    }

    fn send(&mut self, now_ns: Nanoseconds, requests: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
        let mut passing = due(&mut self.held_requests, now_ns);
        for mut request in requests {
            self.asked = request.first().copied().unwrap_or(0);
            self.reply = ReplyFate::Undecided;
            if self.effect == LineEffect::Gone || !self.affects(now_ns, Direction::Sent) {
                passing.push(request);
                continue;
            }
            match self.effect {
                LineEffect::Drop | LineEffect::Gone => {}
                LineEffect::Delay { by_ns } => {
                    self.held_requests.push_back((now_ns.saturating_add(by_ns), request));
                }
                LineEffect::Corrupt { bits, part } => {
                    let address_bytes = 1.min(request.len());
                    let (address, rest) = request.split_at_mut(address_bytes);
                    let touched = if part == Part::Identifier { address } else { rest };
                    invert(touched, bits, &mut self.selector);
                    passing.push(request);
                }
            }
        }
        // What is held back when the line goes is lost, as what is handed over then.
        if self.is_gone() { vec![] } else { passing }
    }

    fn receive(&mut self, now_ns: Nanoseconds, mut bytes: Vec<u8>) -> Vec<u8> {
        let mut passing = due(&mut self.held_replies, now_ns).concat();
        if self.is_gone() {
            return vec![];
        }
        if !bytes.is_empty() && self.reply == ReplyFate::Undecided {
            let is_affected = self.effect != LineEffect::Gone && self.affects(now_ns, Direction::Received);
            let bits_left = if let LineEffect::Corrupt { bits, .. } = self.effect { bits } else { 0 };
            self.reply = match is_affected {
                true => ReplyFate::Affected { has_begun: false, bits_left },
                false => ReplyFate::Untouched,
            };
        }
        let ReplyFate::Affected { has_begun, bits_left } = &mut self.reply else {
            passing.append(&mut bytes);
            return passing;
        };
        match self.effect {
            LineEffect::Drop | LineEffect::Gone => {}
            LineEffect::Delay { by_ns } if !bytes.is_empty() => {
                self.held_replies.push_back((now_ns.saturating_add(by_ns), bytes));
            }
            LineEffect::Delay { .. } => {}
            LineEffect::Corrupt { part, .. } => {
                let address_bytes = usize::from(!*has_begun).min(bytes.len());
                *has_begun |= address_bytes > 0;
                let (address, rest) = bytes.split_at_mut(address_bytes);
                let touched = if part == Part::Identifier { address } else { rest };
                if !touched.is_empty() {
                    invert(touched, std::mem::take(bits_left), &mut self.selector);
                }
                passing.append(&mut bytes);
            }
        }
        passing
    }
}

/// Takes what is due from a queue.
fn due(held: &mut VecDeque<(Nanoseconds, Vec<u8>)>, now_ns: Nanoseconds) -> Vec<Vec<u8>> {
    let count = held.iter().take_while(|(due_ns, _)| *due_ns <= now_ns).count();
    held.drain(..count).map(|(_, bytes)| bytes).collect()
}

/// Inverts so many bits, each anywhere in these bytes.
fn invert(bytes: &mut [u8], bits: u8, selector: &mut Selector) {
    for _ in 0..bits {
        let bit = selector.below(8 * bytes.len());
        if let Some(byte) = bytes.get_mut(bit / 8) {
            *byte ^= 1 << (bit % 8);
        }
    }
}
