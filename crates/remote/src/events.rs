//! The events of a controller in another process.

use std::sync::Arc;
use std::time::Duration;

use takt::channels::EventReader;
use takt::command::{EventSource, WaitError};
use takt::telemetry::words;
use takt_rt::Event;

use crate::client::Client;
use crate::connection::Connection;
use crate::shown::ShownSlots;

/// The events of a controller of another process since a beginning. As an iterator it never waits: it gives the events that have come, then
/// `None`, and later those that have come later. An observer may be 1024 events behind. One that is slower loses the oldest, and
/// [`ClientEvents::missed`] counts them.
pub struct ClientEvents {
    connection: Arc<Connection>,
    reader: EventReader<ShownSlots>,
    lost_before: u64,
}

impl Client {
    /// See [`Handle::events`](takt::Handle::events).
    pub fn events(&self) -> ClientEvents {
        let connection = Arc::clone(&self.0);
        let (reader, lost_before) = (connection.shown.events(), connection.shown.events_lost());
        ClientEvents { connection, reader, lost_before }
    }
}

impl ClientEvents {
    /// Waits for the next event, for no longer than `at_most`.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`]; [`WaitError::Ended`] if the controller has ended and no event is left.
    pub fn wait(&mut self, at_most: Duration) -> Result<Event, WaitError> {
        let Self { connection, reader, .. } = self;
        connection.look_until(at_most, || reader.next())
    }

    /// How many events this observer has missed, because it or the process of the controller was too slow.
    pub fn missed(&self) -> u64 {
        self.reader.missed() + (self.connection.shown.events_lost() - self.lost_before)
    }

    /// An event as a sentence, with the names of the axes and buses.
    pub fn words(&self, event: &Event) -> String {
        words::event(event, &self.connection.description.machine).to_string()
    }
}

impl Iterator for ClientEvents {
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        self.reader.next()
    }
}

impl EventSource for ClientEvents {
    fn wait(&mut self, at_most: Duration) -> Result<Event, WaitError> {
        Self::wait(self, at_most)
    }

    fn missed(&self) -> u64 {
        Self::missed(self)
    }
}
