//! The logger: empties the rings, reckons, writes. It never waits and holds nothing that the motion needs.

use std::fmt::Display;
use std::path::PathBuf;

use mcap::McapError;
use takt_rt::record::Event;
use takt_rt::time::Nanoseconds;

use super::candump::CandumpLog;
use super::destination::Destination;
use super::machine::Machine;
use super::recording::Recording;
use super::statistics::Statistics;
use super::wall_clock::WallClock;
use super::words;
use crate::bus::trace::Trace;
use crate::controller::channels::LogSide;

/// What a logger is to do.
pub struct LoggerOptions {
    /// Names and units.
    pub machine: Machine,
    /// The time of day of the run.
    pub wall_clock: WallClock,
    /// The monotonic time at which the run begins, for the names of files.
    pub started_ns: Nanoseconds,
    /// Where the MCAP recording goes; `None` makes none.
    pub recording: Option<Destination>,
    /// Where the candump log of `traces` goes; `None` makes none.
    pub candump: Option<Destination>,
    /// The buses to be logged.
    pub traces: Vec<Trace>,
}

/// Something that people may want to hear at once.
#[derive(Clone, Debug, PartialEq)]
pub enum Notice {
    /// Something happened; [`words::event`] says it.
    Event(Event),
    /// Something is no longer written: what, where and why. Said once; the motion goes on.
    NotWritten(String),
}

/// What a logger leaves behind.
#[derive(Clone, Debug)]
pub struct LogSummary {
    /// Names and units.
    pub machine: Machine,
    /// What was reckoned from the records.
    pub statistics: Statistics,
    /// Records that came through the ring.
    pub records: u64,
    /// Records that found no room in the ring.
    pub records_dropped: u64,
    /// Events that found no room in the ring.
    pub events_dropped: u64,
    /// Frames that found no room on their way to the candump log.
    pub frames_dropped: u64,
    /// The recording, if it was written to a file, even in part.
    pub recording: Option<PathBuf>,
    /// The candump log, if it was written to a file, even in part.
    pub candump: Option<PathBuf>,
    /// What was not written, or not to its end, and why.
    pub not_written: Vec<String>,
}

/// Empties the rings step by step. Nothing but [`Logger::drain`] and [`Logger::finish`] does any work, so in virtual
/// time the same run leaves the same files, byte for byte.
pub struct Logger {
    source: LogSide,
    machine: Machine,
    statistics: Statistics,
    recording: Option<Recording>,
    candump: Option<CandumpLog>,
    traces: Vec<Trace>,
    paths: [Option<PathBuf>; 2],
    not_written: Vec<String>,
    notify: Box<dyn FnMut(&Notice) + Send>,
}

impl Logger {
    /// Opens what is to be written. What cannot be opened is told to `notify` and left out. `notify` is also told of
    /// every event; it is called by whoever drains.
    pub fn new(source: LogSide, options: LoggerOptions, notify: Box<dyn FnMut(&Notice) + Send>) -> Self {
        let LoggerOptions { machine, wall_clock, started_ns, recording, candump, traces } = options;
        let stem = format!("{}-{}", machine.name, wall_clock.file_stamp(started_ns));
        let mut logger = Self {
            source,
            statistics: Statistics::new(machine.axes.len()),
            machine,
            recording: None,
            candump: None,
            traces,
            paths: [None, None],
            not_written: Vec::new(),
            notify,
        };
        if let Some(destination) = recording {
            logger.begin_recording(destination, &stem, wall_clock);
        }
        if let Some(destination) = candump {
            match destination.open(&stem, "log") {
                Ok(opened) => {
                    logger.paths[1].clone_from(&opened.path);
                    logger.candump = Some(CandumpLog::new(opened, wall_clock));
                }
                Err(error) => logger.give_up(&format!("no candump log: cannot write {error}")),
            }
        }
        logger
    }

    fn begin_recording(&mut self, destination: Destination, stem: &str, wall_clock: WallClock) {
        let opened = match destination.open(stem, "mcap") {
            Ok(opened) => opened,
            Err(error) => return self.give_up(&format!("no recording: cannot write {error}")),
        };
        self.paths[0].clone_from(&opened.path);
        let label = opened.label.clone();
        match Recording::begin(opened, &self.machine, wall_clock) {
            Ok(recording) => self.recording = Some(recording),
            Err(error) => {
                self.give_up(&format!("no recording: cannot write {label}: {}", reason(&error)));
            }
        }
    }

    /// Period of the cycle whose records come here.
    pub fn period_ns(&self) -> Nanoseconds {
        self.machine.cycle_ns
    }

    /// Takes and works off all that waits. Returns how many records and events that was.
    pub fn drain(&mut self) -> usize {
        let mut taken = 0;
        let mut failure = None;
        while let Some(written) = self.source.next_record(|record| {
            self.statistics.add(record);
            self.recording.as_mut().map_or(Ok(()), |recording| recording.cycle(record))
        }) {
            taken += 1;
            if let Err(error) = written {
                failure = self.recording.take().map(|recording| (recording.label, error));
            }
        }
        while let Some(event) = self.source.take_event() {
            taken += 1;
            let text = words::event(&event, &self.machine);
            if let Some(Err(error)) = self.recording.as_mut().map(|recording| recording.event(&event, &text))
            {
                failure = self.recording.take().map(|recording| (recording.label, error));
            }
            (self.notify)(&Notice::Event(event));
        }
        if let Some((label, error)) = failure {
            self.give_up(&format!("the recording ends here: cannot write {label}: {}", reason(&error)));
        }
        self.drain_traces();
        taken
    }

    fn drain_traces(&mut self) {
        let Some(log) = &mut self.candump else {
            return self.traces.iter_mut().for_each(|trace| while trace.take().is_some() {});
        };
        if let Err(error) = log.drain(&mut self.traces) {
            let label = log.label.clone();
            self.candump = None;
            self.give_up(&format!("the candump log ends here: cannot write {label}: {error}"));
        }
    }

    /// Works off the rest and closes the files.
    pub fn finish(mut self) -> LogSummary {
        self.drain();
        if let Some(recording) = self.recording.take() {
            let label = recording.label.clone();
            if let Err(error) = recording.finish() {
                self.give_up(&format!("the recording has no end: cannot write {label}: {}", reason(&error)));
            }
        }
        if let Some(log) = self.candump.take() {
            let label = log.label.clone();
            if let Err(error) = log.finish(&mut self.traces) {
                self.give_up(&format!("the candump log has no end: cannot write {label}: {error}"));
            }
        }
        let [recording, candump] = self.paths;
        LogSummary {
            machine: self.machine,
            statistics: self.statistics,
            records: self.source.records_written(),
            records_dropped: self.source.records_dropped(),
            events_dropped: self.source.events_dropped(),
            frames_dropped: self.traces.iter().map(Trace::dropped).sum(),
            recording,
            candump,
            not_written: self.not_written,
        }
    }

    fn give_up(&mut self, message: &str) {
        self.not_written.push(message.to_owned());
        (self.notify)(&Notice::NotWritten(message.to_owned()));
    }
}

/// The reason in an error of the MCAP writer, without what is clear from the context.
fn reason(error: &McapError) -> &dyn Display {
    match error {
        McapError::Io(error) => error,
        other => other,
    }
}
