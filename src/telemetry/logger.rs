//! The logger drains the rings, computes statistics and writes files. It never waits for the real-time thread, and the
//! real-time thread never waits for it.

use std::fs::File;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use mcap::McapError;
use takt_rt::{CycleRecord, Nanoseconds};
use takt_wire::printable::printable_path;

use super::announce;
use super::black_box::{BlackBox, BlackBoxOptions, Incident, reason};
use super::bus_load::BusLoad;
use super::candump::CandumpLog;
use super::destination::RecordingDestination;
use super::frame_feed::FrameFeed;
use super::history::OnBus;
use super::journal_keeper::JournalKeeper;
use super::listener::{Listener, Notice, Notify};
use super::loop_timing::ShownTimingWriter;
use super::machine::Machine;
use super::missed_slots::MissedSlotsSoFar;
use super::recording_series::{RecordingOptions, RecordingSeries};
use super::statistics::Statistics;
use super::wall_clock::WallClock;
use super::words;
use crate::channels::LogSide;
use crate::config::ConfigSources;
use crate::journal::{RerunParts, RunJournal};
use crate::link::trace::{Trace, Traced, TracedHealth};

/// What is to be done with the record of each cycle.
pub type EachCycle = Box<dyn FnMut(&CycleRecord) + Send>;

/// Settings of a logger.
pub struct LoggerOptions {
    /// Names and units.
    pub machine: Machine,
    /// The time of day of the run.
    pub wall_clock: WallClock,
    /// The monotonic time at which the run begins, for the names of files.
    pub started_ns: Nanoseconds,
    /// Where the MCAP recording goes; `None` makes none.
    pub recording: Option<RecordingDestination>,
    /// How it is written.
    pub recording_options: RecordingOptions,
    /// Where the candump log of `traces` goes; `None` makes none.
    pub candump: Option<RecordingDestination>,
    /// Settings of the black box; `None` makes none.
    pub black_box: Option<BlackBoxOptions>,
    /// The frames of the buses, for the candump log and the black box.
    pub traces: Vec<Trace>,
}

/// The result of a logger.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LogSummary {
    /// Names and units.
    pub machine: Machine,
    /// The statistics of the records.
    pub statistics: Statistics,
    /// Records that came through the ring.
    pub records: u64,
    /// Records that found no room in the ring.
    pub records_dropped: u64,
    /// Events that found no room in the ring.
    pub events_dropped: u64,
    /// Frames that found no room on their way to the candump log and the black box.
    pub frames_dropped: u64,
    /// The recording, if it was written to a file, even in part. Of several files, the last one.
    pub recording: Option<PathBuf>,
    /// The files of the recording before that one, the oldest first.
    pub earlier_recordings: Vec<PathBuf>,
    /// How many older files of the recording were removed.
    pub recordings_removed: u64,
    /// The candump log, if it was written to a file, even in part.
    pub candump: Option<PathBuf>,
    /// The files of the black box.
    pub black_boxes: BlackBoxes,
    /// The files that were not written, or not to their end, and why. If this is not empty, the run has lost data that it was
    /// asked to write.
    pub not_written: Vec<String>,
}

/// The files that the black box has left of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlackBoxes {
    /// Its files, complete or not, the oldest first.
    pub files: Vec<PathBuf>,
    /// How many files were removed for later ones.
    pub replaced: u64,
}

/// Drains the rings step by step. Only [`Logger::drain`] and [`Logger::finish`] do any work. So in virtual time the same run
/// leaves the same files, byte for byte.
pub struct Logger {
    source: LogSide,
    machine: Machine,
    missed_slots: MissedSlotsSoFar,
    statistics: Statistics,
    recording: Option<RecordingSeries>,
    candump: Option<CandumpLog>,
    black_box: Option<BlackBox>,
    each_cycle: Option<EachCycle>,
    timing: Option<ShownTimingWriter>,
    traces: Vec<Trace>,
    frames: Option<Arc<FrameFeed>>,
    /// In the order of the traces.
    loads: Vec<Option<BusLoad>>,
    journal: Option<JournalKeeper>,
    /// The files of the recording when it has ended, and how many were removed.
    recorded: (Vec<PathBuf>, u64),
    candump_path: Option<PathBuf>,
    not_written: Vec<String>,
    listener: Listener,
}

