//! The report of a recording or a black box: why the group stopped, the cycles before, and the timing.

mod render;

use std::path::PathBuf;

use serde::Serialize;
use takt_rt::{AxisRecord, EventKind, Phase};

use super::machine::SetPointMagnitudes;
use super::missed_slots::counted_once;
use super::recorded::{Cause, Recorded, RecordedCycle, RecordedError};
use super::report::{BusReport, LatencyReport, SetPointParts};
use super::words;

/// A recording in numbers and words.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RecordingReport {
    /// The file.
    pub recording: PathBuf,
    /// The version of takt that wrote it.
    pub version: String,
    /// The name of the machine.
    pub machine: String,
    /// Period of the cycle.
    pub cycle_ns: u64,
    /// The time of its first cycle, in UTC.
    pub begins: Option<String>,
    /// The first and the last cycle that are reported, in seconds after the beginning of the recording.
    pub span_s: (f64, f64),
    /// Cycles in it.
    pub cycles: u64,
    /// True if it is the file of a black box.
    pub is_black_box: bool,
    /// Defects of the file.
    pub warnings: Vec<String>,
    /// Why the group stopped; `None` if it did not.
    pub cause: Option<Cause>,
    /// The groups in the order of the configuration; absent where all axes are one group.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<GroupSummary>,
    /// The axis of the cause, or the one that was asked for; `None` if there is no cycle.
    pub axis: Option<AxisCycles>,
    /// Every event.
    pub events: Vec<ReportedEvent>,
    /// Every emergency message of a drive.
    pub emergencies: Vec<ReportedEvent>,
    /// Wake-up latency.
    pub wake_ns: LatencyReport,
    /// SYNC release error.
    pub sync_ns: LatencyReport,
    /// Computing time from feedback to set-points, without I/O.
    pub compute_ns: LatencyReport,
    /// Time from the start of the slot until the last set-point was handed over.
    pub sent_ns: LatencyReport,
    /// How long the calls of callbacks took; absent if none was called.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub callback_ns: Option<LatencyReport>,
    /// Slots that passed unused.
    pub missed_slots: u64,
    /// The axes in the order of the configuration.
    pub axes: Vec<AxisSummary>,
    /// The changes of the buses' health.
    pub buses: Vec<BusChange>,
    /// The loads of the buses; none in a recording of an earlier version.
    pub bus_loads: Vec<BusLoadSummary>,
}

/// The load of a bus over the whole recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BusLoadSummary {
    /// Its name.
    pub name: String,
    /// The mean, from 0 to 1.
    pub mean: f64,
    /// The largest of about 100 ms.
    pub max: f64,
}

/// One group of several over the whole recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct GroupSummary {
    /// Its name.
    pub name: String,
    /// What it was doing in the last cycle; `None` without a cycle, and in a recording of an earlier version.
    pub phase: Option<&'static str>,
    /// Why it stopped first; `None` if it did not.
    pub stop: Option<Cause>,
    /// How long the calls of its callbacks took; absent if none was called.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub callback_ns: Option<LatencyReport>,
}

/// The cycles of one axis before the cause.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AxisCycles {
    /// Its name.
    pub name: String,
    /// `rad` or `m`.
    pub unit: &'static str,
    /// The last cycles, up to the one of the cause.
    pub cycles: Vec<AxisCycle>,
}

/// One axis in one cycle; rad for a rotary axis, m for a linear one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AxisCycle {
    /// The slot.
    pub slot: u64,
    /// The phase of its group.
    pub phase: &'static str,
    /// The set-point.
    pub position_set: f64,
    /// The position that the drive reported; `None` in a cycle without feedback.
    pub position: Option<f64>,
    /// The velocity set-point.
    pub velocity_set: f32,
    /// Actual velocity; `None` in a cycle without feedback.
    pub velocity: Option<f32>,
    /// Distance between the set-point in force and the position reported for it; `None` in a cycle without feedback.
    pub following_error: Option<f32>,
    /// Object 6041, as last reported.
    pub statusword: u16,
    /// The state of the drive that the statusword shows.
    pub state: &'static str,
    /// Object 6040.
    pub controlword: u16,
    /// Object 603F, as last reported.
    pub error_code: u16,
    /// Cycles since the drive last reported; 0 in a cycle with feedback.
    pub feedback_age: u16,
}

/// One axis over the whole recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AxisSummary {
    /// Its name.
    pub name: String,
    /// `rad` or `m`.
    pub unit: &'static str,
    /// The lowest position that the drive has reported.
    pub position_min: Option<f64>,
    /// The highest.
    pub position_max: Option<f64>,
    /// The largest following error while enabled.
    pub following_error_max: Option<f64>,
    /// When that was, in seconds after the beginning of the recording.
    pub following_error_max_at_s: Option<f64>,
    /// The largest torque (force) that the drive has reported, in N·m (N).
    pub torque_max: f64,
    /// The largest velocity, acceleration and jerk of its set-points.
    pub set_point_max: SetPointMagnitudes,
    /// The same as fractions of their limits.
    pub set_point_part: SetPointParts,
}

/// An event.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ReportedEvent {
    /// The slot in which it was seen.
    pub slot: u64,
    /// Seconds after the beginning of the recording; negative for an earlier event.
    pub at_s: f64,
    /// Its text.
    pub text: String,
}

/// A change of a bus.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BusChange {
    /// Its name.
    pub name: String,
    /// Seconds after the beginning of the recording.
    pub at_s: f64,
    /// The fault confinement state.
    pub state: &'static str,
    /// Error frames and bus errors since the run began.
    pub errors: u64,
    /// Frames that the interface had no room for.
    pub tx_overruns: u64,
    /// Received frames that were lost.
    pub rx_overruns: u64,
}

