//! The black box: the last seconds of cycles, events, frames, bus health, and of the journal. They are always in memory. At every incident
//! they are written to a file of their own, together with the half second that follows.
//!
//! One fault often leads to others. An incident within that half second goes into the same file. A run leaves at most
//! [`FILES`] files. If there are more incidents, the first ones and the last one are kept: the first ones show the cause,
//! the last one shows how the run ended.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use mcap::{McapError, McapResult};
use takt_rt::{
    CycleRecord, DriveState, Event, EventKind, Nanoseconds, Origin, Phase, Rule, StopCategory, StopCause,
    StopReason,
};

use super::announce;
use super::destination::{OpenError, Opened, RecordingDestination};
use super::files_in_memory::FilesInMemory;
use super::history::{Entry, History, OnBus};
use super::journal_history::JournalHistory;
use super::machine::Machine;
use super::recording::Recording;
use super::wall_clock::WallClock;
use super::words;
use crate::config::ConfigSources;
use crate::journal::RerunParts;
use crate::link::trace::{TracedFrame, TracedHealth};

/// The most files that a run leaves.
pub const FILES: usize = 16;
/// How long a file goes on after the last incident in it. Within this time the axes come to rest.
const AFTER_NS: Nanoseconds = 500_000_000;
/// How long a file goes on when incident follows incident.
const LONGEST_AFTER_NS: Nanoseconds = 5_000_000_000;
/// The name of the metadata record that describes the incident.
pub const METADATA: &str = "black_box";

/// Settings of the black box.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlackBoxOptions {
    /// The time span that it keeps.
    pub span_ns: Nanoseconds,
    /// The folder for its files. It is made if it does not exist.
    pub directory: PathBuf,
}

/// What makes the black box write a file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Incident {
    /// A group stopped for a fault.
    Stop {
        /// Which.
        group: Option<u8>,
        /// Why.
        stop: StopReason,
    },
    /// A drive reports a fault while the group is not enabled: no stop follows.
    Drive {
        /// The axis.
        axis: u8,
        /// Object 603F, where it is known.
        code: u16,
        /// The slot in which it was seen.
        slot: u64,
        /// What the group was doing.
        phase: Phase,
    },
    /// The real-time thread ended by itself.
    ThreadDied,
    /// The real-time loop stood still, and was given up.
    Stalled,
    /// A function that the caller gave to the run panicked, with this message.
    CallbackPanicked(String),
}

impl Incident {
    /// Its key, for the name of the file.
    pub fn key(&self) -> &'static str {
        match self {
            Self::Stop { stop, .. } => words::rule_key(stop.rule()),
            Self::Drive { .. } => words::rule_key(Rule::DriveFault),
            Self::ThreadDied => "thread_died",
            Self::Stalled => "stalled",
            Self::CallbackPanicked(_) => "callback_panicked",
        }
    }

    /// A sentence that says what happened.
    pub fn words(&self, machine: &Machine) -> String {
        match self {
            Self::Stop { stop, .. } => words::stop(stop, machine).to_string(),
            Self::Drive { axis, code, slot, phase } => {
                let as_stop = StopReason {
                    category: StopCategory::Zero,
                    cause: StopCause::Fault(takt_rt::Fault::DriveFault { error_code: *code }),
                    origin: Origin::Axis(*axis),
                    slot: *slot,
                    phase: *phase,
                };
                let cause = words::stop_cause(&as_stop, machine);
                format!("{cause} while {}; try: {}", words::phase(*phase), machine.drive_cure(*axis, *code))
            }
            Self::ThreadDied => "the real-time thread ended by itself".to_owned(),
            Self::Stalled => "the real-time loop stood still, and was given up".to_owned(),
            Self::CallbackPanicked(message) => format!("a function of the caller panicked: {message}"),
        }
    }

    /// The metadata record. `last_slot` is the last slot that was seen; it is used for an incident without a slot.
    fn metadata(&self, machine: &Machine, last_slot: u64) -> BTreeMap<String, String> {
        let mut metadata = BTreeMap::from([
            ("rule".to_owned(), self.key().to_owned()),
            ("reason".to_owned(), self.words(machine)),
            ("slot".to_owned(), last_slot.to_string()),
        ]);
        let mut add = |key: &str, value: String| {
            metadata.insert(key.to_owned(), value);
        };
        match self {
            Self::Stop { group, stop } => {
                if let Some(group) = group.filter(|_| machine.groups.len() > 1) {
                    add("group", machine.group_name(group));
                }
                add("slot", stop.slot.to_string());
                add("category", (stop.category as u8).to_string());
                add("phase", words::phase(stop.phase).to_owned());
                let (value, limit) = stop.cause.numbers();
                add("value", value.to_string());
                add("limit", limit.to_string());
                match stop.origin {
                    Origin::Group => {}
                    Origin::Axis(axis) => add("axis", machine.axis_name(axis)),
                    Origin::Bus(bus) => add("bus", machine.bus_name(bus)),
                }
            }
            Self::Drive { axis, code, slot, phase } => {
                add("slot", slot.to_string());
                add("phase", words::phase(*phase).to_owned());
                add("value", code.to_string());
                add("axis", machine.axis_name(*axis));
            }
            Self::ThreadDied | Self::Stalled | Self::CallbackPanicked(_) => {}
        }
        metadata
    }
}

