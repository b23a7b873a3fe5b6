//! Stops, phases and events in words, with the names of the axes and the units of the values.
//!
//! What [`StopReason::value`] and [`StopReason::limit`] mean follows from the rule: rad (m) and their derivatives for
//! the limits and the following error; cycles for a stale command, missed feedback and an enable time-out; the error
//! code for a drive fault; the statusword for a drive that has disabled itself; object 6061 against 6060 for a
//! changed mode; the number of the bus for a lost bus; frames not yet on the wire for set-points not transmitted.

use takt_rt::cia402::{OperationMode, State};
use takt_rt::record::{Event, EventKind};
use takt_rt::stop::{Phase, Rule, StopCategory, StopReason};
use takt_rt::watch::TimingLevel;

use super::machine::{Machine, Unit};

mod refusal;

pub use refusal::{refusal, request};

/// What the group was doing, as a verb: "moving".
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

/// A rule by its key in reports: `following_error`.
pub const fn rule_key(rule: Rule) -> &'static str {
    rule.key()
}

/// What a category does (IEC 60204-1, 9.2.2).
pub const fn category(category: StopCategory) -> &'static str {
    match category {
        StopCategory::Zero => "category 0: power removed at once",
        StopCategory::One => "category 1: decelerated, then power removed",
        StopCategory::Two => "category 2: decelerated, held under power",
    }
}

/// A state of a drive (CiA 402).
pub const fn state(state: State) -> &'static str {
    match state {
        State::NotReadyToSwitchOn => "not ready to switch on",
        State::SwitchOnDisabled => "switch on disabled",
        State::ReadyToSwitchOn => "ready to switch on",
        State::SwitchedOn => "switched on",
        State::OperationEnabled => "operation enabled",
        State::QuickStopActive => "quick stop active",
        State::FaultReactionActive => "fault reaction active",
        State::Fault => "fault",
        State::Undefined => "no state of CiA 402",
    }
}

/// A mode of operation by its number.
fn mode(number: f64) -> String {
    let name = match OperationMode::from_number(number as i8) {
        Some(OperationMode::ProfilePosition) => "profile position",
        Some(OperationMode::Velocity) => "velocity",
        Some(OperationMode::ProfileVelocity) => "profile velocity",
        Some(OperationMode::ProfileTorque) => "profile torque",
        Some(OperationMode::Homing) => "homing",
        Some(OperationMode::InterpolatedPosition) => "interpolated position",
        Some(OperationMode::CyclicSynchronousPosition) => "cyclic synchronous position",
        Some(OperationMode::CyclicSynchronousVelocity) => "cyclic synchronous velocity",
        Some(OperationMode::CyclicSynchronousTorque) => "cyclic synchronous torque",
        None => return format!("mode {number:.0}"),
    };
    format!("mode {number:.0} ({name})")
}

