//! Reads a recording or a black box: the machine, the events, the timing, and the cycles.

mod cause;
mod decoder;
mod event;
mod frames;
mod journal;
mod printable_name;
mod records;
mod walk;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, Cursor, Read};
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use takt_rt::{
    AxisRecord, BusHealth, CycleRecord, CycleTiming, GroupRecord, MAX_BUSES, MAX_GROUPS, Nanoseconds, Phase,
};

use super::history::OnBus;
use super::machine::{BusDescription, Machine};
use super::statistics::Statistics;
use super::wall_clock::WallClock;
use crate::link::trace::TracedHealth;
use decoder::{Decoder, Item};
use printable_name::name;
use takt_wire::printable::printable;

pub use cause::Cause;
pub use event::RecordedEvent;
pub use frames::{RecordedFrame, RecordedFrames, frames};
pub use journal::{JournalDefect, RecordedJournal, journal, journal_in_memory};
pub use walk::WalkError;

/// Why a file cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordedError {
    /// It cannot be read.
    #[error("{path}: {error}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        error: WalkError,
    },
    /// It is an MCAP file of another program.
    #[error(
        "{path}: this is not a recording of takt (it was written by {library:?}); name a file of `takt run`"
    )]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The program that wrote it, according to the file.
        library: String,
    },
    /// Its messages have other fields.
    #[error("{path}: written by takt {version}, whose {message} has other fields; read it with that version")]
    OtherVersion {
        /// The file.
        path: PathBuf,
        /// The version that wrote it.
        version: String,
        /// The message.
        message: &'static str,
    },
}

/// A cycle with the axes that the recording has.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedCycle {
    /// When.
    pub timing: CycleTiming,
    /// The groups in the order of the configuration.
    pub groups: Vec<GroupRecord>,
    /// True if set-points were sent in this cycle.
    pub is_commanded: bool,
    /// The axes in the order of the configuration.
    pub axes: Vec<AxisRecord>,
}

/// How much of the time a bus was occupied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedLoad {
    /// The number of the bus.
    pub bus: usize,
    /// The end of the time, on the monotonic clock of the run.
    pub at_ns: Nanoseconds,
    /// From 0 to 1.
    pub load: f64,
}

impl RecordedCycle {
    fn of(record: &CycleRecord) -> Self {
        let CycleRecord { timing, is_commanded, .. } = *record;
        // No room for axes that are not there: a recording has millions of cycles.
        Self { timing, groups: record.groups().to_vec(), is_commanded, axes: record.axes().to_vec() }
    }
}

/// A recording without its cycles.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Recorded {
    /// The file.
    pub path: PathBuf,
    /// The version of takt that wrote it.
    pub version: String,
    /// Names, units and limits.
    pub machine: Machine,
    /// The incidents for which a black box was written, each with its keys; none in an ordinary recording.
    pub incidents: Vec<BTreeMap<String, String>>,
    /// The events in the order of the file.
    pub events: Vec<RecordedEvent>,
    /// Every change of the health of a bus, with the number of the bus.
    pub health: Vec<(usize, TracedHealth)>,
    /// The loads of the buses, over about 100 ms each; none in a recording of an earlier version.
    pub loads: Vec<RecordedLoad>,
    /// The last health of each bus that was read.
    known_health: BTreeMap<usize, TracedHealth>,
    /// The slot and the time of the first cycle of the file.
    begin: Option<(u64, Nanoseconds)>,
    /// The part of the recording that is read, in seconds after its first cycle.
    span_s: Option<Range<f64>>,
    /// What each group was doing in the last cycle.
    pub last_phases: Vec<Phase>,
    /// Timing and following errors of the whole recording.
    pub statistics: Statistics,
    /// The lowest and the highest slot. In a damaged file, slots may be out of order.
    pub slots: Option<(u64, u64)>,
    /// The time of day.
    pub wall_clock: Option<WallClock>,
    /// Defects of the file.
    pub warnings: Vec<String>,
    source: Source,
}

/// Where the bytes of a recording are.
#[derive(Clone, Debug)]
enum Source {
    /// In the file of its path.
    File,
    /// In memory, as a browser has them.
    Memory(Arc<[u8]>),
}

impl Recorded {
    /// Reads a file.
    ///
    /// # Errors
    /// See [`RecordedError`]. A file that is cut off or damaged in parts is read as far as it goes, with a warning.
    pub fn open(path: &Path) -> Result<Self, RecordedError> {
        Self::open_span(path, None, Source::File)
    }

