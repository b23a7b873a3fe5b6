//! Frames as a table of comma-separated values. The columns are those that vendors' tools have: number, time, state, identifier,
//! message, comment; and bus and kind beside them. A reader finds its columns by their names.

use std::fmt::Write;

use takt_rt::{Frame, FrameKind, NANOSECONDS_PER_SECOND};

use super::line::{self, LineItem, LineProblem};
use super::{Direction, LoggedFrame, frame_text, time};

/// The first line, with its end.
pub const HEADER: &str = "number,time,bus,state,id,kind,length,data,meaning\n";

/// Writes a line, with its end.
pub fn line(number: u64, logged: &LoggedFrame<'_>, meaning: &str, text: &mut String) {
    let LoggedFrame { at_ns, bus, direction, frame } = logged;
    let state = match direction {
        Some(Direction::Sent) => "Send",
        Some(Direction::Received) => "Receive",
        None => "",
    };
    let (seconds, rest_ns) = (at_ns / NANOSECONDS_PER_SECOND, at_ns % NANOSECONDS_PER_SECOND);
    let data: Vec<String> = frame.payload().iter().map(|byte| format!("{byte:02X}")).collect();
    // Nothing is written to but a text, which does not fail.
    let _ = writeln!(
        text,
        "{number},{seconds}.{rest_ns:09},{},{state},{:?},{},{},{},{}",
        quoted(bus),
        frame.id(),
        word(frame.kind()),
        frame.length(),
        data.join(" "),
        quoted(meaning),
    );
}

const fn word(kind: FrameKind) -> &'static str {
    match kind {
        FrameKind::Data => "data",
        FrameKind::Remote => "remote",
        FrameKind::Fd => "fd",
        FrameKind::FdBitRateSwitch => "fd-brs",
    }
}

/// A cell, in quotes where it needs them (RFC 4180). A spreadsheet would take a cell that begins with one of the signs for a formula.
fn quoted(cell: &str) -> String {
    let cell = if cell.starts_with(['=', '+', '-', '@']) { format!("'{cell}") } else { cell.to_owned() };
    if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell }
}

/// Where the columns of a table are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    time: Option<usize>,
    bus: Option<usize>,
    state: Option<usize>,
    id: usize,
    kind: Option<usize>,
    length: Option<usize>,
    data: usize,
    /// Those of python-can: the data is base64, and flags say the kind.
    flags: Option<PythonFlags>,
}

/// The columns with flags of python-can's CSV.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PythonFlags {
    extended: usize,
    remote: usize,
    error: usize,
}

impl Columns {
    /// Finds the columns in a header; `None` if it is none, or lacks identifier or data.
    pub fn find(header: &str) -> Option<Self> {
        let header = header.trim_start_matches('\u{FEFF}');
        let names: Vec<String> = cells(header).map(|name| name.trim().to_lowercase()).collect();
        let column = |known: &[&str]| names.iter().position(|name| known.contains(&name.as_str()));
        let flags = || {
            let (extended, remote) = (column(&["extended"])?, column(&["remote"])?);
            Some(PythonFlags { extended, remote, error: column(&["error"])? })
        };
        Some(Self {
            flags: flags(),
            time: column(&["time", "timestamp"]),
            bus: column(&["bus", "channel", "interface"]),
            state: column(&["state", "status", "direction"]),
            id: column(&["id", "frame id", "can id", "arbitration_id"])?,
            kind: column(&["kind"]),
            length: column(&["length", "dlc"]),
            data: column(&["data", "message"])?,
        })
    }

