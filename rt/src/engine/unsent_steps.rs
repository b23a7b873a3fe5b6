//! Steps of the set-points that have not left on a bus yet.
//!
//! A drive gets the way of one cycle of its bus in that cycle. After a missed slot, or commands that were ready too late, more
//! would have gathered: the set-points then stay where they are until the bus has sent them.

use arrayvec::ArrayVec;

use super::BusParameters;
use crate::bus_set::BusSet;

/// Steps since the last set-points that have left, a bus each.
#[derive(Clone, Debug)]
pub(super) struct UnsentSteps<const BUSES: usize>(ArrayVec<u32, BUSES>);

impl<const BUSES: usize> UnsentSteps<BUSES> {
    /// For so many buses.
    pub(super) fn new(buses: usize) -> Self {
        Self(core::iter::repeat_n(0, buses.min(BUSES)).collect())
    }

    /// Whether a bus has yet to send the way of one of its cycles. The others do not wait for a bus that is behind.
    pub(super) fn are_enough(&self, buses: &[BusParameters], behind: BusSet) -> bool {
        let unsent = buses.iter().zip(&self.0).enumerate();
        unsent.filter(|(bus, _)| !behind.contains(*bus)).any(|(_, (bus, steps))| *steps >= bus.divider)
    }

    /// The set-points have made a step.
    pub(super) fn count(&mut self, behind: BusSet) {
        for (bus, steps) in self.0.iter_mut().enumerate() {
            if !behind.contains(bus) {
                *steps = steps.saturating_add(1);
            }
        }
    }

    /// A bus sends the newest set-points.
    pub(super) fn clear(&mut self, bus: usize) {
        if let Some(steps) = self.0.get_mut(bus) {
            *steps = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Id;

    fn bus(divider: u32) -> BusParameters {
        BusParameters {
            sync_id: Id::canopen(0x080, 0),
            divider,
            service_frames_active: 1,
            service_frames_passive: 1,
        }
    }

    #[test]
    fn a_bus_of_every_second_slot_gathers_two_steps_and_no_third() {
        let buses = [bus(1), bus(2)];
        let mut unsent = UnsentSteps::<2>::new(2);
        unsent.count(BusSet::default());
        assert!(unsent.are_enough(&buses, BusSet::default()), "the fast bus has yet to send its step");
        unsent.clear(0);
        assert!(!unsent.are_enough(&buses, BusSet::default()));
        unsent.count(BusSet::default());
        unsent.clear(0);
        assert!(unsent.are_enough(&buses, BusSet::default()), "the slow bus has yet to send two");
    }

    #[test]
    fn nobody_waits_for_a_bus_that_is_behind() {
        let mut behind = BusSet::default();
        behind.insert(0);
        let mut unsent = UnsentSteps::<1>::new(1);
        unsent.count(behind);
        assert!(!unsent.are_enough(&[bus(1)], BusSet::default()));
        unsent.count(BusSet::default());
        assert!(!unsent.are_enough(&[bus(1)], behind));
        assert!(unsent.are_enough(&[bus(1)], BusSet::default()));
    }
}
