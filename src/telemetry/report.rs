//! The report of a run as data, as `takt run --json` prints it.

use std::fs;
use std::path::PathBuf;

use serde::Serialize;
use takt_rt::{BusHealth, BusState, NANOSECONDS_PER_SECOND, Nanoseconds, Snapshot, StopReason};

use super::logger::LogSummary;
use super::machine::{AxisDescription, BusDescription, Machine, SetPointMagnitudes};
use super::statistics::{AxisStatistics, Latency};
use super::words;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum RunEnd {
    /// The program was done, or its time was over.
    Finished,
    /// Ctrl-C or a signal ended it.
    Interrupted,
    /// Another process took the buses over.
    TakenOver,
    /// The group stopped by itself.
    Stopped,
    /// It could not go on for another reason.
    Failed,
}

/// A whole run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunReport {
    /// The name of the machine.
    pub machine: String,
    /// How the run ended.
    pub ended: RunEnd,
    /// True if every drive has confirmed in the end that it has no torque.
    pub is_power_off: bool,
    /// Time from the start of the first cycle to the end of the last one.
    pub duration_s: f64,
    /// Period of the cycle.
    pub cycle_ns: u64,
    /// The number of cycles.
    pub cycles: u64,
    /// Slots that passed unused because the thread was late.
    pub missed_slots: u64,
    /// Wake-up latency: how late the timer woke the thread.
    pub wake_ns: LatencyReport,
    /// SYNC release error: how late SYNC was handed over, against the grid.
    pub sync_ns: LatencyReport,
    /// Computing time from feedback to set-points, without I/O.
    pub compute_ns: LatencyReport,
    /// Time from the start of the slot until the last set-point was handed over.
    pub sent_ns: LatencyReport,
    /// How long the calls of callbacks took; absent if none was called.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub callback_ns: Option<LatencyReport>,
    /// What the operating system granted.
    pub realtime: RealtimeReport,
    /// The groups in the order of the configuration; absent where all axes are one group.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<GroupReport>,
    /// The axes in the order of the configuration.
    pub axes: Vec<AxisReport>,
    /// The buses in the order of the configuration.
    pub buses: Vec<BusReport>,
    /// What was recorded.
    pub telemetry: TelemetryReport,
    /// Why the run ended before its program: the first stop of any group; `None` if the program finished.
    pub stop: Option<StopReport>,
}

/// One group of several.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroupReport {
    /// Its name in the configuration.
    pub name: String,
    /// Why it had stopped at the end; `None` if nothing stopped it, or the program finished.
    pub stop: Option<StopReport>,
    /// How long the calls of its callbacks took; absent if none was called.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub callback_ns: Option<LatencyReport>,
}

/// The distribution of a time in nanoseconds; minimum and maximum are exact, quantiles have three digits.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LatencyReport {
    /// Median.
    pub p50: u64,
    /// 99 %
    pub p99: u64,
    /// 99.9 %
    pub p999: u64,
    /// Maximum.
    pub max: u64,
    /// Minimum.
    pub min: u64,
    /// The number of cycles in each range. There are six ranges in each decade from 100 ns to 100 ms. The first range also
    /// counts all shorter times, the last one all longer times.
    pub histogram: Vec<u64>,
}

/// What the operating system granted the real-time thread.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RealtimeReport {
    /// `SCHED_FIFO` or `SCHED_OTHER`.
    pub policy: String,
    /// Real-time priority, 1 to 99; `None` in the normal class.
    pub priority: Option<u8>,
    /// The CPU that the thread was pinned to.
    pub cpu: Option<usize>,
    /// True if all memory was locked.
    pub memory_locked: bool,
    /// True if the kernel is PREEMPT_RT.
    pub preempt_rt: bool,
    /// The time before a deadline during which the thread spun instead of sleeping.
    pub spin_guard_ns: u64,
    /// Page faults of the real-time thread, minor and major, from its first cycle to its last.
    pub page_faults: u64,
    /// Each refused step, with the reason.
    pub refused: Vec<String>,
    /// The commands that grant the refused steps.
    pub grant_with: Vec<String>,
}

