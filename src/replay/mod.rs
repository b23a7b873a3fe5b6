//! A run again: the engine of a configuration on the journal of a recording.
//!
//! With the configuration of the run, each cycle is what it was, bit for bit. With another one it shows what that would have done on the
//! same frames, requests and times. The drives of the run do not know of it: they report what they reported. So what a changed
//! configuration shows is right as long as the drives would have followed the new set-points as they followed the old ones.

mod comparison;
mod complete_journal;
mod report;
mod settings;

use takt_rt::{CycleRecord, Event, Flow, Grid};

use crate::channels::ChannelSizes;
use crate::config::Config;
use crate::controller::assemble::{self, AssembleError};
use crate::journal::{Journal, ReplayClock, ReplayHost, ReplayPort};

pub use comparison::{AxisDifference, Comparison, FirstDifference, compare};
pub use complete_journal::complete_journal;
pub use report::ComparisonReport;
pub use settings::{Setting, SettingError, apply};

/// The run again, cycle by cycle.
pub struct Replay {
    engine: Box<takt_rt::Engine>,
    cycle: takt_rt::Cycle,
    clock: ReplayClock,
    ports: Vec<ReplayPort>,
    host: ReplayHost,
    is_over: bool,
}

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
}

impl Replay {
    /// The engine of this configuration, on this journal.
    ///
    /// # Errors
    /// See [`ReplayError`].
    pub fn new(config: &Config, journal: Journal) -> Result<Self, ReplayError> {
        let engine = assemble::engine(config)?;
        let grid = journal.epoch_ns.and_then(|epoch_ns| Grid::new(epoch_ns, config.cycle.period_ns));
        let mut ports: Vec<ReplayPort> =
            journal.ports.iter().map(|entries| ReplayPort::new(entries)).collect();
        ports.resize_with(config.buses.len(), ReplayPort::default);
        Ok(Self {
            engine,
            cycle: takt_rt::Cycle::new(grid.ok_or(ReplayError::NoCycle)?, assemble::slot_plan(config)),
            clock: ReplayClock::new(journal.clock),
            ports,
            host: ReplayHost::new(&ChannelSizes::of(config), journal.host, journal.trajectories),
            is_over: false,
        })
    }

    /// Runs the next cycle. Returns its record; nothing after the last one.
    pub fn step(&mut self) -> Option<&CycleRecord> {
        if self.is_over || !self.clock.has_cycle() {
            return None;
        }
        self.host.begin_cycle();
        let flow = self.cycle.run(&mut self.engine, &mut self.clock, &mut self.ports, &mut self.host);
        self.clock.end_cycle();
        self.is_over = flow == Flow::Shutdown;
        Some(&self.host.record)
    }

    /// The events of the last cycle.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.host.events)
    }
}
