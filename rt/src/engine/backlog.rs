//! Own frames that have not got onto the wire, bus by bus.

use arrayvec::ArrayVec;

use crate::bus_set::BusSet;

/// The buses that are behind, and for how long.
#[derive(Clone, Debug)]
pub(super) struct Backlog<const BUSES: usize> {
    /// The buses on which own frames of an earlier cycle wait for the wire.
    behind: BusSet,
    /// The interfaces that had no room for a frame since the last cycle.
    not_taken: BusSet,
    buses: ArrayVec<BusBacklog, BUSES>,
}

/// One bus, in cycles in a row.
#[derive(Clone, Copy, Debug, Default)]
struct BusBacklog {
    /// It was behind.
    behind_cycles: u32,
    /// It was behind or had no room.
    blocked_cycles: u32,
}

impl<const BUSES: usize> Backlog<BUSES> {
    /// For so many buses.
    pub(super) fn new(buses: usize) -> Self {
        let buses = core::iter::repeat_n(BusBacklog::default(), buses.min(BUSES)).collect();
        Self { behind: BusSet::default(), not_taken: BusSet::default(), buses }
    }

    /// Takes the buses that are behind in this cycle.
    pub(super) fn pass(&mut self, behind: BusSet) {
        self.behind = behind;
        let not_taken = core::mem::take(&mut self.not_taken);
        for (bus, own) in self.buses.iter_mut().enumerate() {
            let is_behind = behind.contains(bus);
            own.behind_cycles = counted(own.behind_cycles, is_behind);
            own.blocked_cycles = counted(own.blocked_cycles, is_behind || not_taken.contains(bus));
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
        self.buses.get(bus).map_or(0, |bus| bus.behind_cycles)
    }

    /// The one of these buses that has been behind, or without room, for the longest time, and the cycles in a row.
    pub(super) fn longest_blocked(&self, buses: BusSet) -> (usize, u32) {
        let blocked = self.buses.iter().map(|bus| bus.blocked_cycles).enumerate().rev();
        blocked.filter(|(bus, _)| buses.contains(*bus)).max_by_key(|(_, cycles)| *cycles).unwrap_or_default()
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
        let mut backlog: Backlog<3> = Backlog::new(3);
        for cycle in 0..30 {
            backlog.pass(set(cycle % 3));
            assert!(backlog.longest_blocked(BusSet::first(3)).1 <= 1);
        }
        (0..4).for_each(|_| backlog.pass(set(1)));
        assert_eq!((backlog.longest_blocked(BusSet::first(3)), backlog.behind_cycles(1)), ((1, 4), 4));
    }

    #[test]
    fn an_interface_without_room_counts_until_it_takes_every_frame() {
        let mut backlog: Backlog<2> = Backlog::new(2);
        for cycles in 1..5 {
            backlog.note_not_taken(set(0));
            backlog.pass(BusSet::default());
            assert_eq!(
                (backlog.longest_blocked(BusSet::first(3)), backlog.behind_cycles(0)),
                ((0, cycles), 0)
            );
        }
        backlog.note_not_taken(BusSet::default());
        backlog.pass(BusSet::default());
        assert_eq!(backlog.longest_blocked(BusSet::first(3)).1, 0);
    }
}
