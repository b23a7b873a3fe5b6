//! The journal of a run: everything that the real-time thread was told from outside, so that the same engine can be run again and does
//! the same, bit for bit.
//!
//! The cycle is a function of what its [`Clock`](takt_rt::Clock), its [`BusPort`](takt_rt::BusPort)s and its
//! [`HostInterface`](takt_rt::HostInterface) answer. The journal has these answers:
//!
//! | answers of | noted by | replayed by |
//! | --- | --- | --- |
//! | the clock | [`JournaledClock`] | [`ReplayClock`] |
//! | the ports: frames, and what is out of the ordinary | [`TracedPort`](crate::link::trace::TracedPort) | [`ReplayPort`] |
//! | the host: requests, points, callbacks, service frames, trajectories | the channels ([`channels::journal`](crate::channels::journal)) | [`ReplayHost`] |
//!
//! What a port and the host answer is found again by its time and by its cycle, so that a replay under another configuration, whose
//! engine asks for other things, gets what was there.

mod clock;
mod format;
mod host;
mod host_words;
mod port;
mod rerun;

pub use clock::{ClockAnswer, ClockJournal, JournaledClock, ReplayClock, clock_journal};
pub use format::{Checkpoint, Encoder, Journal, JournalDefect};
pub use host::ReplayHost;
pub use port::{PortEntry, PortState, ReplayPort};
pub use rerun::{Rerun, RerunParts};

use std::collections::VecDeque;

use crate::channels::JournalReader;

/// The first entry of a queue, if it is wanted.
pub fn pop_front_if<T>(queue: &mut VecDeque<T>, is_wanted: impl FnOnce(&T) -> bool) -> Option<T> {
    queue.front().is_some_and(is_wanted).then(|| queue.pop_front()).flatten()
}

/// The ends of the journal of a run, but for those of its ports.
pub struct RunJournal {
    /// The clock.
    pub clock: ClockJournal,
    /// The host.
    pub host: JournalReader,
}

impl RunJournal {
    /// Puts what the clock has answered since the last call. Call it before what the ports and the host have answered is taken: a cycle
    /// whose end is put here then is whole in what has been put by the end of [`RunJournal::drain_host`], however far the run goes on
    /// meanwhile.
    pub fn drain_clock(&mut self, encoder: &mut Encoder) {
        while let Some(answer) = self.clock.pop() {
            encoder.clock(answer);
        }
    }

    /// Puts what the host has answered since the last call.
    pub fn drain_host(&mut self, encoder: &mut Encoder) {
        for (id, group, given) in self.host.take_trajectories() {
            encoder.trajectory(id, group, &given);
        }
        while let Some(entry) = self.host.take() {
            encoder.host(&entry);
        }
    }

    /// Entries that found no room: what is behind them cannot be replayed.
    pub fn dropped(&self) -> u64 {
        self.clock.dropped() + self.host.dropped()
    }
}
