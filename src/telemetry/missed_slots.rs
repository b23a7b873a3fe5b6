//! Missed slots as people read them: one message whose count grows, not one for each time that the thread was late.

use takt_rt::{Event, EventKind};

use super::recorded::RecordedEvent;
use super::words;

/// Missed slots of a run, for those who are told of events as they happen.
#[derive(Clone, Copy, Debug, Default)]
pub struct MissedSlotsSoFar {
    count: u64,
    told: u64,
}

impl MissedSlotsSoFar {
    /// Takes an event. Returns what is to be told: missed slots with their number so far, the first time and each time that it has doubled;
    /// every other event as it is.
    pub fn told(&mut self, event: Event) -> Option<Event> {
        let EventKind::MissedSlots { count } = event.kind else { return Some(event) };
        self.count = self.count.saturating_add(count);
        if self.count < self.told.saturating_mul(2) {
            return None;
        }
        self.told = self.count;
        Some(Event { kind: EventKind::MissedSlots { count: self.count }, ..event })
    }
}

/// The events of a recording, with all of its missed slots in the place of the first ones.
pub fn counted_once(events: &[RecordedEvent]) -> Vec<RecordedEvent> {
    let missed = |event: &RecordedEvent| match event.kind {
        Some(EventKind::MissedSlots { count }) => Some(count),
        _ => None,
    };
    let total = events.iter().filter_map(missed).fold(0, u64::saturating_add);
    let mut is_told = false;
    let told = events.iter().filter_map(|event| match missed(event) {
        None => Some(event.clone()),
        Some(_) if std::mem::replace(&mut is_told, true) => None,
        Some(_) => Some(RecordedEvent { text: words::missed_slots(total).to_string(), ..event.clone() }),
    });
    told.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(kind: EventKind) -> Event {
        Event { slot: 1, at_ns: 2, group: None, kind }
    }

    #[test]
    fn missed_slots_are_told_first_and_each_time_that_they_have_doubled_and_other_events_always() {
        let mut so_far = MissedSlotsSoFar::default();
        let counts: Vec<u64> = (0..300)
            .filter_map(|_| so_far.told(event(EventKind::MissedSlots { count: 1 })))
            .filter_map(|told| match told.kind {
                EventKind::MissedSlots { count } => Some(count),
                _ => None,
            })
            .collect();
        assert_eq!(counts, [1, 2, 4, 8, 16, 32, 64, 128, 256]);
        let other = event(EventKind::MotionFinished { request: takt_rt::RequestId(3) });
        assert_eq!([so_far.told(other), so_far.told(other)], [Some(other); 2]);
    }

    #[test]
    fn a_recording_has_its_missed_slots_once() {
        let recorded = |slot, kind, text: &str| RecordedEvent {
            slot,
            at_ns: slot,
            group: None,
            text: text.to_owned(),
            kind: Some(kind),
        };
        let missed = |slot, count| recorded(slot, EventKind::MissedSlots { count }, "late");
        let finished = recorded(5, EventKind::MotionFinished { request: takt_rt::RequestId(3) }, "finished");
        let told = counted_once(&[missed(2, 3), finished, missed(7, 1), missed(9, 30)]);
        let told: Vec<_> = told.iter().map(|event| (event.slot, event.text.as_str())).collect();
        assert_eq!(told, [(2, "34 slots were missed: the thread was late"), (5, "finished")]);
    }
}
