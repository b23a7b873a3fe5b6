//! How a subcommand ends, as the shell sees it.

use std::process::{ExitCode, Termination};

/// The exit codes of every subcommand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Everything was done.
    Done,
    /// The run ended in a stop or a fault, a check found a problem, or a result could not be written.
    Stopped,
    /// The configuration or the command line is wrong; nothing was done.
    Usage,
    /// Real-time set-up was required and refused.
    RealtimeRefused,
    /// Ctrl-C, SIGTERM, a closed terminal, or a take-over by another process; the axes were stopped in control.
    Interrupted,
}

impl Exit {
    /// The exit code when a result was lost in addition: success becomes failure.
    pub const fn and_failed(self) -> Self {
        match self {
            Self::Done => Self::Stopped,
            worse => worse,
        }
    }
}

impl Termination for Exit {
    fn report(self) -> ExitCode {
        ExitCode::from(match self {
            Self::Done => 0,
            Self::Stopped => 1,
            Self::Usage => 2,
            Self::RealtimeRefused => 3,
            Self::Interrupted => 130,
        })
    }
}