    /// Reads the bytes of a file with this name.
    ///
    /// # Errors
    /// See [`RecordedError`].
    pub fn in_memory(name: &Path, bytes: Arc<[u8]>) -> Result<Self, RecordedError> {
        Self::open_span(name, None, Source::Memory(bytes))
    }

    /// Reads a part of a file: what lies so many seconds after its first cycle.
    ///
    /// # Errors
    /// See [`RecordedError`].
    pub fn open_between(path: &Path, span_s: Range<f64>) -> Result<Self, RecordedError> {
        Self::open_span(path, Some(span_s), Source::File)
    }

    fn open_span(path: &Path, span_s: Option<Range<f64>>, source: Source) -> Result<Self, RecordedError> {
        let mut recorded = Self {
            path: path.to_owned(),
            version: String::new(),
            machine: Machine {
                name: String::new(),
                cycle_ns: 0,
                axes: Vec::new(),
                buses: Vec::new(),
                groups: Vec::new(),
            },
            incidents: Vec::new(),
            events: Vec::new(),
            health: Vec::new(),
            loads: Vec::new(),
            known_health: BTreeMap::new(),
            begin: None,
            span_s,
            last_phases: Vec::new(),
            statistics: Statistics::default(),
            slots: None,
            wall_clock: None,
            warnings: Vec::new(),
            source,
        };
        if fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
            let error = io::Error::other(
                "this is not a regular file, and a recording is read more than once; save it to a file first",
            );
            return Err(RecordedError::Unreadable { path: path.to_owned(), error: error.into() });
        }
        let decoder = recorded.read(|recorded, item| recorded.take(item))?;
        recorded.machine.axes = decoder.axes.into_values().collect();
        // An event can come before the first cycle, whose time is not known then.
        let Self { begin, span_s, events, health, loads, .. } = &mut recorded;
        let is_inside = |at_ns: Nanoseconds| is_inside(span_s.as_ref(), *begin, at_ns);
        events.retain(|event| is_inside(event.at_ns));
        health.retain(|(_, traced)| is_inside(traced.at_ns));
        loads.retain(|load| is_inside(load.at_ns));
        Ok(recorded)
    }

    /// The cycles of these slots, in their order.
    ///
    /// # Errors
    /// See [`RecordedError`].
    pub fn cycles(&self, slots: &RangeInclusive<u64>) -> Result<Vec<RecordedCycle>, RecordedError> {
        let mut cycles = Vec::new();
        let mut copy = Self { warnings: Vec::new(), ..self.clone() };
        copy.read(|_, item| {
            if let Item::Cycle { record, .. } = item
                && slots.contains(&record.timing.slot)
            {
                cycles.push(RecordedCycle::of(record));
            }
        })?;
        Ok(cycles)
    }

    /// Passes every cycle to `visit`, in the order of the file.
    ///
    /// # Errors
    /// See [`RecordedError`].
    pub fn each_cycle(&self, mut visit: impl FnMut(&CycleRecord)) -> Result<(), RecordedError> {
        let mut copy = Self { warnings: Vec::new(), ..self.clone() };
        copy.read(|_, item| {
            if let Item::Cycle { record, .. } = item
                && is_inside(self.span_s.as_ref(), self.begin, record.timing.slot_start_ns)
            {
                visit(record);
            }
        })?;
        Ok(())
    }

    fn take(&mut self, item: Item<'_>) {
        match item {
            Item::Machine(described) => {
                let text = |key: &str| described.get(key).map_or_else(String::new, |text| name(text));
                self.version = text("version");
                self.machine.name = text("machine");
                self.machine.cycle_ns = text("cycle_ns").parse().unwrap_or(0);
                let bus = |line: &str| BusDescription {
                    name: name(line),
                    interface: String::new(),
                    bit_rate: None,
                    data_bit_rate: None,
                };
                let buses = described.get("buses").map_or("", String::as_str);
                self.machine.buses = buses.lines().take(MAX_BUSES).map(bus).collect();
                let groups = described.get("groups").map_or("", String::as_str);
                self.machine.groups = groups.lines().take(MAX_GROUPS).map(name).collect();
            }
            Item::Incident(incident) => {
                self.incidents
                    .push(incident.into_iter().map(|(key, text)| (key, printable(&text))).collect());
            }
            Item::Cycle { record, log_time_ns, axes } => {
                let (slot, start_ns) = (record.timing.slot, record.timing.slot_start_ns);
                self.begin = self.begin.or(Some((slot, start_ns)));
                if !is_inside(self.span_s.as_ref(), self.begin, start_ns) {
                    return;
                }
                if self.statistics.cycles == 0 {
                    self.statistics = Statistics::new(axes.values().map(|axis| axis.group).collect());
                }
                self.statistics.add(record);
                self.last_phases.clear();
                self.last_phases.extend(record.groups().iter().map(|group| group.phase));
                self.wall_clock =
                    self.wall_clock.or_else(|| Some(WallClock::fixed(log_time_ns.saturating_sub(start_ns))));
                let (first, last) = self.slots.unwrap_or((slot, slot));
                self.slots = Some((first.min(slot), last.max(slot)));
            }
            Item::Event(event) => self.events.push(RecordedEvent { text: printable(&event.text), ..event }),
            Item::Health(OnBus { bus, what }) => self.take_health(bus, what),
        }
    }

    fn take_health(&mut self, bus: usize, traced: TracedHealth) {
        let before = self.known_health.insert(bus, traced);
        let of_interest =
            |health: &BusHealth| (health.state, health.errors, health.tx_overruns, health.rx_overruns);
        let known = before.map_or_else(BusHealth::default, |before| before.health);
        if of_interest(&known) != of_interest(&traced.health) {
            self.health.push((bus, traced));
        }
        if let Some(before) = before.filter(|_| traced.health.busy_ns > 0) {
            let busy_ns = traced.health.busy_ns.saturating_sub(before.health.busy_ns);
            let passed_ns = traced.at_ns.saturating_sub(before.at_ns);
            // A change of the state comes between two loads.
            if passed_ns >= SHORTEST_LOAD_NS {
                let load = busy_ns as f64 / passed_ns as f64;
                self.loads.push(RecordedLoad { bus, at_ns: traced.at_ns, load });
            } else {
                self.known_health.insert(
                    bus,
                    TracedHealth {
                        at_ns: before.at_ns,
                        health: BusHealth { busy_ns: before.health.busy_ns, ..traced.health },
                    },
                );
            }
        }
    }

    /// Passes everything in the file to `take`.
    fn read(&mut self, mut take: impl FnMut(&mut Self, Item<'_>)) -> Result<Decoder, RecordedError> {
        let path = self.path.clone();
        let unreadable = |error| RecordedError::Unreadable { path: path.clone(), error };
        let file: Box<dyn Read> = match &self.source {
            Source::File => {
                let file = File::open(&path).map_err(|error| unreadable(error.into()))?;
                Box::new(BufReader::new(file))
            }
            Source::Memory(bytes) => Box::new(Cursor::new(Arc::clone(bytes))),
        };
        let mut decoder = Decoder::default();
        let condition = walk::walk(file, |opcode, body| {
            decoder.record(opcode, body, &mut |item| take(self, item));
        })
        .map_err(unreadable)?;
        decoder.finish(&mut |item| take(self, item));
        if let Some(message) = decoder.other_layout {
            return Err(RecordedError::OtherVersion { path, version: self.version.clone(), message });
        }
        if !decoder.is_of_takt {
            let library = decoder.library;
            return Err(RecordedError::Foreign { path, library });
        }
        if !condition.is_whole {
            self.warnings.push("the file is cut off; it is read to its last whole record".to_owned());
        }
        if condition.damaged_chunks > 0 {
            self.warnings.push(format!("{} damaged chunks were skipped", condition.damaged_chunks));
        }
        if decoder.malformed > 0 {
            self.warnings.push(format!("{} malformed messages were skipped", decoder.malformed));
        }
        Ok(decoder)
    }
}

/// A load is that of a longer time.
const SHORTEST_LOAD_NS: Nanoseconds = 50_000_000;

/// Returns `true` if an instant is in the part of a recording that is read.
fn is_inside(span_s: Option<&Range<f64>>, begin: Option<(u64, Nanoseconds)>, at_ns: Nanoseconds) -> bool {
    let (Some(span_s), Some((_, begin_ns))) = (span_s, begin) else { return true };
    span_s.contains(&((at_ns as f64 - begin_ns as f64) * 1e-9))
}
