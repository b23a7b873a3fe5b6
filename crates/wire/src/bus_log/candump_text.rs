//! What candump prints: ` (1700000000.000123)  can0  181   [2]  37 12`, with or without time, with `RX - -` where it was asked for
//! the direction (`-x`), and with the bytes as letters behind them (`-a`).

use std::fmt::Write;

use takt_rt::{Frame, FrameKind, NANOSECONDS_PER_SECOND};

use super::line::{LineItem, LineProblem};
use super::{Direction, LoggedFrame, candump, frame_text, time};

/// Writes a line, with its end.
pub fn line(logged: &LoggedFrame<'_>, text: &mut String) {
    let LoggedFrame { at_ns, bus, direction, frame } = logged;
    let (seconds, rest_ns) = (at_ns / NANOSECONDS_PER_SECOND, at_ns % NANOSECONDS_PER_SECOND);
    // Nothing is written to but a text, which does not fail.
    let _ = write!(text, " ({seconds}.{:06})  {bus}  ", rest_ns / 1000);
    let switches = frame.kind() == FrameKind::FdBitRateSwitch;
    if direction.is_some() || switches {
        let word = if *direction == Some(Direction::Sent) { "TX" } else { "RX" };
        let _ = write!(text, "{word} {} -  ", if switches { 'B' } else { '-' });
    }
    let _ = write!(text, "{:?}   ", frame.id());
    match frame.kind() {
        FrameKind::Remote => {
            let _ = write!(text, "[{}]  remote request", frame.length());
        }
        kind => {
            let _ = match kind {
                FrameKind::Data => write!(text, "[{}] ", frame.length()),
                _ => write!(text, "[{:02}] ", frame.length()),
            };
            for byte in frame.payload() {
                let _ = write!(text, " {byte:02X}");
            }
        }
    }
    text.push('\n');
}

/// Reads a line.
pub(super) fn parse(line: &str) -> Result<LineItem<'_>, LineProblem> {
    let line = line.trim_start();
    let (at_ns, rest) = match line.strip_prefix('(') {
        None => (0, line),
        Some(rest) => {
            let (at, rest) = rest.split_once(')').ok_or(LineProblem::Time)?;
            let at_ns = match at.trim_start().split_once(' ') {
                Some((date, clock)) => time::moment(date, clock),
                None => time::seconds(at.trim_start()),
            };
            (at_ns.ok_or(LineProblem::Time)?, rest)
        }
    };
    let mut words = rest.split_ascii_whitespace();
    let mut word = || words.next().ok_or(LineProblem::Cut);
    let bus = word()?;
    let (mut direction, mut switches) = (None, false);
    let mut id = word()?;
    if let "TX" | "RX" = id {
        direction = Some(if id == "TX" { Direction::Sent } else { Direction::Received });
        switches = word()? == "B";
        word()?;
        id = word()?;
    }
    let length =
        word()?.strip_prefix('[').and_then(|length| length.strip_suffix(']')).ok_or(LineProblem::Length)?;
    // candump shows two digits for CAN FD, and one for classic frames.
    let is_fd = length.len() == 2;
    let length: usize = length.parse().map_err(|_| LineProblem::Length)?;
    if length > Frame::MAX_BYTES {
        return Err(LineProblem::Length);
    }
    if candump::is_error_id(id) {
        return Ok(LineItem::ErrorFrame);
    }
    let id = frame_text::identifier(id).map_err(LineProblem::Frame)?;
    let mut bytes = [0; Frame::MAX_BYTES];
    for (place, byte) in bytes.iter_mut().take(length).enumerate() {
        let digits = word()?;
        if place == 0 && digits == "remote" {
            let frame = Frame::remote(id, length as u8).map_err(|_| LineProblem::Length)?;
            return Ok(LineItem::Frame(LoggedFrame { at_ns, bus, direction, frame }));
        }
        let number = u8::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 2);
        *byte = number.ok_or(LineProblem::Byte)?;
    }
    let payload = bytes.get(..length).unwrap_or_default();
    let is_remote = length == 0 && words.next() == Some("remote");
    let frame = match (is_remote, is_fd || switches) {
        (true, _) => Frame::remote(id, 0),
        (false, true) => Frame::fd(id, payload, switches),
        (false, false) => Frame::data(id, payload),
    };
    let frame = frame.map_err(|_| LineProblem::Length)?;
    Ok(LineItem::Frame(LoggedFrame { at_ns, bus, direction, frame }))
}
