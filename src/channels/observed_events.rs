//! The last events, for any number of observers. Each observer has its own place, and learns how many events it has missed.

use takt_rt::Event;

use super::event_words::{EVENT_WORDS, put_event, take_event};
use super::latest::{self, Allocated, Cells, Reader, Writer};

/// The events for observers, as the end of the real-time thread and one for an observer. `kept` events (at least 1) can be read.
pub fn observed_events(kept: usize) -> (EventWriter, EventReader) {
    let (writer, reader) = latest::last(EVENT_WORDS, kept as u64 + 1);
    (EventWriter::over(writer), EventReader::over(reader))
}

/// The end of the real-time thread.
pub struct EventWriter<C = Allocated>(Writer<C>);

impl<C: Cells> EventWriter<C> {
    /// Shows events by this mailbox.
    pub const fn over(writer: Writer<C>) -> Self {
        Self(writer)
    }

    /// Shows an event to every observer.
    pub fn write(&mut self, event: &Event) {
        self.0.write(|words| put_event(event, words));
    }
}

/// The place of one observer in the sequence of all events.
pub struct EventReader<C = Allocated> {
    reader: Reader<C>,
    next: u64,
    missed: u64,
}

impl<C> Clone for EventReader<C> {
    fn clone(&self) -> Self {
        Self { reader: self.reader.clone(), ..*self }
    }
}

impl<C: Cells> EventReader<C> {
    /// The place before the first event of a mailbox.
    pub const fn over(reader: Reader<C>) -> Self {
        Self { reader, next: 1, missed: 0 }
    }

    /// A place behind the newest event.
    pub fn begin_now(&self) -> Self {
        Self { next: self.reader.completed() + 1, missed: 0, reader: self.reader.clone() }
    }

    /// Events that came too fast for this observer, since its beginning.
    pub fn missed(&self) -> u64 {
        self.missed
    }
}

impl<C: Cells> Iterator for EventReader<C> {
    type Item = Event;

    /// The next event, if there is one. Later ones may follow `None`.
    fn next(&mut self) -> Option<Event> {
        loop {
            let completed = self.reader.completed();
            let oldest = self.reader.oldest(completed);
            if self.next < oldest {
                self.missed += oldest - self.next;
                self.next = oldest;
            }
            if self.next > completed {
                return None;
            }
            // Otherwise, so many events have come meanwhile that this one is lost.
            if let Some(event) = self.reader.read(self.next, take_event) {
                self.next += 1;
                return Some(event);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;
    use takt_rt::EventKind;

    fn event(slot: u64) -> Event {
        Event { slot, at_ns: slot * 1_000, group: None, kind: EventKind::MissedSlots { count: slot } }
    }

    fn slots(reader: &mut EventReader) -> Vec<u64> {
        reader.map(|event| event.slot).collect()
    }

    #[test]
    fn each_observer_has_its_own_place() {
        let (mut writer, mut first) = observed_events(4);
        assert_eq!(first.next(), None);
        (1..=2).for_each(|slot| writer.write(&event(slot)));
        let mut second = first.begin_now();
        writer.write(&event(3));
        assert_eq!((slots(&mut first), slots(&mut second)), (vec![1, 2, 3], vec![3]));
        writer.write(&event(4));
        assert_eq!((slots(&mut second), slots(&mut first)), (vec![4], vec![4]));
        assert_eq!((first.missed(), second.missed()), (0, 0));
    }

    #[test]
    fn an_observer_that_was_too_slow_knows_how_many_events_it_has_missed() {
        let (mut writer, mut reader) = observed_events(4);
        (1..=11).for_each(|slot| writer.write(&event(slot)));
        assert_eq!((slots(&mut reader), reader.missed()), (vec![8, 9, 10, 11], 7));
        (12..=16).for_each(|slot| writer.write(&event(slot)));
        assert_eq!((slots(&mut reader), reader.missed()), (vec![13, 14, 15, 16], 8));
    }

    #[test]
    fn every_event_is_seen_or_counted_as_missed_whatever_the_speed_of_the_observer() {
        const EVENTS: u64 = 20_000;
        let (mut writer, reader) = observed_events(8);
        thread::scope(|scope| {
            for pause in [0, 50, 5_000] {
                let mut reader = reader.clone();
                scope.spawn(move || {
                    let (mut last, mut seen) = (0, 0);
                    while last < EVENTS {
                        let Some(next) = reader.next() else {
                            thread::yield_now();
                            continue;
                        };
                        assert!(next.slot > last);
                        assert_eq!(next, event(next.slot), "a mixture of two events");
                        (last, seen) = (next.slot, seen + 1);
                        assert_eq!(seen + reader.missed(), last);
                        (0..pause).for_each(|_| std::hint::spin_loop());
                    }
                });
            }
            (1..=EVENTS).for_each(|slot| writer.write(&event(slot)));
        });
    }
}