/// A file that is being written.
struct OpenFile {
    recording: Recording,
    until_ns: Nanoseconds,
    latest_ns: Nanoseconds,
    stage: Stage,
}

/// How far a file is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Everything is written.
    Open,
    /// Its last cycle is written. The journal of that cycle is still on its way.
    LastCycleWritten,
    /// The next block of the journal is the last one that the file needs.
    AwaitsLastBlock,
}

/// Where the files are.
enum Place {
    Directory(PathBuf),
    Memory(FilesInMemory),
}

impl Place {
    fn open(&self, stem: &str) -> Result<Opened, OpenError> {
        match self {
            Self::Directory(directory) => {
                RecordingDestination::Directory(directory.clone()).open(stem, "mcap")
            }
            Self::Memory(files) => files.open(stem).open(stem, "mcap"),
        }
    }
}

/// The black box.
pub struct BlackBox {
    history: History,
    journal: Option<JournalHistory>,
    /// Entries of the journal that were lost. The file says so, and cannot be replayed.
    journal_lost: u64,
    place: Place,
    is_compressed: bool,
    wall_clock: WallClock,
    started_ns: Nanoseconds,
    drives: Vec<Option<DriveState>>,
    /// The group of each axis.
    groups: Vec<usize>,
    open: Option<OpenFile>,
    files: Vec<PathBuf>,
    replaced: u64,
    failure: Option<String>,
    has_failed: bool,
}

impl BlackBox {
    /// Allocates all memory of the black box, for a run that begins at `started_ns`.
    pub fn new(
        options: BlackBoxOptions,
        is_compressed: bool,
        machine: &Machine,
        wall_clock: WallClock,
        started_ns: Nanoseconds,
    ) -> Self {
        Self::new_in(
            Place::Directory(options.directory),
            options.span_ns,
            is_compressed,
            machine,
            wall_clock,
            started_ns,
        )
    }

    /// The same, with its files in memory.
    pub fn in_memory(
        span_ns: Nanoseconds,
        files: FilesInMemory,
        machine: &Machine,
        wall_clock: WallClock,
    ) -> Self {
        Self::new_in(Place::Memory(files), span_ns, false, machine, wall_clock, 0)
    }

