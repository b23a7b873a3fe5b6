//! The black box: the last seconds of cycles, events, frames and the health of the buses, always in memory, and written
//! to a file of their own at every fault, with what led to it and half a second of what came of it.
//!
//! A fault in a run is seldom alone: what follows within that half second goes to the same file. A run leaves
//! [`FILES`] files at most. When there are more faults, the first ones and the very last one are kept: the first ones
//! are the causes, and the last one is how it ended.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use mcap::{McapError, McapResult};
use takt_rt::{
    CycleRecord, DriveState, Event, EventKind, Nanoseconds, Origin, Phase, Rule, StopCategory, StopCause,
    StopReason,
};

use super::destination::Destination;
use super::machine::Machine;
use super::past::{Entry, OnBus, Past};
use super::recording::Recording;
use super::wall_clock::WallClock;
use super::words;
use crate::bus::trace::{TracedFrame, TracedHealth};

/// Files that a run leaves at most.
pub const FILES: usize = 16;
/// How long a file goes on after the last fault in it: the way to rest.
const AFTER_NS: Nanoseconds = 500_000_000;
/// How long a file goes on when fault follows fault.
const LONGEST_AFTER_NS: Nanoseconds = 5_000_000_000;
/// The name of the metadata record with the fault.
pub const METADATA: &str = "black_box";

/// What the black box is to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlackBoxOptions {
    /// How much of the past it keeps.
    pub span_ns: Nanoseconds,
    /// The folder for its files. It is made if it does not exist.
    pub directory: PathBuf,
}

/// What makes the black box write a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// The group stopped, and nobody had asked for it.
    Stop(StopReason),
    /// A drive reports a fault while the group is not under power, so that there is nothing to stop.
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
    /// A function that the caller gave to the run panicked: what it said.
    CallbackPanicked(String),
}

impl Fault {
    /// The rule by its key, for the name of the file.
    pub fn key(&self) -> &'static str {
        match self {
            Self::Stop(stop) => words::rule_key(stop.rule()),
            Self::Drive { .. } => words::rule_key(Rule::DriveFault),
            Self::ThreadDied => "thread_died",
            Self::CallbackPanicked(_) => "callback_panicked",
        }
    }

    /// What happened, in words.
    pub fn words(&self, machine: &Machine) -> String {
        match self {
            Self::Stop(stop) => words::stop(stop, machine),
            Self::Drive { axis, code, slot, phase } => {
                let as_stop = StopReason {
                    category: StopCategory::Zero,
                    cause: StopCause::Fault(takt_rt::Fault::DriveFault { error_code: *code }),
                    origin: Origin::Axis(*axis),
                    slot: *slot,
                    phase: *phase,
                };
                format!("{} while {}", words::stop_cause(&as_stop, machine), words::phase(*phase))
            }
            Self::ThreadDied => "the real-time thread ended by itself".to_owned(),
            Self::CallbackPanicked(message) => format!("a function of the caller panicked: {message}"),
        }
    }

    /// `last_slot` is the last one that was seen, where the fault has none of its own.
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
            Self::Stop(stop) => {
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
            Self::ThreadDied | Self::CallbackPanicked(_) => {}
        }
        metadata
    }
}

/// A file that is being written.
struct OpenFile {
    recording: Recording,
    until_ns: Nanoseconds,
    latest_ns: Nanoseconds,
}

/// The black box.
pub struct BlackBox {
    past: Past,
    directory: PathBuf,
    wall_clock: WallClock,
    started_ns: Nanoseconds,
    drives: Vec<Option<DriveState>>,
    open: Option<OpenFile>,
    files: Vec<PathBuf>,
    replaced: u64,
    failure: Option<String>,
    has_failed: bool,
}

impl BlackBox {
    /// A black box with all its memory, of a run that begins now.
    pub fn new(
        options: BlackBoxOptions,
        machine: &Machine,
        wall_clock: WallClock,
        started_ns: Nanoseconds,
    ) -> Self {
        Self {
            past: Past::new(options.span_ns, machine.cycle_ns, machine.axes.len(), machine.buses.len()),
            directory: options.directory,
            wall_clock,
            started_ns,
            drives: vec![None; machine.axes.len()],
            open: None,
            files: Vec::new(),
            replaced: 0,
            failure: None,
            has_failed: false,
        }
    }

    /// Takes a cycle.
    pub fn cycle(&mut self, record: &CycleRecord) {
        self.past.cycle(record);
        let now_ns = record.timing.slot_start_ns;
        if self.open.as_ref().is_some_and(|open| now_ns > open.until_ns) {
            self.close();
        }
        self.write(|recording| recording.cycle(record));
    }

