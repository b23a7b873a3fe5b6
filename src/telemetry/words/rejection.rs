//! The texts of rejected requests.

use takt_rt::{MappedObject, RejectReason, RequestError, RequestKind};
use takt_wire::printable::Shown;

use super::{mode, phase};
use crate::telemetry::machine::{Machine, Unit};
use crate::words;
use crate::words::Words;

/// The name of a request: "the move".
pub const fn request(kind: RequestKind) -> &'static str {
    match kind {
        RequestKind::Sync => "switching SYNC",
        RequestKind::TimeOfDay => "the time of day",
        RequestKind::RatedTorque => "the rated torque",
        RequestKind::ProcessData => "the process data",
        RequestKind::Position => "the reported position",
        RequestKind::Activate => "activating",
        RequestKind::Enable => "enabling",
        RequestKind::Move => "the move",
        RequestKind::SetProfileTarget => "the target",
        RequestKind::ChangeMode => "the change of the mode",
        RequestKind::Stream => "the stream",
        RequestKind::Execute => "the trajectory",
        RequestKind::RunCallback => "the callback",
        RequestKind::Stop => "the stop",
        RequestKind::Disable => "disabling",
        RequestKind::ResetFaults => "the fault reset",
        RequestKind::BringUp => "the bring-up",
        RequestKind::ConfirmBringUp => "confirming the bring-up",
        RequestKind::InhibitEnable => "inhibiting enable",
        RequestKind::Shutdown => "the shutdown",
    }
}

/// The rejected request and the reason: "the move was rejected while holding: shoulder cannot go to 3.5000 rad, beyond its position
/// limit of 2.9671 rad".
pub fn rejection(rejected: &RequestError, machine: &Machine) -> Words {
    let (what, phase) = (Words::from(request(rejected.request)), Words::from(phase(rejected.phase)));
    match rejected.reason {
        RejectReason::Phase => words!("{what} was rejected: not possible while {phase}", what, phase),
        _ => {
            let reason = reason(rejected, machine);
            words!("{what} was rejected while {phase}: {reason}", what, phase, reason)
        }
    }
}

