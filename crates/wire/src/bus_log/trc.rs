//! TRC, the traces of PEAK's tools: comments that begin with `;`, then a line for each message. Version 1 has fixed columns, version 2 names
//! them in `;$COLUMNS` (PEAK CAN TRC File Format, 5).

use takt_rt::Frame;

use super::asc::bytes;
use super::line::{self, LineItem, LineProblem};
use super::{Direction, LoggedFrame, time};

/// The columns of version 2.0, which need not be named.
const COLUMNS_2_0: &str = "N,O,T,I,d,l,D";

/// What the comments say so far.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Trace {
    /// The letters of the columns; `None` for version 1.
    columns: Option<Vec<char>>,
}

impl Trace {
    /// Begins a trace with its first line, `;$FILEVERSION=2.1`; `None` if this is another line.
    pub fn begin(line: &str) -> Option<Self> {
        let version = line.trim_start().strip_prefix(";$FILEVERSION=")?;
        let is_named = version.trim_start().starts_with('2');
        Some(Self { columns: is_named.then(|| letters(COLUMNS_2_0)) })
    }

    /// Reads a line behind the first one.
    pub fn parse<'a>(&mut self, line: &'a str) -> Result<LineItem<'a>, LineProblem> {
        if let Some(comment) = line.trim_start().strip_prefix(';') {
            if let Some(named) = comment.strip_prefix("$COLUMNS=") {
                self.columns = Some(letters(named));
            }
            return Ok(LineItem::NoFrame);
        }
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let parts = match &self.columns {
            None => Parts::of_version_1(&words)?,
            Some(columns) => Parts::of(columns, &words)?,
        };
        parts.item()
    }
}

fn letters(columns: &str) -> Vec<char> {
    columns.split(',').filter_map(|column| column.trim().chars().next()).collect()
}

/// The words of a line by their meaning.
#[derive(Default)]
struct Parts<'w, 'a> {
    offset: &'a str,
    bus: &'a str,
    /// `DT`, `FD` …; in version 1 `Rx`, `Tx`, `Error` and so on.
    kind: &'a str,
    direction: Option<Direction>,
    id: &'a str,
    length: &'a str,
    data: &'w [&'a str],
}

impl<'w, 'a> Parts<'w, 'a> {
    /// `N) offset [bus] [Rx|Tx|Error|Warng] id [-] length data`
    fn of_version_1(words: &'w [&'a str]) -> Result<Self, LineProblem> {
        let [number, offset, rest @ ..] = words else { return Err(LineProblem::Cut) };
        if !number.ends_with(')') {
            return Err(LineProblem::Time);
        }
        let is_kind = |word: &&str| matches!(*word, "Rx" | "Tx" | "Warng" | "Error" | "Errno");
        let (bus, kind, rest) = match rest {
            [kind, rest @ ..] if is_kind(kind) => ("", *kind, rest),
            [bus, kind, rest @ ..] if is_kind(kind) => (*bus, *kind, rest),
            rest => ("", "", rest),
        };
        let (id, rest) = rest.split_first().ok_or(LineProblem::Cut)?;
        let rest = match rest {
            ["-", rest @ ..] => rest,
            rest => rest,
        };
        let (length, data) = rest.split_first().ok_or(LineProblem::Cut)?;
        Ok(Self { offset, bus, kind, direction: direction(kind), id, length, data })
    }

    fn of(columns: &[char], words: &'w [&'a str]) -> Result<Self, LineProblem> {
        let mut parts = Self::default();
        let mut rest = words;
        for column in columns {
            if *column == 'D' {
                parts.data = rest;
                break;
            }
            let Some((word, behind)) = rest.split_first() else { break };
            rest = behind;
            match column {
                'O' => parts.offset = word,
                'B' => parts.bus = word,
                'T' => parts.kind = word,
                'I' => parts.id = word,
                'd' => parts.direction = direction(word),
                'l' | 'L' => parts.length = word,
                // Number, reserved, and what later versions add.
                _ => {}
            }
        }
        if parts.offset.is_empty() { Err(LineProblem::Cut) } else { Ok(parts) }
    }

    fn item(&self) -> Result<LineItem<'a>, LineProblem> {
        let at_ns = time::seconds(self.offset).ok_or(LineProblem::Time)? / 1000;
        if matches!(self.kind, "Error" | "Errno" | "ER") {
            return Ok(LineItem::ErrorFrame);
        } else if matches!(self.kind, "Warng" | "ST" | "EC" | "EV") {
            return Ok(LineItem::NoFrame);
        }
        let id = line::numbered(u32::from_str_radix(self.id, 16).ok(), self.id.len() > 4)?;
        if self.kind == "RR" || self.data.first() == Some(&"RTR") {
            let length: u8 = self.length.parse().map_err(|_| LineProblem::Length)?;
            let frame = Frame::remote(id, length).map_err(|_| LineProblem::Length)?;
            return Ok(self.framed(at_ns, frame));
        }
        let data = bytes(self.data, true)?;
        let payload = data.payload(data.count())?;
        let frame = match self.kind {
            "FD" | "FE" => Frame::fd(id, payload, false),
            "FB" | "BI" => Frame::fd(id, payload, true),
            // The length of a frame of CAN FD is its length code in some versions.
            _ if self.length.parse() != Ok(data.count()) => return Err(LineProblem::Length),
            _ => Frame::data(id, payload),
        };
        Ok(self.framed(at_ns, frame.map_err(|_| LineProblem::Length)?))
    }

    const fn framed(&self, at_ns: u64, frame: Frame) -> LineItem<'a> {
        LineItem::Frame(LoggedFrame { at_ns, bus: self.bus, direction: self.direction, frame })
    }
}

