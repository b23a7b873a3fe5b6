//! What a recording or a black box tells: why the group stopped, what led to it, how the timing was.

use std::fmt::Write;
use std::ops::RangeInclusive;
use std::path::PathBuf;

use serde::Serialize;
use takt_rt::record::{AxisRecord, CycleRecord, EventKind};
use takt_rt::stop::{Rule, StopReason};

use super::machine::SetPointMagnitudes;
use super::picture::{self, Emphasis, latency_table, line, missed_slots, wrap};
use super::recorded::{Recorded, RecordedError};
use super::report::{BusReport, LatencyReport, SetPointParts};
use super::words;

/// Events that are told before the cause, and after it.
const EVENTS: (usize, usize) = (24, 12);

/// A recording in numbers and words.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordingReport {
    /// The file.
    pub recording: PathBuf,
    /// The version of takt that wrote it.
    pub version: String,
    /// The name of the machine.
    pub machine: String,
    /// Period of the cycle.
    pub cycle_ns: u64,
    /// When it begins, in UTC.
    pub begins: Option<String>,
    /// Cycles in it.
    pub cycles: u64,
    /// Whether it is the file of a black box.
    pub is_black_box: bool,
    /// What is not as it should be with the file.
    pub warnings: Vec<String>,
    /// Why the group stopped; `None` when it did not.
    pub cause: Option<Cause>,
    /// The axis concerned, or the one that was asked for; `None` when there is no cycle.
    pub axis: Option<AxisCycles>,
    /// What happened around the cause, or at last.
    pub events: Vec<ReportedEvent>,
    /// Every emergency message of a drive.
    pub emergencies: Vec<ReportedEvent>,
    /// How late the timer woke the thread.
    pub wake_ns: LatencyReport,
    /// SYNC release error.
    pub sync_ns: LatencyReport,
    /// From feedback to set-points, without I/O.
    pub compute_ns: LatencyReport,
    /// When the last set-point had been handed over, after the start of the slot.
    pub sent_ns: LatencyReport,
    /// Slots that passed unused.
    pub missed_slots: u64,
    /// The axes in the order of the configuration.
    pub axes: Vec<AxisSummary>,
    /// What became worse on the buses; an ordinary recording does not have it.
    pub buses: Vec<BusChange>,
}

/// Why the group stopped.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cause {
    /// In words.
    pub reason: String,
    /// The rule by its key.
    pub rule: String,
    /// IEC 60204-1: 0, 1 or 2; `None` when there was nothing to stop.
    pub category: Option<u8>,
    /// The axis concerned.
    pub axis: Option<String>,
    /// What was seen, in the unit of the rule.
    pub value: Option<f64>,
    /// What would have been allowed.
    pub limit: Option<f64>,
    /// The slot in which it was seen.
    pub slot: u64,
    /// What the group was doing.
    pub phase: Option<String>,
}

/// The cycles of one axis that led to the cause.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
pub struct AxisCycle {
    /// The slot.
    pub slot: u64,
    /// What the group was doing.
    pub phase: &'static str,
    /// The set-point.
    pub position_set: f64,
    /// What the drive reported.
    pub position: f64,
    /// The velocity that was asked for.
    pub velocity_set: f32,
    /// Actual velocity.
    pub velocity: f32,
    /// Distance between the set-point in force and the position reported for it.
    pub following_error: f32,
    /// Object 6041.
    pub statusword: u16,
    /// The state of the drive that the statusword shows.
    pub state: &'static str,
    /// Object 6040.
    pub controlword: u16,
    /// Object 603F.
    pub error_code: u16,
    /// Cycles since the drive last reported.
    pub feedback_age: u16,
}

/// One axis over the whole recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisSummary {
    /// Its name.
    pub name: String,
    /// `rad` or `m`.
    pub unit: &'static str,
    /// The largest following error while enabled.
    pub following_error_max: Option<f64>,
    /// The largest velocity, acceleration and jerk of its set-points.
    pub set_point_max: SetPointMagnitudes,
    /// As parts of their limits.
    pub set_point_part: SetPointParts,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReportedEvent {
    /// The slot in which it was seen.
    pub slot: u64,
    /// After the beginning of the recording; negative for what was before it.
    pub at_s: f64,
    /// In words.
    pub text: String,
}