/// One axis; rad for a rotary axis, m for a linear one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisReport {
    /// Its name in the configuration.
    pub name: String,
    /// `rad` or `m`.
    pub unit: &'static str,
    /// The largest following error while the axis was enabled; `None` when it never was.
    pub following_error_max: Option<f64>,
    /// The time of that error, after the first cycle.
    pub following_error_at_s: Option<f64>,
    /// The velocity set-point at that time, per second.
    pub following_error_velocity: Option<f64>,
    /// The largest velocity, acceleration and jerk of its set-points.
    pub set_point_max: SetPointMagnitudes,
    /// Their limits; the jerk is `null` if it is not limited.
    pub limits: SetPointMagnitudes,
    /// The largest values as fractions of their limits: 1 means that a limit was reached. The jerk is `null` if it is not
    /// limited.
    pub set_point_part: SetPointParts,
    /// The last position while enabled; `None` if the drive did not report it.
    pub final_position: Option<f64>,
    /// The slot of the last position that the drive reported while enabled; `None` if it has never reported.
    pub final_report_slot: Option<u64>,
    /// The target of the last move.
    pub target_position: f64,
    /// The difference between the final position and the target in counts of the encoder; `None` if that is not known.
    pub final_error_counts: Option<f64>,
}

/// The largest derivatives of an axis' set-points as fractions of their limits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SetPointParts {
    /// Of the velocity limit.
    pub velocity: Option<f64>,
    /// Of the acceleration limit.
    pub acceleration: Option<f64>,
    /// Of the jerk limit.
    pub jerk: Option<f64>,
}

impl SetPointParts {
    pub(super) fn new(reached: &SetPointMagnitudes, limits: &SetPointMagnitudes) -> Self {
        let part = |reached: f64, limit: f64| (limit.is_finite() && limit > 0.0).then_some(reached / limit);
        Self {
            velocity: part(reached.velocity, limits.velocity),
            acceleration: part(reached.acceleration, limits.acceleration),
            jerk: part(reached.jerk, limits.jerk),
        }
    }
}

/// One bus.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BusReport {
    /// Its name in the configuration.
    pub name: String,
    /// `sim`, or the name of a network interface.
    pub interface: String,
    /// The fraction of the time in which the wire was occupied, in percent.
    pub load_percent: f64,
    /// Frames sent and seen on the wire.
    pub tx_frames: u64,
    /// Frames received.
    pub rx_frames: u64,
    /// Frames that the interface had no room for.
    pub tx_overruns: u64,
    /// Received frames that were lost before they could be read.
    pub rx_overruns: u64,
    /// Error frames and bus errors.
    pub errors: u64,
    /// The fault confinement state at the end.
    pub state: &'static str,
}

/// What was recorded.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TelemetryReport {
    /// Cycle records that reached the logger.
    pub records: u64,
    /// Cycle records and events that found no room.
    pub dropped: u64,
    /// Frames that found no room on their way to the candump log and the black box.
    pub frames_dropped: u64,
    /// The recording; of several files, the last one.
    pub recording: Option<PathBuf>,
    /// The files of the recording before that one, the oldest first.
    pub earlier_recordings: Vec<PathBuf>,
    /// How many older files of the recording were removed.
    pub recordings_removed: u64,
    /// The size of `recording`.
    pub recording_bytes: Option<u64>,
    /// The candump log.
    pub candump: Option<PathBuf>,
    /// The files of the black box, one for each incident, the oldest first.
    pub black_boxes: Vec<PathBuf>,
    /// How many files of the black box were removed for later ones.
    pub black_boxes_replaced: u64,
    /// The files that were not written, or not to their end, and why.
    pub not_written: Vec<String>,
}

/// Why a run ended before its program.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StopReport {
    /// IEC 60204-1: 0, 1 or 2.
    pub category: u8,
    /// The reason as a sentence.
    pub reason: String,
    /// The key of the rule: `following_error` …
    pub rule: &'static str,
    /// The group that stopped; absent where all axes are one group.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// The axis concerned.
    pub axis: Option<String>,
    /// The bus concerned.
    pub bus: Option<String>,
    /// The value that was seen, in the unit of the rule.
    pub value: f64,
    /// The value that is allowed.
    pub limit: f64,
    /// The slot in which it was seen.
    pub slot: u64,
    /// The phase of the group.
    pub phase: &'static str,
    /// The cure of the fault.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cure: Option<&'static str>,
}

