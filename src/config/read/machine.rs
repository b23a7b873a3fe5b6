//! The sections that exist once: `[cycle]`, `[stream]`, `[realtime]`, `[master]`, `[telemetry]`, `[simulation]`.

use std::path::PathBuf;

use super::entry::{Entry, KeyedEntry};
use super::section::Section;
use crate::config::defaults;
use crate::config::keys::{self, cycle as cycle_keys};
use crate::config::model::{Axis, Cycle, Master, Realtime, Simulation, StreamDelay, Telemetry};
use crate::config::quantity::Quantity;
use crate::config::rules;
use crate::config::spot::Spot;

/// The cycle, and where the file leaves its command phase to the analysis of the buses.
pub fn cycle(mut section: Section<'_>) -> (Cycle, Option<Entry<'_>>) {
    let period_ns = section
        .keyed(&cycle_keys::PERIOD)
        .and_then(|entry| rules::cycle::period(&entry.spot, entry.nanoseconds()?))
        .unwrap_or(defaults::PERIOD_NS);
    let (automatic, command_phase) = match section.keyed(&cycle_keys::COMMAND_PHASE) {
        Some(entry) if entry.is_the_word() => (Some(entry.into_entry()), None),
        entry => (None, entry.and_then(|entry| fraction_of_period(&entry, period_ns))),
    };
    section.finish();
    let command_phase_ns = command_phase.unwrap_or_else(|| defaults::command_phase_ns(period_ns));
    (Cycle { period_ns, command_phase_ns }, automatic)
}

/// A bare number or a percentage is a fraction of the period, anything else a duration.
fn fraction_of_period(entry: &Entry<'_>, period_ns: u64) -> Option<u64> {
    let is_fraction =
        entry.is_bare_number() || entry.text().is_some_and(|text| text.trim_end().ends_with('%'));
    if is_fraction {
        let fraction = entry.quantity(Quantity::FRACTION, keys::COMMAND_PHASE)?;
        Some((fraction * period_ns as f64).round() as u64)
    } else {
        rules::cycle::command_phase(&entry.spot, entry.unbounded(Quantity::DURATION)?, period_ns)
    }
}

/// `[stream]`
pub fn stream_delay(mut section: Section<'_>) -> StreamDelay {
    let delay = section.keyed(&keys::stream::DELAY).filter(|entry| !entry.is_the_word());
    let fixed = delay.and_then(|entry| entry.nanoseconds()).map(StreamDelay::Fixed);
    section.finish();
    fixed.unwrap_or_default()
}

/// Returns the value; `None` for the word of the key.
fn unless_word<T>(entry: &KeyedEntry<'_>, value: impl FnOnce() -> Option<T>) -> Option<T> {
    if entry.is_the_word() { None } else { value() }
}

pub fn realtime(mut section: Section<'_>, period_ns: u64) -> Realtime {
    use keys::realtime::{CPU, HOLD_DMA_LATENCY, LOCK_MEMORY, PRIORITY, SPIN_GUARD};

    let priority = section.keyed(&PRIORITY).map(|entry| unless_word(&entry, || entry.integer()));
    let cpu = section.keyed(&CPU).and_then(|entry| unless_word(&entry, || entry.integer()));
    let spin_guard_ns = section.keyed(&SPIN_GUARD).and_then(|entry| {
        let seconds = rules::realtime::spin_guard(period_ns);
        if entry.is_the_word() { None } else { entry.into_entry().nanoseconds(seconds) }
    });
    let realtime = Realtime {
        priority: priority.unwrap_or(defaults::REALTIME.priority),
        cpu,
        lock_memory: section.boolean(&LOCK_MEMORY),
        hold_dma_latency: section.boolean(&HOLD_DMA_LATENCY),
        spin_guard_ns,
    };
    section.finish();
    realtime
}