fn direction(word: &str) -> Option<Direction> {
    match word {
        "Rx" => Some(Direction::Received),
        "Tx" => Some(Direction::Sent),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(lines: &[&str]) -> Vec<String> {
        let (first, rest) = lines.split_first().unwrap();
        let mut trace = Trace::begin(first).unwrap();
        let show = |line: &&str| match trace.parse(line) {
            Ok(LineItem::Frame(LoggedFrame { at_ns, bus, direction, frame })) => {
                format!("{} {bus} {direction:?} {frame:?}", at_ns / 1000)
            }
            Ok(item) => format!("{item:?}"),
            Err(problem) => problem.to_string(),
        };
        rest.iter().map(show).collect()
    }

    #[test]
    fn the_columns_of_version_1_are_known() {
        let of = |version: &str, line: &str| shown(&[&format!(";$FILEVERSION={version}"), line]).remove(0);
        assert_eq!(
            of("1.0", "     1)      1841  0001  8  00 01 02 03 04 05 06 07"),
            "1841000  None 001#0001020304050607"
        );
        assert_eq!(
            of("1.1", "     1)      1841.2  Rx         0701  1  7F"),
            "1841200  Some(Received) 701#7F"
        );
        assert_eq!(of("1.1", "     2)      1842.2  Tx     18FEE900  0"), "1842200  Some(Sent) 18FEE900#");
        assert_eq!(
            of("1.1", "     3)      1842.2  Rx         0601  8  RTR"),
            "1842200  Some(Received) 601#R8"
        );
        assert_eq!(of("1.1", "     4)      1842.2  Error      0008  4  00 19 08 08"), "ErrorFrame");
        assert_eq!(
            of("1.3", "     1)      1059.9 1  Rx        0300 -  7    00 00 00 00 04 00 00"),
            "1059900 1 Some(Received) 300#00000000040000"
        );
        assert_eq!(
            of("1.1", "     1)      1841.2  Rx         0701  2  7F"),
            "its length is that of no frame"
        );
    }

    #[test]
    fn version_2_names_its_columns() {
        let lines = [
            ";$FILEVERSION=2.1",
            ";$STARTTIME=43008.4",
            ";$COLUMNS=N,O,T,B,I,d,R,L,D",
            "      1      1059.900 DT 1      0300 Rx -  2    00 07",
            "      2      1060.000 FB 1      0301 Tx -  9    00 01 02 03 04 05 06 07 08 09 0A 0B",
            "      3      1061.000 RR 1      0701 Rx -  0",
            "      4      1062.000 ER 1         - Rx -  4    00 19 08 08",
            "      5      1063.000 ST 1           Rx -  4    00 00 00 00",
        ];
        assert_eq!(
            shown(&lines),
            [
                "NoFrame",
                "NoFrame",
                "1059900 1 Some(Received) 300#0007",
                "1060000 1 Some(Sent) 301##1000102030405060708090A0B",
                "1061000 1 Some(Received) 701#R0",
                "ErrorFrame",
                "NoFrame",
            ]
        );
        let unnamed = [";$FILEVERSION=2.0", "      1      1059.900 DT     0300 Rx 1  04"];
        assert_eq!(shown(&unnamed), ["1059900  Some(Received) 300#04"]);
    }
}