/// The data of a report that the logger does not have.
#[derive(Clone, Debug)]
pub struct RunOutcome {
    /// How the run ended.
    pub ended: RunEnd,
    /// What the operating system granted.
    pub realtime: RealtimeReport,
    /// The state after the last cycle, with the counters of the buses.
    pub last: Snapshot,
    /// The time for which the buses were open. The bus load refers to it.
    pub buses_open_ns: Nanoseconds,
    /// The targets of the program's last moves, in rad (m), an axis each; `None` and an absent one take the last set-point.
    pub targets: Vec<Option<f64>>,
    /// Why the run ended before its program.
    pub stop: Option<StopReason>,
    /// True if every drive has confirmed in the end that it has no torque.
    pub is_power_off: bool,
}

/// Ranges in a decade of [`LatencyReport::histogram`].
pub(super) const RANGES_PER_DECADE: usize = 6;
/// Decades of [`LatencyReport::histogram`].
pub(super) const DECADES: usize = 6;
/// The lower bound of [`LatencyReport::histogram`].
const SHORTEST_NS: f64 = 100.0;

impl RunReport {
    /// Makes the report.
    pub fn new(log: &LogSummary, outcome: &RunOutcome) -> Self {
        let (machine, statistics, last) = (&log.machine, &log.statistics, &outcome.last);
        let covered_ns = statistics.last_ns.saturating_sub(statistics.first_ns) + machine.cycle_ns;
        let axis = |(index, (description, axis)): (usize, (&AxisDescription, &AxisStatistics))| {
            let target = outcome.targets.get(index).copied().flatten();
            AxisReport::new(description, axis, statistics.first_ns, target)
        };
        let bus = |(description, health)| BusReport::new(description, health, outcome.buses_open_ns);
        Self {
            machine: machine.name.clone(),
            ended: outcome.ended,
            is_power_off: outcome.is_power_off,
            duration_s: if statistics.cycles == 0 { 0.0 } else { seconds(covered_ns) },
            cycle_ns: machine.cycle_ns,
            cycles: statistics.cycles + log.records_dropped,
            // The missed slots of a dropped record are counted by the snapshot only.
            missed_slots: statistics.missed_slots.max(last.missed_slots),
            wake_ns: LatencyReport::new(&statistics.wake),
            sync_ns: LatencyReport::new(&statistics.sync),
            compute_ns: LatencyReport::new(&statistics.compute),
            sent_ns: LatencyReport::new(&statistics.sent),
            callback_ns: statistics.callback().as_ref().map(LatencyReport::new),
            groups: groups(log, outcome),
            realtime: outcome.realtime.clone(),
            axes: machine.axes.iter().zip(&statistics.axes).enumerate().map(axis).collect(),
            buses: machine.buses.iter().zip(&last.buses).map(bus).collect(),
            telemetry: TelemetryReport::new(log),
            stop: outcome.stop.as_ref().map(|stop| StopReport::new(stop, last, machine)),
        }
    }
}

/// The groups, where there are several. What was asked for is a stop of a group only in a run that did not finish.
fn groups(log: &LogSummary, outcome: &RunOutcome) -> Vec<GroupReport> {
    if log.machine.groups.len() < 2 {
        return vec![];
    }
    let group = |(number, name): (usize, &String)| {
        let stop = outcome.last.groups().get(number).and_then(|group| group.stop);
        let stop = stop.filter(|stop| !stop.is_requested() || outcome.stop.is_some());
        GroupReport {
            name: name.clone(),
            stop: stop.map(|stop| StopReport::of_group(&stop, Some(number), &log.machine)),
            callback_ns: log.statistics.callback_of(number).map(LatencyReport::new),
        }
    };
    log.machine.groups.iter().enumerate().map(group).collect()
}

fn seconds(ns: Nanoseconds) -> f64 {
    ns as f64 / NANOSECONDS_PER_SECOND as f64
}

