//! What a run makes visible: statistics, recordings, reports, and texts about events.
//!
//! The real-time thread puts a record of every cycle, and an event for each change, into lock-free rings
//! ([`LogSide`] reads them). A [`Logger`] empties them, in a thread of its own that is not real-time
//! (`LoggerThread`), or step by step in virtual time. A failure in this module never reaches the motion. A full ring
//! drops records and counts them. A full disk ends the recording with one message. A caller's function that panics is not
//! called again.
//!
//! The black box ([`BlackBoxOptions`]) keeps the last seconds in memory, frames included. It writes them to a file of
//! their own at every [`Incident`]. [`Recorded`] reads such files and recordings, and [`RecordingReport`] summarises them.

mod announce;
mod black_box;
mod bus_load;
mod candump;
mod cdr;
#[cfg_attr(not(target_os = "linux"), path = "compression_elsewhere.rs")]
mod compression;
mod destination;
mod files_in_memory;
mod frame_feed;
mod history;
mod journal_history;
mod journal_keeper;
mod listener;
mod logger;
mod loop_timing;
mod machine;
mod messages;
#[doc(hidden)]
pub mod missed_slots;
mod own_errors;
#[cfg(target_os = "linux")]
mod realtime;
mod recorded;
mod recording;
mod recording_report;
mod recording_series;
#[doc(hidden)]
pub mod render;
mod replay_recording;
mod report;
mod severity;
mod statistics;
#[cfg(target_os = "linux")]
pub(crate) mod thread;
mod wall_clock;
#[doc(hidden)]
pub mod words;

pub use crate::channels::LogSide;
#[doc(hidden)]
pub use black_box::BlackBox;
pub use black_box::{BlackBoxOptions, Incident};
pub use cdr::{CdrDecoder, CdrEncoder};
pub use destination::RecordingDestination;
#[doc(hidden)]
pub use files_in_memory::{FileInMemory, FilesInMemory};
pub use frame_feed::{FrameFeed, FrameReader};
#[doc(hidden)]
pub use history::OnBus;
pub use listener::{Notice, Notify};
pub use logger::{BlackBoxes, EachCycle, LogSummary, Logger, LoggerOptions};
#[doc(hidden)]
pub use loop_timing::{LOOP_TIMING_WORDS, newest_timing};
pub use loop_timing::{LoopTiming, TIME_BOUNDS_NS, TimeCounts};
pub(crate) use loop_timing::{ShownTiming, shown_timing};
pub use machine::{AxisDescription, BusDescription, Machine, SetPointMagnitudes, Unit};
pub use recorded::frames as recorded_frames;
pub use recorded::{
    Cause, Recorded, RecordedCycle, RecordedError, RecordedEvent, RecordedFrame, RecordedFrames,
    RecordedLoad, WalkError,
};
#[doc(hidden)]
pub use recorded::{
    JournalDefect, RecordedJournal, journal as recorded_journal,
    journal_in_memory as recorded_journal_in_memory,
};
pub use recording_report::{
    AxisCycle, AxisCycles, AxisSummary, BusChange, BusLoadSummary, GroupSummary, RecordingReport,
    ReportedEvent,
};
pub use recording_series::RecordingOptions;
pub use render::Emphasis;
#[doc(hidden)]
pub use replay_recording::{ReplayRecording, ReplayRecordingError};
pub use report::{
    AxisReport, BusReport, GroupReport, LatencyReport, RealtimeReport, RunEnd, RunOutcome, RunReport,
    SetPointParts, StopReport, TelemetryReport,
};
#[doc(hidden)]
pub use severity::Severity;
pub use statistics::{AxisStatistics, FollowingErrorMaximum, Latency, Statistics};
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub use thread::LoggerThread;
pub use wall_clock::WallClock;
pub use words::{event as event_words, phase as phase_words};
