//! The sections that exist once: `[cycle]`, `[realtime]`, `[master]`, `[telemetry]`, `[simulation]`.

use std::path::PathBuf;

use super::entry::{Bounds, Entry};
use super::section::Section;
use crate::bus::schedule::automatic_command_phase;
use crate::config::defaults;
use crate::config::model::{Config, Cycle, Master, Realtime, Simulation, Telemetry};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantity::Quantity;

/// The cycle must leave room on both sides of the command phase.
const COMMAND_PHASE_RANGE: (f64, f64) = (0.05, 0.95);

/// The cycle, and where the file leaves its command phase to the analysis of the buses.
pub fn cycle(mut section: Section<'_>) -> (Cycle, Option<Entry<'_>>) {
    let period = section.get("period");
    let period_ns = period.as_ref().and_then(|entry| entry.nanoseconds(250e-6, 0.1));
    if let (Some(entry), Some(ns)) = (&period, period_ns)
        && ns % 1000 != 0
    {
        // Object 1006 of the drives is in whole microseconds.
        entry.report_range(Quantity::DURATION.show(ns as f64 / 1e9), "whole microseconds".to_owned());
    }
    let period_ns = period_ns.unwrap_or(defaults::PERIOD_NS);
    let (automatic, command_phase) = match section.get("command_phase") {
        Some(entry) if entry.is_word("auto") => (Some(entry), None),
        entry => (None, entry.and_then(|entry| fraction_of_period(&entry, period_ns))),
    };
    section.finish();
    let default_phase = (defaults::COMMAND_PHASE * period_ns as f64).round() as u64;
    (Cycle { period_ns, command_phase_ns: command_phase.unwrap_or(default_phase) }, automatic)
}

/// Resolves `command_phase = "auto"`, once everything else that counts is known.
pub fn resolve_command_phase(config: &mut Config, automatic: &Entry<'_>) {
    match automatic_command_phase(config) {
        Ok(command_phase_ns) => config.cycle.command_phase_ns = command_phase_ns,
        Err(cause) => automatic.report(ProblemKind::NoCommandPhase { cause }),
    }
}

/// A bare number or a percentage is a fraction of the period, anything else a duration.
fn fraction_of_period(entry: &Entry<'_>, period_ns: u64) -> Option<u64> {
    let (low, high) = COMMAND_PHASE_RANGE;
    let period_s = period_ns as f64 / 1e9;
    let is_fraction =
        entry.is_bare_number() || entry.text().is_some_and(|text| text.trim_end().ends_with('%'));
    if is_fraction {
        let fraction = entry.quantity(Quantity::FRACTION, Bounds::Between(low, high))?;
        Some((fraction * period_ns as f64).round() as u64)
    } else {
        entry.nanoseconds(low * period_s, high * period_s)
    }
}

pub fn realtime(mut section: Section<'_>, period_ns: u64) -> Realtime {
    let priority = section.get("priority").map(|entry| {
        if entry.is_word("off") {
            None
        } else {
            entry.integer(1..100).and_then(|value| u8::try_from(value).ok())
        }
    });
    let cpu = section.get("cpu").and_then(|entry| {
        if entry.is_word("last") {
            None
        } else {
            entry.integer(0..1024).and_then(|value| usize::try_from(value).ok())
        }
    });
    let spin_guard_ns = section.get("spin_guard").and_then(|entry| {
        if entry.is_word("measure") { None } else { entry.nanoseconds(0.0, period_ns as f64 / 2e9) }
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

pub fn master(mut section: Section<'_>) -> Master {
    let node = section.get("node").and_then(|entry| node(&entry));
    let heartbeat = section.get("heartbeat").map(|entry| heartbeat(&entry));
    let heartbeat_ns = heartbeat.unwrap_or(Some(defaults::MASTER_HEARTBEAT_NS));
    let timeout = section.get("heartbeat_timeout");
    let heartbeat_timeout_ns = timeout
        .as_ref()
        .and_then(|entry| milliseconds(entry, 1e-3))
        .unwrap_or(defaults::HEARTBEAT_TIMEOUT_NS);
    if let Some(period_ns) = heartbeat_ns
        && heartbeat_timeout_ns <= period_ns
    {
        let (value, period) = (heartbeat_timeout_ns as f64 / 1e9, period_ns as f64 / 1e9);
        let allowed = format!("longer than heartbeat, {}", Quantity::DURATION.show(period));
        match timeout {
            Some(entry) => entry.report_range(Quantity::DURATION.show(value), allowed),
            None => section.report_default_out_of_range(
                "heartbeat_timeout",
                Quantity::DURATION.show(value),
                allowed,
            ),
        }
    }
    let time_ns = section.get("time").and_then(|entry| time_period(&entry));
    section.finish();
    Master { node: node.unwrap_or(defaults::MASTER_NODE), heartbeat_ns, heartbeat_timeout_ns, time_ns }
}

/// A node number of CANopen.
pub fn node(entry: &Entry<'_>) -> Option<u8> {
    entry.integer(1..128).and_then(|value| u8::try_from(value).ok())
}

/// The period of a heartbeat, or `"off"`.
pub fn heartbeat(entry: &Entry<'_>) -> Option<u64> {
    if entry.is_word("off") { None } else { milliseconds(entry, 10e-3) }
}

/// The period of TIME, or `"off"`. More often than every 10 ms tells nobody more; seldom is up to an hour.
fn time_period(entry: &Entry<'_>) -> Option<u64> {
    if entry.is_word("off") { None } else { entry.nanoseconds(10e-3, 3600.0) }
}

/// Objects 1016 and 1017 hold whole milliseconds in 16 bits (CiA 301, 7.5.2.16 and 7.5.2.17).
fn milliseconds(entry: &Entry<'_>, low_s: f64) -> Option<u64> {
    let ns = entry.nanoseconds(low_s, 65.535)?;
    if ns % 1_000_000 != 0 {
        entry.report_range(Quantity::DURATION.show(ns as f64 / 1e9), "whole milliseconds".to_owned());
    }
    Some(ns)
}

pub fn telemetry(mut section: Section<'_>) -> Telemetry {
    let directory = section.get("directory").and_then(|entry| {
        let text = entry.text()?;
        if text.is_empty() {
            entry.report_range("an empty text".to_owned(), "the path of a folder".to_owned());
        }
        Some(PathBuf::from(text))
    });
    let black_box_ns = section
        .get("black_box")
        .map(|entry| if entry.is_word("off") { None } else { entry.nanoseconds(0.1, 60.0) });
    let ring_records = section.get("ring_records").and_then(|entry| entry.integer(64..1_048_577));
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

/// Within a cycle the simulated world never stands still.
pub fn simulation(mut section: Section<'_>, period_ns: u64) -> Simulation {
    let seed =
        section.get("seed").and_then(|entry| entry.integer(0..i64::MAX)).and_then(|v| u64::try_from(v).ok());
    let longest_gap_ns =
        section.get("longest_gap").and_then(|entry| entry.nanoseconds(period_ns as f64 / 1e9, 1.0));
    let stops_for_missed_slots =
        boolean(&mut section, "stops_for_missed_slots", defaults::STOPS_FOR_MISSED_SLOTS);
    section.finish();
    Simulation {
        seed: seed.unwrap_or(defaults::SEED),
        longest_gap_ns: longest_gap_ns.unwrap_or(defaults::LONGEST_GAP_NS.max(2 * period_ns)),
        stops_for_missed_slots,
    }
}

pub fn boolean(section: &mut Section<'_>, key: &'static str, default: bool) -> bool {
    section.get(key).and_then(|entry| entry.boolean()).unwrap_or(default)
}
