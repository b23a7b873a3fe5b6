//! Steps of the set-points that have not left on a bus yet.
//!
//! A drive gets the way of one cycle of its bus in that cycle. After a missed slot, or commands that were ready too late, more
//! would have gathered: the set-points then stay where they are until the bus has sent them.

use super::parameters::BusParameters;
use crate::bit_set::BitSet;

/// Steps since the last set-points that have left, a bus each.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct UnsentSteps<const BUSES: usize>([u32; BUSES]);

impl<const BUSES: usize> Default for UnsentSteps<BUSES> {
    fn default() -> Self {
        Self([0; BUSES])
    }
}

impl<const BUSES: usize> UnsentSteps<BUSES> {
    /// Returns `true` if one of those that are on time has yet to send the way of one of its cycles. The others do not wait for a bus
    /// that is behind.
    pub(super) fn are_enough(&self, buses: &[BusParameters], on_time: BitSet) -> bool {
        let mut unsent = buses.iter().zip(&self.0).enumerate().filter(|(bus, _)| on_time.contains(*bus));
        unsent.any(|(_, (bus, steps))| *steps >= bus.divider)
    }

    /// The set-points have made a step.
    pub(super) fn count(&mut self, on_time: BitSet) {
        for bus in on_time.iter() {
            if let Some(steps) = self.0.get_mut(bus) {
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

    fn bus(divider: u32) -> BusParameters {
        BusParameters { canopen: None, divider, service_frames_active: 1, service_frames_passive: 1 }
    }

    #[test]
    fn a_bus_of_every_second_slot_gathers_two_steps_and_no_third() {
        let (buses, both) = ([bus(1), bus(2)], BitSet::first(2));
        let mut unsent = UnsentSteps::<2>::default();
        unsent.count(both);
        assert!(unsent.are_enough(&buses, both), "the fast bus has yet to send its step");
        unsent.clear(0);
        assert!(!unsent.are_enough(&buses, both));
        unsent.count(both);
        unsent.clear(0);
        assert!(unsent.are_enough(&buses, both), "the slow bus has yet to send two");
    }

    #[test]
    fn nobody_waits_for_a_bus_that_is_behind() {
        let (on_time, none) = (BitSet::first(1), BitSet::default());
        let mut unsent = UnsentSteps::<1>::default();
        unsent.count(none);
        assert!(!unsent.are_enough(&[bus(1)], on_time));
        unsent.count(on_time);
        assert!(!unsent.are_enough(&[bus(1)], none));
        assert!(unsent.are_enough(&[bus(1)], on_time));
    }
}
