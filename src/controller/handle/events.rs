//! The events of a controller of this process.

use std::sync::Arc;
use std::time::Duration;

use takt_rt::Event;

use super::OwnProcess;
use crate::channels::EventReader;
use crate::command::{Backend, EventSource, WaitError};

/// The place of an observer among the events.
pub(super) struct OwnEvents {
    own: Arc<OwnProcess>,
    reader: EventReader,
}

impl OwnEvents {
    /// The events from now on.
    pub fn new(own: Arc<OwnProcess>) -> Self {
        let reader = own.events.begin_now();
        Self { own, reader }
    }
}

impl EventSource for OwnEvents {
    fn wait(&mut self, at_most: Duration) -> Result<Event, WaitError> {
        let deadline = self.own.deadline_after(at_most);
        loop {
            // This is read before the events, so that the last ones before the end are seen.
            let has_ended = self.own.has_ended();
            if let Some(event) = self.next() {
                return Ok(event);
            }
            if has_ended {
                return Err(WaitError::Ended);
            }
            self.own.sleep_until_look(self.own.observer.look(|state| state.at_ns), &deadline)?;
        }
    }

    fn missed(&self) -> u64 {
        self.reader.missed()
    }
}

impl Iterator for OwnEvents {
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        self.reader.next()
    }
}
