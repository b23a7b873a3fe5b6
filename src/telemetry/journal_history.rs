//! The journal of the last seconds, and the run as it was before them: what a black box needs to be replayed.
//!
//! The state before the last seconds is that of a second engine, which runs on what is older of the journal. The real-time thread has
//! nothing to do with it.

use std::collections::VecDeque;

use mcap::McapResult;
use takt_rt::Nanoseconds;

use super::recording::Recording;
use crate::config::ConfigSources;
use crate::journal::{Journal, Rerun, RerunParts, pop_front_if};

/// The journal of a time span, and what was before it.
pub struct JournalHistory {
    span_ns: Nanoseconds,
    sources: ConfigSources,
    /// The run up to the blocks.
    before: Rerun,
    /// Each with the start of the newest cycle that was known when it was made.
    blocks: VecDeque<(Nanoseconds, Vec<u8>)>,
}

impl JournalHistory {
    /// Keeps the journal of this time span. The engine of `parts` is that of the run, before its first cycle.
    pub fn new(span_ns: Nanoseconds, parts: RerunParts, sources: &ConfigSources) -> Self {
        Self { span_ns, sources: sources.clone(), before: Rerun::new(parts), blocks: VecDeque::new() }
    }

    /// Adds a block, and runs the engine through those that are older than the time span.
    pub fn add(&mut self, newest_cycle_ns: Nanoseconds, block: Vec<u8>) {
        self.blocks.push_back((newest_cycle_ns, block));
        let oldest_ns = newest_cycle_ns.saturating_sub(self.span_ns);
        while let Some((_, block)) = pop_front_if(&mut self.blocks, |(at_ns, _)| *at_ns < oldest_ns) {
            let mut journal = Journal::default();
            // The blocks were made here, and none has a state in it: neither step can fail.
            if journal.add_block(&block).is_ok() && self.before.add(journal).is_ok() {
                while self.before.step().is_some() {}
                self.before.take_events();
            }
        }
    }

    /// Writes where the journal begins, and the files of the configuration.
    pub fn begin(&self, recording: &mut Recording) -> McapResult<()> {
        recording.begin_journal(&self.sources)
    }

    /// Writes the state and the journal behind it.
    pub fn write(&self, recording: &mut Recording) -> McapResult<()> {
        self.before.checkpoint().map_or(Ok(()), |block| recording.journal(&block))?;
        self.blocks.iter().try_for_each(|(_, block)| recording.journal(block))
    }
}
