//! ASC, the text logs of Vector's tools: a header with the number base, then a line for each frame and event. python-can, BUSMASTER and
//! `log2asc` write it as well.

use takt_rt::{Frame, Id, Nanoseconds};

use super::line::{self, LineItem, LineProblem};
use super::{Direction, LoggedFrame, time};

/// What the header says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    is_hexadecimal: bool,
    /// True if each time counts from the line before.
    is_relative: bool,
    last_ns: Nanoseconds,
}

impl Header {
    /// Reads the line `base hex  timestamps absolute`; `None` if this is another line.
    pub fn read(line: &str) -> Option<Self> {
        let mut words = line.split_ascii_whitespace();
        let base = words.next().filter(|word| *word == "base").and_then(|_| words.next())?;
        let is_hexadecimal = match base {
            "hex" => true,
            "dec" => false,
            _ => return None,
        };
        let times = words.next().filter(|word| *word == "timestamps").and_then(|_| words.next());
        Some(Self { is_hexadecimal, is_relative: times == Some("relative"), last_ns: 0 })
    }

    /// Reads a line behind the header.
    pub fn parse<'a>(&mut self, line: &'a str) -> Result<LineItem<'a>, LineProblem> {
        let mut words = line.split_ascii_whitespace();
        // Comments, trigger blocks and remarks about the log begin with a word.
        let Some(at_ns) = words.next().and_then(time::seconds) else { return Ok(LineItem::NoFrame) };
        let at_ns = if self.is_relative { self.last_ns.saturating_add(at_ns) } else { at_ns };
        self.last_ns = at_ns;
        let words: Vec<&str> = words.collect();
        let Some((bus, direction, frame)) = self.frame(&words)? else { return Ok(LineItem::NoFrame) };
        match frame {
            Some(frame) => Ok(LineItem::Frame(LoggedFrame { at_ns, bus, direction: Some(direction), frame })),
            None => Ok(LineItem::ErrorFrame),
        }
    }

    /// Bus, direction and frame, which is `None` for an error frame; nothing where these words are of another event.
    #[allow(clippy::type_complexity, reason = "the parts of one line")]
    fn frame<'a>(
        &self,
        words: &[&'a str],
    ) -> Result<Option<(&'a str, Direction, Option<Frame>)>, LineProblem> {
        let direction = |word: &str| match word {
            "Rx" => Some(Direction::Received),
            "Tx" | "TxRq" => Some(Direction::Sent),
            _ => None,
        };
        match words {
            [bus, "ErrorFrame", ..] | ["CANFD", bus, _, "ErrorFrame", ..] => {
                Ok(Some((bus, Direction::Received, None)))
            }
            ["CANFD", bus, way, id, rest @ ..] if direction(way).is_some() => {
                // A name of the message may stand before the flags.
                let rest = match rest {
                    ["0" | "1", ..] => rest,
                    [_, rest @ ..] => rest,
                    [] => return Err(LineProblem::Cut),
                };
                let [switches, _state, _code, length, data @ ..] = rest else { return Err(LineProblem::Cut) };
                let length: usize = length.parse().map_err(|_| LineProblem::Length)?;
                let data = bytes(data.iter().take(length), self.is_hexadecimal)?;
                let payload = data.payload(length)?;
                let frame = Frame::fd(self.id(id)?, payload, *switches == "1");
                let frame = frame.map_err(|_| LineProblem::Length)?;
                Ok(direction(way).map(|direction| (*bus, direction, Some(frame))))
            }
            [bus, id, way, kind, rest @ ..] if direction(way).is_some() => {
                let id = self.id(id)?;
                let length = rest.first().map(|length| usize::from_str_radix(length, 16));
                let length = length.transpose().map_err(|_| LineProblem::Length)?;
                let frame = match (*kind, length) {
                    ("r", length) => Frame::remote(id, length.unwrap_or(0).min(8) as u8),
                    ("d", Some(length)) => {
                        let data = rest.iter().skip(1).take(length);
                        Frame::data(id, bytes(data, self.is_hexadecimal)?.payload(length)?)
                    }
                    _ => return Err(LineProblem::Cut),
                };
                let frame = frame.map_err(|_| LineProblem::Length)?;
                Ok(direction(way).map(|direction| (*bus, direction, Some(frame))))
            }
            _ => Ok(None),
        }
    }

    /// An identifier: `x` behind it makes it one of 29 bits.
    fn id(&self, text: &str) -> Result<Id, LineProblem> {
        let (digits, is_extended) = match text.strip_suffix(['x', 'X']) {
            Some(digits) => (digits, true),
            None => (text, false),
        };
        let radix = if self.is_hexadecimal { 16 } else { 10 };
        line::numbered(u32::from_str_radix(digits, radix).ok(), is_extended)
    }
}