    /// Reads a line.
    pub fn parse<'a>(&self, line: &'a str) -> Result<LineItem<'a>, LineProblem> {
        let cells: Vec<&str> = cells(line).collect();
        let cell = |at: usize| cells.get(at).map(|cell| cell.trim()).ok_or(LineProblem::Cut);
        let given = |at: Option<usize>| at.and_then(|at| cell(at).ok()).filter(|cell| !cell.is_empty());
        let at_ns = match given(self.time) {
            None => 0,
            Some(text) => match text.split_once(' ') {
                Some((date, clock)) => time::moment(date, clock),
                None => time::seconds(text),
            }
            .ok_or(LineProblem::Time)?,
        };
        let direction = match given(self.state).map(|state| state.chars().next()) {
            Some(Some('S' | 's' | 'T' | 't')) => Some(Direction::Sent),
            Some(Some('R' | 'r')) => Some(Direction::Received),
            _ => None,
        };
        if let Some(flags) = self.flags {
            return self.of_python(flags, &cells, at_ns);
        }
        // The vendor's tool does not fill identifiers up with zeros.
        let id = cell(self.id)?.trim_start_matches("0x");
        let id = if id.len() < 3 { format!("{id:0>3}") } else { id.to_owned() };
        let id = frame_text::identifier(&id).map_err(LineProblem::Frame)?;
        let mut bytes = [0; Frame::MAX_BYTES];
        let mut length = 0;
        for digits in cell(self.data)?.split_ascii_whitespace() {
            let byte = bytes.get_mut(length).ok_or(LineProblem::Length)?;
            *byte =
                u8::from_str_radix(digits, 16).ok().filter(|_| digits.len() <= 2).ok_or(LineProblem::Byte)?;
            length += 1;
        }
        let payload = bytes.get(..length).unwrap_or_default();
        let frame = match given(self.kind) {
            Some("remote") => {
                let length =
                    given(self.length).and_then(|length| length.parse().ok()).ok_or(LineProblem::Length)?;
                Frame::remote(id, length)
            }
            Some("fd") => Frame::fd(id, payload, false),
            Some("fd-brs") => Frame::fd(id, payload, true),
            _ => Frame::data(id, payload),
        };
        let frame = frame.map_err(|_| LineProblem::Length)?;
        let bus = given(self.bus).unwrap_or_default();
        Ok(LineItem::Frame(LoggedFrame { at_ns, bus, direction, frame }))
    }
}

impl Columns {
    /// Reads the cells of a line of python-can.
    fn of_python<'a>(
        &self,
        flags: PythonFlags,
        cells: &[&'a str],
        at_ns: u64,
    ) -> Result<LineItem<'a>, LineProblem> {
        let cell = |at: usize| cells.get(at).map(|cell| cell.trim()).ok_or(LineProblem::Cut);
        let is_set = |at: usize| cell(at).map(|cell| cell == "1");
        if is_set(flags.error)? {
            return Ok(LineItem::ErrorFrame);
        }
        let digits = cell(self.id)?.trim_start_matches("0x");
        let id = line::numbered(u32::from_str_radix(digits, 16).ok(), is_set(flags.extended)?)?;
        let mut bytes = [0; Frame::MAX_BYTES];
        let length = base64(cell(self.data)?, &mut bytes)?;
        let payload = bytes.get(..length).unwrap_or_default();
        let frame = if is_set(flags.remote)? {
            let length = self.length.map_or(Ok("0"), cell)?;
            Frame::remote(id, length.parse().map_err(|_| LineProblem::Length)?)
        } else if length > 8 {
            Frame::fd(id, payload, false)
        } else {
            Frame::data(id, payload)
        };
        let frame = frame.map_err(|_| LineProblem::Length)?;
        let bus = self.bus.map_or(Ok(""), cell)?;
        Ok(LineItem::Frame(LoggedFrame { at_ns, bus, direction: None, frame }))
    }
}

/// Decodes base64 (RFC 4648, 4). Returns the number of bytes.
fn base64(text: &str, bytes: &mut [u8]) -> Result<usize, LineProblem> {
    let (mut bits, mut kept, mut length) = (0_u32, 0, 0);
    for sign in text.trim_end_matches('=').bytes() {
        let value = match sign {
            b'A'..=b'Z' => sign - b'A',
            b'a'..=b'z' => sign - b'a' + 26,
            b'0'..=b'9' => sign - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return Err(LineProblem::Base64),
        };
        bits = (bits << 6 | u32::from(value)) & 0xFFFF;
        kept += 6;
        if kept >= 8 {
            kept -= 8;
            *bytes.get_mut(length).ok_or(LineProblem::Length)? = (bits >> kept) as u8;
            length += 1;
        }
    }
    Ok(length)
}

/// The cells of a line. Quotes around a cell are left out; two quotes within stay two, which no cell that is read needs.
fn cells(line: &str) -> impl Iterator<Item = &str> {
    let mut rest = Some(line);
    std::iter::from_fn(move || {
        let text = rest?;
        if let Some(quoted) = text.strip_prefix('"') {
            let end = closing_quote(quoted).unwrap_or(quoted.len());
            let (cell, behind) = quoted.split_at(end);
            rest = behind.trim_start_matches('"').split_once(',').map(|(_, next)| next);
            return Some(cell);
        }
        match text.split_once(',') {
            Some((cell, next)) => {
                rest = Some(next);
                Some(cell)
            }
            None => {
                rest = None;
                Some(text)
            }
        }
    })
}

/// The place of the first quote that is not one of two.
fn closing_quote(text: &str) -> Option<usize> {
    let mut signs = text.char_indices().peekable();
    while let Some((at, sign)) = signs.next() {
        if sign == '"' && signs.next_if(|(_, next)| *next == '"').is_none() {
            return Some(at);
        }
    }
    None
}
