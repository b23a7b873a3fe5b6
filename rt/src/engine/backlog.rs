//! Own frames that have not got onto the wire, bus by bus.
//!
//! A bus is judged in the slots in which it has a cycle, and stays as it was in the slots between. A slow bus that is behind
//! whenever its set-points are due would otherwise seem to catch up again and again, though none of them ever leaves.
//!
//! A bus of which a confirmation was lost looks like one that is behind, until a later frame is confirmed. So a bus that is behind gets
//! a trial: one SYNC, or the frames of one cycle where it has no SYNC. The next one comes when it has been behind for twice as long.

use arrayvec::ArrayVec;

use crate::bit_set::BitSet;

/// The buses that are behind, and for how long.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Backlog<const BUSES: usize> {
    /// The buses on which own frames of an earlier cycle wait for the wire.
    behind: BitSet,
    /// The same as it was found in the last slot in which each bus had a cycle, or since.
    found_behind: BitSet,
    /// Those that were behind when their last cycle began: the frames of the cycle before have not left.
    cycle_behind: BitSet,
    /// The interfaces that had no room for a frame since their buses' last cycles.
    not_taken: BitSet,
    /// Those that are behind and have a trial, which lasts until frames have left.
    on_trial: BitSet,
    /// Those that get SYNC: it is their trial.
    with_sync: BitSet,
    /// Slots for which a bus is behind before its first trial.
    first_trial_cycles: u32,
    buses: ArrayVec<BusBacklog, BUSES>,
}

/// One bus, in slots in a row.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
struct BusBacklog {
    /// It was behind.
    behind_cycles: u32,
    /// It was behind or had no room.
    blocked_cycles: u32,
    /// It is to have a trial when it has been behind for so long.
    trial_cycles: u32,
}

impl<const BUSES: usize> Backlog<BUSES> {
    /// For so many buses, of which each may be behind for so many slots.
    pub(super) fn new(buses: usize, allowed_cycles: u32) -> Self {
        // Early enough for the bus to be found free before it counts as one that does not transmit.
        let first_trial_cycles = (allowed_cycles / 2).max(1);
        let bus = BusBacklog { trial_cycles: first_trial_cycles, ..BusBacklog::default() };
        Self {
            behind: BitSet::default(),
            found_behind: BitSet::default(),
            cycle_behind: BitSet::default(),
            not_taken: BitSet::default(),
            on_trial: BitSet::default(),
            with_sync: BitSet::default(),
            first_trial_cycles,
            buses: core::iter::repeat_n(bus, buses.min(BUSES)).collect(),
        }
    }

    /// Takes the buses that are behind in this slot, in which these buses have a cycle, and those that get SYNC.
    pub(super) fn pass(&mut self, behind: BitSet, in_cycle: BitSet, with_sync: BitSet) {
        self.with_sync = with_sync;
        self.on_trial = BitSet::default();
        self.found_behind = behind.union(self.found_behind.without(in_cycle));
        self.behind = self.found_behind;
        self.cycle_behind = behind.intersection(in_cycle).union(self.cycle_behind.without(in_cycle));
        for (bus, own) in self.buses.iter_mut().enumerate() {
            let is_behind = self.behind.contains(bus);
            own.behind_cycles = counted(own.behind_cycles, is_behind);
            if !is_behind {
                own.trial_cycles = self.first_trial_cycles;
            } else if own.behind_cycles >= own.trial_cycles {
                self.on_trial.insert(bus);
            }
            own.blocked_cycles = counted(own.blocked_cycles, is_behind || self.not_taken.contains(bus));
        }
        self.not_taken = self.not_taken.without(in_cycle);
    }

    /// Takes the buses that have caught up since.
    pub(super) fn clear(&mut self, caught_up: BitSet) {
        self.behind = self.behind.without(caught_up);
        self.cycle_behind = self.cycle_behind.without(caught_up);
    }

    /// Takes the interfaces that had no room for all frames of a slot.
    pub(super) fn note_not_taken(&mut self, buses: BitSet) {
        self.not_taken = self.not_taken.union(buses);
    }

    /// The buses that are behind.
    pub(super) const fn behind(&self) -> BitSet {
        self.behind
    }

    /// The buses that are behind, and on which no SYNC leaves.
    pub(super) const fn without_sync(&self) -> BitSet {
        self.behind.without(self.on_trial)
    }

    /// The buses that are behind, and on which nothing else leaves either.
    pub(super) const fn held_back(&self) -> BitSet {
        self.behind.without(self.on_trial.without(self.with_sync))
    }

    /// The buses whose last cycle began while frames of the one before still waited, and which have no trial by set-points. A slow bus
    /// may take the slots between for its frames.
    pub(super) const fn behind_at_cycle(&self) -> BitSet {
        self.cycle_behind.without(self.on_trial.without(self.with_sync))
    }

    /// Frames leave on a bus. If it has a trial, that is over.
    #[inline]
    pub(super) fn note_leaving(&mut self, bus: usize) {
        if let Some(own) = self.buses.get_mut(bus).filter(|_| self.on_trial.take(bus)) {
            own.trial_cycles = own.behind_cycles.saturating_mul(2);
        }
    }

    /// Slots in a row in which a bus was behind.
    pub(super) fn behind_cycles(&self, bus: usize) -> u32 {
        self.buses.get(bus).map_or(0, |bus| bus.behind_cycles)
    }

