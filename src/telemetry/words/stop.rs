//! The texts of stops.

use takt_rt::{Fault, Id, StopCause, StopReason};
use takt_wire::printable::Shown;

use super::{category, mode, phase};
use crate::telemetry::machine::{Machine, Unit};
use crate::words;
use crate::words::Words;

/// Returns `true` if this is the identifier of an SDO request to a node (CiA 301, 7.3.3).
fn is_sdo_request(id: Id) -> bool {
    !id.is_extended() && (0x601..=0x67F).contains(&id.value())
}

/// The cause of a stop, without phase and category: "joint3 was 0.0214 rad from its set-point (allowed: 0.0200 rad)".
pub fn stop_cause(stop: &StopReason, machine: &Machine) -> Words {
    let axis = &stop.axis().map_or_else(|| "an axis".to_owned(), |axis| machine.axis_name(axis));
    let bus = || match stop.origin.bus() {
        Some(bus) => words!("bus {name}", name = machine.bus_name(bus)),
        None => "a bus".into(),
    };
    let unit = stop.axis().map_or(Unit::Radian, |axis| machine.axis_unit(axis));
    let (unit, effort) = (unit.symbol(), unit.effort_symbol());
    let length = |value| format!("{:.4} {unit}", Shown(value));
    let speed = |value| format!("{:.3} {unit}/s", Shown(value));
    let torque_of = |value| format!("{:.2} {effort}", Shown(value));
    let rounded = |value| format!("{:.3}", Shown(value));
    let error_of = |code| machine.drive_error(stop.axis().unwrap_or(u8::MAX), code);
    let StopCause::Fault(fault) = stop.cause else { return "a stop was requested".into() };
    // No set-point is sent to a drive that plans its own profile: its measured motion is checked.
    let is_measured = stop.axis().is_some_and(|axis| machine.plans_own_profile(axis));
    match fault {
        Fault::PositionLimit { position, limit } if is_measured => words!(
            "{axis} would come to rest at {position}, outside its position limit of {limit}",
            axis,
            position = length(position),
            limit = length(limit)
        ),
        Fault::FollowingError { .. } if is_measured => {
            words!("{axis} stood still, and its drive had not reached its target", axis)
        }
        Fault::NotFinite { position } => {
            words!("the set-point of {axis} was not a finite number ({position})", axis, position)
        }
        Fault::PositionLimit { position, limit } => words!(
            "the set-point of {axis}, {position}, was outside its position limit of {limit}",
            axis,
            position = length(position),
            limit = length(limit)
        ),
        Fault::VelocityLimit { velocity: wanted, limit } => asked_for(axis, speed(wanted), speed(limit)),
        Fault::AccelerationLimit { acceleration: wanted, limit } => {
            let acceleration = |value| format!("{:.2} {unit}/s²", Shown(value));
            asked_for(axis, acceleration(wanted), acceleration(limit))
        }
        Fault::JerkLimit { jerk: wanted, limit } => {
            let jerk = |value| format!("{:.1} {unit}/s³", Shown(value));
            asked_for(axis, jerk(wanted), jerk(limit))
        }
        Fault::FollowingError { error, limit } => words!(
            "{axis} was {error} from its set-point (allowed: {limit})",
            axis,
            error = length(error),
            limit = length(limit)
        ),
        Fault::StartPose { distance, limit } => words!(
            "the stream of set-points began {distance} from where {axis} is (allowed: {limit})",
            axis,
            distance = length(distance),
            limit = length(limit)
        ),
        Fault::ImplausibleFeedback { distance, reachable } => words!(
            "{axis} was reported {distance} from where it was, farther than it can have moved ({reachable})",
            axis,
            distance = length(distance),
            reachable = length(reachable)
        ),
        Fault::StaleCommand { .. } if stop.axis().is_some() => {
            words!("the velocity or torque of {axis} expired and was not renewed", axis)
        }
        Fault::StaleCommand { .. } => {
            "the stream of set-points ended: its last command expired and no newer one came".into()
        }
        Fault::StreamNotBegun { limit, .. } => {
            words!("the stream of set-points did not begin within {cycles}", cycles = cycles(limit))
        }
        Fault::MissedFeedback { cycles: missed, limit } => words!(
            "{axis} has not reported in time for {cycles} (allowed: {limit})",
            axis,
            cycles = cycles(missed),
            limit
        ),
        Fault::LateFeedback { cycles: late } => {
            words!("the drive of {axis} always answers {cycles} late", axis, cycles = cycles(late))
        }
        Fault::DriveFault { error_code: 0 } => {
            words!("the drive of {axis} reports a fault without an error code", axis)
        }
        Fault::DriveFault { error_code } => {
            words!("the drive of {axis} reports fault {error}", axis, error = error_of(error_code))
        }
        Fault::DriveDisabled { statusword } => words!(
            "the drive of {axis} is no longer in operation enabled{statusword}",
            axis,
            statusword = machine.statusword(stop.axis(), statusword)
        ),
        Fault::NotDisabled { state, silent_cycles: 0 } => words!(
            "the drive of {axis} was to be disabled and still shows {state}",
            axis,
            state = Words::from(state.name())
        ),
        Fault::NotDisabled { state, silent_cycles } => words!(
            "the drive of {axis} has not confirmed that it is disabled: no report for {cycles}, and {state} before",
            axis,
            cycles = cycles(silent_cycles),
            state = Words::from(state.name())
        ),
        Fault::DriveEnabled { state } => words!(
            "the drive of {axis} shows {state} although its group is disabled: something else has enabled it",
            axis,
            state = Words::from(state.name())
        ),
        Fault::DriveLocal { statusword } => words!(
            "the drive of {axis} does not obey the bus any more: it has cleared its remote bit (statusword {statusword})",
            axis,
            statusword = format!("0x{statusword:04X}")
        ),
        Fault::MeasuredPosition { position, limit } => words!(
            "{axis} was at {position}, beyond its position limit of {limit}",
            axis,
            position = length(position),
            limit = length(limit)
        ),
        Fault::MeasuredVelocity { velocity, limit } => words!(
            "{axis} moved at {velocity} (allowed: {limit})",
            axis,
            velocity = speed(velocity),
            limit = speed(limit)
        ),
        Fault::MeasuredTorque { torque, limit } => words!(
            "the drive of {axis} exerted {torque} (allowed: {limit})",
            axis,
            torque = torque_of(torque),
            limit = torque_of(limit)
        ),
        Fault::ModeChanged { shown, expected } => words!(
            "the drive of {axis} shows {shown} instead of {expected}",
            axis,
            shown = mode(shown),
            expected = mode(expected as i8)
        ),
        Fault::ModeNotShown { shown, expected } => words!(
            "the drive of {axis} has not changed to {expected} in time: it shows {shown}",
            axis,
            expected = mode(expected as i8),
            shown = mode(shown)
        ),
        Fault::NoTorqueInMode { mode: own } => words!(
            "a torque or an impedance was wanted of {axis}, which is in {mode} and takes them in CST alone",
            axis,
            mode = mode(own as i8)
        ),
        Fault::StiffnessLimit { stiffness, limit } => words!(
            "a stiffness of {stiffness} was wanted of {axis} (allowed: 0 to {limit})",
            axis,
            stiffness = rounded(stiffness),
            limit = rounded(limit)
        ),
        Fault::DampingLimit { damping, limit } => words!(
            "a damping of {damping} was wanted of {axis} (allowed: 0 to {limit})",
            axis,
            damping = rounded(damping),
            limit = rounded(limit)
        ),
        Fault::NotAcknowledged { limit, .. } => words!(
            "the drive of {axis} did not acknowledge its target within {cycles}",
            axis,
            cycles = cycles(limit)
        ),
        Fault::NodeLost { cycles: silent, limit } => words!(
            "no heartbeat of {axis} has come for {cycles} (allowed: {limit})",
            axis,
            cycles = cycles(silent),
            limit
        ),
        Fault::NodeNotOperational { state } => words!(
            "the node of {axis} is no longer operational: its heartbeat shows state {state}",
            axis,
            state = format!("0x{state:02X}")
        ),
        Fault::UnexpectedBootUp => words!("the drive of {axis} started anew during its work", axis),
        Fault::EmergencyMessage { code } => words!(
            "the drive of {axis} sent emergency message {error} and shows no fault",
            axis,
            error = error_of(code)
        ),
        Fault::DuplicateNode { node } => words!(
            "two nodes answer with the node ID of {axis}, {node}: its feedback comes twice",
            axis,
            node
        ),
        Fault::ForeignMaster { id } if is_sdo_request(id) => words!(
            "another master writes to the drive of node {node} on {bus}: an SDO request with identifier {id} is not from this controller",
            node = id.value() & 0x7F,
            bus = bus(),
            id = format!("0x{id:?}")
        ),
        Fault::ForeignMaster { id } => words!(
            "another master sends on {bus}: a frame with identifier {id} is not from this controller",
            bus = bus(),
            id = format!("0x{id:?}")
        ),
        Fault::TimingUnfit { missed, limit } => words!(
            "the controller misses its slots too often: {missed} recently (allowed: {limit})",
            missed,
            limit
        ),
        Fault::Suspended { suspended_ns } => words!(
            "the computer was suspended for {seconds} s",
            seconds = format!("{:.1}", suspended_ns as f64 * 1e-9)
        ),
        Fault::CallbackOverrun { spent_ns, budget_ns } => words!(
            "the callback took {spent} µs (allowed: {budget} µs)",
            spent = format!("{:.1}", spent_ns as f64 * 1e-3),
            budget = format!("{:.1}", budget_ns as f64 * 1e-3)
        ),
        Fault::CallbackPanicked => "the callback panicked".into(),
        Fault::BusErrorPassive => {
            words!("{bus} is error-passive: almost no frame gets through", bus = bus())
        }
        Fault::BusOff => words!("{bus} is bus-off: too many of its frames had errors", bus = bus()),
        Fault::BusDown => words!("the interface of {bus} is down, or has gone", bus = bus()),
        Fault::NotAtRest { velocity, limit } => words!(
            "{axis} did not come to rest to be enabled: it moved at {velocity}/s (at rest: below {limit}/s)",
            axis,
            velocity = length(velocity),
            limit = length(limit)
        ),
        Fault::EnableTimeout { limit, .. } => words!(
            "the drive of {axis} did not reach operation enabled within {cycles} ({seconds} s)",
            axis,
            cycles = cycles(limit),
            seconds = format!("{:.1}", f64::from(limit) * machine.cycle_ns as f64 * 1e-9)
        ),
        Fault::NoTrajectory if stop.axis().is_some() => {
            words!("no trajectory within the limits of {axis} leads to its target", axis)
        }
        Fault::NoTrajectory => "no trajectory within the limits leads to the target".into(),
        Fault::NotTransmitted { cycles: blocked, .. } => words!(
            "set-points on {bus} were not transmitted for {cycles}",
            bus = bus(),
            cycles = cycles(blocked)
        ),
    }
}

