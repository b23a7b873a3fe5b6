//! Why a controller was not started.

use std::fmt;

use crate::controller::assemble::AssembleError;
#[cfg(target_os = "linux")]
use crate::controller::session::{Session, SessionError};

/// Why a controller could not be started.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum StartFailure {
    #[cfg(target_os = "linux")]
    /// The session could not be started: nothing was sent to the drives.
    #[error(transparent)]
    Session(#[from] SessionError),
    #[cfg(target_os = "linux")]
    /// The drives could not be brought up or enabled. The session tells why.
    #[error("the drives could not be enabled: {}", .0.outcome.words(&.0.log.machine))]
    NotEnabled(Box<Session>),
    /// The configuration of a [`VirtualController`](super::VirtualController) cannot be executed.
    #[error(transparent)]
    Assemble(#[from] AssembleError),
    /// The simulated drives of a [`VirtualController`](super::VirtualController) could not be brought up or enabled.
    #[error("the simulated drives could not be enabled: {words}")]
    NotEnabledVirtually {
        /// Why.
        words: String,
    },
    /// The session thread has panicked. That is a defect of takt.
    #[error("the session thread has panicked; this is a defect of takt, please report it")]
    Died,
}

impl fmt::Debug for StartFailure {
    /// A session would be hundreds of lines.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            #[cfg(target_os = "linux")]
            Self::Session(error) => fmt::Debug::fmt(error, formatter),
            Self::Assemble(error) => fmt::Debug::fmt(error, formatter),
            other => fmt::Display::fmt(other, formatter),
        }
    }
}
