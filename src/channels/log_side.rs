//! The side of the logger.

use takt_rt::{CycleRecord, Event};

use super::records::RecordConsumer;
use super::ring::Consumer;

/// The logger's side.
pub struct LogSide {
    pub(super) records: RecordConsumer,
    pub(super) events: Consumer<Event>,
}

impl LogSide {
    /// Passes the oldest waiting cycle record to `read`, in place. Axes beyond `axis_count` hold arbitrary values.
    pub fn next_record<T>(&mut self, read: impl FnOnce(&CycleRecord) -> T) -> Option<T> {
        self.records.next(read)
    }

    /// The oldest waiting event.
    pub fn take_event(&mut self) -> Option<Event> {
        self.events.pop()
    }

    /// The number of records written since the start.
    pub fn records_written(&self) -> u64 {
        self.records.pushed()
    }

    /// The number of records dropped since the start.
    pub fn records_dropped(&self) -> u64 {
        self.records.dropped()
    }

    /// The number of events dropped since the start.
    pub fn events_dropped(&self) -> u64 {
        self.events.dropped()
    }
}
