//! One line of a log.

use takt_rt::Id;

use super::LoggedFrame;
use super::frame_text::{FrameTextError, FrameTextProblem};

/// Content of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LineItem<'a> {
    Frame(LoggedFrame<'a>),
    /// A message of the CAN controller.
    ErrorFrame,
    /// What a log of this kind has beside frames.
    NoFrame,
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
    #[error("its identifier is no number")]
    Id,
    #[error("a byte is not two hexadecimal digits")]
    Byte,
    #[error("its data is not base64")]
    Base64,
    #[error("{0}")]
    Frame(FrameTextError),
}

/// Returns the identifier with this number, which is `None` for a text that is not one.
pub(super) fn numbered(number: Option<u32>, is_extended: bool) -> Result<Id, LineProblem> {
    let number = number.ok_or(LineProblem::Id)?;
    let id = if is_extended { Id::extended(number) } else { Id::base(number) };
    id.map_err(|error| LineProblem::Frame(FrameTextError { at: 0, problem: FrameTextProblem::Id(error) }))
}
