//! Logs of the frames of buses, as other programs write and read them.
//!
//! - [`frame_text`]: a frame as `cansend` takes it: `181#3712`, `123##1DEAD`, `701#R`.
//! - [`candump`]: `candump -l`; `candump_text`: what candump prints.
//! - `pcapng`: Wireshark, which decodes CANopen by itself.
//! - `csv`: a table with a header, for spreadsheets; also that of python-can.
//! - `asc`, `trc`: the logs of Vector's and PEAK's tools, which are read alone.
//! - [`read`] tells them apart; [`LogWriter`] writes one of them.

mod asc;
pub mod candump;
mod candump_text;
mod condition;
mod csv;
pub mod frame_text;
mod line;
mod pcapng;
mod reader;
mod time;
mod trc;
mod writer;

pub use condition::{LogCondition, LogError};
pub use reader::read;
pub use time::is_time_of_day;
pub use writer::{LogFormat, LogWriter};

use takt_rt::{Frame, Nanoseconds};

/// Which way a frame went, seen from the machine that wrote the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// That machine sent it.
    Sent,
    /// That machine received it.
    Received,
}

/// A frame of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoggedFrame<'a> {
    /// Since 1970-01-01 UTC, or since any other moment; 0 where the log has no times.
    pub at_ns: Nanoseconds,
    /// The name of the bus; empty where the log has none.
    pub bus: &'a str,
    /// Which way it went, where the log says so.
    pub direction: Option<Direction>,
    /// The frame.
    pub frame: Frame,
}
