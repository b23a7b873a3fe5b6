//! What a stop is said to concern is what it concerns: the axis that has the fault, the bus on which it is.

use takt_rt::{ControlLaw, EventKind, Fault, Origin, Rule, StopCause, StopReason};

use super::Seen;
use crate::heartbeat::MissedHeartbeat;
use crate::off_cycle::is_beside_the_cycle;

/// What a drive that has missed the heartbeat says in its own: of its node the eRob, of its alarm the YZ-AIM.
const STOPPED: u8 = 4;

pub fn check(seen: &Seen<'_>) -> Result<(), String> {
    let mut reasons = seen.events.iter().filter_map(|event| match event.kind {
        EventKind::Stop(reason) => Some(reason),
        _ => None,
    });
    reasons.try_for_each(|reason| check_reason(seen, &reason))
}

fn check_reason(seen: &Seen<'_>, reason: &StopReason) -> Result<(), String> {
    let is_troubled =
        |axis: u8| seen.concerns.get(usize::from(axis)).is_some_and(|concern| concern.is_present);
    let has_missed_heartbeat = |axis: u8| {
        seen.concerns
            .get(usize::from(axis))
            .is_some_and(|concern| concern.missed_heartbeat != MissedHeartbeat::No)
    };
    let has_cut_itself =
        |axis: u8| seen.concerns.get(usize::from(axis)).is_some_and(|concern| concern.has_cut_itself);
    let is_crowded = |axis: u8| {
        let is_overloaded =
            seen.config.axes.get(usize::from(axis)).is_some_and(|axis| seen.overloaded_buses[axis.bus]);
        is_overloaded || seen.concerns.get(usize::from(axis)).is_some_and(|concern| concern.is_crowded)
    };
    let is_late = |axis: u8| seen.concerns.get(usize::from(axis)).is_some_and(|concern| concern.is_late);
    let has_paused =
        |axis: u8| seen.concerns.get(usize::from(axis)).is_some_and(|concern| concern.has_paused);
    let is_neglected =
        |axis: u8| seen.concerns.get(usize::from(axis)).is_some_and(|concern| concern.is_neglected);
    let is_loop_closed_here = |axis: u8| {
        let axis = seen.config.axes.get(usize::from(axis));
        axis.is_some_and(|axis| {
            let mut laws = axis.controls();
            laws.any(|law| matches!(law, ControlLaw::Velocity { .. } | ControlLaw::Torque { .. }))
        })
    };
    let is_right = match (reason.rule(), reason.origin) {
        // What is asked of the group, and how it is paced.
        (
            Rule::Requested | Rule::TimingUnfit | Rule::CallbackOverrun | Rule::CallbackPanicked,
            Origin::Group,
        ) => true,
        // A stream is one of the group, a velocity or a torque one of an axis.
        (Rule::StaleCommand, Origin::Group | Origin::Axis(_)) => true,
        // Set-points break a limit in good weather too.
        (
            Rule::NotFinite
            | Rule::PositionLimit
            | Rule::VelocityLimit
            | Rule::AccelerationLimit
            | Rule::JerkLimit
            | Rule::StartPose,
            Origin::Axis(_),
        ) => true,
        (Rule::MissedFeedback, Origin::Axis(axis)) if is_crowded(axis) => true,
        // It is spoken to so rarely that its reports miss cycles, and it does not count as at rest.
        (Rule::MissedFeedback | Rule::EnableTimeout | Rule::NotAtRest, Origin::Axis(axis))
            if is_neglected(axis) =>
        {
            true
        }
        // A joint swings where the machine is too late to close its loop, and one that is led anew after a pause has to catch up.
        (Rule::FollowingError, Origin::Axis(axis))
            if (is_crowded(axis) || is_late(axis)) && is_loop_closed_here(axis) || has_paused(axis) =>
        {
            true
        }
        // Nothing but the load holds a joint back that is given a torque.
        (Rule::MeasuredVelocity, Origin::Axis(axis))
            if seen.config.axes.get(usize::from(axis)).map(|axis| axis.control)
                == Some(ControlLaw::ProfileTorque) =>
        {
            true
        }
        (Rule::ModeNotShown, Origin::Axis(axis)) if is_crowded(axis) => true,
        // A drive that answers whole cycles late is not heard before it is to be enabled.
        (Rule::NotDisabled, Origin::Axis(axis))
            if !seen.snapshot.axes().get(usize::from(axis)).is_some_and(|axis| axis.is_heard) =>
        {
            true
        }
        // A drive that has stopped reporting has confirmed nothing.
        (Rule::NotDisabled, Origin::Axis(_))
            if matches!(reason.cause, StopCause::Fault(Fault::NotDisabled { silent_cycles: 1.., .. })) =>
        {
            true
        }
        // Streams and callbacks ask for what the first mode takes, and the axis may be in another one.
        (Rule::NoTorqueInMode, Origin::Axis(axis)) => {
            seen.config.axes.get(usize::from(axis)).is_some_and(|axis| !axis.other_modes.is_empty())
        }
        // An eRob stops its node: it has no process data any more, and says so. A YZ-AIM shows an alarm.
        (
            Rule::DriveFault
            | Rule::ModeNotShown
            | Rule::MissedFeedback
            | Rule::EmergencyMessage
            | Rule::DriveDisabled,
            Origin::Axis(axis),
        ) if has_missed_heartbeat(axis) => true,
        // Who speaks to a drive outside of the cycle stops it when the set-points are old.
        (Rule::DriveDisabled, Origin::Axis(axis))
            if has_paused(axis)
                && seen.config.axes.get(usize::from(axis)).is_some_and(is_beside_the_cycle) =>
        {
            true
        }
        // A group that has been enabled since stops with one whose joint coasts to rest without power, long after the alarm.
        (Rule::DriveDisabled, Origin::Axis(axis)) if has_cut_itself(axis) => true,
        (Rule::NodeNotOperational, Origin::Axis(axis)) if has_missed_heartbeat(axis) => {
            is_troubled(axis)
                || reason.cause == StopCause::Fault(Fault::NodeNotOperational { state: STOPPED })
        }
        (
            Rule::FollowingError
            | Rule::MissedFeedback
            | Rule::DriveFault
            | Rule::DriveDisabled
            | Rule::NotDisabled
            | Rule::DriveEnabled
            | Rule::DriveLocal
            | Rule::MeasuredPosition
            | Rule::MeasuredVelocity
            | Rule::MeasuredTorque
            | Rule::ModeChanged
            | Rule::ModeNotShown
            | Rule::EnableTimeout
            | Rule::NotAtRest
            | Rule::NotAcknowledged
            | Rule::NodeLost
            | Rule::NodeNotOperational
            | Rule::UnexpectedBootUp
            | Rule::EmergencyMessage
            | Rule::DuplicateNode
            | Rule::ImplausibleFeedback,
            Origin::Axis(axis),
        ) => is_troubled(axis),
        (
            Rule::BusLost | Rule::BusErrorPassive | Rule::ForeignMaster | Rule::NotTransmitted,
            Origin::Bus(bus),
        ) => seen.troubled_buses.get(usize::from(bus)) == Some(&true),
        _ => false,
    };
    if is_right { Ok(()) } else { Err(format!("nothing is wrong with what this names: {reason:?}")) }
}
