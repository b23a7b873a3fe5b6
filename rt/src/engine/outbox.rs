//! The events of a cycle, until the cycle hands them out.

use arrayvec::ArrayVec;

use crate::record::Event;

/// A cycle in which every one of 32 drives changes its state has more events than any other that was seen: these, a change
/// of phase, a stop, and emergency messages.
const CAPACITY: usize = 64;

/// Events in the order in which they were emitted.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Outbox {
    events: ArrayVec<Event, CAPACITY>,
    lost: u64,
}

impl Outbox {
    /// Takes an event. One that finds no room is counted.
    pub(super) fn push(&mut self, event: Event) {
        self.lost += u64::from(self.events.try_push(event).is_err());
    }

    /// Hands out every event, and returns how many were lost: those without room here, and those that `take` did not take.
    pub(super) fn drain(&mut self, mut take: impl FnMut(&Event) -> bool) -> u64 {
        let not_taken = self.events.iter().filter(|event| !take(event)).count() as u64;
        self.events.clear();
        not_taken + core::mem::take(&mut self.lost)
    }
}
