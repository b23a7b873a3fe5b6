//! Keeps the journal of a run: makes blocks of it for the recording.

use crate::journal::{Encoder, RunJournal};
use crate::link::trace::Traced;

/// The journal of a run on its way into the recording.
pub struct JournalKeeper {
    journal: RunJournal,
    encoder: Encoder,
}

impl JournalKeeper {
    /// Keeps this journal.
    pub fn new(journal: RunJournal) -> Self {
        Self { journal, encoder: Encoder::default() }
    }

    /// Takes what has passed the port of a bus.
    pub fn port(&mut self, bus: usize, traced: &Traced) {
        self.encoder.port(bus, traced);
    }

    /// What has been noted since the last call, as a block; nothing if that is nothing.
    pub fn drain(&mut self) -> Option<Vec<u8>> {
        self.journal.drain(&mut self.encoder);
        self.encoder.take_block()
    }

    /// Entries that found no room.
    pub fn dropped(&self) -> u64 {
        self.journal.dropped()
    }
}
