//! Refused requests in words.

use takt_rt::{MappedObject, Refusal, RejectReason, RequestKind, Rule};

use super::{mode, phase, rule_key};
use crate::telemetry::machine::{Machine, Unit};

/// What was asked for: "the move".
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
        RequestKind::Stream => "the stream",
        RequestKind::Stop => "the stop",
        RequestKind::Disable => "disabling",
        RequestKind::ResetFaults => "the fault reset",
        RequestKind::InhibitEnable => "retiring",
        RequestKind::Shutdown => "leaving",
    }
}

/// What was refused and why: "the move was refused while holding: shoulder cannot go to 3.5000 rad, beyond its position
/// limit of 2.9671 rad".
pub fn refusal(refused: &Refusal, machine: &Machine) -> String {
    let (what, during) = (request(refused.request), phase(refused.phase));
    match refused.objection {
        RejectReason::Phase => format!("{what} was refused: not possible while {during}"),
        _ => format!("{what} was refused while {during}: {}", objection(refused, machine)),
    }
}

fn objection(refused: &Refusal, machine: &Machine) -> String {
    let Refusal { value, limit, .. } = *refused;
    let axis = refused.axis.map_or_else(|| "an axis".to_owned(), |axis| machine.axis_name(axis));
    let unit = refused.axis.map_or(Unit::Radian, |axis| machine.axis_unit(axis));
    let (length, force) = match unit {
        Unit::Radian => ("rad", "Nm"),
        Unit::Metre => ("m", "N"),
    };
    match refused.objection {
        RejectReason::Phase => format!("not possible while {}", phase(refused.phase)),
        RejectReason::StopLatched => {
            let rule = Rule::ALL.get(value as usize).copied();
            let of = refused.axis.map_or_else(String::new, |_| format!(" of {axis}"));
            let key = rule.map_or("unknown", rule_key);
            format!("the group has stopped for a fault{of} ({key}), which must be reset first")
        }
        RejectReason::EnableInhibited => "the run is on its way out".to_owned(),
        RejectReason::MissedSlots => {
            format!("{value:.0} slots were missed of late, and from {limit:.0} on no stream is begun")
        }
        RejectReason::UnknownAxis => {
            format!("there is no axis {value:.0}: there are {limit:.0}, counted from 0")
        }
        RejectReason::WrongMode => format!("{axis} is in {}, which takes no such target", mode(value)),
        RejectReason::NotFinite => format!("what was asked of {axis} is no finite number ({value})"),
        RejectReason::PositionLimit => {
            format!(
                "{axis} cannot go to {value:.4} {length}, beyond its position limit of {limit:.4} {length}"
            )
        }
        RejectReason::VelocityLimit => {
            format!("{value:.3} {length}/s is beyond the velocity limit of {axis}, {limit:.3} {length}/s")
        }
        RejectReason::TorqueLimit => {
            format!("{value:.2} {force} is beyond the torque limit of {axis}, {limit:.2} {force}")
        }
        RejectReason::NoRoomToStop => format!(
            "at such a speed {axis} comes to rest only at {value:.4} {length}, beyond its position limit of \
             {limit:.4} {length}"
        ),
        RejectReason::VelocityScale => {
            format!("{value} is no fraction of the velocity limits, above 0 up to 1")
        }
        RejectReason::AccelerationScale => {
            format!("{value} is no fraction of the acceleration limits, above 0 up to 1")
        }
        RejectReason::MinimumDuration => format!("{value} s is no duration that it can have at least"),
        RejectReason::NoTrajectory => format!("no trajectory within the limits of {axis} leads there"),
        RejectReason::RatedTorque => format!("{value} {force} is no rated torque for {axis}"),
        RejectReason::NoProcessData => format!("{axis} would have none in one direction"),
        RejectReason::Mapping if value == 0.0 => format!("a PDO of {axis} has too many objects"),
        RejectReason::Mapping => {
            let MappedObject { index, subindex, bits } = MappedObject::from_parameter(value as u32);
            format!("{index:04X}:{subindex:02X} of {bits} bits cannot be in a PDO of {axis}")
        }
        RejectReason::IdTaken => format!("identifier {:03X} for {axis} is in use", value as u32),
        RejectReason::NoTime => "the drives are not told the time (`time` of [master])".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::telemetry::machine::{AxisDescription, SetPointMagnitudes};
    use takt_rt::Phase;

    fn machine() -> Machine {
        let axis = |name: &str, unit| AxisDescription {
            name: name.to_owned(),
            bus: None,
            unit,
            counts_per_unit: 1.0,
            limits: SetPointMagnitudes::default(),
        };
        let axes = vec![axis("shoulder", Unit::Radian), axis("slide", Unit::Metre)];
        Machine { name: "arm".to_owned(), cycle_ns: 1_000_000, axes, buses: vec![] }
    }

    fn said(objection: RejectReason, axis: Option<u8>, value: f64, limit: f64) -> String {
        let phase = Phase::Holding;
        refusal(&Refusal { request: RequestKind::Move, objection, axis, value, limit, phase }, &machine())
    }

    #[test]
    fn a_refusal_names_what_was_asked_for_the_axis_and_why() {
        let begin = "the move was refused while holding: ";
        for (objection, axis, value, limit, why) in [
            (
                RejectReason::PositionLimit,
                Some(1),
                1.25,
                0.8,
                "slide cannot go to 1.2500 m, beyond its position limit of 0.8000 m",
            ),
            (
                RejectReason::StopLatched,
                Some(0),
                f64::from(Rule::FollowingError as u8),
                0.0,
                "the group has stopped for a fault of shoulder (following_error), which must be reset first",
            ),
            (
                RejectReason::NoRoomToStop,
                Some(0),
                -3.05,
                -3.0,
                "at such a speed shoulder comes to rest only at -3.0500 rad, beyond its position limit of -3.0000 rad",
            ),
            (
                RejectReason::VelocityScale,
                None,
                1.5,
                1.0,
                "1.5 is no fraction of the velocity limits, above 0 up to 1",
            ),
            (RejectReason::UnknownAxis, None, 7.0, 2.0, "there is no axis 7: there are 2, counted from 0"),
            (
                RejectReason::WrongMode,
                Some(0),
                8.0,
                0.0,
                "shoulder is in mode 8 (cyclic synchronous position), which takes no such target",
            ),
            (
                RejectReason::Mapping,
                Some(1),
                f64::from(0x2000_0110_u32),
                0.0,
                "2000:01 of 16 bits cannot be in a PDO of slide",
            ),
        ] {
            assert_eq!(said(objection, axis, value, limit), format!("{begin}{why}"));
        }
    }

    #[test]
    fn no_two_objections_and_no_two_requests_are_said_in_the_same_words() {
        let objections = RejectReason::ALL.map(|objection| said(objection, Some(0), 1.0, 2.0));
        for (index, words) in objections.iter().enumerate() {
            assert!(!objections[..index].contains(words), "{words}");
        }
        let requests = RequestKind::ALL.map(request);
        for (index, words) in requests.iter().enumerate() {
            assert!(!requests[..index].contains(words), "{words}");
        }
    }
}
