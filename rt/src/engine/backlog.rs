//! Own frames that have not got onto the wire, bus by bus.

use crate::bus_set::BusSet;

/// The buses that are behind, and for how long.
#[derive(Clone, Debug)]
pub(super) struct Backlog<const BUSES: usize> {
    /// The buses on which own frames of an earlier cycle wait for the wire.
    behind: BusSet,
    /// The interfaces that had no room for a frame since the last cycle.
    not_taken: BusSet,
    /// Cycles in a row in which a bus was behind, a bus each.
    behind_cycles: [u32; BUSES],
    /// Cycles in a row in which a bus was behind or had no room, a bus each.
    blocked_cycles: [u32; BUSES],
}

impl<const BUSES: usize> Default for Backlog<BUSES> {
    fn default() -> Self {
        let (behind, not_taken) = (BusSet::default(), BusSet::default());
        Self { behind, not_taken, behind_cycles: [0; BUSES], blocked_cycles: [0; BUSES] }
    }
}

impl<const BUSES: usize> Backlog<BUSES> {
    /// Takes the buses that are behind in this cycle.
    pub(super) fn pass(&mut self, behind: BusSet) {
        self.behind = behind;
        let not_taken = core::mem::take(&mut self.not_taken);
        for (bus, cycles) in self.behind_cycles.iter_mut().enumerate() {
            *cycles = counted(*cycles, behind.contains(bus));
        }
        for (bus, cycles) in self.blocked_cycles.iter_mut().enumerate() {
            *cycles = counted(*cycles, behind.contains(bus) || not_taken.contains(bus));
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

    /// Cycles in a row in which a bus was behind.
    pub(super) fn behind_cycles(&self, bus: usize) -> u32 {
        self.behind_cycles.get(bus).copied().unwrap_or(0)
    }

    /// The bus that has been behind, or without room, for the longest time, and the cycles in a row.
    pub(super) fn longest_blocked(&self) -> (usize, u32) {
        let blocked = self.blocked_cycles.iter().copied().enumerate().rev();
        blocked.max_by_key(|(_, cycles)| *cycles).unwrap_or_default()
    }
}

/// One cycle more, or none.
const fn counted(cycles: u32, goes_on: bool) -> u32 {
    if goes_on { cycles.saturating_add(1) } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(bus: usize) -> BusSet {
        let mut set = BusSet::default();
        set.insert(bus);
        set
    }

    #[test]
    fn buses_that_are_behind_one_after_the_other_are_not_taken_for_one() {
        let mut backlog: Backlog<3> = Backlog::default();
        for cycle in 0..30 {
            backlog.pass(set(cycle % 3));
            assert!(backlog.longest_blocked().1 <= 1);
        }
        (0..4).for_each(|_| backlog.pass(set(1)));
        assert_eq!((backlog.longest_blocked(), backlog.behind_cycles(1)), ((1, 4), 4));
    }

    #[test]
    fn an_interface_without_room_counts_until_it_takes_every_frame() {
        let mut backlog: Backlog<2> = Backlog::default();
        for cycles in 1..5 {
            backlog.note_not_taken(set(0));
            backlog.pass(BusSet::default());
            assert_eq!((backlog.longest_blocked(), backlog.behind_cycles(0)), ((0, cycles), 0));
        }
        backlog.note_not_taken(BusSet::default());
        backlog.pass(BusSet::default());
        assert_eq!(backlog.longest_blocked().1, 0);
    }
}
