//! Tells the kinds of logs apart, and reads each.

use std::io::{self, BufRead, Read};

use super::csv::Columns;
use super::line::{LineItem, LineProblem};
use super::{LogCondition, LogError, LoggedFrame, candump, candump_text, pcapng};

/// No line of a log is longer. What is longer is cut there.
const LONGEST_LINE: u64 = 1 << 12;

/// Passes each frame of a log to `visit`, in the order of the file, until that returns `false`.
///
/// # Errors
/// See [`LogError`]. Single lines that cannot be read are passed over and counted.
pub fn read(
    mut file: impl BufRead,
    mut visit: impl FnMut(LoggedFrame<'_>) -> bool,
) -> Result<LogCondition, LogError> {
    let mut condition = LogCondition::default();
    let mut error_frames = 0;
    let mut take = |item: LineItem<'_>| match item {
        LineItem::Frame(frame) => visit(frame),
        LineItem::ErrorFrame => {
            error_frames += 1;
            true
        }
    };
    let mut first = Vec::with_capacity(4);
    (&mut file).take(4).read_to_end(&mut first)?;
    match first.as_slice() {
        [] => return Err(LogError::Empty),
        magic if magic == pcapng::MAGIC => pcapng::read(file, &mut take, &mut condition)?,
        [0xD4, 0xC3, 0xB2, 0xA1]
        | [0xA1, 0xB2, 0xC3, 0xD4]
        | [0x4D, 0x3C, 0xB2, 0xA1]
        | [0xA1, 0xB2, 0x3C, 0x4D] => {
            return Err(LogError::OldCapture);
        }
        _ => lines(io::Cursor::new(first).chain(file), &mut take, &mut condition)?,
    }
    condition.error_frames = error_frames;
    Ok(condition)
}

/// A kind of log whose lines have one frame each.
enum LineFormat {
    Candump,
    CandumpText,
    Csv(Columns),
}

impl LineFormat {
    /// The kind of log that begins with this line, and whether the line is one of it.
    fn of(line: &str) -> (Self, bool) {
        if let Some(columns) = Columns::find(line) {
            return (Self::Csv(columns), false);
        }
        let has_hash = line.split_ascii_whitespace().nth(2).is_some_and(|word| word.contains('#'));
        (if has_hash { Self::Candump } else { Self::CandumpText }, true)
    }

    fn parse<'a>(&self, line: &'a str) -> Result<LineItem<'a>, LineProblem> {
        match self {
            Self::Candump => candump::parse(line),
            Self::CandumpText => candump_text::parse(line),
            Self::Csv(columns) => columns.parse(line),
        }
    }
}

fn lines(
    mut file: impl BufRead,
    take: &mut dyn FnMut(LineItem<'_>) -> bool,
    condition: &mut LogCondition,
) -> Result<(), LogError> {
    let mut format = None;
    let mut bytes = vec![];
    let mut is_log = false;
    for number in 1.. {
        bytes.clear();
        if (&mut file).take(LONGEST_LINE).read_until(b'\n', &mut bytes)? == 0 {
            break;
        }
        let text = String::from_utf8_lossy(&bytes);
        let line = text.trim_end();
        if line.trim_start().is_empty() {
            continue;
        }
        let known = format.get_or_insert_with(|| LineFormat::of(line));
        if !std::mem::replace(&mut known.1, true) {
            is_log = true;
            continue;
        }
        match known.0.parse(line) {
            Ok(item) => {
                is_log = true;
                if !take(item) {
                    break;
                }
            }
            // It may be any file, and nobody wants to read it to its end.
            Err(problem) if !is_log => {
                return Err(LogError::Unknown { line: number, problem: problem.to_string() });
            }
            Err(problem) => condition.count_malformed(number, problem.to_string()),
        }
    }
    if format.is_none() { Err(LogError::Empty) } else { Ok(()) }
}
