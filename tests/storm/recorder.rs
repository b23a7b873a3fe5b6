//! The journal of a storm, by the way that it takes in a recording.

use takt::journal::{Journal, RunJournal};
use takt::link::trace::Trace;
use takt_rt::CycleRecord;

/// Keeps the journal and the records of a run.
pub struct Recorder {
    run: RunJournal,
    block: Journal,
    pub journal: Journal,
    pub records: Vec<CycleRecord>,
    /// Entries that have found no room up to the last cycle.
    pub lost: u64,
}

impl Recorder {
    pub fn new(run: RunJournal) -> Self {
        Self { run, block: Journal::default(), journal: Journal::default(), records: vec![], lost: 0 }
    }

    /// Takes what has been noted: as bytes, and read again.
    pub fn drain(&mut self, traces: &mut [Trace]) {
        self.run.drain_clock(&mut self.block);
        for (bus, trace) in traces.iter_mut().enumerate() {
            while let Some(traced) = trace.take_any() {
                self.block.add_port(bus, &traced);
            }
        }
        self.run.drain_host(&mut self.block);
        if let Some(block) = self.block.take_block() {
            self.journal.add_block(&block).unwrap();
        }
        self.lost = self.run.dropped() + traces.iter().map(Trace::dropped).sum::<u64>();
    }
}
