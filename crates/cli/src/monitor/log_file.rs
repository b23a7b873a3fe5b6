//! Frames from a file: a log, or a black box.

use std::fs::File;
use std::io::{BufRead, BufReader, stdin};
use std::path::Path;

use takt_rt::{Frame, Nanoseconds};
use takt_wire::bus_log::{self, Direction, LogCondition, LoggedFrame};

use super::session::Session;
use crate::usage_error::UsageError;
use takt::telemetry;

/// The first bytes of a recording of takt (MCAP).
const MCAP: [u8; 5] = *b"\x89MCAP";

/// Passes every frame of a file to the session; `None` is standard input.
pub fn read(
    path: Option<&Path>,
    session: &mut Session,
    is_stopped: impl Fn() -> bool,
) -> Result<(), UsageError> {
    let Some(path) = path else {
        // Another program may be writing it at this moment.
        return log("standard input", stdin().lock(), session, true, is_stopped);
    };
    let shown = path.display().to_string();
    let failed = |error| format!("{shown}: {error}");
    if path.is_dir() {
        return Err(format!("{shown}: this is a folder; name one of its files").into());
    }
    let mut file = BufReader::new(File::open(path).map_err(failed)?);
    let begin = file.fill_buf().map_err(failed)?;
    if begin.starts_with(&MCAP) {
        return black_box(path, session, is_stopped);
    }
    log(&shown, file, session, false, is_stopped)
}

fn log(
    shown: &str,
    file: impl BufRead,
    session: &mut Session,
    is_live: bool,
    is_stopped: impl Fn() -> bool,
) -> Result<(), UsageError> {
    let mut names = Names::default();
    let read = bus_log::read(file, |LoggedFrame { at_ns, bus, direction, frame }| {
        let bus = names.number(bus, session);
        let wants_more = session.take(bus, at_ns, direction, &frame);
        if is_live {
            session.print();
        }
        wants_more && session.wants_more() && !is_stopped()
    });
    let condition = read.map_err(|error| format!("{shown}: {error}"))?;
    remark(shown, &condition, session);
    Ok(())
}

fn remark(shown: &str, condition: &LogCondition, session: &mut Session) {
    let LogCondition {
        error_frames,
        foreign,
        malformed,
        first_malformed,
        steps_back,
        first_step_back,
        is_cut_off,
    } = condition;
    if *error_frames > 0 {
        session.remark(format!("{shown} has {error_frames} messages of CAN controllers about errors"));
    }
    if *foreign > 0 {
        session.remark(format!("{shown} has {foreign} packets of other networks, which were passed over"));
    }
    if let Some((at, problem)) = first_malformed {
        session.remark(format!(
            "{malformed} lines (blocks) of {shown} are no frames, and were passed over; the first one is {at}: {problem}"
        ));
    }
    if let Some(first) = first_step_back {
        session.remark(format!(
            "the times of {shown} go back at {steps_back} of its frames, first at frame {first}: they may be those of several logs, or count \
             from the frame before (candump -t d)"
        ));
    }
    if *is_cut_off {
        session.remark(format!("{shown} is cut off; it is read to its last whole block"));
    }
}

/// The buses that a log names.
#[derive(Default)]
struct Names {
    known: Vec<(String, usize)>,
}

/// A log of a damaged file may have any number of names.
const MOST_BUSES: usize = 64;

impl Names {
    fn number(&mut self, name: &str, session: &mut Session) -> usize {
        if let Some((_, number)) = self.known.iter().find(|(known, _)| known == name) {
            return *number;
        }
        if self.known.len() >= MOST_BUSES {
            return 0;
        }
        let shown = takt_wire::printable::printable(name);
        let number = session.add_bus(&shown, session.number_of(name));
        self.known.push((name.to_owned(), number));
        number
    }
}

/// A frame of a black box.
struct Kept {
    unix_ns: Nanoseconds,
    bus: usize,
    direction: Direction,
    frame: Frame,
}

fn black_box(path: &Path, session: &mut Session, is_stopped: impl Fn() -> bool) -> Result<(), UsageError> {
    let mut names = Names::default();
    let mut kept = vec![];
    let found = telemetry::recorded_frames(path, |recorded| {
        let direction = if recorded.traced.is_sent { Direction::Sent } else { Direction::Received };
        let bus = names.number(recorded.bus, session);
        kept.push(Kept { unix_ns: recorded.unix_ns, bus, direction, frame: recorded.traced.frame });
    });
    let found = found.map_err(|error| error.to_string())?;
    let shown = path.display();
    if found.frames == 0 {
        return Err(format!(
            "{shown}: this recording has no frames; black boxes have them, and a log of candump, which \
             `candump = true` in the table [telemetry] of the configuration writes"
        )
        .into());
    }
    // The buses are recorded one after the other.
    kept.sort_by_key(|kept| kept.unix_ns);
    for Kept { unix_ns, bus, direction, frame } in kept {
        if !session.take(bus, unix_ns, Some(direction), &frame) || is_stopped() {
            break;
        }
    }
    if found.damaged > 0 {
        session.remark(format!("{} damaged parts of {shown} were passed over", found.damaged));
    }
    if !found.is_whole {
        session.remark(format!("{shown} is cut off; it is read to its last whole record"));
    }
    Ok(())
}
