//! The events of a running controller, for any number of observers.

use std::time::Duration;

use takt_rt::Event;

use super::Handle;
use crate::channels::EventReader;
use crate::command::WaitError;
use crate::telemetry::words;

/// The events of a controller since a beginning: changes of phase, stops, emergency messages, rejections …
///
/// As an iterator it never waits: it gives the events that have come, then `None`, and later those that have come later. An
/// observer may be 1024 events behind. One that is slower loses the oldest, and [`Events::missed`] counts them.
pub struct Events {
    handle: Handle,
    reader: EventReader,
}

impl Handle {
    /// The events from now on. Each observer has its own place among them.
    pub fn events(&self) -> Events {
        Events { handle: self.clone(), reader: self.0.events.begin_now() }
    }
}

impl Events {
    /// Waits for the next event, for no longer than `at_most`.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`]; [`WaitError::Ended`] if the controller has ended and no event is left.
    pub fn wait(&mut self, at_most: Duration) -> Result<Event, WaitError> {
        let deadline = self.handle.deadline_after(at_most);
        loop {
            // This is read before the events, so that the last ones before the end are seen.
            let has_ended = self.handle.has_ended();
            if let Some(event) = self.next() {
                return Ok(event);
            }
            if has_ended {
                return Err(WaitError::Ended);
            }
            self.handle.sleep_until_look(&self.handle.state(), &deadline)?;
        }
    }

    /// How many events this observer has missed because it was too slow.
    pub fn missed(&self) -> u64 {
        self.reader.missed()
    }

    /// An event as a sentence, with the names of the axes and buses.
    pub fn words(&self, event: &Event) -> String {
        words::event(event, self.handle.machine())
    }
}

impl Iterator for Events {
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        self.reader.next()
    }
}
