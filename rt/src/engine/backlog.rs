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
    /// For how long, a bus each.
    cycles: ArrayVec<Cycles, BUSES>,
}

/// Cycles in a row.
#[derive(Clone, Copy, Debug, Default)]
struct Cycles {
    /// In which the bus was behind.
    behind: u32,
    /// In which it was behind or had no room.
    blocked: u32,
}

impl<const BUSES: usize> Backlog<BUSES> {
    /// So many buses, none of which is behind.
    pub(super) fn new(buses: usize) -> Self {
        let cycles = (0..buses.min(BUSES)).map(|_| Cycles::default()).collect();
        Self { behind: BusSet::default(), not_taken: BusSet::default(), cycles }
    }

    /// Takes the buses that are behind in this cycle.
    pub(super) fn pass(&mut self, behind: BusSet) {
        self.behind = behind;
        let not_taken = core::mem::take(&mut self.not_taken);
        for (bus, cycles) in self.cycles.iter_mut().enumerate() {
            let is_behind = behind.contains(bus);
            cycles.behind = counted(cycles.behind, is_behind);
            cycles.blocked = counted(cycles.blocked, is_behind || not_taken.contains(bus));
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
        self.cycles.get(bus).map_or(0, |cycles| cycles.behind)
    }

    /// The one of these buses that has been behind, or without room, for the longest time, and the cycles in a row.
    pub(super) fn longest_blocked(&self, buses: BusSet) -> (usize, u32) {
        let of_these = self.cycles.iter().enumerate().rev().filter(|(bus, _)| buses.contains(*bus));
        of_these
            .map(|(bus, cycles)| (bus, cycles.blocked))
            .max_by_key(|(_, cycles)| *cycles)
            .unwrap_or_default()
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
                (backlog.longest_blocked(BusSet::first(2)), backlog.behind_cycles(0)),
                ((0, cycles), 0)
            );
        }
        backlog.note_not_taken(BusSet::default());
        backlog.pass(BusSet::default());
        assert_eq!(backlog.longest_blocked(BusSet::first(3)).1, 0);
    }
}
