//! Why a client has no answer, and how long it waits for one.

use std::io;
use std::time::Duration;

use takt::{CommandError, LeaseError, StreamError};

/// How often a client that waits makes sure that the other process is still there.
pub const LOOK: Duration = Duration::from_millis(50);

/// A process that is there and does not answer is waited for so long: longer than any command takes, which is one that takes the place of
/// a trajectory under way.
pub const REPLY_WITHIN: Duration = Duration::from_secs(10);

/// Why a demand has no answer.
#[derive(Clone, Copy)]
pub(crate) enum NoAnswer {
    /// This client may not command.
    Lease(LeaseError),
    /// The other process has not answered.
    NoReply,
    /// It is gone.
    Ended,
}

/// Why a connection for commands or stops cannot be had.
impl From<io::ErrorKind> for NoAnswer {
    fn from(kind: io::ErrorKind) -> Self {
        match kind {
            io::ErrorKind::PermissionDenied => Self::Lease(LeaseError::ReadOnly),
            _ => Self::Ended,
        }
    }
}

impl From<NoAnswer> for CommandError {
    fn from(no_answer: NoAnswer) -> Self {
        match no_answer {
            NoAnswer::Lease(error) => Self::Lease(error),
            NoAnswer::NoReply => Self::NoReply { after: REPLY_WITHIN },
            NoAnswer::Ended => Self::Ended,
        }
    }
}

impl From<NoAnswer> for StreamError {
    fn from(no_answer: NoAnswer) -> Self {
        match no_answer {
            NoAnswer::Lease(error) => Self::Lease(error),
            NoAnswer::NoReply => Self::NoReply { after: REPLY_WITHIN },
            NoAnswer::Ended => Self::Ended,
        }
    }
}
