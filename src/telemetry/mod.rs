//! What becomes visible of a run: statistics, recordings, the report, and everything said in words.
//!
//! The real-time thread leaves a record of every cycle and an event for whatever happens in lock-free rings
//! ([`crate::controller::channels`]). A [`Logger`] empties them: as a thread of its own that is not real-time
//! ([`LoggerThread`]), or step by step in virtual time. Nothing that goes wrong here ever reaches the motion: a full
//! ring drops and counts, a full disk ends the recording with one message, a caller's function that panics is not called
//! again.
//!
//! The last seconds are also kept in memory, frames included, and written to a file of their own at every [`Fault`]:
//! the black box ([`BlackBoxOptions`]). [`Recorded`] reads such files and recordings again, and [`RecordingReport`] says
//! what they tell.

mod black_box;
mod candump;
mod cdr;
mod destination;
mod listener;
mod logger;
mod machine;
mod messages;
mod past;
pub(crate) mod picture;
mod realtime;
mod recorded;
mod recording;
mod recording_report;
mod report;
mod statistics;
mod thread;
mod wall_clock;
pub mod words;

pub use black_box::{BlackBoxOptions, Fault};
pub use destination::Destination;
pub use listener::{Notify, panic_message};
pub use logger::{BlackBoxes, LogSummary, Logger, LoggerOptions, Notice};
pub use machine::{AxisDescription, BusDescription, Machine, SetPointMagnitudes, Unit};
pub use picture::Emphasis;
pub use recorded::{Cause, Recorded, RecordedCycle, RecordedError, RecordedEvent, WalkError};
pub use recording_report::{AxisCycle, AxisCycles, AxisSummary, BusChange, RecordingReport, ReportedEvent};
pub use report::{
    AxisReport, BusReport, LatencyReport, RealtimeReport, RunOutcome, RunReport, SetPointParts, StopReport,
    TelemetryReport,
};
pub use statistics::{AxisStatistics, FollowingErrorMaximum, Latency, Statistics};
pub use thread::LoggerThread;
pub use wall_clock::WallClock;
