//! The clock of a run, noted and replayed.

use std::collections::VecDeque;

use bitcode::{Decode, Encode};
use takt_rt::{Clock, Nanoseconds, Wake};

use super::pop_front_if;
use crate::channels::{Consumer, Producer, ring};

/// Answers that wait for the logger: those of half a second at 1 ms.
const ANSWERS: usize = 1 << 13;

/// An answer of the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum ClockAnswer {
    /// The start of slot 0. It comes first.
    Epoch(Nanoseconds),
    /// The present.
    Now(Nanoseconds),
    /// The end of a wait.
    Woke(Wake),
    /// The end of a wait at whose end a frame leaves.
    WokeToSend(Wake),
    /// The cycle is over.
    CycleEnd,
}

/// The end of whoever keeps the journal.
pub type ClockJournal = Consumer<ClockAnswer>;

/// A clock whose answers are noted, if that is asked for. A full journal drops and counts.
pub struct JournaledClock<C> {
    /// The clock.
    pub clock: C,
    answers: Option<Producer<ClockAnswer>>,
}

impl<C> JournaledClock<C> {
    /// A clock of which nothing is noted.
    pub fn new(clock: C) -> Self {
        Self { clock, answers: None }
    }

    /// A clock whose answers are noted here.
    pub fn noted_in(clock: C, answers: Option<Producer<ClockAnswer>>) -> Self {
        Self { clock, answers }
    }

    /// Notes the start of slot 0.
    pub fn note_epoch(&mut self, epoch_ns: Nanoseconds) {
        self.note(ClockAnswer::Epoch(epoch_ns));
    }

    /// Notes that a cycle is over.
    pub fn end_cycle(&mut self) {
        self.note(ClockAnswer::CycleEnd);
    }

    fn note(&mut self, answer: ClockAnswer) {
        if let Some(answers) = &mut self.answers {
            answers.push(answer);
        }
    }
}

/// The two ends of the journal of a clock.
pub fn clock_journal() -> (Producer<ClockAnswer>, ClockJournal) {
    ring(ANSWERS)
}

impl<C: Clock> Clock for JournaledClock<C> {
    fn now_ns(&mut self) -> Nanoseconds {
        let now_ns = self.clock.now_ns();
        self.note(ClockAnswer::Now(now_ns));
        now_ns
    }

    fn wait_until(&mut self, deadline_ns: Nanoseconds) -> Wake {
        let wake = self.clock.wait_until(deadline_ns);
        self.note(ClockAnswer::Woke(wake));
        wake
    }

    fn wait_to_send(&mut self, deadline_ns: Nanoseconds) -> Wake {
        let wake = self.clock.wait_to_send(deadline_ns);
        self.note(ClockAnswer::WokeToSend(wake));
        wake
    }
}

/// A clock that answers as it did.
///
/// An engine of another configuration may look at the clock more or less often within a cycle. The waits and the ends of cycles keep it
/// in step: what is left of the answers before them is passed over.
#[derive(Clone, Debug, Default)]
pub struct ReplayClock {
    answers: VecDeque<ClockAnswer>,
    now_ns: Nanoseconds,
    /// Whole cycles that are left.
    cycles: usize,
}

impl ReplayClock {
    /// Adds answers that it is to give.
    pub fn add(&mut self, answers: impl IntoIterator<Item = ClockAnswer>) {
        for answer in answers {
            self.cycles += usize::from(answer == ClockAnswer::CycleEnd);
            self.answers.push_back(answer);
        }
    }

    /// Goes on from this time.
    pub fn resume(&mut self, now_ns: Nanoseconds) {
        self.now_ns = now_ns;
    }

    /// The last time that it has told.
    pub const fn told_ns(&self) -> Nanoseconds {
        self.now_ns
    }

    /// The answers that it has not given yet.
    pub fn unused(&self) -> impl Iterator<Item = ClockAnswer> + '_ {
        self.answers.iter().copied()
    }

    /// Returns `true` if there are answers for another whole cycle.
    pub fn has_cycle(&self) -> bool {
        self.cycles > 0
    }

    /// The cycle is over.
    pub fn end_cycle(&mut self) {
        while let Some(answer) = self.answers.pop_front() {
            if answer == ClockAnswer::CycleEnd {
                self.cycles -= 1;
                return;
            }
        }
    }

    /// The wake-up at the end of the next wait of this kind in this cycle. Where there is none, the clock stands.
    fn wake(&mut self, of_kind: impl Fn(&ClockAnswer) -> Option<Wake>) -> Wake {
        while let Some(answer) = pop_front_if(&mut self.answers, |answer| *answer != ClockAnswer::CycleEnd) {
            if let Some(wake) = of_kind(&answer) {
                self.now_ns = wake.now_ns;
                return wake;
            }
        }
        Wake { now_ns: self.now_ns, ..Wake::default() }
    }
}

impl Clock for ReplayClock {
    fn now_ns(&mut self) -> Nanoseconds {
        if let Some(ClockAnswer::Now(now_ns)) = self.answers.front() {
            self.now_ns = *now_ns;
            self.answers.pop_front();
        }
        self.now_ns
    }

    fn wait_until(&mut self, _deadline_ns: Nanoseconds) -> Wake {
        self.wake(|answer| match answer {
            ClockAnswer::Woke(wake) => Some(*wake),
            _ => None,
        })
    }

    fn wait_to_send(&mut self, _deadline_ns: Nanoseconds) -> Wake {
        self.wake(|answer| match answer {
            ClockAnswer::WokeToSend(wake) => Some(*wake),
            _ => None,
        })
    }
}
