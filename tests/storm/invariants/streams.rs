//! A stream that is followed as closely as the limits allow stops the group for none of its points. A drive in a profile mode
//! follows none: its joint may be pushed beyond a limit.

use takt::config::Follow;
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
        let Origin::Axis(axis) = stop.origin else { continue };
        let axis = &seen.config.axes[usize::from(axis)];
        let is_followed = axis.follow == Follow::Smooth && !axis.control.is_profile();
        if stop.phase == Phase::Streaming && is_for_a_point && is_followed {
            return Err(format!("{}: stopped for a point of a smooth stream: {stop:?}", axis.name));
        }
    }
    Ok(())
}
