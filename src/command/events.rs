//! The events of a running controller, for any number of observers.

use std::sync::Arc;
use std::time::Duration;

use takt_rt::Event;

use super::backend::{Backend, EventSource};
use super::error::WaitError;
use super::handle::Handle;
use crate::telemetry::{Machine, words};

/// The events of a controller since a beginning: changes of phase, stops, emergency messages, rejections …
///
/// As an iterator it never waits: it gives the events that have come, then `None`, and later those that have come later. An
/// observer may be 1024 events behind. One that is slower loses the oldest, and [`Events::missed`] counts them.
pub struct Events {
    source: Box<dyn EventSource>,
    machine: Machine,
}

impl<B: Backend + ?Sized> Handle<B> {
    /// The events from now on. Each observer has its own place among them.
    pub fn events(&self) -> Events {
        Events { source: Arc::clone(self.backend()).events(), machine: self.machine().clone() }
    }
}

impl Events {
    /// Waits for the next event, for no longer than `at_most`.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`]; [`WaitError::Ended`] if the controller has ended and no event is left.
    pub fn wait(&mut self, at_most: Duration) -> Result<Event, WaitError> {
        self.source.wait(at_most)
    }

    /// How many events this observer has missed because it was too slow.
    pub fn missed(&self) -> u64 {
        self.source.missed()
    }

    /// An event as a sentence, with the names of the axes and buses.
    pub fn words(&self, event: &Event) -> String {
        words::event(event, &self.machine).to_string()
    }
}

impl Iterator for Events {
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        self.source.next()
    }
}