/// A change of a bus.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BusChange {
    /// Its name.
    pub name: String,
    /// After the beginning of the recording.
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

impl Recorded {
    /// Why the group stopped: what the black box was written for, else the first stop that nobody had asked for, else
    /// the first that somebody had.
    pub fn cause(&self) -> Option<Cause> {
        if let Some(fault) = self.faults.first() {
            let text = |key: &str| fault.get(key).cloned();
            let number = |key: &str| fault.get(key)?.parse::<f64>().ok();
            return Some(Cause {
                reason: text("reason").unwrap_or_default(),
                rule: text("rule").unwrap_or_default(),
                category: number("category").map(|category| category as u8),
                axis: text("axis"),
                value: number("value"),
                limit: number("limit"),
                slot: fault.get("slot").and_then(|slot| slot.parse().ok()).unwrap_or(0),
                phase: text("phase"),
            });
        }
        let stops = || {
            self.events.iter().filter_map(|event| match event.kind {
                Some(EventKind::Stop(stop)) => Some((event.slot, stop)),
                _ => None,
            })
        };
        let unrequested = stops().find(|(_, stop)| stop.rule != Rule::Requested);
        unrequested.or_else(|| stops().next()).map(|(slot, stop)| self.cause_of(slot, &stop))
    }

    fn cause_of(&self, slot: u64, stop: &StopReason) -> Cause {
        Cause {
            reason: words::stop(stop, &self.machine),
            rule: words::rule_key(stop.rule).to_owned(),
            category: Some(stop.category as u8),
            axis: stop.axis.map(|axis| self.machine.axis_name(axis)),
            value: Some(stop.value),
            limit: Some(stop.limit),
            slot,
            phase: Some(words::phase(stop.phase).to_owned()),
        }
    }

    /// The slots from so many before the cause (or the end, when there is none) to so many after it.
    pub fn slots_around_cause(&self, before: u64, after: u64) -> RangeInclusive<u64> {
        let (first, last) = self.slots.unwrap_or((0, 0));
        let slot = self.cause().map_or(last, |cause| cause.slot).clamp(first, last);
        slot.saturating_sub(before).max(first)..=slot.saturating_add(after).min(last)
    }

    /// The number of the axis with this name; without a name, of the axis concerned, or else of the one that was
    /// furthest from its set-points.
    pub fn axis(&self, name: Option<&str>) -> Option<usize> {
        let position = |name: &str| self.machine.axes.iter().position(|axis| axis.name == name);
        if let Some(name) = name {
            return position(name);
        }
        let error = |axis: &usize| {
            let largest = self.statistics.axes.get(*axis).and_then(|axis| axis.following_error_max);
            largest.map_or(0.0, |largest| largest.error)
        };
        let furthest =
            || (0..self.machine.axes.len()).max_by(|a, b| error(a).total_cmp(&error(b)).then(b.cmp(a)));
        self.cause().and_then(|cause| position(&cause.axis?)).or_else(furthest)
    }

    fn seconds(&self, at_ns: u64) -> f64 {
        (at_ns as f64 - self.statistics.first_ns as f64) * 1e-9
    }
}

