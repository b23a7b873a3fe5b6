//! The heartbeat of this controller (CiA 301, 7.2.8.3.2), which the drives watch: when it leaves on each bus.

use arrayvec::ArrayVec;

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
    /// A bus each.
    buses: ArrayVec<OnBus, BUSES>,
}

/// The heartbeat on one bus.
#[derive(Clone, Copy, Debug, Default)]
struct OnBus {
    /// Cycles until the next one.
    due: u32,
    /// Cycles for which one has been due and could not leave.
    overdue: u32,
    /// Heartbeats that have still to leave before any drive is enabled.
    awaited: u32,
}

impl<const BUSES: usize> HeartbeatProducer<BUSES> {
    pub(super) fn new(heartbeat: Heartbeat, slowest_divider: u32, buses: usize) -> Self {
        let held_cycles = HELD_BUS_CYCLES.saturating_mul(slowest_divider);
        let buses = (0..buses.min(BUSES)).map(|_| OnBus::default()).collect();
        Self { heartbeat, held_cycles, buses }
    }

    /// Cycles without a heartbeat after which the drives stop by themselves.
    pub(super) const fn timeout_cycles(&self) -> u32 {
        self.heartbeat.timeout_cycles
    }

    /// Lets slots pass. After an absence that a drive may have noticed, the heartbeat waits.
    pub(super) fn pass(&mut self, elapsed: u64) {
        let was_away = elapsed > self.heartbeat.cycles.into();
        for bus in &mut self.buses {
            bus.overdue = if bus.due == 0 { bus.overdue.saturating_add(1) } else { 0 };
            bus.due = if was_away { bus.due.max(self.held_cycles) } else { bus.due.saturating_sub(1) };
        }
    }

    /// A drive watches the controller from the first heartbeat on that it receives after its set-up: that one leaves before
    /// the drive is enabled, and not only after a whole period.
    pub(super) fn hasten(&mut self) {
        for bus in &mut self.buses {
            bus.awaited = BEFORE_ENABLING;
            bus.due = bus.due.min(self.held_cycles);
        }
    }

    /// Whether enough heartbeats have left on a bus, or leave with this cycle, for its drives to be enabled.
    pub(super) fn allows_enabling(&self, bus: usize) -> bool {
        self.buses.get(bus).is_some_and(|bus| bus.awaited <= u32::from(bus.due == 0))
    }

    /// The heartbeat of a bus, if it is due. It counts as sent. One that could not leave for a whole period has been missed by
    /// the drives as in an absence.
    pub(super) fn take(&mut self, bus: usize) -> Option<Frame> {
        let bus = self.buses.get_mut(bus)?;
        if bus.due > 0 {
            return None;
        }
        if core::mem::take(&mut bus.overdue) > self.heartbeat.cycles {
            bus.due = self.held_cycles;
            return None;
        }
        bus.awaited = bus.awaited.saturating_sub(1);
        // While more are awaited, the next one comes as soon as after an absence.
        bus.due = if bus.awaited > 0 {
            self.heartbeat.cycles.min(self.held_cycles + 1)
        } else {
            self.heartbeat.cycles
        };
        Some(Frame::of(Id::canopen(0x700, self.heartbeat.node), [NMT_OPERATIONAL]))
    }
}
