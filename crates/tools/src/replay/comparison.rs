//! A replay beside the recording that it was made from.

use takt_rt::{AxisRecord, CycleRecord, CycleTiming, Event, EventKind, GroupRecord, StopReason};

use super::{Replay, ReplayError};
use takt::config::Config;
use takt::journal::Journal;
use takt::telemetry::{Recorded, RecordedError};

/// What has come out.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Comparison {
    /// Cycles that were replayed.
    pub cycles: u64,
    /// Cycles of the recording that were compared with their replay.
    pub compared: u64,
    /// Cycles of the recording behind the end of the replay.
    pub missing: u64,
    /// Cycles that differ in any bit.
    pub differing: u64,
    /// The first of them.
    pub first: Option<FirstDifference>,
    /// What each axis does otherwise, in the order of the configuration.
    pub axes: Vec<AxisDifference>,
    /// The stops of the replay, with their groups.
    pub stops: Vec<(Option<u8>, StopReason)>,
    /// The names of the axes.
    names: Vec<String>,
    /// When all axes were last moved by set-points, in seconds after the first cycle: in the recording, and in the replay.
    pub last_motion_s: (f64, f64),
}

/// The first cycle that differs.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstDifference {
    /// Its slot.
    pub slot: u64,
    /// What differs: `timing`, `groups`, or an axis and its field.
    pub what: String,
    /// What the recording has, and the replay.
    pub values: (String, String),
}

/// What an axis does otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisDifference {
    /// The largest distance of the position set-points (rad or m), and its slot.
    pub position: f64,
    /// The slot of that.
    pub slot: u64,
    /// The largest speed of the recording, and of the replay (rad/s or m/s).
    pub velocity: (f64, f64),
    /// The same of the acceleration.
    pub acceleration: (f64, f64),
    /// The same of the jerk.
    pub jerk: (f64, f64),
}

/// Replays a journal under a configuration, and compares it with the files of its recording, one after the other, as far as they have the same axes. Each cycle is also
/// handed to `each`.
///
/// # Errors
/// The journal cannot be replayed, or the recording not be read.
pub fn compare(
    files: impl IntoIterator<Item = Result<Recorded, RecordedError>>,
    config: &Config,
    journal: Journal,
    mut each: impl FnMut(&CycleRecord, &[Event]),
) -> Result<Comparison, CompareError> {
    let mut replay = Replay::new(config, journal)?;
    let mut comparison = Comparison {
        axes: vec![AxisDifference::default(); config.axes.len()],
        names: config.axes.iter().map(|axis| axis.name.clone()).collect(),
        ..Comparison::default()
    };
    let mut next: Option<CycleRecord> = None;
    let mut first_ns = None;
    let mut step = |comparison: &mut Comparison| -> Option<CycleRecord> {
        let record = *replay.step()?;
        let events = replay.take_events();
        comparison.cycles += 1;
        comparison.stops.extend(events.iter().filter_map(|event| match event.kind {
            EventKind::Stop(stop) => Some((event.group, stop)),
            _ => None,
        }));
        each(&record, &events);
        Some(record)
    };
    let mut compare_cycle = |record: &CycleRecord| {
        let slot = record.timing.slot;
        // Records that the logger has lost are not in the recording.
        while next.as_ref().is_none_or(|replayed| replayed.timing.slot < slot) {
            match step(&mut comparison) {
                Some(replayed) => next = Some(replayed),
                None => {
                    comparison.missing += 1;
                    return;
                }
            }
        }
        if let Some(replayed) = next.as_ref().filter(|replayed| replayed.timing.slot == slot) {
            let begun_ns = *first_ns.get_or_insert(record.timing.slot_start_ns);
            comparison.take(
                record,
                replayed,
                record.timing.slot_start_ns.saturating_sub(begun_ns) as f64 / 1e9,
            );
        }
    };
    for file in files {
        file?.each_cycle(&mut compare_cycle)?;
    }
    while step(&mut comparison).is_some() {}
    Ok(comparison)
}

/// Why nothing could be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// The journal cannot be replayed.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recorded(#[from] RecordedError),
}

impl Comparison {
    /// Returns `true` if every cycle that was compared is the same, bit for bit.
    pub fn is_identical(&self) -> bool {
        self.differing == 0 && self.missing == 0 && self.compared > 0
    }