impl RecordingReport {
    /// Puts it together, with so many cycles of the axis concerned, or of `axis`.
    ///
    /// # Errors
    /// See [`RecordedError`].
    pub fn new(recorded: &Recorded, axis: Option<usize>, cycles: u64) -> Result<Self, RecordedError> {
        let (machine, statistics) = (&recorded.machine, &recorded.statistics);
        let window = recorded.cycles(&recorded.slots_around_cause(cycles.saturating_sub(1), 0))?;
        let shown = axis.or_else(|| recorded.axis(None)).and_then(|axis| {
            let description = machine.axes.get(axis)?;
            let row = |record: &CycleRecord| Some(AxisCycle::new(record, record.axes().get(axis)?));
            Some(AxisCycles {
                name: description.name.clone(),
                unit: description.unit.symbol(),
                cycles: window.iter().filter_map(row).collect(),
            })
        });
        let events: Vec<ReportedEvent> = recorded
            .events
            .iter()
            .map(|event| ReportedEvent {
                slot: event.slot,
                at_s: recorded.seconds(event.at_ns),
                text: event.text.clone(),
            })
            .collect();
        let is_emergency = |index: &usize| {
            matches!(
                recorded.events.get(*index).and_then(|event| event.kind),
                Some(EventKind::Emergency { .. })
            )
        };
        let emergencies =
            (0..events.len()).filter(is_emergency).filter_map(|index| events.get(index).cloned()).collect();
        let cause = recorded.cause();
        let end = match &cause {
            Some(cause) => events.partition_point(|event| event.slot <= cause.slot) + EVENTS.1,
            None => events.len(),
        };
        let begin = end.saturating_sub(EVENTS.0 + EVENTS.1);
        let axes = machine.axes.iter().zip(&statistics.axes).map(|(description, axis)| AxisSummary {
            name: description.name.clone(),
            unit: description.unit.symbol(),
            following_error_max: axis.following_error_max.map(|largest| largest.error),
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
            cycles: statistics.cycles,
            is_black_box: !recorded.faults.is_empty(),
            warnings: recorded.warnings.clone(),
            cause,
            axis: shown,
            events: events.into_iter().take(end).skip(begin).collect(),
            emergencies,
            wake_ns: LatencyReport::new(&statistics.wake),
            sync_ns: LatencyReport::new(&statistics.sync),
            compute_ns: LatencyReport::new(&statistics.compute),
            sent_ns: LatencyReport::new(&statistics.sent),
            missed_slots: statistics.missed_slots,
            axes: axes.collect(),
            buses: buses.collect(),
        })
    }

    /// The report as text of at most 100 columns (but for paths, which are not broken).
    pub fn picture(&self, emphasis: Emphasis) -> String {
        let mut text = String::new();
        let kind = if self.is_black_box { "black box" } else { "recording" };
        let cycle_ms = self.cycle_ns as f64 * 1e-6;
        let begins = self.begins.as_ref().map_or_else(String::new, |begins| format!(" from {begins}"));
        let heading = emphasis.heading(&self.machine);
        line(&mut text, &format!("{heading}  {kind} of {} cycles of {cycle_ms} ms{begins}", self.cycles));
        for warning in &self.warnings {
            wrap(&mut text, &emphasis.bad("file"), 4, std::slice::from_ref(warning));
        }
        match &self.cause {
            Some(cause) if cause.rule == words::rule_key(Rule::Requested) => {
                wrap(&mut text, "stop", 4, &[format!("{} (slot {})", cause.reason, cause.slot)]);
            }
            Some(cause) => {
                wrap(
                    &mut text,
                    &emphasis.bad("why"),
                    3,
                    &[format!("{} (slot {})", cause.reason, cause.slot)],
                );
            }
            None => wrap(&mut text, "stop", 4, &["there is none in it".to_owned()]),
        }
        self.axis_cycles(&mut text, emphasis);
        self.what_happened(&mut text, emphasis);
        line(&mut text, "");
        let rows = [
            ("wake-up", &self.wake_ns),
            ("SYNC release", &self.sync_ns),
            ("computing", &self.compute_ns),
            ("set-points out at", &self.sent_ns),
        ];
        latency_table(&mut text, emphasis, &rows);
        missed_slots(&mut text, emphasis, self.missed_slots, self.cycles);
        self.axis_table(&mut text, emphasis);
        self.bus_table(&mut text, emphasis);
        text
    }

    fn axis_cycles(&self, text: &mut String, emphasis: Emphasis) {
        let Some(axis) = self.axis.as_ref().filter(|axis| !axis.cycles.is_empty()) else { return };
        let milli = if axis.unit == "m" { "mm" } else { "mrad" };
        let until = if self.cause.is_some() { "up to the stop" } else { "at the end" };
        line(text, "");
        line(
            text,
            &emphasis.heading(&format!("{}, the last {} cycles {until}", axis.name, axis.cycles.len())),
        );
        let units =
            [axis.unit.to_owned(), axis.unit.to_owned(), format!("{}/s", axis.unit), milli.to_owned()];
        let [set, actual, velocity, error] = units;
        line(
            text,
            &emphasis.heading(&format!(
                "{:>8} {:<9}{:>10}{:>10}{:>9}{:>9}  {:<28}{:>6}{:>4}",
                "slot", "phase", "set", "actual", "velocity", "error", "statusword", "6040", "age"
            )),
        );
        line(text, &format!("{:>8} {:<9}{set:>10}{actual:>10}{velocity:>9}{error:>9}", "", ""));
        for cycle in &axis.cycles {
            line(text, &cycle.row());
        }
    }

