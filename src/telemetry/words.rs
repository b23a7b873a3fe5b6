//! The texts of stops, phases, events and rejections, with the names of the axes and the units of the values.

use takt_rt::{
    AxisSnapshot, Event, EventKind, OperationMode, Phase, Rule, Snapshot, StopCategory, StreamState,
    TimingLevel,
};

use super::machine::Machine;
use crate::words;
use crate::words::Words;

mod rejection;
mod stop;

pub use rejection::rejection;
pub use stop::stop;
#[doc(hidden)]
pub use stop::{stop_cause, stop_cure};

/// The name of a phase: "moving".
pub const fn phase(phase: Phase) -> &'static str {
    match phase {
        Phase::Passive => "passive",
        Phase::Disabled => "disabled",
        Phase::Enabling => "enabling",
        Phase::Holding => "holding",
        Phase::Moving => "moving",
        Phase::Streaming => "streaming",
        Phase::Stopping => "stopping",
        Phase::Disabling => "disabling",
    }
}

/// The key of a rule in reports: `following_error`.
pub const fn rule_key(rule: Rule) -> &'static str {
    rule.key()
}

/// The text of a stop category (IEC 60204-1, 9.2.2).
pub const fn category(category: StopCategory) -> &'static str {
    match category {
        StopCategory::Zero => "category 0: remove power at once",
        StopCategory::One => "category 1: decelerate, then remove power",
        StopCategory::Two => "category 2: decelerate, hold under power",
    }
}

/// The name of a mode of operation, with its number (object 6060).
fn mode(number: i8) -> Words {
    match OperationMode::from_number(number) {
        Some(mode) => words!("mode {number} ({name})", number, name = Words::from(mode.name())),
        None => words!("mode {number}", number),
    }
}

/// How many slots were missed.
pub(super) fn missed_slots(count: u64) -> Words {
    match count {
        1 => "1 slot was missed: the thread was late".into(),
        _ => words!("{count} slots were missed: the thread was late", count),
    }
}

/// An event as one line, without its time. Where there are several groups, the line begins with the one that it concerns, unless
/// it concerns an axis that it names.
pub fn event(event: &Event, machine: &Machine) -> Words {
    let is_of_axis = matches!(
        event.kind,
        EventKind::DriveState { .. } | EventKind::Mode { .. } | EventKind::Emergency { .. }
    );
    let what = what_happened(event, machine);
    match event.group.filter(|_| machine.groups.len() > 1 && !is_of_axis) {
        Some(group) => words!("{name}: {what}", name = machine.group_name(group), what),
        None => what,
    }
}

fn what_happened(event: &Event, machine: &Machine) -> Words {
    match event.kind {
        EventKind::PhaseChanged { from, to } => {
            words!("{from} → {to}", from = Words::from(phase(from)), to = Words::from(phase(to)))
        }
        EventKind::Stop(reason) => words!("stop: {stop}", stop = stop(&reason, machine)),
        EventKind::MotionFinished { request } => words!("motion {number} finished", number = request.0),
        EventKind::Stream { state: StreamState::Idle } => "stream: over".into(),
        EventKind::Stream { state: StreamState::Awaited } => "stream: awaited".into(),
        EventKind::Stream { state: StreamState::Following } => "stream: followed".into(),
        EventKind::Stream { state: StreamState::Dry } => {
            "stream: the points have run out, the axes come to rest".into()
        }
        EventKind::Stream { state: StreamState::Callback } => "a callback leads the axes".into(),
        EventKind::DriveState { axis, state, statusword } => words!(
            "{axis}: {state}{statusword}",
            axis = machine.axis_name(axis),
            state = Words::from(state.name()),
            statusword = machine.statusword(Some(axis), statusword)
        ),
        EventKind::Mode { axis, mode: new } => {
            words!("{axis}: changed to {mode}", axis = machine.axis_name(axis), mode = mode(new as i8))
        }
        EventKind::Emergency { axis, code: 0, .. } => {
            words!("{axis}: emergency message: no error any more", axis = machine.axis_name(axis))
        }
        EventKind::Emergency { axis, code, register, manufacturer: [a, b, c, d, e] } => words!(
            "{axis}: emergency message: error {error}, register {register}, manufacturer {bytes}; try: {cure}",
            axis = machine.axis_name(axis),
            error = machine.drive_error(axis, code),
            register = format!("0x{register:02X}"),
            bytes = format!("{a:02X} {b:02X} {c:02X} {d:02X} {e:02X}"),
            cure = Words::from(machine.drive_cure(axis, code))
        ),
        EventKind::Timing { level: TimingLevel::Normal } => "missed slots: normal again".into(),
        EventKind::Timing { level: TimingLevel::Warning } => "missed slots: many".into(),
        EventKind::Timing { level: TimingLevel::Degraded } => {
            "missed slots: too many to begin a stream".into()
        }
        EventKind::Timing { level: TimingLevel::Unfit } => "missed slots: too many to go on".into(),
        EventKind::MissedSlots { count } => missed_slots(count),
        EventKind::Rejected(rejected) => rejection(&rejected, machine),
    }
}

