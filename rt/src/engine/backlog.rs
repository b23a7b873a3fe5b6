//! Own frames that have not got onto the wire, bus by bus.

use crate::bus_set::BusSet;

/// The buses that are behind, and for how long.
#[derive(Clone, Debug)]
pub(super) struct Backlog<const BUSES: usize> {
    /// The buses on which own frames of an earlier cycle wait for the wire.
    behind: BusSet,
    /// For so many cycles in a row, a bus each.
    cycles: [u32; BUSES],
    /// Cycles in a row in which any bus was behind or had no room.
    blocked_cycles: u32,
    /// The interfaces that had no room for a frame since the last cycle.
    not_taken: BusSet,
}

impl<const BUSES: usize> Default for Backlog<BUSES> {
    fn default() -> Self {
        Self {
            behind: BusSet::default(),
            cycles: [0; BUSES],
            blocked_cycles: 0,
            not_taken: BusSet::default(),
        }
    }
}

impl<const BUSES: usize> Backlog<BUSES> {
    /// Takes the buses that are behind in this cycle.
    pub(super) fn pass(&mut self, behind: BusSet) {
        let count = |cycles: u32, goes_on: bool| if goes_on { cycles.saturating_add(1) } else { 0 };
        self.behind = behind;
        self.blocked_cycles = count(self.blocked_cycles, !(behind.is_empty() && self.not_taken.is_empty()));
        for (bus, cycles) in self.cycles.iter_mut().enumerate() {
            *cycles = count(*cycles, behind.contains(bus));
        }
    }

    /// Takes the buses that have caught up since.
    pub(super) fn clear(&mut self, caught_up: BusSet) {
        self.behind = self.behind.without(caught_up);
    }

    /// Takes the interfaces that had no room for all frames of a cycle.
    pub(super) fn note_not_taken(&mut self, buses: BusSet) {
        self.not_taken = buses;
    }

    /// The buses that are behind.
    pub(super) const fn behind(&self) -> BusSet {
        self.behind
    }

    /// Cycles in a row for which a bus has been behind.
    pub(super) fn cycles_of(&self, bus: usize) -> u32 {
        self.cycles.get(bus).copied().unwrap_or(0)
    }

    /// Cycles in a row in which any bus was behind or had no room.
    pub(super) const fn blocked_cycles(&self) -> u32 {
        self.blocked_cycles
    }

    /// The bus whose frames have waited longest, or else one that had no room for all of them.
    pub(super) fn slowest_bus(&self) -> Option<usize> {
        let waiting = self.cycles.iter().enumerate().rev().max_by_key(|(_, cycles)| **cycles);
        let behind = waiting.filter(|(_, cycles)| **cycles > 0).map(|(bus, _)| bus);
        behind.or_else(|| (0..BUSES).find(|bus| self.not_taken.contains(*bus)))
    }
}