/// Bytes of a line.
pub(super) struct Bytes {
    bytes: [u8; Frame::MAX_BYTES],
    count: usize,
}

impl Bytes {
    /// The payload, if it has this length.
    pub fn payload(&self, length: usize) -> Result<&[u8], LineProblem> {
        let whole = self.bytes.get(..length).filter(|_| self.count == length);
        whole.ok_or(if self.count < length { LineProblem::Cut } else { LineProblem::Length })
    }

    /// The number of bytes.
    pub const fn count(&self) -> usize {
        self.count
    }
}

/// Reads bytes, each a word.
pub(super) fn bytes<'a>(
    words: impl IntoIterator<Item = &'a &'a str>,
    is_hexadecimal: bool,
) -> Result<Bytes, LineProblem> {
    let mut read = Bytes { bytes: [0; Frame::MAX_BYTES], count: 0 };
    for word in words {
        let radix = if is_hexadecimal { 16 } else { 10 };
        let byte = u8::from_str_radix(word, radix).map_err(|_| LineProblem::Byte)?;
        *read.bytes.get_mut(read.count).ok_or(LineProblem::Length)? = byte;
        read.count += 1;
    }
    Ok(read)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "base hex  timestamps absolute";

    fn shown(header: &str, lines: &[&str]) -> Vec<String> {
        let mut header = Header::read(header).unwrap();
        let show = |line: &&str| match header.parse(line) {
            Ok(LineItem::Frame(LoggedFrame { at_ns, bus, direction, frame })) => {
                format!("{} {bus} {direction:?} {frame:?}", at_ns / 1_000_000)
            }
            Ok(item) => format!("{item:?}"),
            Err(problem) => problem.to_string(),
        };
        lines.iter().map(show).collect()
    }

    #[test]
    fn frames_and_events_of_every_kind_are_read() {
        let lines = [
            "   0.010000 1  181             Rx   d 8 01 02 03 04 05 06 07 08  Length = 0",
            "   0.020000 2  18DAF110x       Tx   d 1 FF",
            "   0.030000 1  601             TxRq r 8",
            "   0.040000 1  ErrorFrame",
            "   0.050000 CANFD   1 Rx        123                                  1 0 9 12 00 01 02 03 04 05 06 07 08 09 0A 0B 0 0 0",
            "   0.060000 CANFD   1 Tx        124  Name                            0 0 2 2 AA BB",
            "   0.070000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.0%",
            "Begin Triggerblock Mon Nov 30 10:00:00.000 am 2026",
            "   0.080000 1  181             Rx   d 3 01 02",
        ];
        assert_eq!(
            shown(HEADER, &lines),
            [
                "10 1 Some(Received) 181#0102030405060708",
                "20 2 Some(Sent) 18DAF110#FF",
                "30 1 Some(Sent) 601#R8",
                "ErrorFrame",
                "50 1 Some(Received) 123##1000102030405060708090A0B",
                "60 1 Some(Sent) 124##0AABB",
                "NoFrame",
                "NoFrame",
                "it ends too early",
            ]
        );
    }

    #[test]
    fn numbers_may_be_decimal_and_times_count_from_the_line_before() {
        let lines = ["0.5 1  385 Rx d 2 10 255", "0.25 1  385 Rx d 0"];
        assert_eq!(
            shown("base dec timestamps relative", &lines),
            ["500 1 Some(Received) 181#0AFF", "750 1 Some(Received) 181#"]
        );
        assert_eq!(Header::read("date Mon Nov 30 10:00:00.000 am 2026"), None);
    }
}
