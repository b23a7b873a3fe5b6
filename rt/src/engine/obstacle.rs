//! What stands in the way of a request: found here where a target is asked for.

use crate::axis::Axis;
use crate::control::ControlLaw;
use crate::guard;
use crate::host::Move;
use crate::plan::PlanError;
use crate::profile::ProfileTarget;
use crate::refusal::RejectReason;

/// An objection with its particulars.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Obstacle {
    pub objection: RejectReason,
    pub axis: Option<u8>,
    pub value: f64,
    pub limit: f64,
}

impl From<RejectReason> for Obstacle {
    fn from(objection: RejectReason) -> Self {
        Self { objection, axis: None, value: 0.0, limit: 0.0 }
    }
}

impl Obstacle {
    /// The same, of this axis.
    pub fn of_axis(self, index: usize) -> Self {
        Self { axis: u8::try_from(index).ok(), ..self }
    }

    /// The same, with what was asked for and what is allowed.
    pub const fn with(self, value: f64, limit: f64) -> Self {
        Self { value, limit, ..self }
    }

    /// What keeps a move from being planned.
    pub fn of_plan(error: PlanError, minimum_duration_s: f64) -> Self {
        match (error, error.axis()) {
            (PlanError::InvalidTiming, _) => {
                Self::from(RejectReason::MinimumDuration).with(minimum_duration_s, 0.0)
            }
            (_, Some(index)) => Self::from(RejectReason::NoTrajectory).of_axis(index),
            (_, None) => RejectReason::NoTrajectory.into(),
        }
    }
}

/// Looks at the numbers of a move that concern all axes.
pub(super) fn check_scales(wanted: &Move) -> Result<(), Obstacle> {
    let is_scale = |value: f64| value > 0.0 && value <= 1.0;
    for (objection, value) in [
        (RejectReason::VelocityScale, wanted.velocity_scale),
        (RejectReason::AccelerationScale, wanted.acceleration_scale),
    ] {
        if !is_scale(value) {
            return Err(Obstacle::from(objection).with(value, 1.0));
        }
    }
    if !wanted.minimum_duration_s.is_finite() {
        return Err(Obstacle::from(RejectReason::MinimumDuration).with(wanted.minimum_duration_s, 0.0));
    }
    Ok(())
}

/// Whether an axis can be sent to a position, and be stopped behind it where it passes it at speed: up to a cycle later.
/// One that is driven by velocity or torque has none to go to, and is left as it is.
pub(super) fn check_target(axis: &Axis, position: f64, velocity: f64, period_s: f64) -> Result<(), Obstacle> {
    let limits = &axis.parameters().limits;
    let velocity = match axis.parameters().law {
        ControlLaw::ProfileVelocity | ControlLaw::ProfileTorque => return Ok(()),
        ControlLaw::ProfilePosition => 0.0,
        _ => velocity,
    };
    check_position(axis, position, RejectReason::PositionLimit)?;
    check_magnitude(velocity, limits.velocity, RejectReason::VelocityLimit)?;
    if velocity == 0.0 {
        return Ok(());
    }
    let way = velocity.abs() * period_s + guard::braking_distance(limits, velocity.abs(), 0.0);
    check_position(axis, position + way.copysign(velocity), RejectReason::NoRoomToStop)
}

/// Whether a target is of the kind that the axis' mode takes, and within its limits.
pub(super) fn check_profile_target(axis: &Axis, target: ProfileTarget) -> Result<(), Obstacle> {
    let parameters = axis.parameters();
    match (parameters.law, target) {
        (ControlLaw::ProfilePosition, ProfileTarget::Position(position)) => {
            check_position(axis, position, RejectReason::PositionLimit)
        }
        (ControlLaw::ProfileVelocity, ProfileTarget::Velocity(velocity)) => {
            check_magnitude(velocity, parameters.limits.velocity, RejectReason::VelocityLimit)
        }
        (ControlLaw::ProfileTorque, ProfileTarget::Torque(torque)) => {
            check_magnitude(torque, parameters.limits.torque, RejectReason::TorqueLimit)
        }
        (law, _) => {
            Err(Obstacle::from(RejectReason::WrongMode).with(f64::from(law.operation_mode() as i8), 0.0))
        }
    }
}

fn check_position(axis: &Axis, position: f64, objection: RejectReason) -> Result<(), Obstacle> {
    let limits = &axis.parameters().limits;
    if !position.is_finite() {
        return Err(Obstacle::from(RejectReason::NotFinite).with(position, 0.0));
    }
    if limits.contain(position) {
        return Ok(());
    }
    let broken = if position > limits.position_max { limits.position_max } else { limits.position_min };
    Err(Obstacle::from(objection).with(position, broken))
}

fn check_magnitude(value: f64, limit: f64, objection: RejectReason) -> Result<(), Obstacle> {
    if !value.is_finite() {
        Err(Obstacle::from(RejectReason::NotFinite).with(value, 0.0))
    } else if value.abs() > limit {
        Err(Obstacle::from(objection).with(value, limit.copysign(value)))
    } else {
        Ok(())
    }
}
