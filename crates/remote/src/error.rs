//! Why a client cannot connect.

use std::fmt;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use crate::layout::VERSION;
use crate::socket::NameError;

/// Why a controller of another process cannot be connected to.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum ConnectError {
    /// It cannot be the name of one.
    #[error("{words}")]
    Name {
        /// Why.
        words: String,
    },
    /// No process serves by this name.
    #[error("no controller is served by the name {name:?}; `takt run CONFIG --serve {name}` serves one")]
    NotServed {
        /// The name.
        name: String,
    },
    /// The file permissions do not let this process observe it.
    #[error("this process may not observe the controller: it may not write to {}; see --serve-mode", path.display())]
    NotAllowed {
        /// The socket.
        path: PathBuf,
    },
    /// Another user serves by this name, where everybody may.
    #[error(
        "user {user} serves by the name {name:?}, in a folder where everybody may make files: it may be another controller than you mean. Serve \
         it in a folder of its own"
    )]
    NotBelieved {
        /// The name.
        name: String,
        /// The user.
        user: u32,
    },
    /// Too many processes observe it.
    #[error("too many processes observe the controller")]
    TooManyObservers,
    /// The process that serves does not answer.
    #[error("the process of the controller has not answered for {after:?}: it is paused, or overloaded")]
    NoReply {
        /// For how long.
        after: Duration,
    },
    /// It is served by another version of takt.
    #[error(
        "the controller is served with version {theirs} of the host interface, and this program has version {VERSION}"
    )]
    Version {
        /// Theirs.
        theirs: u64,
    },
    /// Something else is served by this name.
    #[error("what is served by the name {name:?} is no controller of takt")]
    Foreign {
        /// The name.
        name: String,
    },
    /// The connection has failed.
    #[error("the connection to {} has failed: {error}", path.display())]
    Failed {
        /// The socket.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
}

impl From<NameError> for ConnectError {
    fn from(error: NameError) -> Self {
        Self::Name { words: error.to_string() }
    }
}

/// `main` prints the error that `?` hands it by `Debug`.
impl fmt::Debug for ConnectError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}
