//! One line of a log.

use super::LoggedFrame;
use super::frame_text::FrameTextError;

/// Content of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LineItem<'a> {
    Frame(LoggedFrame<'a>),
    /// A message of the CAN controller.
    ErrorFrame,
}

/// Reason for which a line has no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum LineProblem {
    #[error("it has no time such as (1700000000.000123)")]
    Time,
    #[error("it ends too early")]
    Cut,
    #[error("its length is that of no frame")]
    Length,
    #[error("a byte is not two hexadecimal digits")]
    Byte,
    #[error("{0}")]
    Frame(FrameTextError),
}
