//! The journal of a run as it is written.

use super::clock::ClockJournal;
use super::format::Journal;
use crate::channels::JournalReader;

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
    pub fn drain_clock(&mut self, block: &mut Journal) {
        while let Some(answer) = self.clock.pop() {
            block.add_clock(answer);
        }
    }

    /// Puts what the host has answered since the last call.
    pub fn drain_host(&mut self, block: &mut Journal) {
        for (id, group, given) in self.host.take_trajectories() {
            block.add_trajectory(id, group, &given);
        }
        while let Some(entry) = self.host.take() {
            block.host.push_back(entry);
        }
    }

    /// Entries that found no room: what is behind them cannot be replayed.
    pub fn dropped(&self) -> u64 {
        self.clock.dropped() + self.host.dropped()
    }
}
