//! Tells the kinds of logs apart, and reads each.

use std::io::{self, BufRead, Read};

use super::csv::Columns;
use super::line::{LineItem, LineProblem};
use super::{LogCondition, LogError, LoggedFrame, asc, candump, candump_text, pcapng, trc};
use takt_rt::Nanoseconds;

/// No line of a log is longer. What is longer is cut there.
const LONGEST_LINE: u64 = 1 << 12;
/// Lines before the first one of a log: a header, a prompt, what somebody has written above.
const LINES_BEFORE: u64 = 100;

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
    let mut times = Times::default();
    let mut take = |item: LineItem<'_>| match item {
        LineItem::Frame(frame) => {
            times.add(frame.at_ns);
            visit(frame)
        }
        LineItem::ErrorFrame => {
            error_frames += 1;
            true
        }
        LineItem::NoFrame => true,
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
    (condition.steps_back, condition.first_step_back) = (times.steps_back, times.first_step_back);
    Ok(condition)
}

/// The times of the frames so far.
#[derive(Default)]
struct Times {
    frames: u64,
    last_ns: Nanoseconds,
    steps_back: u64,
    first_step_back: Option<u64>,
}

impl Times {
    fn add(&mut self, at_ns: Nanoseconds) {
        self.frames += 1;
        if at_ns < self.last_ns {
            self.steps_back += 1;
            self.first_step_back.get_or_insert(self.frames);
        }
        self.last_ns = at_ns;
    }
}

/// A kind of log whose lines have one frame each.
enum LineFormat {
    Candump,
    CandumpText,
    Csv(Columns),
    Asc(asc::Header),
    Trc(trc::Trace),
}

impl LineFormat {
    /// The kind of log that begins with this line, which is none of its frames.
    fn of_header(line: &str) -> Option<Self> {
        let asc = || asc::Header::read(line).map(Self::Asc);
        let trc = || trc::Trace::begin(line).map(Self::Trc);
        Columns::find(line).map(Self::Csv).or_else(asc).or_else(trc)
    }

    /// The kind of log that this line is probably a frame of.
    fn of_frame(line: &str) -> Self {
        let has_hash = line.split_ascii_whitespace().nth(2).is_some_and(|word| word.contains('#'));
        if has_hash { Self::Candump } else { Self::CandumpText }
    }

    fn parse<'a>(&mut self, line: &'a str) -> Result<LineItem<'a>, LineProblem> {
        match self {
            Self::Candump => candump::parse(line),
            Self::CandumpText => candump_text::parse(line),
            Self::Csv(columns) => columns.parse(line),
            Self::Asc(header) => header.parse(line),
            Self::Trc(trace) => trace.parse(line),
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
    // Of the first line, while no line is known to be of a log.
    let mut first_problem = None;
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
        if format.is_none() {
            format = LineFormat::of_header(line);
            if format.is_some() {
                continue;
            }
        }
        let is_begun = format.is_some();
        let mut probable = format.take().unwrap_or_else(|| LineFormat::of_frame(line));
        match probable.parse(line) {
            Ok(item) => {
                format = Some(probable);
                if !take(item) {
                    break;
                }
            }
            Err(problem) => {
                condition.count_malformed(number, problem.to_string());
                if is_begun {
                    format = Some(probable);
                } else {
                    first_problem.get_or_insert((number, problem.to_string()));
                    // It may be any file, and nobody wants to read it to its end.
                    if condition.malformed > LINES_BEFORE {
                        break;
                    }
                }
            }
        }
    }
    match (format, first_problem) {
        (Some(_), _) => Ok(()),
        (None, Some((line, problem))) => Err(LogError::Unknown { line, problem }),
        (None, None) => Err(LogError::Empty),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(log: &str) -> Result<(Vec<String>, LogCondition), LogError> {
        let mut frames = vec![];
        let condition = read(log.as_bytes(), |logged| {
            frames.push(format!("{} {:?}", logged.at_ns, logged.frame));
            true
        })?;
        Ok((frames, condition))
    }

    #[test]
    fn a_log_may_begin_with_lines_that_are_no_frames() {
        for log in [
            "...\n  can0  TX - -  080   [0] \n...\n  can0  TX - -  080   [0] \n",
            "$ candump can0\n  can0  080   [0]\n  can0  080   [0]\n...\n",
            "a trace of Tuesday\nbase hex  timestamps absolute\n0.0 1 080 Rx d 0\n0.0 1 080 Rx d 0\n0.0 1 080 Rx d 9\n",
        ] {
            let (frames, condition) = frames(log).unwrap();
            assert_eq!(frames, ["0 080#", "0 080#"], "{log}");
            assert_eq!(condition.malformed, 2, "{log}");
            assert_eq!(condition.first_malformed.map(|(line, _)| line), Some(1), "{log}");
        }
        let other = "It was a dark and stormy night.\n".repeat(200);
        let refused = frames(&other).unwrap_err().to_string();
        assert!(refused.contains("no log of a bus; line 1:"), "{refused}");
    }

    #[test]
    fn times_that_go_back_are_counted_with_the_first() {
        let log = "(10.0) can0 080#\n(10.1) can0 080#\n(9.5) can0 080#\n(9.6) can0 080#\n(1.0) can0 080#\n";
        let condition = frames(log).unwrap().1;
        assert_eq!((condition.steps_back, condition.first_step_back), (2, Some(3)));
    }

    #[test]
    fn the_table_of_python_can_is_read() {
        let log = "timestamp,arbitration_id,extended,remote,error,dlc,data\n1.5,0x181,0,0,0,2,AAE=\n1.6,0x18daf110,1,0,0,3,/+8A\n\
                   1.7,0x701,0,1,0,1,\n1.8,0x1,0,0,1,0,\n1.9,0x123,0,0,0,9,AAECAwQFBgcICQoL\n2.0,0x123,0,0,0,1,?\n";
        let (frames, condition) = frames(log).unwrap();
        assert_eq!(
            frames,
            [
                "1500000000 181#0001",
                "1600000000 18DAF110#FFEF00",
                "1700000000 701#R1",
                "1900000000 123##0000102030405060708090A0B",
            ]
        );
        assert_eq!((condition.error_frames, condition.malformed), (1, 1));
    }
}