    fn what_happened(&self, text: &mut String, emphasis: Emphasis) {
        if !self.events.is_empty() {
            line(text, "");
            line(text, &emphasis.heading(&format!("{:>8} {:>10}  what happened", "slot", "s")));
        }
        for event in &self.events {
            let is_of_cause = self.cause.as_ref().is_some_and(|cause| cause.slot == event.slot);
            let row = format!("{:>8} {:>10.3}  {}", event.slot, event.at_s, event.text);
            let is_told_above = is_of_cause && event.text.starts_with("stop: ");
            line(text, &if is_told_above { emphasis.bad(&cut(&row)) } else { cut(&row) });
        }
        if !self.emergencies.is_empty() {
            let lines: Vec<String> =
                self.emergencies.iter().map(|event| format!("{:.3} s: {}", event.at_s, event.text)).collect();
            line(text, "");
            wrap(text, &emphasis.heading("emergencies"), 11, &lines);
        }
    }

    fn axis_table(&self, text: &mut String, emphasis: Emphasis) {
        line(text, "");
        let titles = format!(
            "{:<16}{:>18}{:>14}{:>14}{:>12}   {}",
            "axis", "following error", "velocity", "acceleration", "jerk", "(largest, of the limit)"
        );
        line(text, &emphasis.heading(&titles));
        for axis in &self.axes {
            let milli = if axis.unit == "m" { "mm" } else { "mrad" };
            let error = axis.following_error_max;
            let error = error
                .map_or_else(|| "never enabled".to_owned(), |error| format!("{:.3} {milli}", error * 1e3));
            let SetPointParts { velocity, acceleration, jerk } = axis.set_point_part;
            let [velocity, acceleration, jerk] = [velocity, acceleration, jerk].map(picture::part);
            let name = picture::shortened(&axis.name, 16);
            line(text, &format!("{name:<16}{error:>18}{velocity:>14}{acceleration:>14}{jerk:>12}"));
        }
    }

    fn bus_table(&self, text: &mut String, emphasis: Emphasis) {
        if self.buses.is_empty() {
            return;
        }
        line(text, "");
        let titles = format!(
            "{:<16}{:>10}  {:<16}{:>10}{:>18}{:>20}",
            "bus", "s", "state", "errors", "sending overruns", "receiving overruns"
        );
        line(text, &emphasis.heading(&titles));
        for bus in &self.buses {
            let name = picture::shortened(&bus.name, 16);
            let row = format!(
                "{name:<16}{:>10.3}  {:<16}{:>10}{:>18}{:>20}",
                bus.at_s, bus.state, bus.errors, bus.tx_overruns, bus.rx_overruns
            );
            line(text, &row);
        }
    }
}

/// At most 100 columns of a line.
fn cut(row: &str) -> String {
    let mut cut: String = row.chars().take(99).collect();
    if row.chars().count() > 99 {
        let _ = write!(cut, "…");
    }
    cut
}

impl AxisCycle {
    fn new(record: &CycleRecord, axis: &AxisRecord) -> Self {
        Self {
            slot: record.timing.slot,
            phase: words::phase(record.phase),
            position_set: axis.position_set,
            position: axis.position,
            velocity_set: axis.velocity_set,
            velocity: axis.velocity,
            following_error: axis.following_error,
            statusword: axis.statusword,
            state: words::state(axis.state()),
            controlword: axis.controlword,
            error_code: axis.error_code,
            feedback_age: axis.feedback_age,
        }
    }

    fn row(&self) -> String {
        let status = format!("{:04X} {}", self.statusword, self.state);
        format!(
            "{:>8} {:<9}{:>10.5}{:>10.5}{:>+9.3}{:>+9.3}  {status:<28}{:>6}{:>4}",
            self.slot,
            self.phase,
            self.position_set,
            self.position,
            self.velocity,
            self.following_error * 1e3,
            format!("{:04X}", self.controlword),
            self.feedback_age,
        )
    }
}