fn reason(rejected: &RequestError, machine: &Machine) -> Words {
    let axis = &rejected.axis.map_or_else(|| "an axis".to_owned(), |axis| machine.axis_name(axis));
    let unit = rejected.axis.map_or(Unit::Radian, |axis| machine.axis_unit(axis));
    let (unit, force) = (unit.symbol(), unit.effort_symbol());
    let length = |value| format!("{:.4} {unit}", Shown(value));
    let exact_length = |value| format!("{:.6} {unit}", Shown(value));
    let speed = |value| format!("{:.3} {unit}/s", Shown(value));
    let torque_of = |value| format!("{:.2} {force}", Shown(value));
    match rejected.reason {
        RejectReason::Phase => {
            words!("not possible while {phase}", phase = Words::from(phase(rejected.phase)))
        }
        RejectReason::StopLatched { rule } if rejected.axis.is_some() => words!(
            "the group has stopped for a fault of {axis} ({rule}), which must be reset first",
            axis,
            rule = Words::from(rule.key())
        ),
        RejectReason::StopLatched { rule } => words!(
            "the group has stopped for a fault ({rule}), which must be reset first",
            rule = Words::from(rule.key())
        ),
        RejectReason::EnableInhibited => "the run is ending".into(),
        RejectReason::MissedSlots { missed, limit } => words!(
            "{missed} slots were missed recently, and a stream or a callback needs fewer than {limit}",
            missed,
            limit
        ),
        RejectReason::UnknownAxis { axis, axes } => {
            words!("there is no axis {axis}: there are {axes}, counted from 0", axis, axes)
        }
        RejectReason::WrongMode { mode: present } => {
            words!("{axis} is in {mode}, which takes no such target", axis, mode = mode(present as i8))
        }
        RejectReason::NotFinite { value } => {
            words!("the number given for {axis} is not finite ({value})", axis, value)
        }
        RejectReason::PositionLimit { position, limit } => words!(
            "{axis} cannot go to {position}, beyond its position limit of {limit}",
            axis,
            position = length(position),
            limit = length(limit)
        ),
        RejectReason::VelocityLimit { velocity, limit } => words!(
            "{velocity} is beyond the velocity limit of {axis}, {limit}",
            velocity = speed(velocity),
            axis,
            limit = speed(limit)
        ),
        RejectReason::TorqueLimit { torque, limit } => words!(
            "{torque} is beyond the torque limit of {axis}, {limit}",
            torque = torque_of(torque),
            axis,
            limit = torque_of(limit)
        ),
        RejectReason::NoRoomToStop { rest, limit } => words!(
            "at such a speed {axis} comes to rest only at {rest}, beyond its position limit of {limit}",
            axis,
            rest = length(rest),
            limit = length(limit)
        ),
        RejectReason::VelocityScale { scale } => {
            words!("{scale} is not a fraction of the velocity limits, above 0 up to 1", scale = Shown(scale))
        }
        RejectReason::AccelerationScale { scale } => words!(
            "{scale} is not a fraction of the acceleration limits, above 0 up to 1",
            scale = Shown(scale)
        ),
        RejectReason::MinimumDuration { duration_s } => {
            words!("{duration} s is not a possible shortest duration", duration = Shown(duration_s))
        }
        RejectReason::UnknownGroup { group, groups } => {
            words!("there is no group {group}: there are {groups}, counted from 0", group, groups)
        }
        RejectReason::GroupNotNamed { .. } => {
            words!("it is for one group, and must name it: {groups}", groups = machine.groups.join(", "))
        }
        RejectReason::OtherGroup { asked, of_axis } => words!(
            "{axis} is in the group {of_axis}, not in {asked}",
            axis,
            of_axis = machine.group_name(of_axis),
            asked = machine.group_name(asked)
        ),
        RejectReason::NoTrajectory => words!("no trajectory within the limits of {axis} leads there", axis),
        RejectReason::RatedTorque { torque } => words!(
            "{torque} is not a possible rated torque of {axis}",
            torque = format!("{} {force}", Shown(torque)),
            axis
        ),
        RejectReason::NoProcessData => words!("{axis} would have no PDO in one direction", axis),
        RejectReason::TooManyObjects => words!("a PDO of {axis} has too many objects", axis),
        RejectReason::Mapping { object: MappedObject { index, subindex, bits } } => words!(
            "{object} of {bits} bits cannot be in a PDO of {axis}",
            object = format!("{index:04X}:{subindex:02X}"),
            bits,
            axis
        ),
        RejectReason::IdTaken { id } => {
            words!("identifier {id} for {axis} is in use", id = format!("{id:?}"), axis)
        }
        RejectReason::TooManyFrames { frames, limit } => words!(
            "the bus of {axis} would need {frames} frames in a cycle, and {limit} fit",
            axis,
            frames,
            limit
        ),
        RejectReason::NoTime => "the drives are not told the time (`time` of [master])".into(),
        RejectReason::UnknownTrajectory => "there is no such trajectory".into(),
        RejectReason::UnknownCallback => "there is no such callback".into(),
        RejectReason::StartMismatch { position, present } => words!(
            "it begins at {position} while {axis} is at {present}, or at another velocity",
            position = exact_length(position),
            axis,
            present = exact_length(present)
        ),
        RejectReason::TooLate => "the cycle at which it was to begin has passed".into(),
        RejectReason::ModeChanging => "the mode of operation is being changed".into(),
        RejectReason::UnknownMode { mode: wanted } => {
            words!("{axis} cannot be in {mode}: it is not among its `modes`", axis, mode = mode(wanted as i8))
        }
        RejectReason::ObjectNotMapped { object } => words!(
            "{object} is not in the PDOs of {axis}, and a change of its mode needs it",
            object = object.to_string(),
            axis
        ),
        RejectReason::NotBroughtUp => {
            "the last bring-up of the drives has failed or is not finished: call `bring_up`".into()
        }
        RejectReason::NotDisabled => words!("the drive of {axis} must be disabled for it", axis),
        RejectReason::NotAtRest { velocity } => words!(
            "{axis} is not at rest, or has not been for some cycles ({velocity})",
            axis,
            velocity = format!("{}/s", length(velocity))
        ),
        RejectReason::OffSetPoint { distance, limit } => words!(
            "{axis} is {distance} from its set-point (allowed: {limit}), and would be pulled there",
            axis,
            distance = exact_length(distance),
            limit = exact_length(limit)
        ),
        RejectReason::BeyondCounter { position, limit } => words!(
            "{axis} is at {position}, where the count of its drive may have wrapped: turn it by hand to its limit of {limit}",
            axis,
            position = length(position),
            limit = length(limit)
        ),
        RejectReason::SuccessorPending => {
            "another trajectory is already to take the place of the present one".into()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::telemetry::machine::{AxisDescription, SetPointMagnitudes};
    use takt_rt::{OperationMode, Phase, Rule};

    fn machine() -> Machine {
        let axis = |name: &str, unit| AxisDescription {
            name: name.to_owned(),
            bus: None,
            group: 0,
            family: None,
            own_errors: vec![],
            unit,
            plans_own_profile: false,
            counts_per_unit: 1.0,
            limits: SetPointMagnitudes::default(),
        };
        let axes = vec![axis("shoulder", Unit::Radian), axis("slide", Unit::Metre)];
        Machine { name: "arm".to_owned(), cycle_ns: 1_000_000, axes, buses: vec![], groups: vec![] }
    }

    fn text(reason: RejectReason, axis: Option<u8>) -> String {
        let rejected = RequestError { request: RequestKind::Move, reason, axis, phase: Phase::Holding };
        rejection(&rejected, &machine()).to_string()
    }

    #[test]
    fn a_rejection_names_what_was_asked_for_the_axis_and_why() {
        let begin = "the move was rejected while holding: ";
        for (reason, axis, why) in [
            (
                RejectReason::PositionLimit { position: 1.25, limit: 0.8 },
                Some(1),
                "slide cannot go to 1.2500 m, beyond its position limit of 0.8000 m",
            ),
            (
                RejectReason::PositionLimit { position: -1e308, limit: -0.8 },
                Some(1),
                "slide cannot go to -1e308 m, beyond its position limit of -0.8000 m",
            ),
            (
                RejectReason::StopLatched { rule: Rule::FollowingError },
                Some(0),
                "the group has stopped for a fault of shoulder (following_error), which must be reset first",
            ),
            (
                RejectReason::NoRoomToStop { rest: -3.05, limit: -3.0 },
                Some(0),
                "at such a speed shoulder comes to rest only at -3.0500 rad, beyond its position limit of -3.0000 rad",
            ),
            (
                RejectReason::NotBroughtUp,
                None,
                "the last bring-up of the drives has failed or is not finished: call `bring_up`",
            ),
            (
                RejectReason::VelocityScale { scale: 1.5 },
                None,
                "1.5 is not a fraction of the velocity limits, above 0 up to 1",
            ),
            (
                RejectReason::UnknownAxis { axis: 7, axes: 2 },
                None,
                "there is no axis 7: there are 2, counted from 0",
            ),
            (
                RejectReason::WrongMode { mode: OperationMode::CyclicSynchronousPosition },
                Some(0),
                "shoulder is in mode 8 (cyclic synchronous position), which takes no such target",
            ),
            (
                RejectReason::Mapping { object: MappedObject::new(0x2000, 1, 16) },
                Some(1),
                "2000:01 of 16 bits cannot be in a PDO of slide",
            ),
        ] {
            assert_eq!(text(reason, axis), format!("{begin}{why}"));
        }
    }

    #[test]
    fn no_two_reasons_and_no_two_requests_have_the_same_words() {
        let reasons: Vec<_> = RejectReason::all().map(|reason| text(reason, Some(0))).collect();
        for (index, words) in reasons.iter().enumerate() {
            assert!(!reasons[..index].contains(words), "{words}");
        }
        let requests = RequestKind::ALL.map(request);
        for (index, words) in requests.iter().enumerate() {
            assert!(!requests[..index].contains(words), "{words}");
        }
    }
}
