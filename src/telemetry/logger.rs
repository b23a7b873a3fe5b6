//! The logger: empties the rings, reckons, writes. It never waits and holds nothing that the motion needs.

use std::fs::File;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use mcap::McapError;
use takt_rt::{Event, Nanoseconds};

use super::black_box::{BlackBox, BlackBoxOptions, Fault, reason};
use super::candump::CandumpLog;
use super::destination::Destination;
use super::listener::{Listener, Notify};
use super::machine::Machine;
use super::past::OnBus;
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
    /// What is kept and written at a fault; `None` has no black box.
    pub black_box: Option<BlackBoxOptions>,
    /// The buses whose frames are to be logged or kept.
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
    /// Frames that found no room on their way to the candump log and the black box.
    pub frames_dropped: u64,
    /// The recording, if it was written to a file, even in part.
    pub recording: Option<PathBuf>,
    /// The candump log, if it was written to a file, even in part.
    pub candump: Option<PathBuf>,
    /// What the black box left.
    pub black_boxes: BlackBoxes,
    /// What was not written, or not to its end, and why.
    pub not_written: Vec<String>,
}

/// What the black box has left of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlackBoxes {
    /// Its files, even if only in part, the oldest first.
    pub files: Vec<PathBuf>,
    /// Files that had to make room for later ones.
    pub replaced: u64,
}

/// Empties the rings step by step. Nothing but [`Logger::drain`] and [`Logger::finish`] does any work, so in virtual
/// time the same run leaves the same files, byte for byte.
pub struct Logger {
    source: LogSide,
    machine: Machine,
    statistics: Statistics,
    recording: Option<Recording>,
    candump: Option<CandumpLog>,
    black_box: Option<BlackBox>,
    traces: Vec<Trace>,
    paths: [Option<PathBuf>; 2],
    not_written: Vec<String>,
    listener: Listener,
}

