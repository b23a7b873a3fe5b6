//! Keeps the journal of a run: makes blocks of it for the recording.

use crate::journal::{Journal, RunJournal};
use crate::link::trace::Traced;

/// The journal of a run on its way into the recording.
pub struct JournalKeeper {
    journal: RunJournal,
    block: Journal,
}

impl JournalKeeper {
    /// Keeps this journal.
    pub fn new(journal: RunJournal) -> Self {
        Self { journal, block: Journal::default() }
    }

    /// A block begins. Whatever belongs to a cycle whose end is known by now is in the block, if what has passed the ports is taken
    /// after this call.
    pub fn begin_block(&mut self) {
        self.journal.drain_clock(&mut self.block);
    }

    /// Takes what has passed the port of a bus.
    pub fn port(&mut self, bus: usize, traced: &Traced) {
        self.block.add_port(bus, traced);
    }

    /// The block, up to what the host has answered by now; nothing if that is nothing.
    pub fn end_block(&mut self) -> Option<Vec<u8>> {
        self.journal.drain_host(&mut self.block);
        self.block.take_block()
    }

    /// Entries that found no room.
    pub fn dropped(&self) -> u64 {
        self.journal.dropped()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::channels::{ChannelSizes, channels, journal};
    use crate::config::Config;
    use crate::journal::{ClockAnswer, clock_journal};
    use crate::link::trace::TracedFrame;
    use takt_rt::{Frame, Id};

    #[test]
    fn a_cycle_that_ends_while_frames_are_taken_is_left_to_the_next_block_with_its_frames() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/first.toml");
        let sizes = ChannelSizes::of(&Config::load(&path).unwrap());
        let (mut rt, mut host, _log) = channels(&sizes);
        let (mut answers, clock) = clock_journal();
        let mut keeper = JournalKeeper::new(RunJournal { clock, host: journal(&mut rt, &mut host) });
        let frame = |at_ns| {
            let frame = Frame::of(Id::canopen(0x180, 1), [7]);
            Traced::Frame(TracedFrame { at_ns, is_sent: false, frame })
        };
        answers.push(ClockAnswer::CycleEnd);
        keeper.begin_block();
        keeper.port(0, &frame(1));
        // Meanwhile the run goes on: the frames of this cycle come behind those that have been taken.
        answers.push(ClockAnswer::CycleEnd);
        let first = keeper.end_block().unwrap();
        keeper.begin_block();
        keeper.port(0, &frame(2));
        let second = keeper.end_block().unwrap();
        for block in [first, second] {
            let mut journal = Journal::default();
            journal.add_block(&block).unwrap();
            assert_eq!(journal.clock, [ClockAnswer::CycleEnd]);
            assert_eq!(journal.ports[0].len(), 1);
        }
    }
}