    /// Takes an event, which is also said in words, and says whether it is a fault.
    pub fn event(&mut self, event: &Event, text: &str) -> Option<Fault> {
        self.past.event(event);
        self.write(|recording| recording.event(event, text));
        match event.kind {
            EventKind::Stop(stop) if stop.rule() != Rule::Requested => Some(Fault::Stop(stop)),
            EventKind::DriveState { axis, state, .. } => {
                let known = self.drives.get_mut(usize::from(axis))?.replace(state);
                let phase = self.past.last_phase();
                // Under power the engine stops the group and says why. Before the bring-up is over, a fault is an old one.
                let is_new = known.is_some_and(|known| !known.is_faulted()) && state.is_faulted();
                let code = self.past.last_error_code(axis.into());
                (is_new && matches!(phase, Phase::Disabled | Phase::Disabling)).then_some(Fault::Drive {
                    axis,
                    code,
                    slot: event.slot,
                    phase,
                })
            }
            _ => None,
        }
    }

    /// Takes a frame.
    pub fn frame(&mut self, frame: &OnBus<TracedFrame>) {
        self.past.frame(frame);
        self.write(|recording| recording.frame(frame));
    }

    /// Takes a change of a bus' health.
    pub fn health(&mut self, health: &OnBus<TracedHealth>) {
        self.past.health(health);
        self.write(|recording| recording.health(health));
    }

    /// Writes the past to a file, or adds the fault to the file that is open.
    pub fn fault(&mut self, fault: &Fault, machine: &Machine) {
        let (slot, at_ns) = self.past.last_slot().unwrap_or((0, self.started_ns));
        if let Some(open) = &mut self.open {
            open.until_ns = (at_ns + AFTER_NS).min(open.latest_ns);
            let metadata = fault.metadata(machine, slot);
            return self.write(|recording| recording.metadata(METADATA, metadata));
        }
        if let Some(last) = self.files.get(FILES - 1) {
            // Only the latest of the many is worth its place; that it cannot be removed changes nothing else.
            let _ = fs::remove_file(last);
            self.files.truncate(FILES - 1);
            self.replaced += 1;
        }
        let stem =
            format!("{}-{}-black-box-{}", machine.name, self.wall_clock.file_stamp(at_ns), fault.key());
        let opened = match Destination::Directory(self.directory.clone()).open(&stem, "mcap") {
            Ok(opened) => opened,
            Err(error) => return self.fail(format!("no black box: cannot write {error}")),
        };
        self.files.extend(opened.path.clone());
        let label = opened.label.clone();
        let begun = Recording::begin(opened, machine, self.wall_clock).and_then(|mut recording| {
            recording.add_buses(machine)?;
            recording.metadata(METADATA, fault.metadata(machine, slot))?;
            write_past(&self.past, &mut recording, machine)?;
            Ok(recording)
        });
        match begun {
            Ok(recording) => {
                self.open = Some(OpenFile {
                    recording,
                    until_ns: at_ns + AFTER_NS,
                    latest_ns: at_ns + LONGEST_AFTER_NS,
                });
            }
            Err(error) => {
                self.fail(format!("the black box is not whole: cannot write {label}: {}", reason(&error)))
            }
        }
    }

    /// Writes the end of the file that is open, if any.
    pub fn close(&mut self) {
        let Some(OpenFile { recording, .. }) = self.open.take() else { return };
        let label = recording.label.clone();
        if let Err(error) = recording.finish() {
            self.fail(format!("the black box has no end: cannot write {label}: {}", reason(&error)));
        }
    }

    /// What could not be written, and why; said once, however often it happens.
    pub fn take_failure(&mut self) -> Option<String> {
        self.failure.take()
    }

    /// The files, if only in part, the oldest first.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Files that had to make room for later ones.
    pub fn replaced(&self) -> u64 {
        self.replaced
    }

    fn write(&mut self, write: impl FnOnce(&mut Recording) -> McapResult<()>) {
        let Some(open) = &mut self.open else { return };
        if let Err(error) = write(&mut open.recording) {
            let label = open.recording.label.clone();
            self.open = None;
            self.fail(format!("the black box ends here: cannot write {label}: {}", reason(&error)));
        }
    }

    fn fail(&mut self, message: String) {
        if !std::mem::replace(&mut self.has_failed, true) {
            self.failure = Some(message);
        }
    }
}

fn write_past(past: &Past, recording: &mut Recording, machine: &Machine) -> McapResult<()> {
    past.visit(|entry| match entry {
        Entry::Cycle(record) => recording.cycle(record),
        Entry::Event(event) => recording.event(event, &words::event(event, machine)),
        Entry::Frame(frame) => recording.frame(&frame),
        Entry::Health(health) => recording.health(health),
    })?;
    // What led to the fault is safe from now on, whatever happens next.
    recording.flush()
}

/// The reason in an error of the MCAP writer, without what is clear from the context.
pub fn reason(error: &McapError) -> String {
    match error {
        McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}
