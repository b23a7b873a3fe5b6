//! The events of a controller in another process.

use std::sync::Arc;
use std::time::Duration;

use takt::channels::EventReader;
use takt::command::{EventSource, WaitError};
use takt_rt::Event;

use crate::connection::Connection;
use crate::shown::ShownSlots;

/// The events since a beginning.
pub struct ShownEvents {
    connection: Arc<Connection>,
    reader: EventReader<ShownSlots>,
    lost_before: u64,
}

impl ShownEvents {
    /// The events from now on.
    pub fn new(connection: Arc<Connection>) -> Self {
        let (reader, lost_before) = (connection.shown.events(), connection.shown.events_lost());
        Self { connection, reader, lost_before }
    }
}

impl Iterator for ShownEvents {
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        self.reader.next()
    }
}

impl EventSource for ShownEvents {
    fn wait(&mut self, at_most: Duration) -> Result<Event, WaitError> {
        let Self { connection, reader, .. } = self;
        connection.await_found(at_most, || reader.next())
    }

    fn missed(&self) -> u64 {
        self.reader.missed() + (self.connection.shown.events_lost() - self.lost_before)
    }
}
