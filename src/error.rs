//! One error for a program that embeds takt, and what it may have inside.

use std::fmt;

use crate::command::{CommandError, MotionError, RecoveryError, StreamError, WaitError};
use crate::config::{ConfigError, OverrideError};
use crate::controller::StartFailure;
#[cfg(target_os = "linux")]
use crate::controller::session::SessionError;
use crate::faults::ScenarioError;

pub use crate::controller::assemble::AssembleError;
#[cfg(target_os = "linux")]
pub use crate::controller::realtime_thread::StartError;

/// The result of a program, or of a function of it.
pub type Result<T = (), E = Error> = std::result::Result<T, E>;

/// Any error of a program that embeds takt.
///
/// `main` prints the error that it returns by `Debug`. The `Debug` text of this error is made for people: it is the sentence of
/// `Display`, and for a file that is wrong it shows each problem at its line.
///
/// ```no_run
/// fn main() -> takt::Result {
///     let config = takt::Config::load("arm.toml".as_ref())?;
///     let arm = takt::Controller::start(config, takt::SessionOptions::default())?;
///     arm.stop(takt::StopCategory::Two)?;
///     Ok(())
/// }
/// ```
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A configuration cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A bus cannot be connected to another interface.
    #[error(transparent)]
    Override(#[from] OverrideError),
    /// A fault scenario cannot be used.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A controller could not be started.
    #[error(transparent)]
    Start(#[from] StartFailure),
    /// A run could not be started.
    #[cfg(target_os = "linux")]
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A controller in virtual time could not be made.
    #[error(transparent)]
    Assemble(#[from] AssembleError),
    /// A command was not executed.
    #[error(transparent)]
    Command(#[from] CommandError),
    /// A motion did not reach its targets.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// Points were not taken.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// A wait did not end with what it was for.
    #[error(transparent)]
    Wait(#[from] WaitError),
    /// A group was not taken out of what had stopped it.
    #[error(transparent)]
    Recovery(#[from] RecoveryError),
}

impl fmt::Debug for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let inner: &dyn fmt::Debug = match self {
            Self::Config(error) => error,
            Self::Override(error) => error,
            Self::Scenario(error) => error,
            Self::Start(error) => error,
            #[cfg(target_os = "linux")]
            Self::Session(error) => error,
            Self::Assemble(error) => error,
            Self::Command(error) => error,
            Self::Motion(error) => error,
            Self::Stream(error) => error,
            Self::Wait(error) => error,
            Self::Recovery(error) => error,
        };
        inner.fmt(formatter)
    }
}