/// `[master]` as the file gives it. The default of its heartbeat depends on the modes of the axes.
pub struct ReadMaster<'a> {
    pub node: u8,
    /// The outer `None`: nothing is said.
    heartbeat_ns: Option<Option<u64>>,
    heartbeat_timeout_ns: Option<u64>,
    time_ns: Option<u64>,
    timeout_spot: Spot<'a>,
}

pub fn master(mut section: Section<'_>) -> ReadMaster<'_> {
    use keys::master::{HEARTBEAT, HEARTBEAT_TIMEOUT, NODE, TIME};

    let node = section.integer(&NODE);
    let heartbeat_ns = section.keyed(&HEARTBEAT).map(|entry| heartbeat(&entry));
    let heartbeat_timeout_ns = section
        .keyed(&HEARTBEAT_TIMEOUT)
        .and_then(|entry| rules::master::heartbeat_timeout(&entry.spot, entry.nanoseconds()?));
    let time_ns = section.keyed(&TIME).and_then(|entry| unless_word(&entry, || entry.nanoseconds()));
    let timeout_spot = section.spot(HEARTBEAT_TIMEOUT.name);
    section.finish();
    let node = node.unwrap_or(defaults::MASTER_NODE);
    ReadMaster { node, heartbeat_ns, heartbeat_timeout_ns, time_ns, timeout_spot }
}

impl ReadMaster<'_> {
    /// The whole of it, once the axes are known.
    pub fn complete(self, axes: &[Axis], period_ns: u64) -> Master {
        let default_ns = || Some(defaults::master_heartbeat_ns(axes, period_ns));
        let heartbeat_ns = self.heartbeat_ns.unwrap_or_else(default_ns);
        let heartbeat_timeout_ns =
            self.heartbeat_timeout_ns.unwrap_or_else(|| defaults::heartbeat_timeout_ns(heartbeat_ns));
        rules::master::outlasts_heartbeat(&self.timeout_spot, heartbeat_timeout_ns, heartbeat_ns);
        Master { node: self.node, heartbeat_ns, heartbeat_timeout_ns, time_ns: self.time_ns }
    }
}

/// The period of a heartbeat, or `"off"`.
pub fn heartbeat(entry: &KeyedEntry<'_>) -> Option<u64> {
    unless_word(entry, || rules::master::heartbeat(&entry.spot, entry.nanoseconds()?))
}

pub fn telemetry(mut section: Section<'_>) -> Telemetry {
    use keys::telemetry::{BLACK_BOX, CANDUMP, DIRECTORY, RECORD, RING_RECORDS};

    let directory = section.keyed(&DIRECTORY).and_then(|entry| {
        let directory = PathBuf::from(entry.text()?);
        rules::telemetry::directory(&entry.spot, &directory);
        Some(directory)
    });
    let black_box_ns = section.keyed(&BLACK_BOX).map(|entry| unless_word(&entry, || entry.nanoseconds()));
    let default = Telemetry::default();
    let telemetry = Telemetry {
        directory: directory.unwrap_or(default.directory),
        is_recorded: section.boolean(&RECORD),
        is_candump_written: section.boolean(&CANDUMP),
        black_box_ns: black_box_ns.unwrap_or(default.black_box_ns),
        ring_records: section.integer(&RING_RECORDS).unwrap_or(default.ring_records),
    };
    section.finish();
    telemetry
}

pub fn simulation(mut section: Section<'_>, period_ns: u64) -> Simulation {
    use keys::simulation::{LONGEST_GAP, SEED, STOPS_FOR_MISSED_SLOTS};

    let seed = section.integer(&SEED);
    let longest_gap_ns = section
        .keyed(&LONGEST_GAP)
        .and_then(|entry| entry.into_entry().nanoseconds(rules::simulation::longest_gap(period_ns)));
    let stops_for_missed_slots = section.boolean(&STOPS_FOR_MISSED_SLOTS);
    section.finish();
    Simulation {
        seed: seed.unwrap_or(defaults::SEED),
        longest_gap_ns: longest_gap_ns.unwrap_or_else(|| defaults::longest_gap_ns(period_ns)),
        stops_for_missed_slots,
    }
}