impl LatencyReport {
    /// The numbers of a distribution.
    pub fn new(latency: &Latency) -> Self {
        let bound = |index: usize| {
            let decades = index as f64 / RANGES_PER_DECADE as f64;
            (SHORTEST_NS * 10_f64.powf(decades)).round() as u64
        };
        let bounds_ns: Vec<u64> = (0..=RANGES_PER_DECADE * DECADES).map(bound).collect();
        Self {
            p50: latency.quantile_ns(0.5),
            p99: latency.quantile_ns(0.99),
            p999: latency.quantile_ns(0.999),
            max: latency.max_ns(),
            min: latency.min_ns(),
            histogram: latency.counts(&bounds_ns),
        }
    }
}

impl AxisReport {
    fn new(
        description: &AxisDescription,
        axis: &AxisStatistics,
        first_ns: Nanoseconds,
        target: Option<f64>,
    ) -> Self {
        let largest = axis.following_error_max;
        let target_position = target.unwrap_or(axis.position_set);
        let final_position = axis.is_reported.then_some(axis.position);
        let error_counts = |position: f64| (position - target_position) * description.counts_per_unit;
        Self {
            name: description.name.clone(),
            unit: description.unit.symbol(),
            following_error_max: largest.map(|largest| largest.error),
            following_error_at_s: largest.map(|largest| seconds(largest.at_ns.saturating_sub(first_ns))),
            following_error_velocity: largest.map(|largest| largest.velocity_set),
            set_point_max: axis.set_point_max,
            limits: description.limits,
            set_point_part: SetPointParts::new(&axis.set_point_max, &description.limits),
            final_position,
            final_report_slot: axis.reported_slot,
            target_position,
            // Adding 0 turns -0 into 0.
            final_error_counts: final_position
                .map(|position| (error_counts(position) * 10.0).round() / 10.0 + 0.0),
        }
    }
}

impl BusReport {
    /// The name of a fault confinement state.
    pub const fn state_words(state: BusState) -> &'static str {
        match state {
            BusState::ErrorActive => "error active",
            BusState::ErrorPassive => "error passive",
            BusState::BusOff => "bus off",
            BusState::Down => "down",
        }
    }

    fn new(description: &BusDescription, health: &BusHealth, open_ns: Nanoseconds) -> Self {
        let load = 100.0 * health.busy_ns as f64 / open_ns.max(1) as f64;
        Self {
            name: description.name.clone(),
            interface: description.interface.clone(),
            load_percent: (load * 100.0).round() / 100.0,
            tx_frames: health.tx_frames,
            rx_frames: health.rx_frames,
            tx_overruns: health.tx_overruns,
            rx_overruns: health.rx_overruns,
            errors: health.errors,
            state: Self::state_words(health.state),
        }
    }
}

impl TelemetryReport {
    fn new(log: &LogSummary) -> Self {
        let size = |path: &PathBuf| fs::metadata(path).ok().map(|metadata| metadata.len());
        Self {
            records: log.records,
            dropped: log.records_dropped + log.events_dropped,
            frames_dropped: log.frames_dropped,
            recording_bytes: log.recording.as_ref().and_then(size),
            recording: log.recording.clone(),
            earlier_recordings: log.earlier_recordings.clone(),
            recordings_removed: log.recordings_removed,
            candump: log.candump.clone(),
            black_boxes: log.black_boxes.files.clone(),
            black_boxes_replaced: log.black_boxes.replaced,
            not_written: log.not_written.clone(),
        }
    }
}

impl StopReport {
    /// A stop, with the names of the machine. The last state shows which group it has stopped.
    pub fn new(stop: &StopReason, last: &Snapshot, machine: &Machine) -> Self {
        let group = last.groups().iter().position(|group| group.stop.as_ref() == Some(stop));
        Self::of_group(stop, group, machine)
    }

    fn of_group(stop: &StopReason, group: Option<usize>, machine: &Machine) -> Self {
        let several = (machine.groups.len() > 1).then_some(&machine.groups);
        Self {
            group: several.zip(group).and_then(|(groups, group)| groups.get(group)).cloned(),
            category: stop.category as u8,
            reason: words::stop_cause(stop, machine).to_string(),
            rule: words::rule_key(stop.rule()),
            axis: stop.axis().map(|axis| machine.axis_name(axis)),
            bus: stop.origin.bus().map(|bus| machine.bus_name(bus)),
            value: stop.cause.numbers().0,
            limit: stop.cause.numbers().1,
            slot: stop.slot,
            phase: words::phase(stop.phase),
            cure: words::stop_cure(stop, machine),
        }
    }
}