/// Why the group stopped, without how and when: "joint3 was 0.0214 rad from its set-point (allowed: 0.0200 rad)".
pub fn stop_cause(stop: &StopReason, machine: &Machine) -> String {
    let axis = stop.axis.map_or_else(|| "an axis".to_owned(), |axis| machine.axis_name(axis));
    let unit = stop.axis.map_or(Unit::Radian, |axis| machine.axis_unit(axis)).symbol();
    let (value, limit) = (stop.value, stop.limit);
    match stop.rule {
        Rule::Requested => "a stop was asked for".to_owned(),
        Rule::NotFinite => format!("the set-point of {axis} was not a finite number ({value})"),
        Rule::PositionLimit => format!(
            "the set-point of {axis}, {value:.4} {unit}, lay outside its position limit of {limit:.4} {unit}"
        ),
        Rule::VelocityLimit => {
            format!("the set-point of {axis} asked for {value:.3} {unit}/s (allowed: {limit:.3} {unit}/s)")
        }
        Rule::AccelerationLimit => {
            format!("the set-point of {axis} asked for {value:.2} {unit}/s² (allowed: {limit:.2} {unit}/s²)")
        }
        Rule::FollowingError => {
            format!("{axis} was {value:.4} {unit} from its set-point (allowed: {limit:.4} {unit})")
        }
        Rule::StaleCommand if stop.axis.is_some() => {
            format!("what {axis} had been asked for expired and was not asked for again")
        }
        // One that has begun may be late by nothing.
        Rule::StaleCommand if limit > 0.0 => {
            format!("the stream of set-points did not begin within {}", cycles(limit))
        }
        Rule::StaleCommand => {
            "the stream of set-points ended: its last command expired and no newer one came".to_owned()
        }
        // At least one may always be missing: this is not about missing ones.
        Rule::MissedFeedback if limit == 0.0 => {
            format!("the drive of {axis} always answers {} late", cycles(value))
        }
        Rule::MissedFeedback => {
            format!("{axis} has not reported in time for {} (allowed: {limit:.0})", cycles(value))
        }
        Rule::DriveFault => {
            let code = value as u32;
            if code == 0 {
                format!("the drive of {axis} reports a fault without an error code")
            } else {
                format!("the drive of {axis} reports fault 0x{code:04X}")
            }
        }
        Rule::DriveDisabled => format!(
            "the drive of {axis} left operation enabled by itself (statusword 0x{:04X})",
            value as u16
        ),
        Rule::ModeChanged => {
            format!("the drive of {axis} shows {} instead of {}", mode(value), mode(limit))
        }
        Rule::NotAcknowledged => {
            format!("the drive of {axis} did not acknowledge its target within {}", cycles(limit))
        }
        Rule::NodeLost => {
            format!("no heartbeat of {axis} has come for {} (allowed: {limit:.0})", cycles(value))
        }
        Rule::NodeNotOperational => {
            format!(
                "the node of {axis} is no longer operational: its heartbeat shows state 0x{:02X}",
                value as u8
            )
        }
        Rule::UnexpectedBootUp => format!("the drive of {axis} has started anew in the middle of its work"),
        Rule::EmergencyMessage => {
            format!("the drive of {axis} sent emergency message 0x{:04X} and shows no fault", value as u16)
        }
        Rule::DuplicateNode => {
            format!("two nodes answer under the number of {axis}, {value:.0}: its feedback comes twice")
        }
        Rule::ForeignMaster => format!(
            "somebody else sends what only this controller may: a frame with identifier 0x{:03X}",
            value as u32
        ),
        Rule::TimingUnfit => {
            format!("the controller misses its slots too often: {value:.0} of late (allowed: {limit:.0})")
        }
        Rule::StartPose => format!(
            "the stream of set-points began {value:.4} {unit} from where {axis} is (allowed: {limit:.4} {unit})"
        ),
        Rule::JerkLimit => {
            format!("the set-point of {axis} asked for {value:.1} {unit}/s³ (allowed: {limit:.1} {unit}/s³)")
        }
        Rule::ImplausibleFeedback => format!(
            "{axis} was reported {value:.4} {unit} from where it was, further than it can have got ({limit:.4} {unit})"
        ),
        Rule::BusErrorPassive => {
            format!("bus {} is error-passive: hardly a frame gets through", bus_name(value, machine))
        }
        Rule::EnableTimeout => format!(
            "the drive of {axis} did not reach operation enabled within {} ({:.1} s)",
            cycles(limit),
            limit * machine.cycle_ns as f64 * 1e-9
        ),
        Rule::NoTrajectory => match stop.axis {
            Some(_) => format!("no trajectory leads {axis} to what was asked"),
            None => "no trajectory leads to what was asked".to_owned(),
        },
        Rule::BusLost => {
            format!("bus {} is bus-off or its interface is down", bus_name(value, machine))
        }
        Rule::NotTransmitted => {
            let of = stop.axis.map_or_else(String::new, |_| format!(" of {axis}"));
            format!("set-points{of} are not getting onto the wire for {}", cycles(value))
        }
    }
}

fn cycles(count: f64) -> String {
    if count == 1.0 { "1 cycle".to_owned() } else { format!("{count:.0} cycles") }
}

/// The whole story of a stop: cause, what was going on, and how.
pub fn stop(stop: &StopReason, machine: &Machine) -> String {
    format!("{} while {}; {}", stop_cause(stop, machine), phase(stop.phase), category(stop.category))
}

