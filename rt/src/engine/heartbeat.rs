//! The heartbeat of this controller (CiA 301, 7.2.8.3.2), which the drives watch: when it leaves on each bus.

use super::parameters::Heartbeat;
use crate::frame::{Frame, Id};

/// Cycles of the slowest bus for which the heartbeat waits after the controller was away for more than its period.
/// A drive that has stopped for want of it may go on to its old target once the heartbeat is back: until then its report
/// must have been received, and it must have a new target and a new controlword.
const HELD_BUS_CYCLES: u32 = 4;
/// A single one might be lost on the wire. The drive that misses it would run unwatched for a whole period.
const BEFORE_ENABLING: u32 = 2;
const NMT_OPERATIONAL: u8 = 5;

/// Produces the heartbeat.
#[derive(Clone, Debug)]
pub(super) struct HeartbeatProducer<const BUSES: usize> {
    heartbeat: Heartbeat,
    /// Cycles for which it waits after an absence.
    held_cycles: u32,
    /// Cycles until the next one, on each bus.
    due: [u32; BUSES],
    /// Cycles for which one has been due and could not leave, on each bus.
    overdue: [u32; BUSES],
    /// Heartbeats that have still to leave before any drive is enabled, on each bus.
    awaited: [u32; BUSES],
}

impl<const BUSES: usize> HeartbeatProducer<BUSES> {
    pub(super) fn new(heartbeat: Heartbeat, slowest_divider: u32) -> Self {
        let held_cycles = HELD_BUS_CYCLES.saturating_mul(slowest_divider);
        Self { heartbeat, held_cycles, due: [0; BUSES], overdue: [0; BUSES], awaited: [0; BUSES] }
    }

    /// Cycles without a heartbeat after which the drives stop by themselves.
    pub(super) const fn timeout_cycles(&self) -> u32 {
        self.heartbeat.timeout_cycles
    }

    /// Lets slots pass. After an absence that a drive may have noticed, the heartbeat waits.
    pub(super) fn pass(&mut self, elapsed: u64) {
        let was_away = elapsed > self.heartbeat.cycles.into();
        for (due, overdue) in self.due.iter_mut().zip(&mut self.overdue) {
            *overdue = if *due == 0 { overdue.saturating_add(1) } else { 0 };
            *due = if was_away { (*due).max(self.held_cycles) } else { due.saturating_sub(1) };
        }
    }

    /// A drive watches the controller from the first heartbeat on that it receives after its set-up: that one leaves before
    /// the drive is enabled, and not only after a whole period.
    pub(super) fn hasten(&mut self) {
        self.awaited = [BEFORE_ENABLING; BUSES];
        self.due.iter_mut().for_each(|due| *due = (*due).min(self.held_cycles));
    }

    /// Whether enough heartbeats have left on a bus, or leave with this cycle, for its drives to be enabled.
    pub(super) fn allows_enabling(&self, bus: usize) -> bool {
        let (awaited, due) = (self.awaited.get(bus), self.due.get(bus));
        awaited.copied().unwrap_or(0) <= u32::from(due == Some(&0))
    }

    /// The heartbeat of a bus, if it is due. It counts as sent. One that could not leave for a whole period has been missed by
    /// the drives as in an absence.
    pub(super) fn take(&mut self, bus: usize) -> Option<Frame> {
        let (due, awaited) = (self.due.get_mut(bus)?, self.awaited.get_mut(bus)?);
        if *due > 0 {
            return None;
        }
        let overdue = core::mem::take(self.overdue.get_mut(bus)?);
        if overdue > self.heartbeat.cycles {
            *due = self.held_cycles;
            return None;
        }
        *awaited = awaited.saturating_sub(1);
        // While more are awaited, the next one comes as soon as after an absence.
        *due = if *awaited > 0 {
            self.heartbeat.cycles.min(self.held_cycles + 1)
        } else {
            self.heartbeat.cycles
        };
        Some(Frame::of(Id::canopen(0x700, self.heartbeat.node), [NMT_OPERATIONAL]))
    }
}