    fn new_in(
        place: Place,
        span_ns: Nanoseconds,
        is_compressed: bool,
        machine: &Machine,
        wall_clock: WallClock,
        started_ns: Nanoseconds,
    ) -> Self {
        Self {
            history: History::new(span_ns, machine.cycle_ns, machine.axes.len(), machine.buses.len()),
            journal: None,
            journal_lost: 0,
            place,
            is_compressed,
            wall_clock,
            started_ns,
            drives: vec![None; machine.axes.len()],
            groups: machine.groups_of_axes(),
            open: None,
            files: Vec::new(),
            replaced: 0,
            failure: None,
            has_failed: false,
        }
    }

    /// Also keeps the journal, so that its files can be replayed.
    pub fn keep_journal(&mut self, parts: RerunParts, sources: &ConfigSources) {
        self.journal = Some(JournalHistory::new(self.history.span_ns(), parts, sources));
    }

    /// Adds what the journal has gained since the last call, and how many of its entries were lost until now.
    pub fn journal(&mut self, block: Option<Vec<u8>>, lost: u64) {
        let Some(journal) = &mut self.journal else { return };
        self.journal_lost = lost;
        if let Some(block) = block {
            if let Some(open) = &mut self.open
                && let Err(error) = open.recording.journal(&block)
            {
                return self.end_file(&error);
            }
            let (_, newest_cycle_ns) = self.history.last_slot().unwrap_or_default();
            journal.add(newest_cycle_ns, block);
        }
        if let Some(open) = &mut self.open {
            match open.stage {
                Stage::Open => {}
                Stage::LastCycleWritten => open.stage = Stage::AwaitsLastBlock,
                Stage::AwaitsLastBlock => self.close(),
            }
        }
    }

    /// Adds a cycle.
    pub fn cycle(&mut self, record: &CycleRecord) {
        self.history.cycle(record);
        let now_ns = record.timing.slot_start_ns;
        match &mut self.open {
            Some(open) if open.stage == Stage::Open && now_ns > open.until_ns => match self.journal {
                Some(_) => open.stage = Stage::LastCycleWritten,
                None => self.close(),
            },
            _ => {}
        }
        self.write(|recording| recording.cycle(record));
    }

    /// Adds an event and its text. Returns the incident, if the event is one.
    pub fn event(&mut self, event: &Event, text: &str) -> Option<Incident> {
        self.history.event(event);
        self.write(|recording| recording.event(event, text));
        match event.kind {
            EventKind::Stop(stop) if stop.rule() != Rule::Requested => {
                Some(Incident::Stop { group: event.group, stop })
            }
            EventKind::DriveState { axis, state, .. } => {
                let known = self.drives.get_mut(usize::from(axis))?.replace(state);
                let phase = self.history.last_phase(*self.groups.get(usize::from(axis))?);
                // While the group is enabled, the engine stops it and reports the fault. During bring-up, a fault is an old one.
                let is_new = known.is_some_and(|known| !known.is_faulted()) && state.is_faulted();
                let code = self.history.last_error_code(axis.into());
                (is_new && matches!(phase, Phase::Disabled | Phase::Disabling)).then_some(Incident::Drive {
                    axis,
                    code,
                    slot: event.slot,
                    phase,
                })
            }
            _ => None,
        }
    }

    /// Adds a frame.
    pub fn frame(&mut self, frame: &OnBus<TracedFrame>) {
        self.history.frame(frame);
        self.write(|recording| recording.frame(frame));
    }

    /// Adds a change of the health of a bus.
    pub fn health(&mut self, health: &OnBus<TracedHealth>) {
        self.history.health(health);
        self.write(|recording| recording.health(health));
    }