    fn take(&mut self, recorded: &CycleRecord, replayed: &CycleRecord, at_s: f64) {
        self.compared += 1;
        if let Some((what, values)) = difference(recorded, replayed, &self.names) {
            self.differing += 1;
            let slot = recorded.timing.slot;
            self.first.get_or_insert(FirstDifference { slot, what, values });
        }
        for ((axis, was), is) in self.axes.iter_mut().zip(recorded.axes()).zip(replayed.axes()) {
            let distance = (was.position_set - is.position_set).abs();
            if distance > axis.position {
                (axis.position, axis.slot) = (distance, recorded.timing.slot);
            }
            let larger = |most: &mut (f64, f64), was: f32, is: f32| {
                *most = (most.0.max(was.abs().into()), most.1.max(is.abs().into()));
            };
            larger(&mut axis.velocity, was.velocity_set, is.velocity_set);
            larger(&mut axis.acceleration, was.acceleration_set, is.acceleration_set);
            larger(&mut axis.jerk, was.jerk_set, is.jerk_set);
        }
        let is_moving = |record: &CycleRecord| record.axes().iter().any(|axis| axis.velocity_set != 0.0);
        if is_moving(recorded) {
            self.last_motion_s.0 = at_s;
        }
        if is_moving(replayed) {
            self.last_motion_s.1 = at_s;
        }
    }
}

/// The first difference of two records of one slot, in any bit.
fn difference(was: &CycleRecord, is: &CycleRecord, names: &[String]) -> Option<(String, (String, String))> {
    let found = |what: String, was: String, is: String| Some((what, (was, is)));
    if was.timing != is.timing {
        let show = |timing: &CycleTiming| format!("{timing:?}");
        return found("timing".to_owned(), show(&was.timing), show(&is.timing));
    }
    if was.is_commanded != is.is_commanded {
        let show = |is_commanded: bool| is_commanded.to_string();
        return found("set-points sent".to_owned(), show(was.is_commanded), show(is.is_commanded));
    }
    if was.groups() != is.groups() {
        let show = |groups: &[GroupRecord]| format!("{groups:?}");
        return found("groups".to_owned(), show(was.groups()), show(is.groups()));
    }
    if was.axes().len() != is.axes().len() {
        return found("axes".to_owned(), was.axes().len().to_string(), is.axes().len().to_string());
    }
    was.axes().iter().zip(is.axes()).enumerate().find_map(|(axis, (was, is))| {
        let (field, was, is) = axis_difference(was, is)?;
        let name = names.get(axis).map_or("", String::as_str);
        found(format!("{name}: {field}"), was, is)
    })
}

/// The first field of an axis that differs in any bit.
fn axis_difference(was: &AxisRecord, is: &AxisRecord) -> Option<(&'static str, String, String)> {
    let double = |name, was: f64, is: f64| {
        (was.to_bits() != is.to_bits()).then(|| (name, was.to_string(), is.to_string()))
    };
    let single = |name, was: f32, is: f32| {
        (was.to_bits() != is.to_bits()).then(|| (name, was.to_string(), is.to_string()))
    };
    let whole = |name, was: i64, is: i64| (was != is).then(|| (name, was.to_string(), is.to_string()));
    let AxisRecord {
        position_set,
        position,
        velocity_set,
        acceleration_set,
        jerk_set,
        velocity,
        torque_set,
        torque,
        following_error,
        drive_state,
        controlword,
        statusword,
        error_code,
        feedback_age,
        command_raw,
        position_raw,
    } = *was;
    double("position set-point", position_set, is.position_set)
        .or_else(|| whole("command", command_raw.into(), is.command_raw.into()))
        .or_else(|| double("position", position, is.position))
        .or_else(|| single("velocity set-point", velocity_set, is.velocity_set))
        .or_else(|| single("acceleration set-point", acceleration_set, is.acceleration_set))
        .or_else(|| single("jerk set-point", jerk_set, is.jerk_set))
        .or_else(|| single("velocity", velocity, is.velocity))
        .or_else(|| single("torque set-point", torque_set, is.torque_set))
        .or_else(|| single("torque", torque, is.torque))
        .or_else(|| single("following error", following_error, is.following_error))
        .or_else(|| whole("controlword", controlword.into(), is.controlword.into()))
        .or_else(|| whole("statusword", statusword.into(), is.statusword.into()))
        .or_else(|| whole("error code", error_code.into(), is.error_code.into()))
        .or_else(|| whole("age of the feedback", feedback_age.into(), is.feedback_age.into()))
        .or_else(|| whole("position in counts", position_raw.into(), is.position_raw.into()))
        .or_else(|| whole("drive state", drive_state as i64, is.drive_state as i64))
}
