//! A run again: the engine of a configuration on the journal of a recording.
//!
//! With the configuration of the run, each cycle is what it was, bit for bit. With another one it shows what that would have done on the
//! same frames, requests and times. The drives of the run do not know of it: they report what they reported. So what a changed
//! configuration shows is right as long as the drives would have followed the new set-points as they followed the old ones.

mod comparison;
mod complete_journal;
mod report;
mod settings;

use takt_rt::{CheckpointError, CycleRecord, Event};

use takt::config::Config;
use takt::controller::assemble::{self, AssembleError};
use takt::journal::{Journal, Rerun};

pub use comparison::{AxisDifference, Comparison, FirstDifference, compare};
pub use complete_journal::complete_journal;
pub use report::ComparisonReport;
pub use settings::{Setting, SettingError, apply};

/// The run again, cycle by cycle.
pub struct Replay(Rerun);

/// Why there is nothing to be replayed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The configuration cannot be carried out.
    #[error(transparent)]
    Assemble(#[from] AssembleError),
    /// The run ended before its first cycle.
    #[error("the run ended before its first cycle")]
    NoCycle,
    /// The journal begins in the middle of a run, with a state that the engine of this configuration cannot take over.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

impl Replay {
    /// The engine of this configuration, on this journal.
    ///
    /// # Errors
    /// See [`ReplayError`].
    pub fn new(config: &Config, journal: Journal) -> Result<Self, ReplayError> {
        let mut rerun = Rerun::new(assemble::rerun_parts(config)?);
        let mut journal = Some(journal);
        assemble::on_a_large_stack(|| journal.take().map_or(Ok(()), |journal| rerun.add(journal)))?;
        if rerun.has_begun() { Ok(Self(rerun)) } else { Err(ReplayError::NoCycle) }
    }

    /// Runs the next cycle. Returns its record; nothing after the last one.
    pub fn step(&mut self) -> Option<&CycleRecord> {
        self.0.step()
    }

    /// The events of the last cycle.
    pub fn take_events(&mut self) -> Vec<Event> {
        self.0.take_events()
    }

    /// A block of a journal that goes on from here.
    pub fn checkpoint(&self) -> Option<Vec<u8>> {
        self.0.checkpoint()
    }
}