/// An event as one line, without its time.
pub fn event(event: &Event, machine: &Machine) -> String {
    match event.kind {
        EventKind::PhaseChanged { from, to } => format!("{} → {}", phase(from), phase(to)),
        EventKind::Stop(reason) => format!("stop: {}", stop(&reason, machine)),
        EventKind::MoveFinished { id } => format!("move {id} finished"),
        EventKind::DriveState { axis, state: to, statusword } => {
            format!("{}: {} (statusword 0x{statusword:04X})", machine.axis_name(axis), state(to))
        }
        EventKind::Emergency { axis, code: 0, .. } => {
            format!("{}: emergency message: all errors gone", machine.axis_name(axis))
        }
        EventKind::Emergency { axis, code, register, manufacturer: [a, b, c, d, e] } => format!(
            "{}: emergency message: error 0x{code:04X}, register 0x{register:02X}, \
             manufacturer {a:02X} {b:02X} {c:02X} {d:02X} {e:02X}",
            machine.axis_name(axis)
        ),
        EventKind::Timing { level: TimingLevel::Normal } => "slots are hardly missed any more".to_owned(),
        EventKind::Timing { level: TimingLevel::Warning } => "slots are missed often".to_owned(),
        EventKind::Timing { level: TimingLevel::Degraded } => {
            "slots are missed so often that no stream is begun".to_owned()
        }
        EventKind::Timing { level: TimingLevel::Unfit } => "slots are missed too often to go on".to_owned(),
        EventKind::MissedSlots { count: 1 } => "1 slot passed unused: the thread was late".to_owned(),
        EventKind::MissedSlots { count } => format!("{count} slots passed unused: the thread was late"),
        EventKind::Refused(refused) => refusal(&refused, machine),
    }
}

fn bus_name(number: f64, machine: &Machine) -> String {
    machine.buses.get(number as usize).map_or_else(|| format!("{number:.0}"), |bus| bus.name.clone())
}

#[cfg(test)]
mod tests {
    use super::super::machine::SetPointMagnitudes;
    use super::*;
    use crate::telemetry::machine::{AxisDescription, BusDescription};
    use takt_rt::refusal::{Objection, Refusal, RequestKind};

    fn machine() -> Machine {
        let axis = |name: &str, unit| AxisDescription {
            name: name.to_owned(),
            unit,
            counts_per_unit: 1.0,
            limits: SetPointMagnitudes::default(),
        };
        Machine {
            name: "arm".to_owned(),
            cycle_ns: 1_000_000,
            axes: vec![axis("shoulder", Unit::Radian), axis("slide", Unit::Metre)],
            buses: vec![BusDescription { name: "left".to_owned(), interface: "can0".to_owned() }],
        }
    }

    fn reason(rule: Rule, axis: Option<u8>, value: f64, limit: f64) -> StopReason {
        StopReason { category: StopCategory::One, rule, axis, value, limit, slot: 9, phase: Phase::Moving }
    }