impl Logger {
    /// Opens the files. A file that cannot be opened is reported to `notify` and left out. `notify` also gets every event. It
    /// is called in the thread that drains. After a panic it is never called again; see [`Self::panic`].
    pub fn new(source: LogSide, options: LoggerOptions, notify: Notify) -> Self {
        let LoggerOptions {
            machine,
            wall_clock,
            started_ns,
            recording,
            recording_options,
            candump,
            black_box,
            traces,
        } = options;
        let stem = format!("{}-{}", machine.name, wall_clock.file_stamp(started_ns));
        let is_compressed = recording_options.is_compressed;
        let black_box =
            black_box.map(|options| BlackBox::new(options, is_compressed, &machine, wall_clock, started_ns));
        let loads = machine.buses.iter().map(BusLoad::of).collect();
        let mut logger = Self {
            source,
            statistics: Statistics::new(machine.groups_of_axes()),
            machine,
            missed_slots: MissedSlotsSoFar::default(),
            recording: None,
            candump: None,
            black_box,
            each_cycle: None,
            timing: None,
            traces,
            frames: None,
            loads,
            journal: None,
            recorded: (Vec::new(), 0),
            candump_path: None,
            not_written: Vec::new(),
            listener: Listener::new(notify),
        };
        if let Some(destination) = recording {
            logger.begin_recording(destination, &stem, wall_clock, recording_options);
        }
        if let Some(destination) = candump {
            match destination.open(&stem, "log") {
                Ok(opened) => {
                    logger.candump_path.clone_from(&opened.path);
                    announce::opened("candump log", &opened.label);
                    logger.candump = Some(CandumpLog::new(opened, wall_clock));
                }
                Err(error) => logger.report_failure(format!("no candump log: cannot write {error}")),
            }
        }
        logger
    }

    /// Also calls this with the record of each cycle, in the thread that drains. It must not panic.
    #[must_use]
    pub(crate) fn with_each_cycle(self, each_cycle: Option<EachCycle>) -> Self {
        Self { each_cycle, ..self }
    }

    /// Also passes the frames of the buses there.
    #[must_use]
    pub(crate) fn with_frames(self, frames: Option<Arc<FrameFeed>>) -> Self {
        Self { frames, ..self }
    }

    /// Also keeps this black box.
    #[must_use]
    pub fn with_black_box(self, black_box: BlackBox) -> Self {
        Self { black_box: Some(black_box), ..self }
    }

    /// Also writes the journal of the run, and the files of its configuration, into the recording, if there is one; and into the files of
    /// the black box, if there is one and `again` runs the engine once more for it.
    #[must_use]
    pub fn with_journal(
        mut self,
        journal: Option<RunJournal>,
        again: Option<RerunParts>,
        sources: &ConfigSources,
    ) -> Self {
        let begun = self.recording.as_mut().map(|recording| recording.begin_journal(sources));
        if let Some(Err(error)) = begun {
            self.end_recording(&error);
        }
        if let (Some(black_box), Some(again)) = (&mut self.black_box, again) {
            black_box.keep_journal(again, sources);
        }
        self.journal = journal.map(JournalKeeper::new);
        self
    }

    /// Also counts the times of each cycle, and shows the counts.
    #[must_use]
    pub(crate) fn with_timing(self, timing: ShownTimingWriter) -> Self {
        Self { timing: Some(timing), ..self }
    }

    fn begin_recording(
        &mut self,
        destination: RecordingDestination,
        stem: &str,
        wall_clock: WallClock,
        options: RecordingOptions,
    ) {
        match RecordingSeries::begin(destination, stem, options, &self.machine, wall_clock) {
            Ok(recording) => self.recording = Some(recording),
            Err(error) => {
                self.recorded.0.extend(error.path());
                self.report_failure(format!("no recording: cannot write {error}"));
            }
        }
    }

    /// Period of the cycle whose records come here.
    pub fn period_ns(&self) -> Nanoseconds {
        self.machine.cycle_ns
    }

    /// The message of the panic of `notify`, if it has panicked. Any thread can read it.
    pub fn panic(&self) -> Arc<OnceLock<String>> {
        Arc::clone(&self.listener.panic)
    }

