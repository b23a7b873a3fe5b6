//! The texts of rejected requests.

use takt_rt::{MappedObject, RejectReason, RequestError, RequestKind};
use takt_wire::printable::Shown;

use super::{mode, phase, rule_key};
use crate::telemetry::machine::{Machine, Unit};

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
pub fn rejection(rejected: &RequestError, machine: &Machine) -> String {
    let (what, during) = (request(rejected.request), phase(rejected.phase));
    match rejected.reason {
        RejectReason::Phase => format!("{what} was rejected: not possible while {during}"),
        _ => format!("{what} was rejected while {during}: {}", reason(rejected, machine)),
    }
}

fn reason(rejected: &RequestError, machine: &Machine) -> String {
    let axis = rejected.axis.map_or_else(|| "an axis".to_owned(), |axis| machine.axis_name(axis));
    let unit = rejected.axis.map_or(Unit::Radian, |axis| machine.axis_unit(axis));
    let (length, force) = (unit.symbol(), unit.effort_symbol());
    match rejected.reason {
        RejectReason::Phase => format!("not possible while {}", phase(rejected.phase)),
        RejectReason::StopLatched { rule } if rejected.axis.is_some() => {
            let rule = rule_key(rule);
            format!("the group has stopped for a fault of {axis} ({rule}), which must be reset first")
        }
        RejectReason::StopLatched { rule } => {
            format!("the group has stopped for a fault ({}), which must be reset first", rule_key(rule))
        }
        RejectReason::EnableInhibited => "the run is ending".to_owned(),
        RejectReason::MissedSlots { missed, limit } => {
            format!(
                "{missed} slots were missed recently, and a stream or a callback needs fewer than {limit}"
            )
        }
        RejectReason::UnknownAxis { axis, axes } => {
            format!("there is no axis {axis}: there are {axes}, counted from 0")
        }
        RejectReason::WrongMode { mode: present } => {
            format!("{axis} is in {}, which takes no such target", mode((present as i8).into()))
        }
        RejectReason::NotFinite { value } => format!("the number given for {axis} is not finite ({value})"),
        RejectReason::PositionLimit { position, limit } => format!(
            "{axis} cannot go to {position:.4} {length}, beyond its position limit of {limit:.4} {length}",
            position = Shown(position),
            limit = Shown(limit)
        ),
        RejectReason::VelocityLimit { velocity, limit } => {
            format!(
                "{velocity:.3} {length}/s is beyond the velocity limit of {axis}, {limit:.3} {length}/s",
                velocity = Shown(velocity),
                limit = Shown(limit)
            )
        }
        RejectReason::TorqueLimit { torque, limit } => {
            format!(
                "{torque:.2} {force} is beyond the torque limit of {axis}, {limit:.2} {force}",
                torque = Shown(torque),
                limit = Shown(limit)
            )
        }
        RejectReason::NoRoomToStop { rest, limit } => format!(
            "at such a speed {axis} comes to rest only at {rest:.4} {length}, beyond its position limit of \
             {limit:.4} {length}",
            rest = Shown(rest),
            limit = Shown(limit)
        ),
        RejectReason::VelocityScale { scale } => {
            format!("{} is not a fraction of the velocity limits, above 0 up to 1", Shown(scale))
        }
        RejectReason::AccelerationScale { scale } => {
            format!("{} is not a fraction of the acceleration limits, above 0 up to 1", Shown(scale))
        }
        RejectReason::MinimumDuration { duration_s } => {
            format!("{} s is not a possible shortest duration", Shown(duration_s))
        }
        RejectReason::UnknownGroup { group, groups } => {
            format!("there is no group {group}: there are {groups}, counted from 0")
        }
        RejectReason::GroupNotNamed { .. } => {
            format!("it is for one group, and must name it: {}", machine.groups.join(", "))
        }
        RejectReason::OtherGroup { asked, of_axis } => format!(
            "{axis} is in the group {}, not in {}",
            machine.group_name(of_axis),
            machine.group_name(asked)
        ),
        RejectReason::NoTrajectory => format!("no trajectory within the limits of {axis} leads there"),
        RejectReason::RatedTorque { torque } => {
            format!("{} {force} is not a possible rated torque of {axis}", Shown(torque))
        }
        RejectReason::NoProcessData => format!("{axis} would have no PDO in one direction"),
        RejectReason::TooManyObjects => format!("a PDO of {axis} has too many objects"),
        RejectReason::Mapping { object: MappedObject { index, subindex, bits } } => {
            format!("{index:04X}:{subindex:02X} of {bits} bits cannot be in a PDO of {axis}")
        }
        RejectReason::IdTaken { id } => format!("identifier {id:?} for {axis} is in use"),
        RejectReason::TooManyFrames { frames, limit } => {
            format!("the bus of {axis} would need {frames} frames in a cycle, and {limit} fit")
        }
        RejectReason::NoTime => "the drives are not told the time (`time` of [master])".to_owned(),
        RejectReason::UnknownTrajectory => "there is no such trajectory".to_owned(),
        RejectReason::UnknownCallback => "there is no such callback".to_owned(),
        RejectReason::StartMismatch { position, present } => format!(
            "it begins at {position:.6} {length} while {axis} is at {present:.6} {length}, or at another velocity",
            position = Shown(position),
            present = Shown(present)
        ),
        RejectReason::TooLate => "the cycle at which it was to begin has passed".to_owned(),
        RejectReason::ModeChanging => "the mode of operation is being changed".to_owned(),
        RejectReason::UnknownMode { mode: wanted } => {
            format!("{axis} cannot be in {}: it is not among its `modes`", mode((wanted as i8).into()))
        }
        RejectReason::ObjectNotMapped { object } => {
            format!("{object} is not in the PDOs of {axis}, and a change of its mode needs it")
        }
        RejectReason::NotBroughtUp => {
            "the last bring-up of the drives has failed or is not finished: call `bring_up`".to_owned()
        }
        RejectReason::NotDisabled => format!("the drive of {axis} must be disabled for it"),
        RejectReason::NotAtRest { velocity } => {
            format!(
                "{axis} is not at rest, or has not been for some cycles ({velocity:.4} {length}/s)",
                velocity = Shown(velocity)
            )
        }
        RejectReason::OffSetPoint { distance, limit } => format!(
            "{axis} is {distance:.6} {length} from its set-point (allowed: {limit:.6} {length}), and would be pulled there",
            distance = Shown(distance),
            limit = Shown(limit)
        ),
        RejectReason::BeyondCounter { position, limit } => format!(
            "{axis} is at {position:.4} {length}, where the count of its drive may have wrapped: turn it by hand to its limit of {limit:.4} {length}",
            position = Shown(position),
            limit = Shown(limit)
        ),
        RejectReason::SuccessorPending => {
            "another trajectory is already to take the place of the present one".to_owned()
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
        rejection(&rejected, &machine())
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
