//! The sections that exist once: `[cycle]`, `[stream]`, `[realtime]`, `[master]`, `[telemetry]`, `[simulation]`.

use std::path::PathBuf;

use super::entry::Entry;
use super::section::Section;
use crate::config::bounds::Bounds;
use crate::config::defaults;
use crate::config::model::{Axis, Cycle, Master, Realtime, Simulation, StreamDelay, Telemetry};
use crate::config::quantity::Quantity;
use crate::config::ranges;
use crate::config::rules;
use crate::config::spot::Spot;

/// The cycle, and where the file leaves its command phase to the analysis of the buses.
pub fn cycle(mut section: Section<'_>) -> (Cycle, Option<Entry<'_>>) {
    let period_ns = section
        .get("period")
        .and_then(|entry| rules::cycle::period(&entry.spot, entry.nanoseconds(ranges::PERIOD_S)?))
        .unwrap_or(defaults::PERIOD_NS);
    let (automatic, command_phase) = match section.get("command_phase") {
        Some(entry) if entry.is_word("auto") => (Some(entry), None),
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
        let bounds = Bounds::Between(*ranges::COMMAND_PHASE.start(), *ranges::COMMAND_PHASE.end());
        let fraction = entry.quantity(Quantity::FRACTION, bounds)?;
        Some((fraction * period_ns as f64).round() as u64)
    } else {
        rules::cycle::command_phase(&entry.spot, entry.unbounded(Quantity::DURATION)?, period_ns)
    }
}

/// `[stream]`
pub fn stream_delay(mut section: Section<'_>) -> StreamDelay {
    let delay = section.get("delay").filter(|entry| !entry.is_word("auto"));
    let fixed = delay.and_then(|entry| entry.nanoseconds(ranges::STREAM_DELAY_S)).map(StreamDelay::Fixed);
    section.finish();
    fixed.unwrap_or_default()
}

pub fn realtime(mut section: Section<'_>, period_ns: u64) -> Realtime {
    let priority = section.get("priority").map(|entry| {
        if entry.is_word("off") {
            None
        } else {
            entry.integer(ranges::PRIORITY).and_then(|value| u8::try_from(value).ok())
        }
    });
    let cpu = section.get("cpu").and_then(|entry| {
        if entry.is_word("last") {
            None
        } else {
            entry.integer(ranges::CPU).and_then(|value| usize::try_from(value).ok())
        }
    });
    let spin_guard_ns = section.get("spin_guard").and_then(|entry| {
        if entry.is_word("measure") {
            None
        } else {
            entry.nanoseconds(rules::realtime::spin_guard(period_ns))
        }
    });
    let realtime = Realtime {
        priority: priority.unwrap_or(Some(defaults::PRIORITY)),
        cpu,
        lock_memory: boolean(&mut section, "lock_memory", defaults::LOCK_MEMORY),
        hold_dma_latency: boolean(&mut section, "hold_dma_latency", defaults::HOLD_DMA_LATENCY),
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
    let node = section.get("node").and_then(|entry| node(&entry));
    let heartbeat_ns = section.get("heartbeat").map(|entry| heartbeat(&entry));
    let heartbeat_timeout_ns = section.get("heartbeat_timeout").and_then(|entry| {
        rules::master::heartbeat_timeout(&entry.spot, entry.nanoseconds(ranges::HEARTBEAT_TIMEOUT_S)?)
    });
    let time_ns = section.get("time").and_then(|entry| time_period(&entry));
    let timeout_spot = section.spot("heartbeat_timeout");
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

/// A node ID of CANopen.
pub fn node(entry: &Entry<'_>) -> Option<u8> {
    entry.integer(ranges::NODE_ID).and_then(|value| u8::try_from(value).ok())
}

/// The period of a heartbeat, or `"off"`.
pub fn heartbeat(entry: &Entry<'_>) -> Option<u64> {
    if entry.is_word("off") {
        return None;
    }
    rules::master::heartbeat(&entry.spot, entry.nanoseconds(ranges::HEARTBEAT_S)?)
}

/// The period of TIME, or `"off"`.
fn time_period(entry: &Entry<'_>) -> Option<u64> {
    if entry.is_word("off") { None } else { entry.nanoseconds(ranges::TIME_S) }
}

pub fn telemetry(mut section: Section<'_>) -> Telemetry {
    let directory = section.get("directory").and_then(|entry| {
        let directory = PathBuf::from(entry.text()?);
        rules::telemetry::directory(&entry.spot, &directory);
        Some(directory)
    });
    let black_box_ns = section
        .get("black_box")
        .map(|entry| if entry.is_word("off") { None } else { entry.nanoseconds(ranges::BLACK_BOX_S) });
    let ring_records = section.get("ring_records").and_then(|entry| entry.integer(ranges::RING_RECORDS));
    let telemetry = Telemetry {
        directory: directory.unwrap_or_else(|| PathBuf::from(defaults::DIRECTORY)),
        is_recorded: boolean(&mut section, "record", true),
        is_candump_written: boolean(&mut section, "candump", false),
        black_box_ns: black_box_ns.unwrap_or(Some(defaults::BLACK_BOX_NS)),
        ring_records: ring_records
            .and_then(|value| usize::try_from(value).ok())
            .unwrap_or(defaults::RING_RECORDS),
    };
    section.finish();
    telemetry
}

pub fn simulation(mut section: Section<'_>, period_ns: u64) -> Simulation {
    let seed =
        section.get("seed").and_then(|entry| entry.integer(0..i64::MAX)).and_then(|v| u64::try_from(v).ok());
    let longest_gap_ns = section
        .get("longest_gap")
        .and_then(|entry| entry.nanoseconds(rules::simulation::longest_gap(period_ns)));
    let stops_for_missed_slots =
        boolean(&mut section, "stops_for_missed_slots", defaults::STOPS_FOR_MISSED_SLOTS);
    section.finish();
    Simulation {
        seed: seed.unwrap_or(defaults::SEED),
        longest_gap_ns: longest_gap_ns.unwrap_or_else(|| defaults::longest_gap_ns(period_ns)),
        stops_for_missed_slots,
    }
}

pub fn boolean(section: &mut Section<'_>, key: &'static str, default: bool) -> bool {
    section.get(key).and_then(|entry| entry.boolean()).unwrap_or(default)
}
