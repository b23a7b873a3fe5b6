//! The lines of `candump -l`: `(1700000000.000123) can0 181#3712`. `canplayer`, `log2asc`, python-can, SavvyCAN and Wireshark read it.
//! Newer versions of candump write the direction behind it (` T`, ` R`), which is read, and not written: Wireshark 4.0 stops there.

use std::fmt;

use takt_rt::{Frame, NANOSECONDS_PER_SECOND, Nanoseconds};

use super::line::{LineItem, LineProblem};
use super::{Direction, LoggedFrame, frame_text, time};

/// A line of a log, without its end. Log readers split it at spaces: a bus must not have one in its name.
#[derive(Clone, Copy, Debug)]
pub struct CandumpLine<'a> {
    /// Since 1970-01-01 UTC.
    pub unix_ns: Nanoseconds,
    /// The name of the bus.
    pub bus: &'a str,
    /// The frame.
    pub frame: Frame,
}

impl fmt::Display for CandumpLine<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seconds, rest_ns) =
            (self.unix_ns / NANOSECONDS_PER_SECOND, self.unix_ns % NANOSECONDS_PER_SECOND);
        write!(f, "({seconds}.{:06}) {} {:?}", rest_ns / 1000, self.bus, self.frame)
    }
}

/// Reads a line.
pub(super) fn parse(line: &str) -> Result<LineItem<'_>, LineProblem> {
    let mut words = line.split_ascii_whitespace();
    let at = words.next().and_then(|word| word.strip_prefix('(')?.strip_suffix(')'));
    let at_ns = at.and_then(time::seconds).ok_or(LineProblem::Time)?;
    let bus = words.next().ok_or(LineProblem::Cut)?;
    let text = words.next().ok_or(LineProblem::Cut)?;
    let direction = match words.next() {
        Some("T") => Some(Direction::Sent),
        Some("R") => Some(Direction::Received),
        _ => None,
    };
    if text.split_once('#').is_some_and(|(id, _)| is_error_id(id)) {
        return Ok(LineItem::ErrorFrame);
    }
    let frame = frame_text::parse(text).map_err(LineProblem::Frame)?;
    Ok(LineItem::Frame(LoggedFrame { at_ns, bus, direction, frame }))
}

/// Bit 29 of an identifier marks a message of the controller (CAN_ERR_FLAG), which was no frame on the bus.
const ERROR_FLAG: u32 = 1 << 29;

/// Returns `true` if an identifier of eight digits is that of a message of the controller.
pub(super) fn is_error_id(digits: &str) -> bool {
    digits.len() == 8 && u32::from_str_radix(digits, 16).is_ok_and(|id| id & ERROR_FLAG != 0)
}