impl Logger {
    /// Opens what is to be written. What cannot be opened is told to `notify` and left out. `notify` is also told of
    /// every event; it is called by whoever drains. When it panics it is never called again; see [`Self::panic`].
    pub fn new(source: LogSide, options: LoggerOptions, notify: Notify) -> Self {
        let LoggerOptions { machine, wall_clock, started_ns, recording, candump, black_box, traces } =
            options;
        let stem = format!("{}-{}", machine.name, wall_clock.file_stamp(started_ns));
        let black_box = black_box.map(|options| BlackBox::new(options, &machine, wall_clock, started_ns));
        let mut logger = Self {
            source,
            statistics: Statistics::new(machine.axes.len()),
            machine,
            recording: None,
            candump: None,
            black_box,
            traces,
            paths: [None, None],
            not_written: Vec::new(),
            listener: Listener::new(notify),
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
                Err(error) => logger.give_up(format!("no candump log: cannot write {error}")),
            }
        }
        logger
    }

    fn begin_recording(&mut self, destination: Destination, stem: &str, wall_clock: WallClock) {
        let opened = match destination.open(stem, "mcap") {
            Ok(opened) => opened,
            Err(error) => return self.give_up(format!("no recording: cannot write {error}")),
        };
        self.paths[0].clone_from(&opened.path);
        let label = opened.label.clone();
        match Recording::begin(opened, &self.machine, wall_clock) {
            Ok(recording) => self.recording = Some(recording),
            Err(error) => {
                self.give_up(format!("no recording: cannot write {label}: {}", reason(&error)));
            }
        }
    }

    /// Period of the cycle whose records come here.
    pub fn period_ns(&self) -> Nanoseconds {
        self.machine.cycle_ns
    }

    /// What `notify` said when it panicked, if it has; it can be asked from any thread.
    pub fn panic(&self) -> Arc<OnceLock<String>> {
        Arc::clone(&self.listener.panic)
    }

    /// Takes and works off all that waits. Returns how many records and events that was.
    pub fn drain(&mut self) -> usize {
        self.drain_traces();
        let taken = self.drain_records() + self.drain_events();
        if let Some(message) = self.black_box.as_mut().and_then(BlackBox::take_failure) {
            self.give_up(message);
        }
        taken
    }

    fn drain_records(&mut self) -> usize {
        let mut taken = 0;
        let mut failure = None;
        while let Some(written) = self.source.next_record(|record| {
            self.statistics.add(record);
            if let Some(black_box) = &mut self.black_box {
                black_box.cycle(record);
            }
            self.recording.as_mut().map_or(Ok(()), |recording| recording.cycle(record))
        }) {
            taken += 1;
            if let Err(error) = written {
                failure = self.recording.take().map(|recording| (recording.label, error));
            }
        }
        self.end_recording(failure);
        taken
    }

    fn drain_events(&mut self) -> usize {
        let mut taken = 0;
        let mut faults = Vec::new();
        while let Some(event) = self.source.take_event() {
            taken += 1;
            let text = words::event(&event, &self.machine);
            let written = self.recording.as_mut().map(|recording| recording.event(&event, &text));
            if let Some(Err(error)) = written {
                let failure = self.recording.take().map(|recording| (recording.label, error));
                self.end_recording(failure);
            }
            faults.extend(self.black_box.as_mut().and_then(|black_box| black_box.event(&event, &text)));
            if self.listener.tell(&Notice::Event(event)).is_err() {
                faults.extend(self.listener.fault());
            }
        }
        // The file bears the name of the stop, if there is one. A drive whose fault made the group stop may be without
        // power by now, which makes it no second fault.
        faults.sort_by_key(|fault| !matches!(fault, Fault::Stop(_)));
        if matches!(faults.first(), Some(Fault::Stop(_))) {
            faults.retain(|fault| !matches!(fault, Fault::Drive { .. }));
        }
        faults.iter().for_each(|fault| self.fault(fault));
        taken
    }

    /// Has the black box written because of this.
    pub fn fault(&mut self, fault: &Fault) {
        if let Some(black_box) = &mut self.black_box {
            black_box.fault(fault, &self.machine);
        }
    }

    fn end_recording(&mut self, failure: Option<(String, McapError)>) {
        if let Some((label, error)) = failure {
            self.give_up(format!("the recording ends here: cannot write {label}: {}", reason(&error)));
        }
    }

    fn drain_traces(&mut self) {
        for (bus, trace) in self.traces.iter_mut().enumerate() {
            while let Some(what) = trace.take() {
                let frame = OnBus { bus, what };
                if let Some(black_box) = &mut self.black_box {
                    black_box.frame(&frame);
                }
                if let Some(log) = &mut self.candump {
                    log.add(&frame);
                }
            }
            while let Some(what) = trace.take_health() {
                if let Some(black_box) = &mut self.black_box {
                    black_box.health(&OnBus { bus, what });
                }
            }
        }
        if let Some(log) = &mut self.candump
            && let Err(error) = log.write(&self.traces)
        {
            let label = log.label.clone();
            self.candump = None;
            self.give_up(format!("the candump log ends here: cannot write {label}: {error}"));
        }
    }

    /// Works off the rest and closes the files.
    pub fn finish(mut self) -> LogSummary {
        self.drain();
        if let Some(recording) = self.recording.take() {
            let label = recording.label.clone();
            if let Err(error) = recording.finish() {
                self.give_up(format!("the recording has no end: cannot write {label}: {}", reason(&error)));
            }
        }
        if let Some(log) = self.candump.take() {
            let label = log.label.clone();
            if let Err(error) = log.finish(&self.traces) {
                self.give_up(format!("the candump log has no end: cannot write {label}: {error}"));
            }
        }
        let mut black_boxes = BlackBoxes::default();
        if let Some(mut black_box) = self.black_box.take() {
            black_box.close();
            if let Some(message) = black_box.take_failure() {
                self.give_up(message);
            }
            black_boxes = BlackBoxes { files: black_box.files().to_vec(), replaced: black_box.replaced() };
        }
        let [recording, candump] = std::mem::take(&mut self.paths);
        let [recording, candump] = [recording, candump].map(|path| self.still_there(path));
        black_boxes.files =
            black_boxes.files.into_iter().filter_map(|path| self.still_there(Some(path))).collect();
        LogSummary {
            machine: self.machine,
            statistics: self.statistics,
            records: self.source.records_written(),
            records_dropped: self.source.records_dropped(),
            events_dropped: self.source.events_dropped(),
            frames_dropped: self.traces.iter().map(Trace::dropped).sum(),
            recording,
            candump,
            black_boxes,
            not_written: self.not_written,
        }
    }

    /// A file that somebody has removed during the run is none: writing to it goes on to the end, into nothing. So it does
    /// on a disk that has failed or a file system that has turned read-only, which is not told before one asks.
    fn still_there(&mut self, path: Option<PathBuf>) -> Option<PathBuf> {
        let path = path?;
        if !path.exists() {
            self.give_up(format!("{} was removed during the run", path.display()));
            return None;
        }
        if let Err(error) = File::open(&path).and_then(|file| file.sync_data()) {
            self.give_up(format!(
                "{} may not be whole: cannot bring it to the disk: {error}",
                path.display()
            ));
        }
        Some(path)
    }

    fn give_up(&mut self, message: String) {
        self.not_written.push(message.clone());
        if self.listener.tell(&Notice::NotWritten(message)).is_err()
            && let Some(fault) = self.listener.fault()
        {
            self.fault(&fault);
        }
    }
}