/// The axes whose drives do not report at present, and since when, for a line of status; `None` if every drive reports, or if none
/// is asked yet.
pub fn silence(snapshot: &Snapshot, machine: &Machine) -> Option<String> {
    if snapshot.groups().iter().all(|group| group.phase == Phase::Passive) {
        return None;
    }
    let silent = |(number, axis): (u8, &AxisSnapshot)| {
        let name = machine.axis_name(number);
        match axis.feedback_age_ns(snapshot.at_ns) {
            _ if !axis.is_stale() => None,
            None => Some(format!("{name} (never)")),
            Some(age_ns) => Some(format!("{name} ({} ms ago)", age_ns / 1_000_000)),
        }
    };
    let silent: Vec<String> = (0..).zip(snapshot.axes()).filter_map(silent).collect();
    (!silent.is_empty()).then(|| format!("no feedback from {}", silent.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::telemetry::machine::{AxisDescription, BusDescription, SetPointMagnitudes, Unit};
    use takt_rt::DriveState;
    use takt_rt::{RejectReason, RequestError, RequestKind};

    pub(super) fn machine() -> Machine {
        let axis = |name: &str, unit| AxisDescription {
            name: name.to_owned(),
            bus: None,
            group: 0,
            family: Some("erob-canopen".to_owned()),
            own_errors: vec![],
            unit,
            plans_own_profile: false,
            counts_per_unit: 1.0,
            limits: SetPointMagnitudes::default(),
        };
        Machine {
            name: "arm".to_owned(),
            cycle_ns: 1_000_000,
            axes: vec![axis("shoulder", Unit::Radian), axis("slide", Unit::Metre)],
            buses: vec![BusDescription {
                name: "left".to_owned(),
                interface: "can0".to_owned(),
                bit_rate: None,
                data_bit_rate: None,
            }],
            groups: vec![],
        }
    }

    #[test]
    fn a_drive_without_a_statusword_is_said_to_have_none() {
        let mut damiao = machine();
        damiao.axes[0].family = Some("bit-fields".to_owned());
        let kind = EventKind::DriveState { axis: 0, state: DriveState::OperationEnabled, statusword: 0x0007 };
        let text = event(&Event { slot: 1, at_ns: 2, group: Some(0), kind }, &damiao);
        assert_eq!(text.to_string(), "shoulder: operation enabled");
    }

    #[test]
    fn events_read_as_sentences() {
        let words = |kind| event(&Event { slot: 1, at_ns: 2, group: Some(0), kind }, &machine()).to_string();
        assert_eq!(
            words(EventKind::PhaseChanged { from: Phase::Enabling, to: Phase::Holding }),
            "enabling → holding"
        );
        assert_eq!(
            words(EventKind::DriveState { axis: 0, state: DriveState::OperationEnabled, statusword: 0x1637 }),
            "shoulder: operation enabled (statusword 0x1637)"
        );
        assert_eq!(
            words(EventKind::Emergency {
                axis: 1,
                code: 0x7305,
                register: 0x21,
                manufacturer: [1, 2, 3, 4, 0xFF]
            }),
            "slide: emergency message: error 0x7305 (incremental sensor 1 fault), register 0x21, \
             manufacturer 01 02 03 04 FF; try: check the encoder and its cable, then power-cycle the drive"
        );
        assert_eq!(
            words(EventKind::Mode { axis: 0, mode: OperationMode::CyclicSynchronousVelocity }),
            "shoulder: changed to mode 9 (cyclic synchronous velocity)"
        );
        assert_eq!(words(EventKind::MissedSlots { count: 30 }), "30 slots were missed: the thread was late");
        assert_eq!(
            words(EventKind::Rejected(RequestError {
                request: RequestKind::Enable,
                reason: RejectReason::Phase,
                axis: None,
                phase: Phase::Moving,
            })),
            "enabling was rejected: not possible while moving"
        );
    }

    #[test]
    fn drives_that_do_not_report_are_named_with_how_long_ago_they_did() {
        let mut snapshot = Snapshot { at_ns: 90_000_000, axis_count: 2, ..Snapshot::default() };
        snapshot.axes[0] =
            AxisSnapshot { is_heard: true, feedback_ns: 78_000_000, ..AxisSnapshot::default() };
        assert_eq!(silence(&snapshot, &machine()), None, "in bring-up no drive reports yet");
        snapshot.groups[0].phase = Phase::Moving;
        assert_eq!(silence(&snapshot, &machine()).as_deref(), Some("no feedback from slide (never)"));
        snapshot.axes[0].feedback_age = 12;
        snapshot.axes[1].is_heard = true;
        assert_eq!(silence(&snapshot, &machine()).as_deref(), Some("no feedback from shoulder (12 ms ago)"));
        snapshot.axes[0].feedback_age = 0;
        assert_eq!(silence(&snapshot, &machine()), None);
    }
}
