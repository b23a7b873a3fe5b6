//! The engine of a run, run again from its journal: as much of it as is there.

use takt_rt::{CheckpointError, Cycle, CycleRecord, Engine, Event, Flow, Grid, Nanoseconds, SlotPlan};

use super::format::{Checkpoint, Journal};
use super::{ReplayClock, ReplayHost, ReplayPort};
use crate::channels::ChannelSizes;

/// What an engine is run again with.
pub struct RerunParts {
    /// The engine of the configuration, before its first cycle.
    pub engine: Box<Engine>,
    /// The plan of its slots.
    pub plan: SlotPlan,
    /// Its channels.
    pub sizes: ChannelSizes,
}

/// A run again, cycle by cycle. Its journal may come bit by bit.
pub struct Rerun {
    engine: Box<Engine>,
    plan: SlotPlan,
    /// The start of slot 0, and the place on the grid; `None` before the journal has told the start.
    place: Option<(Nanoseconds, Cycle)>,
    clock: ReplayClock,
    ports: Vec<ReplayPort>,
    host: ReplayHost,
    is_over: bool,
}

impl Rerun {
    /// A run that has no journal yet.
    pub fn new(parts: RerunParts) -> Self {
        let mut ports = Vec::new();
        ports.resize_with(parts.sizes.buses, ReplayPort::default);
        Self {
            engine: parts.engine,
            plan: parts.plan,
            place: None,
            clock: ReplayClock::default(),
            ports,
            host: ReplayHost::new(&parts.sizes),
            is_over: false,
        }
    }

    /// Adds the next part of the journal.
    ///
    /// # Errors
    /// It begins with a state that is none of this machine. The run is over then.
    pub fn add(&mut self, journal: Journal) -> Result<(), CheckpointError> {
        if let Some(epoch_ns) = journal.epoch_ns {
            let grid = Grid::new(epoch_ns, self.engine.period_ns());
            self.place = grid.map(|grid| (epoch_ns, Cycle::new(grid, self.plan)));
        }
        if let Some(checkpoint) = &journal.checkpoint {
            self.resume(checkpoint).inspect_err(|_| self.is_over = true)?;
        }
        self.clock.add(journal.clock);
        for (port, entries) in self.ports.iter_mut().zip(journal.ports) {
            entries.iter().for_each(|entry| port.add(entry));
        }
        self.host.add(journal.host, journal.trajectories);
        Ok(())
    }

    fn resume(&mut self, checkpoint: &Checkpoint) -> Result<(), CheckpointError> {
        let Some((epoch_ns, _)) = self.place else { return Err(CheckpointError::Unreadable) };
        let grid = Grid::new(epoch_ns, self.engine.period_ns()).ok_or(CheckpointError::Unreadable)?;
        if checkpoint.ports.len() != self.ports.len() {
            return Err(CheckpointError::OtherMachine);
        }
        self.engine.resume(&checkpoint.engine)?;
        self.host.resume(checkpoint.next_cycle, &checkpoint.streams)?;
        self.place = Some((epoch_ns, Cycle::resumed(grid, self.plan, checkpoint.next_slot)));
        self.clock.resume(checkpoint.now_ns);
        self.ports.iter_mut().zip(&checkpoint.ports).for_each(|(port, shown)| port.resume(*shown));
        Ok(())
    }

    /// Returns `true` if the journal has told when the run began.
    pub const fn has_begun(&self) -> bool {
        self.place.is_some()
    }

    /// Runs the next cycle, if all of its journal is there. Returns its record.
    pub fn step(&mut self) -> Option<&CycleRecord> {
        let Self { engine, place, clock, ports, host, is_over, .. } = self;
        let (_, cycle) = place.as_mut().filter(|_| !*is_over && clock.has_cycle())?;
        host.begin_cycle();
        let flow = cycle.run(engine, clock, ports, host);
        ports.iter_mut().for_each(|port| port.sent.clear());
        clock.end_cycle();
        *is_over = flow == Flow::Shutdown;
        Some(&host.record)
    }

    /// The events since the last call.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.host.events)
    }

    /// A block of a journal that goes on from here: the state, and the part of the journal that is there and has not been run.
    /// `None` before the run has begun.
    pub fn checkpoint(&self) -> Option<Vec<u8>> {
        let (epoch_ns, cycle) = self.place.as_ref()?;
        let mut checkpoint = Checkpoint {
            next_slot: cycle.next_slot(),
            next_cycle: self.host.next_cycle(),
            now_ns: self.clock.told_ns(),
            ports: self.ports.iter().map(ReplayPort::shown).collect(),
            engine: self.engine.checkpoint(),
            streams: self.host.streams(),
            crc32: 0,
        };
        checkpoint.crc32 = checkpoint.checksum();
        let mut rest = Journal {
            checkpoint: Some(checkpoint),
            epoch_ns: Some(*epoch_ns),
            clock: self.clock.unused().collect(),
            ports: self.ports.iter().map(ReplayPort::unused).collect(),
            host: self.host.unused().copied().collect(),
            trajectories: Vec::new(),
        };
        self.host.trajectories().for_each(|(id, group, given)| rest.add_trajectory(id, group, given));
        rest.take_block()
    }
}