    /// The one of these buses that has been behind, or without room, for the longest time, and the slots in a row.
    pub(super) fn longest_blocked(&self, buses: BitSet) -> (usize, u32) {
        let mut longest = (0, 0);
        for (bus, own) in self.buses.iter().enumerate().filter(|(bus, _)| buses.contains(*bus)) {
            if own.blocked_cycles > longest.1 {
                longest = (bus, own.blocked_cycles);
            }
        }
        longest
    }
}

/// One cycle more, or none.
const fn counted(cycles: u32, goes_on: bool) -> u32 {
    if goes_on { cycles.saturating_add(1) } else { 0 }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    fn set(bus: usize) -> BitSet {
        let mut set = BitSet::default();
        set.insert(bus);
        set
    }

    const ALL: BitSet = BitSet::first(3);

    #[test]
    fn buses_that_are_behind_one_after_the_other_are_not_taken_for_one() {
        let mut backlog: Backlog<3> = Backlog::new(3, 4);
        for cycle in 0..30 {
            backlog.pass(set(cycle % 3), ALL, ALL);
            assert!(backlog.longest_blocked(ALL).1 <= 1);
        }
        (0..4).for_each(|_| backlog.pass(set(1), ALL, ALL));
        assert_eq!((backlog.longest_blocked(ALL), backlog.behind_cycles(1)), ((1, 4), 4));
    }

    #[test]
    fn a_slow_bus_may_take_the_slots_between_its_cycles_for_its_frames() {
        let mut backlog: Backlog<3> = Backlog::new(3, 4);
        let (slow, fast) = (set(1), ALL.without(set(1)));
        backlog.pass(BitSet::default(), ALL, ALL);
        backlog.pass(slow, fast, ALL);
        assert_eq!((backlog.behind(), backlog.behind_at_cycle()), (slow, BitSet::default()));
        backlog.pass(slow, ALL, ALL);
        assert_eq!((backlog.behind(), backlog.behind_at_cycle()), (slow, slow));
        backlog.pass(BitSet::default(), fast, ALL);
        assert_eq!(backlog.behind_at_cycle(), slow, "none of its frames would leave before its next cycle");
        backlog.clear(slow);
        assert_eq!(backlog.behind_at_cycle(), BitSet::default());
    }

    #[test]
    fn an_interface_without_room_counts_until_it_takes_every_frame() {
        let mut backlog: Backlog<2> = Backlog::new(2, 4);
        for cycles in 1..5 {
            backlog.note_not_taken(set(0));
            backlog.pass(BitSet::default(), ALL, ALL);
            assert_eq!((backlog.longest_blocked(ALL), backlog.behind_cycles(0)), ((0, cycles), 0));
        }
        backlog.note_not_taken(BitSet::default());
        backlog.pass(BitSet::default(), ALL, ALL);
        assert_eq!(backlog.longest_blocked(ALL).1, 0);
    }

    #[test]
    fn a_bus_that_is_behind_has_a_trial_that_lasts_until_frames_leave_and_comes_again_after_twice_the_time() {
        for (with_sync, is_by_set_points) in [(BitSet::default(), true), (ALL, false)] {
            let mut backlog: Backlog<3> = Backlog::new(3, 4);
            let bus = set(1);
            for _ in 0..2 {
                let mut trials = Vec::new();
                for slot in 1..=40 {
                    backlog.pass(bus, ALL, with_sync);
                    if backlog.without_sync().is_empty() {
                        trials.push(slot);
                        let is_held_back = !backlog.held_back().is_empty();
                        assert_eq!(is_held_back, !is_by_set_points);
                        assert_eq!(backlog.behind_at_cycle().is_empty(), is_by_set_points);
                    }
                    assert_eq!((backlog.behind(), backlog.behind_cycles(1)), (bus, slot));
                    // Nothing was to leave in slot 4.
                    if slot != 4 {
                        backlog.note_leaving(1);
                    }
                    let is_open = slot == 4;
                    assert_eq!(backlog.without_sync().is_empty(), is_open, "{slot}");
                }
                assert_eq!(trials, [2, 4, 5, 10, 20, 40]);
                // Found free: the next time begins anew.
                backlog.pass(BitSet::default(), ALL, with_sync);
            }
        }
    }

    #[test]
    fn a_bus_that_may_be_behind_for_one_slot_alone_has_its_trial_in_that_slot() {
        let mut backlog: Backlog<3> = Backlog::new(3, 1);
        backlog.pass(set(1), ALL, ALL);
        assert_eq!((backlog.behind(), backlog.without_sync()), (set(1), BitSet::default()));
    }

    #[test]
    fn a_slow_bus_stays_as_it_was_in_its_last_cycle() {
        let (fast, slow) = (set(0), set(1));
        let in_cycle = |slot: u32| if slot.is_multiple_of(2) { fast.union(slow) } else { fast };
        for is_behind in [true, false] {
            let mut backlog: Backlog<2> = Backlog::new(2, 4);
            for slot in 0..10 {
                // Between its cycles it has caught up, or its interface has room.
                let is_due = slot % 2 == 0;
                let behind = if is_behind && is_due { slow } else { BitSet::default() };
                backlog.pass(behind, in_cycle(slot), ALL);
                backlog.note_not_taken(if !is_behind && is_due { slow } else { BitSet::default() });
                let blocked = slot + u32::from(is_behind);
                assert_eq!(backlog.longest_blocked(ALL).1, blocked, "{is_behind}, slot {slot}");
            }
            backlog.pass(BitSet::default(), in_cycle(10), ALL);
            backlog.pass(BitSet::default(), in_cycle(11), ALL);
            assert_eq!(backlog.longest_blocked(ALL).1, 0);
        }
    }
}
