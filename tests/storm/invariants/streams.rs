//! A stream that is followed as closely as the limits allow stops the group for none of its points, nor does a move or a checked
//! trajectory. A drive in a profile mode follows none: its joint may be pushed beyond a limit.

use takt::config::{Control, Follow};
use takt_rt::{EventKind, Origin, Phase, Rule};

use super::Seen;

pub fn check(seen: &Seen<'_>) -> Result<(), String> {
    for event in seen.events {
        let EventKind::Stop(stop) = event.kind else { continue };
        let is_for_a_point = matches!(
            stop.rule(),
            Rule::NotFinite
                | Rule::PositionLimit
                | Rule::VelocityLimit
                | Rule::AccelerationLimit
                | Rule::JerkLimit
                | Rule::StartPose
                | Rule::NoTrajectory
        );
        let Origin::Axis(number) = stop.origin else { continue };
        // Where it stops with another group, it is in a phase of its own.
        if event.group != Some(seen.groups[usize::from(number)] as u8) {
            continue;
        }
        let axis = &seen.config.axes[usize::from(number)];
        // A joint that a torque drives is stopped before it gets beyond a limit.
        let may_be_driven = seen.are_torques_commanded && matches!(axis.control, Control::Torque { .. });
        let is_followed = axis.follow == Follow::Smooth && !axis.control.is_profile() && !may_be_driven;
        let is_planned = stop.phase == Phase::Moving && !axis.control.is_profile();
        if is_for_a_point && (stop.phase == Phase::Streaming && is_followed || is_planned) {
            return Err(format!("{}: stopped for a set-point that keeps the limits: {stop:?}", axis.name));
        }
    }
    Ok(())
}