fn asked_for(axis: &str, wanted: String, limit: String) -> Words {
    words!("the set-point of {axis} asked for {wanted} (allowed: {limit})", axis, wanted, limit)
}

fn cycles(count: impl Into<u32>) -> Words {
    match count.into() {
        1 => "1 cycle".into(),
        count => words!("{count} cycles", count),
    }
}

/// What to do about the fault of a stop: the cure of the drive's error where it is known. `None` for a stop that was asked for.
pub fn stop_cure(stop: &StopReason, machine: &Machine) -> Option<&'static str> {
    let fault = stop.cause.fault()?;
    let of_drive = match fault {
        Fault::DriveFault { error_code: code } | Fault::EmergencyMessage { code } => {
            stop.axis().map(|axis| machine.drive_cure(axis, *code))
        }
        _ => None,
    };
    Some(of_drive.unwrap_or_else(|| fault.cure()))
}

/// The full text of a stop: cause, phase, category, and the cure of a fault.
pub fn stop(stop: &StopReason, machine: &Machine) -> Words {
    let (cause, phase) = (stop_cause(stop, machine), Words::from(phase(stop.phase)));
    let category = Words::from(category(stop.category));
    match stop_cure(stop, machine).map(Words::from) {
        Some(cure) => words!("{cause} while {phase}; {category}; try: {cure}", cause, phase, category, cure),
        None => words!("{cause} while {phase}; {category}", cause, phase, category),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::telemetry::words::rule_key;
    use crate::telemetry::words::tests::machine;
    use takt_rt::{Origin, Phase, Rule, StopCategory};

    fn reason(rule: Rule, origin: Origin, value: f64, limit: f64) -> StopReason {
        let cause = StopCause::from_numbers(rule, value, limit).unwrap();
        StopReason { category: StopCategory::One, cause, origin, slot: 9, phase: Phase::Moving }
    }

    #[test]
    fn every_cause_names_its_axis_and_its_unit() {
        let cases = [
            (
                Rule::FollowingError,
                Origin::Axis(0),
                0.0214,
                0.02,
                "shoulder was 0.0214 rad from its set-point (allowed: 0.0200 rad)",
            ),
            (
                Rule::StaleCommand,
                Origin::Group,
                3.0,
                0.0,
                "the stream of set-points ended: its last command expired and no newer one came",
            ),
            (
                Rule::StaleCommand,
                Origin::Group,
                501.0,
                500.0,
                "the stream of set-points did not begin within 500 cycles",
            ),
            (
                Rule::StaleCommand,
                Origin::Axis(1),
                1.0,
                0.0,
                "the velocity or torque of slide expired and was not renewed",
            ),
            (
                Rule::ImplausibleFeedback,
                Origin::Axis(0),
                0.5,
                0.0101,
                "shoulder was reported 0.5000 rad from where it was, farther than it can have moved (0.0101 rad)",
            ),
            (
                Rule::VelocityLimit,
                Origin::Axis(1),
                2.5,
                2.0,
                "the set-point of slide asked for 2.500 m/s (allowed: 2.000 m/s)",
            ),
            (
                Rule::MissedFeedback,
                Origin::Axis(1),
                4.0,
                3.0,
                "slide has not reported in time for 4 cycles (allowed: 3)",
            ),
            (
                Rule::MissedFeedback,
                Origin::Axis(1),
                2.0,
                0.0,
                "the drive of slide always answers 2 cycles late",
            ),
            (
                Rule::DriveFault,
                Origin::Axis(0),
                0x730F.into(),
                0.0,
                "the drive of shoulder reports fault 0x730F (battery voltage of the multi-turn encoder low)",
            ),
            (
                Rule::DriveDisabled,
                Origin::Axis(0),
                0x1250.into(),
                0.0,
                "the drive of shoulder is no longer in operation enabled (statusword 0x1250)",
            ),
            (
                Rule::NotDisabled,
                Origin::Axis(0),
                4.0,
                0.0,
                "the drive of shoulder was to be disabled and still shows operation enabled",
            ),
            (
                Rule::NotDisabled,
                Origin::Axis(0),
                4.0,
                5001.0,
                "the drive of shoulder has not confirmed that it is disabled: no report for 5001 cycles, and operation enabled before",
            ),
            (
                Rule::DriveEnabled,
                Origin::Axis(1),
                5.0,
                0.0,
                "the drive of slide shows quick stop active although its group is disabled: something else has enabled it",
            ),
            (
                Rule::DriveLocal,
                Origin::Axis(0),
                0x0037.into(),
                0.0,
                "the drive of shoulder does not obey the bus any more: it has cleared its remote bit (statusword 0x0037)",
            ),
            (
                Rule::MeasuredPosition,
                Origin::Axis(1),
                1.25,
                1.0,
                "slide was at 1.2500 m, beyond its position limit of 1.0000 m",
            ),
            (
                Rule::MeasuredVelocity,
                Origin::Axis(1),
                2.5,
                2.0,
                "slide moved at 2.500 m/s (allowed: 2.000 m/s)",
            ),
            (
                Rule::MeasuredTorque,
                Origin::Axis(1),
                260.0,
                200.0,
                "the drive of slide exerted 260.00 N (allowed: 200.00 N)",
            ),
            (
                Rule::ModeChanged,
                Origin::Axis(0),
                1.0,
                8.0,
                "the drive of shoulder shows mode 1 (profile position) instead of \
              mode 8 (cyclic synchronous position)",
            ),
            (
                Rule::EnableTimeout,
                Origin::Axis(9),
                0.0,
                2000.0,
                "the drive of axis 9 did not reach operation enabled within 2000 cycles (2.0 s)",
            ),
            (
                Rule::NotAtRest,
                Origin::Axis(0),
                0.02,
                0.0033,
                "shoulder did not come to rest to be enabled: it moved at 0.0200 rad/s (at rest: below 0.0033 rad/s)",
            ),
            (
                Rule::BusLost,
                Origin::Bus(0),
                0.0,
                0.0,
                "bus left is bus-off: too many of its frames had errors",
            ),
            (Rule::BusLost, Origin::Bus(0), 1.0, 0.0, "the interface of bus left is down, or has gone"),
            (
                Rule::NotTransmitted,
                Origin::Bus(0),
                6.0,
                0.0,
                "set-points on bus left were not transmitted for 6 cycles",
            ),
            (
                Rule::StartPose,
                Origin::Axis(1),
                0.5,
                0.002,
                "the stream of set-points began 0.5000 m from where slide is (allowed: 0.0020 m)",
            ),
            (
                Rule::JerkLimit,
                Origin::Axis(0),
                250.0,
                100.0,
                "the set-point of shoulder asked for 250.0 rad/s³ (allowed: 100.0 rad/s³)",
            ),
            (
                Rule::NodeLost,
                Origin::Axis(0),
                301.0,
                300.0,
                "no heartbeat of shoulder has come for 301 cycles (allowed: 300)",
            ),
            (
                Rule::NodeNotOperational,
                Origin::Axis(0),
                127.0,
                5.0,
                "the node of shoulder is no longer operational: its heartbeat shows state 0x7F",
            ),
            (
                Rule::EmergencyMessage,
                Origin::Axis(0),
                0x4310.into(),
                0.0,
                "the drive of shoulder sent emergency message 0x4310 (excess temperature of the drive) and shows no fault",
            ),
            (
                Rule::ForeignMaster,
                Origin::Bus(0),
                0x080.into(),
                0.0,
                "another master sends on bus left: a frame with identifier 0x080 is not from this controller",
            ),
            (
                Rule::ForeignMaster,
                Origin::Bus(0),
                0x605.into(),
                0.0,
                "another master writes to the drive of node 5 on bus left: an SDO request with identifier 0x605 is not from this controller",
            ),
            (
                Rule::ForeignMaster,
                Origin::Bus(0),
                0x080.into(),
                29.0,
                "another master sends on bus left: a frame with identifier 0x00000080 is not from this controller",
            ),
            (
                Rule::TimingUnfit,
                Origin::Group,
                250.0,
                250.0,
                "the controller misses its slots too often: 250 recently (allowed: 250)",
            ),
            (Rule::TimingUnfit, Origin::Group, 3.2e9, 0.0, "the computer was suspended for 3.2 s"),
            (
                Rule::BusErrorPassive,
                Origin::Bus(0),
                0.0,
                0.0,
                "bus left is error-passive: almost no frame gets through",
            ),
            (
                Rule::NotAcknowledged,
                Origin::Axis(0),
                501.0,
                500.0,
                "the drive of shoulder did not acknowledge its target within 500 cycles",
            ),
        ];
        for (rule, origin, value, limit, words) in cases {
            assert_eq!(stop_cause(&reason(rule, origin, value, limit), &machine()).to_string(), words);
        }
    }

    #[test]
    fn the_text_of_a_stop_has_cause_phase_and_category() {
        assert_eq!(
            stop(&reason(Rule::Requested, Origin::Group, 0.0, 0.0), &machine()).to_string(),
            "a stop was requested while moving; category 1: decelerate, then remove power"
        );
    }

    #[test]
    fn the_text_of_a_stop_for_a_drive_fault_ends_with_its_cure() {
        let text = |code: u16| {
            stop(&reason(Rule::DriveFault, Origin::Axis(0), code.into(), 0.0), &machine()).to_string()
        };
        assert!(text(0x730F).ends_with("the joint's zero must be set again"), "{}", text(0x730F));
        assert!(text(0x8611).contains("; try: look for a blocked or overloaded joint"), "{}", text(0x8611));
        assert!(text(0).contains("; try: `takt drive … info` reads"), "{}", text(0));
    }

    #[test]
    fn the_text_of_a_stop_for_a_drive_with_torque_that_it_should_not_have_ends_with_what_to_do() {
        for rule in [Rule::NotDisabled, Rule::DriveEnabled, Rule::DriveLocal] {
            let text = stop(&reason(rule, Origin::Axis(0), 4.0, 0.0), &machine()).to_string();
            assert!(text.contains("; try: keep away from the joint"), "{text}");
        }
    }

    #[test]
    fn for_a_drive_that_plans_its_own_profile_the_measured_motion_is_named_and_no_set_point() {
        let mut machine = machine();
        machine.axes[1].plans_own_profile = true;
        let text = |rule, value, limit| {
            stop_cause(&reason(rule, Origin::Axis(1), value, limit), &machine).to_string()
        };
        assert_eq!(
            text(Rule::PositionLimit, 1.25, 1.0),
            "slide would come to rest at 1.2500 m, outside its position limit of 1.0000 m"
        );
        assert_eq!(
            text(Rule::FollowingError, 0.5, 0.02),
            "slide stood still, and its drive had not reached its target"
        );
    }

    #[test]
    fn no_two_rules_share_a_key_or_a_cause() {
        let causes = Rule::ALL
            .map(|rule| stop_cause(&reason(rule, Origin::Axis(0), 1.0, 8.0), &machine()).to_string());
        let keys = Rule::ALL.map(rule_key);
        for (index, rule) in Rule::ALL.into_iter().enumerate() {
            assert!(!causes[..index].contains(&causes[index]), "{rule:?}");
            assert!(!keys[..index].contains(&keys[index]), "{rule:?}");
        }
    }
}
