//! The heartbeat of this controller (CiA 301, 7.2.8.3.2), which the drives watch: when it leaves on each CANopen bus.

use arrayvec::ArrayVec;

use super::parameters::{BusParameters, Heartbeat};
use crate::frame::{Frame, Id};
use crate::function_code;

/// Cycles of the slowest bus for which the heartbeat waits after the controller was away for more than its period.
/// A drive that has stopped for want of it may go on to its old target once the heartbeat is back: until then its report
/// must have been received, and it must have a new target and a new controlword.
const HELD_BUS_CYCLES: u32 = 4;
/// A single one might be lost on the wire. The drive that misses it would run unwatched for a whole period.
const BEFORE_ENABLING: u32 = 2;
const NMT_OPERATIONAL: u8 = 5;

/// Produces the heartbeat.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct HeartbeatProducer<const BUSES: usize> {
    heartbeat: Heartbeat,
    /// Cycles for which it waits after an absence.
    held_cycles: u32,
    /// `None` where no heartbeat is sent: the bus is no CANopen network.
    buses: ArrayVec<Option<BusHeartbeat>, BUSES>,
}

/// The heartbeat on one bus.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
struct BusHeartbeat {
    /// Cycles until the next one.
    due: u32,
    /// Cycles for which one has been due and could not leave.
    overdue: u32,
    /// Heartbeats that have still to leave before any drive is enabled.
    awaited: u32,
}

impl<const BUSES: usize> HeartbeatProducer<BUSES> {
    /// For these buses, of which those have it that are CANopen networks.
    pub(super) fn new(heartbeat: Heartbeat, buses: &[BusParameters]) -> Self {
        let slowest_divider = buses.iter().map(|bus| bus.divider).max().unwrap_or(1);
        let held_cycles = HELD_BUS_CYCLES.saturating_mul(slowest_divider);
        let buses = buses.iter().take(BUSES).map(|bus| bus.canopen.map(|_| BusHeartbeat::default()));
        Self { heartbeat, held_cycles, buses: buses.collect() }
    }

    /// Lets slots pass. After an absence that a drive may have noticed, the heartbeat waits.
    pub(super) fn pass(&mut self, elapsed: u64) {
        let was_away = elapsed > self.heartbeat.cycles.into();
        for BusHeartbeat { due, overdue, .. } in self.buses.iter_mut().flatten() {
            *overdue = if *due == 0 { overdue.saturating_add(1) } else { 0 };
            *due = if was_away { (*due).max(self.held_cycles) } else { due.saturating_sub(1) };
        }
    }

    /// A drive watches the controller from the first heartbeat on that it receives after its set-up: that one leaves before
    /// the drive is enabled, and not only after a whole period.
    pub(super) fn hasten(&mut self) {
        for bus in self.buses.iter_mut().flatten() {
            bus.awaited = BEFORE_ENABLING;
            bus.due = bus.due.min(self.held_cycles);
        }
    }

    /// Returns `true` if enough heartbeats have left on a bus, or leave with this cycle, for its drives to be enabled.
    pub(super) fn allows_enabling(&self, bus: usize) -> bool {
        self.buses.get(bus).copied().flatten().is_none_or(|bus| bus.awaited <= u32::from(bus.due == 0))
    }

    /// The heartbeat of a bus, if it is due. It counts as sent. One that could not leave for a whole period has been missed by
    /// the drives as in an absence.
    pub(super) fn take(&mut self, bus: usize) -> Option<Frame> {
        let BusHeartbeat { due, overdue, awaited } = self.buses.get_mut(bus)?.as_mut()?;
        if *due > 0 {
            return None;
        }
        if core::mem::take(overdue) > self.heartbeat.cycles {
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
        Some(Frame::of(Id::canopen(function_code::ERROR_CONTROL, self.heartbeat.node), [NMT_OPERATIONAL]))
    }
}