    /// Processes all waiting records, events and frames. Returns the number of records and events.
    pub fn drain(&mut self) -> usize {
        if let Some(journal) = &mut self.journal {
            journal.begin_block();
        }
        self.drain_traces();
        let taken = self.drain_records() + self.drain_events();
        self.drain_journal();
        if let Some(message) = self.black_box.as_mut().and_then(BlackBox::take_failure) {
            self.report_failure(message);
        }
        taken
    }

    fn drain_records(&mut self) -> usize {
        let mut taken = 0;
        while let Some(written) = self.source.next_record(|record| {
            self.statistics.add(record);
            if let Some(timing) = &mut self.timing {
                timing.add(&record.timing);
            }
            if let Some(each_cycle) = &mut self.each_cycle {
                each_cycle(record);
            }
            if let Some(black_box) = &mut self.black_box {
                black_box.cycle(record);
            }
            self.recording.as_mut().map_or(Ok(()), |recording| recording.cycle(record))
        }) {
            taken += 1;
            let rotated =
                written.and_then(|()| self.recording.as_mut().map_or(Ok(()), RecordingSeries::rotate));
            if let Err(error) = rotated {
                self.end_recording(&error);
            }
        }
        if let Some(timing) = self.timing.as_mut().filter(|_| taken > 0) {
            timing.show();
        }
        taken
    }

    fn drain_events(&mut self) -> usize {
        let mut taken = 0;
        let mut incidents = Vec::new();
        while let Some(event) = self.source.take_event() {
            taken += 1;
            let text = words::event(&event, &self.machine).to_string();
            if let Some(told) = self.missed_slots.told(event) {
                announce::event(&told, &words::event(&told, &self.machine).to_string(), &self.machine);
            }
            let written = self.recording.as_mut().map(|recording| recording.event(&event, &text));
            if let Some(Err(error)) = written {
                self.end_recording(&error);
            }
            incidents.extend(self.black_box.as_mut().and_then(|black_box| black_box.event(&event, &text)));
            if self.listener.notify(&Notice::Event(event)).is_err() {
                incidents.extend(self.listener.incident());
            }
        }
        // A stop names the file. The drive fault that caused the stop may be seen after the power was removed: that is not
        // a second incident.
        incidents.sort_by_key(|incident| !matches!(incident, Incident::Stop { .. }));
        if matches!(incidents.first(), Some(Incident::Stop { .. })) {
            incidents.retain(|incident| !matches!(incident, Incident::Drive { .. }));
        }
        incidents.iter().for_each(|incident| self.incident(incident));
        taken
    }

    /// Makes the black box write a file for this incident.
    pub fn incident(&mut self, incident: &Incident) {
        if let Some(black_box) = &mut self.black_box {
            black_box.incident(incident, &self.machine);
        }
    }

    /// Ends the recording, which cannot be written any more.
    fn end_recording(&mut self, error: &McapError) {
        let Some(recording) = self.recording.take() else { return };
        self.recorded = (recording.files().to_vec(), recording.removed());
        let label = recording.label().to_owned();
        self.report_failure(format!("the recording ends here: cannot write {label}: {}", reason(error)));
    }

    /// Writes what the buses are like.
    fn write_health(&mut self, health: &[OnBus<TracedHealth>]) {
        for health in health {
            if let Some(black_box) = &mut self.black_box {
                black_box.health(health);
            }
            let written = self.recording.as_mut().map(|recording| recording.health(health));
            if let Some(Err(error)) = written {
                self.end_recording(&error);
            }
        }
    }

    fn drain_traces(&mut self) {
        let mut healths = Vec::new();
        let feed = self.frames.as_ref().filter(|feed| feed.is_read());
        let mut read = Vec::new();
        for (bus, trace) in self.traces.iter_mut().enumerate() {
            while let Some(traced) = trace.take_any() {
                if let Some(journal) = &mut self.journal {
                    journal.port(bus, &traced);
                }
                let Traced::Frame(what) = traced else { continue };
                let load = self.loads.get_mut(bus).and_then(Option::as_mut);
                healths.extend(load.and_then(|load| load.frame(&what)).map(|what| OnBus { bus, what }));
                let frame = OnBus { bus, what };
                if let Some(black_box) = &mut self.black_box {
                    black_box.frame(&frame);
                }
                if let Some(log) = &mut self.candump {
                    log.add(&frame);
                }
                read.extend(feed.map(|_| frame));
            }
            while let Some(what) = trace.take_health() {
                let load = self.loads.get_mut(bus).and_then(Option::as_mut);
                healths.push(OnBus { bus, what: load.map_or(what, |load| load.change(&what)) });
            }
        }
        if let Some(feed) = feed {
            feed.pass(&read);
        }
        self.write_health(&healths);
        if let Some(log) = &mut self.candump
            && let Err(error) = log.write(&self.traces)
        {
            let label = log.label.clone();
            self.candump = None;
            self.report_failure(format!("the candump log ends here: cannot write {label}: {error}"));
        }
    }

