//! An event of a recording.

use takt_rt::{EventKind, Nanoseconds};

/// An event with its text.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RecordedEvent {
    /// The slot in which it was seen.
    pub slot: u64,
    /// When, on the monotonic clock of the run.
    pub at_ns: Nanoseconds,
    /// The group that it concerns; `None` for the controller as a whole, and in a recording of an earlier version.
    pub group: Option<u8>,
    /// Its text.
    pub text: String,
    /// Its kind; `None` if this version does not know it.
    pub kind: Option<EventKind>,
}
