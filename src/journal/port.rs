//! The port of a bus, replayed.

use std::collections::VecDeque;

use takt_rt::{BusHealth, BusPort, BusState, Frame, Nanoseconds, ReceiveBatch, Received};

use super::format::PortEntry;
use super::pop_front_if;
use crate::link::trace::PortAnswer;

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
    /// What has been sent since the last look.
    pub sent: Vec<Frame>,
}

impl ReplayPort {
    /// A port with this journal.
    pub fn new(entries: &[PortEntry]) -> Self {
        let mut port = Self::default();
        let mut handed_over_ns = 0;
        for entry in entries {
            match *entry {
                PortEntry::Received(received) => port.received.push_back((handed_over_ns, received)),
                PortEntry::Mark(mark) => match mark.answer {
                    PortAnswer::Received => handed_over_ns = mark.at_ns,
                    PortAnswer::Unconfirmed(count) => {
                        port.unconfirmed.push_back((mark.at_ns, count as usize))
                    }
                    PortAnswer::Taken(count) => port.taken.push_back((mark.at_ns, count as usize)),
                    PortAnswer::State(state) => port.states.push_back((mark.at_ns, state)),
                },
            }
        }
        port
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