    fn drain_journal(&mut self) {
        let Some(journal) = &mut self.journal else { return };
        let block = journal.end_block();
        let written =
            self.recording.as_mut().zip(block.as_ref()).map(|(recording, block)| recording.journal(block));
        if let Some(Err(error)) = written {
            self.end_recording(&error);
        }
        let lost = self.journal_lost().unwrap_or(0);
        if let Some(black_box) = &mut self.black_box {
            black_box.journal(block, lost);
        }
    }

    /// Entries of the journal that found no room; `None` without a journal.
    fn journal_lost(&self) -> Option<u64> {
        let frames = || self.traces.iter().map(Trace::dropped).sum::<u64>();
        self.journal.as_ref().map(|journal| journal.dropped() + frames())
    }

    /// Processes the rest and closes the files.
    pub fn finish(mut self) -> LogSummary {
        self.drain();
        if let Some(recording) = self.recording.take() {
            let label = recording.label().to_owned();
            self.recorded = (recording.files().to_vec(), recording.removed());
            match recording.finish_with(self.journal_lost()) {
                Ok(()) => announce::closed("recording", &label),
                Err(error) => self.report_failure(format!(
                    "the recording is incomplete: cannot write {label}: {}",
                    reason(&error)
                )),
            }
        }
        if let Some(log) = self.candump.take() {
            let label = log.label.clone();
            match log.finish(&self.traces) {
                Ok(()) => announce::closed("candump log", &label),
                Err(error) => self
                    .report_failure(format!("the candump log is incomplete: cannot write {label}: {error}")),
            }
        }
        let mut black_boxes = BlackBoxes::default();
        if let Some(mut black_box) = self.black_box.take() {
            black_box.close();
            if let Some(message) = black_box.take_failure() {
                self.report_failure(message);
            }
            black_boxes = BlackBoxes { files: black_box.files().to_vec(), replaced: black_box.replaced() };
        }
        let (recorded, recordings_removed) = std::mem::take(&mut self.recorded);
        let mut earlier_recordings: Vec<PathBuf> =
            recorded.into_iter().filter_map(|path| self.verified(Some(path))).collect();
        let recording = earlier_recordings.pop();
        let candump = self.candump_path.take();
        let candump = self.verified(candump);
        black_boxes.files =
            black_boxes.files.into_iter().filter_map(|path| self.verified(Some(path))).collect();
        let (records_dropped, events_dropped) = (self.source.records_dropped(), self.source.events_dropped());
        let frames_dropped = self.traces.iter().map(Trace::dropped).sum();
        announce::dropped(records_dropped, events_dropped, frames_dropped);
        LogSummary {
            machine: self.machine,
            statistics: self.statistics,
            records: self.source.records_written(),
            records_dropped,
            events_dropped,
            frames_dropped,
            recording,
            earlier_recordings,
            recordings_removed,
            candump,
            black_boxes,
            not_written: self.not_written,
        }
    }

    /// Checks that a file exists and is on the disk. Writing succeeds although the file was removed during the run. It also
    /// succeeds on a failed disk or a read-only file system, until the data is synced.
    fn verified(&mut self, path: Option<PathBuf>) -> Option<PathBuf> {
        let path = path?;
        if !path.exists() {
            self.report_failure(format!("{} was removed during the run", printable_path(&path)));
            return None;
        }
        if let Err(error) = File::open(&path).and_then(|file| file.sync_data()) {
            self.report_failure(format!(
                "{} may be incomplete: cannot write it to the disk: {error}",
                printable_path(&path)
            ));
        }
        Some(path)
    }

    fn report_failure(&mut self, message: String) {
        announce::not_written(&message);
        self.not_written.push(message.clone());
        if self.listener.notify(&Notice::NotWritten(message)).is_err()
            && let Some(incident) = self.listener.incident()
        {
            self.incident(&incident);
        }
    }
}