    /// Writes the history to a new file, or adds the incident to the file that is open.
    pub fn incident(&mut self, incident: &Incident, machine: &Machine) {
        let (slot, at_ns) = self.history.last_slot().unwrap_or((0, self.started_ns));
        if self.open.as_ref().is_some_and(|open| open.stage != Stage::Open) {
            self.close();
        }
        if let Some(open) = &mut self.open {
            open.until_ns = (at_ns + AFTER_NS).min(open.latest_ns);
            let metadata = incident.metadata(machine, slot);
            return self.write(|recording| recording.metadata(METADATA, metadata));
        }
        if let Some(last) = self.files.get(FILES - 1) {
            // The newest incident takes the last place. If the old file cannot be removed, it stays.
            let _ = fs::remove_file(last);
            self.files.truncate(FILES - 1);
            self.replaced += 1;
        }
        let stem =
            format!("{}-{}-black-box-{}", machine.name, self.wall_clock.file_stamp(at_ns), incident.key());
        let opened = match self.place.open(&stem) {
            Ok(opened) => opened,
            Err(error) => return self.fail(format!("no black box: cannot write {error}")),
        };
        self.files.extend(opened.path.clone());
        let label = opened.label.clone();
        let begun = Recording::begin(opened, machine, self.wall_clock, self.is_compressed).and_then(
            |mut recording| {
                recording.add_frames(machine)?;
                recording.metadata(METADATA, incident.metadata(machine, slot))?;
                self.journal.as_ref().map_or(Ok(()), |journal| journal.begin(&mut recording))?;
                write_history(&self.history, &mut recording, machine)?;
                self.journal.as_ref().map_or(Ok(()), |journal| journal.write(&mut recording))?;
                // From now on, the history before the incident is in the file.
                recording.end_chunk()?;
                Ok(recording)
            },
        );
        match begun {
            Ok(recording) => {
                announce::opened("black box", &label);
                self.open = Some(OpenFile {
                    recording,
                    until_ns: at_ns + AFTER_NS,
                    latest_ns: at_ns + LONGEST_AFTER_NS,
                    stage: Stage::Open,
                });
            }
            Err(error) => {
                self.fail(format!("the black box is incomplete: cannot write {label}: {}", reason(&error)))
            }
        }
    }

    /// Writes the end of the file that is open, if any.
    pub fn close(&mut self) {
        let Some(OpenFile { recording, .. }) = self.open.take() else { return };
        let label = recording.label.clone();
        let lost = self.journal.as_ref().map(|_| self.journal_lost);
        match recording.finish_with(lost) {
            Ok(()) => announce::closed("black box", &label),
            Err(error) => {
                self.fail(format!("the black box is incomplete: cannot write {label}: {}", reason(&error)))
            }
        }
    }

    /// What could not be written, and why. Only the first failure is reported.
    pub fn take_failure(&mut self) -> Option<String> {
        self.failure.take()
    }

    /// The files, complete or not, the oldest first.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// How many files were removed for later ones.
    pub fn replaced(&self) -> u64 {
        self.replaced
    }

    fn write(&mut self, write: impl FnOnce(&mut Recording) -> McapResult<()>) {
        let Some(open) = self.open.as_mut().filter(|open| open.stage == Stage::Open) else { return };
        if let Err(error) = write(&mut open.recording) {
            self.end_file(&error);
        }
    }

    /// Gives up the file that is open, which cannot be written any more.
    fn end_file(&mut self, error: &McapError) {
        let Some(OpenFile { recording, .. }) = self.open.take() else { return };
        self.fail(format!("the black box ends here: cannot write {}: {}", recording.label, reason(error)));
    }

    fn fail(&mut self, message: String) {
        if !std::mem::replace(&mut self.has_failed, true) {
            self.failure = Some(message);
        }
    }
}

fn write_history(history: &History, recording: &mut Recording, machine: &Machine) -> McapResult<()> {
    history.visit(|entry| match entry {
        Entry::Cycle(record) => recording.cycle(record),
        Entry::Event(event) => recording.event(event, &words::event(event, machine).to_string()),
        Entry::Frame(frame) => recording.frame(&frame),
        Entry::Health(health) => recording.health(health),
    })
}

/// The reason of an error of the MCAP writer, without its prefix.
pub fn reason(error: &McapError) -> String {
    match error {
        McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}