impl RecordingReport {
    /// Makes the report, with so many cycles of `axis`, or of the axis of the cause.
    ///
    /// # Errors
    /// See [`RecordedError`].
    pub fn new(recorded: &Recorded, axis: Option<usize>, cycles: u64) -> Result<Self, RecordedError> {
        let (machine, statistics) = (&recorded.machine, &recorded.statistics);
        let window = recorded.cycles(&recorded.slots_around_cause(cycles.saturating_sub(1), 0))?;
        let shown = axis.or_else(|| recorded.axis(None)).and_then(|axis| {
            let description = machine.axes.get(axis)?;
            let row = |cycle: &RecordedCycle| {
                let group = cycle.groups.get(description.group).copied().unwrap_or_default();
                Some(AxisCycle::new(cycle, group.phase, cycle.axes.get(axis)?))
            };
            Some(AxisCycles {
                name: description.name.clone(),
                unit: description.unit.symbol(),
                cycles: window.iter().filter_map(row).collect(),
            })
        });
        let told = counted_once(&recorded.events);
        let events: Vec<ReportedEvent> = told
            .iter()
            .map(|event| ReportedEvent {
                slot: event.slot,
                at_s: recorded.seconds(event.at_ns),
                text: event.text.clone(),
            })
            .collect();
        let is_emergency = |index: &usize| {
            matches!(told.get(*index).and_then(|event| event.kind), Some(EventKind::Emergency { .. }))
        };
        let emergencies =
            (0..events.len()).filter(is_emergency).filter_map(|index| events.get(index).cloned()).collect();
        let groups = match &machine.groups[..] {
            [] | [_] => vec![],
            several => several.iter().enumerate().map(|group| GroupSummary::new(recorded, group)).collect(),
        };
        let axes = machine.axes.iter().zip(&statistics.axes).map(|(description, axis)| AxisSummary {
            name: description.name.clone(),
            unit: description.unit.symbol(),
            position_min: axis.position_range.map(|(low, _)| low),
            position_max: axis.position_range.map(|(_, high)| high),
            following_error_max: axis.following_error_max.map(|largest| largest.error),
            following_error_max_at_s: axis.following_error_max.map(|largest| recorded.seconds(largest.at_ns)),
            torque_max: axis.torque_max,
            set_point_max: axis.set_point_max,
            set_point_part: SetPointParts::new(&axis.set_point_max, &description.limits),
        });
        let buses = recorded.health.iter().map(|(bus, traced)| BusChange {
            name: machine.buses.get(*bus).map_or_else(|| format!("bus {bus}"), |bus| bus.name.clone()),
            at_s: recorded.seconds(traced.at_ns),
            state: BusReport::state_words(traced.health.state),
            errors: traced.health.errors,
            tx_overruns: traced.health.tx_overruns,
            rx_overruns: traced.health.rx_overruns,
        });
        Ok(Self {
            recording: recorded.path.clone(),
            version: recorded.version.clone(),
            machine: machine.name.clone(),
            cycle_ns: machine.cycle_ns,
            begins: recorded.wall_clock.map(|clock| clock.moment(statistics.first_ns)),
            span_s: (recorded.seconds(statistics.first_ns), recorded.seconds(statistics.last_ns)),
            cycles: statistics.cycles,
            is_black_box: !recorded.incidents.is_empty(),
            warnings: recorded.warnings.clone(),
            cause: recorded.cause(),
            groups,
            axis: shown,
            events,
            emergencies,
            wake_ns: LatencyReport::new(&statistics.wake),
            sync_ns: LatencyReport::new(&statistics.sync),
            compute_ns: LatencyReport::new(&statistics.compute),
            sent_ns: LatencyReport::new(&statistics.sent),
            callback_ns: statistics.callback().as_ref().map(LatencyReport::new),
            missed_slots: statistics.missed_slots,
            axes: axes.collect(),
            buses: buses.collect(),
            bus_loads: bus_loads(recorded),
        })
    }
}

fn bus_loads(recorded: &Recorded) -> Vec<BusLoadSummary> {
    let of_bus = |(number, name): (usize, String)| {
        let loads = || recorded.loads.iter().filter(|load| load.bus == number).map(|load| load.load);
        let count = loads().count();
        (count > 0).then(|| BusLoadSummary {
            name,
            mean: loads().sum::<f64>() / count as f64,
            max: loads().fold(0.0, f64::max),
        })
    };
    recorded.machine.buses.iter().map(|bus| bus.name.clone()).enumerate().filter_map(of_bus).collect()
}

impl GroupSummary {
    fn new(recorded: &Recorded, (number, name): (usize, &String)) -> Self {
        Self {
            name: name.clone(),
            phase: recorded.last_phases.get(number).map(|phase| words::phase(*phase)),
            stop: recorded.cause_of_group(number),
            callback_ns: recorded.statistics.callback_of(number).map(LatencyReport::new),
        }
    }
}

impl AxisCycle {
    fn new(cycle: &RecordedCycle, phase: Phase, axis: &AxisRecord) -> Self {
        let is_fresh = axis.feedback_age == 0;
        Self {
            slot: cycle.timing.slot,
            phase: words::phase(phase),
            position_set: axis.position_set,
            position: is_fresh.then_some(axis.position),
            velocity_set: axis.velocity_set,
            velocity: is_fresh.then_some(axis.velocity),
            following_error: is_fresh.then_some(axis.following_error),
            statusword: axis.statusword,
            state: axis.drive_state.name(),
            controlword: axis.controlword,
            error_code: axis.error_code,
            feedback_age: axis.feedback_age,
        }
    }
}