    #[test]
    fn every_cause_names_its_axis_and_its_unit() {
        let cases = [
            (
                Rule::FollowingError,
                Some(0),
                0.0214,
                0.02,
                "shoulder was 0.0214 rad from its set-point (allowed: 0.0200 rad)",
            ),
            (
                Rule::StaleCommand,
                None,
                3.0,
                0.0,
                "the stream of set-points ended: its last command expired and no newer one came",
            ),
            (
                Rule::StaleCommand,
                None,
                501.0,
                500.0,
                "the stream of set-points did not begin within 500 cycles",
            ),
            (
                Rule::StaleCommand,
                Some(1),
                1.0,
                0.0,
                "what slide had been asked for expired and was not asked for again",
            ),
            (
                Rule::ImplausibleFeedback,
                Some(0),
                0.5,
                0.0101,
                "shoulder was reported 0.5000 rad from where it was, further than it can have got (0.0101 rad)",
            ),
            (
                Rule::VelocityLimit,
                Some(1),
                2.5,
                2.0,
                "the set-point of slide asked for 2.500 m/s (allowed: 2.000 m/s)",
            ),
            (
                Rule::MissedFeedback,
                Some(1),
                4.0,
                3.0,
                "slide has not reported in time for 4 cycles (allowed: 3)",
            ),
            (Rule::MissedFeedback, Some(1), 2.0, 0.0, "the drive of slide always answers 2 cycles late"),
            (Rule::DriveFault, Some(0), 0x730F.into(), 0.0, "the drive of shoulder reports fault 0x730F"),
            (
                Rule::DriveDisabled,
                Some(0),
                0x1250.into(),
                0.0,
                "the drive of shoulder left operation enabled by itself (statusword 0x1250)",
            ),
            (
                Rule::ModeChanged,
                Some(0),
                1.0,
                8.0,
                "the drive of shoulder shows mode 1 (profile position) instead of \
              mode 8 (cyclic synchronous position)",
            ),
            (
                Rule::EnableTimeout,
                Some(9),
                0.0,
                2000.0,
                "the drive of axis 9 did not reach operation enabled within 2000 cycles (2.0 s)",
            ),
            (Rule::BusLost, None, 0.0, 0.0, "bus left is bus-off or its interface is down"),
            (Rule::NotTransmitted, None, 6.0, 0.0, "set-points are not getting onto the wire for 6 cycles"),
            (
                Rule::StartPose,
                Some(1),
                0.5,
                0.002,
                "the stream of set-points began 0.5000 m from where slide is (allowed: 0.0020 m)",
            ),
            (
                Rule::JerkLimit,
                Some(0),
                250.0,
                100.0,
                "the set-point of shoulder asked for 250.0 rad/s³ (allowed: 100.0 rad/s³)",
            ),
            (
                Rule::NodeLost,
                Some(0),
                301.0,
                300.0,
                "no heartbeat of shoulder has come for 301 cycles (allowed: 300)",
            ),
            (
                Rule::NodeNotOperational,
                Some(0),
                127.0,
                5.0,
                "the node of shoulder is no longer operational: its heartbeat shows state 0x7F",
            ),
            (
                Rule::EmergencyMessage,
                Some(0),
                0x4310.into(),
                0.0,
                "the drive of shoulder sent emergency message 0x4310 and shows no fault",
            ),
            (
                Rule::ForeignMaster,
                None,
                0x080.into(),
                0.0,
                "somebody else sends what only this controller may: a frame with identifier 0x080",
            ),
            (
                Rule::TimingUnfit,
                None,
                250.0,
                250.0,
                "the controller misses its slots too often: 250 of late (allowed: 250)",
            ),
            (Rule::BusErrorPassive, None, 0.0, 0.0, "bus left is error-passive: hardly a frame gets through"),
            (
                Rule::NotAcknowledged,
                Some(0),
                501.0,
                500.0,
                "the drive of shoulder did not acknowledge its target within 500 cycles",
            ),
        ];
        for (rule, axis, value, limit, words) in cases {
            assert_eq!(stop_cause(&reason(rule, axis, value, limit), &machine()), words);
        }
    }

    #[test]
    fn a_stop_tells_cause_phase_and_category() {
        assert_eq!(
            stop(&reason(Rule::Requested, None, 0.0, 0.0), &machine()),
            "a stop was asked for while moving; category 1: decelerated, then power removed"
        );
    }

    #[test]
    fn no_two_rules_share_a_key_or_a_cause() {
        let causes = Rule::ALL.map(|rule| stop_cause(&reason(rule, Some(0), 1.0, 2.0), &machine()));
        let keys = Rule::ALL.map(rule_key);
        for (index, rule) in Rule::ALL.into_iter().enumerate() {
            assert!(!causes[..index].contains(&causes[index]), "{rule:?}");
            assert!(!keys[..index].contains(&keys[index]), "{rule:?}");
        }
    }

    #[test]
    fn events_read_as_sentences() {
        let words = |kind| event(&Event { slot: 1, at_ns: 2, kind }, &machine());
        assert_eq!(
            words(EventKind::PhaseChanged { from: Phase::Enabling, to: Phase::Holding }),
            "enabling → holding"
        );
        assert_eq!(
            words(EventKind::DriveState { axis: 0, state: State::OperationEnabled, statusword: 0x1637 }),
            "shoulder: operation enabled (statusword 0x1637)"
        );
        assert_eq!(
            words(EventKind::Emergency {
                axis: 1,
                code: 0x7305,
                register: 0x21,
                manufacturer: [1, 2, 3, 4, 0xFF]
            }),
            "slide: emergency message: error 0x7305, register 0x21, manufacturer 01 02 03 04 FF"
        );
        assert_eq!(
            words(EventKind::MissedSlots { count: 30 }),
            "30 slots passed unused: the thread was late"
        );
        assert_eq!(
            words(EventKind::Refused(Refusal {
                request: RequestKind::Enable,
                objection: Objection::Phase,
                axis: None,
                value: 0.0,
                limit: 0.0,
                phase: Phase::Moving,
            })),
            "enabling was refused: not possible while moving"
        );
    }
}
