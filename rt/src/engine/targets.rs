//! Whether what is asked for is possible: the numbers of a move, and the targets of axes.

use crate::axis::Axis;
use crate::control::ControlLaw;
use crate::guard;
use crate::profile::ProfileTarget;
use crate::rejection::RejectReason;
use crate::request::Move;

/// Why a request is rejected, and for which axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rejection {
    pub reason: RejectReason,
    pub axis: Option<u8>,
    /// The group that rejects it; `None` if none was asked.
    pub group: Option<u8>,
}

impl From<RejectReason> for Rejection {
    fn from(reason: RejectReason) -> Self {
        Self { reason, axis: None, group: None }
    }
}

impl RejectReason {
    /// This reason, for an axis.
    pub(super) const fn of_axis(self, axis: u8) -> Rejection {
        Rejection { reason: self, axis: Some(axis), group: None }
    }
}

/// Checks the numbers of a move that concern all axes.
pub(super) fn check_scales<const AXES: usize>(wanted: &Move<AXES>) -> Result<(), RejectReason> {
    let is_scale = |value: f64| value > 0.0 && value <= 1.0;
    let Move { velocity_scale, acceleration_scale, minimum_duration_s, .. } = *wanted;
    if !is_scale(velocity_scale) {
        return Err(RejectReason::VelocityScale { scale: velocity_scale });
    }
    if !is_scale(acceleration_scale) {
        return Err(RejectReason::AccelerationScale { scale: acceleration_scale });
    }
    if !minimum_duration_s.is_finite() {
        return Err(RejectReason::MinimumDuration { duration_s: minimum_duration_s });
    }
    Ok(())
}

/// Checks that an axis can be sent to a position, and be stopped behind it where it passes it at speed: up to a cycle later.
/// An axis that is driven by velocity or torque stays as it is; its numbers are checked all the same.
pub(super) fn check_target(
    axis: &Axis,
    position: f64,
    velocity: f64,
    period_s: f64,
) -> Result<(), RejectReason> {
    let limits = &axis.parameters().limits;
    check_position(axis, position)?;
    check_velocity(axis, velocity)?;
    if velocity == 0.0 || axis.is_profile() {
        return Ok(());
    }
    let distance = velocity.abs() * period_s + guard::braking_distance(limits, velocity.abs(), 0.0);
    let rest = position + distance.copysign(velocity);
    match broken_limit(axis, rest) {
        Some(limit) => Err(RejectReason::NoRoomToStop { rest, limit }),
        None => Ok(()),
    }
}

/// Checks that a target is of the kind that the axis' mode takes, and within its limits.
pub(super) fn check_profile_target(axis: &Axis, target: ProfileTarget) -> Result<(), RejectReason> {
    match (axis.parameters().law, target) {
        (ControlLaw::ProfilePosition, ProfileTarget::Position(position)) => check_position(axis, position),
        (ControlLaw::ProfileVelocity, ProfileTarget::Velocity(velocity)) => check_velocity(axis, velocity),
        (ControlLaw::ProfileTorque, ProfileTarget::Torque(torque)) => check_torque(axis, torque),
        (law, _) => Err(RejectReason::WrongMode { mode: law.operation_mode() }),
    }
}

fn check_finite(value: f64) -> Result<(), RejectReason> {
    if value.is_finite() { Ok(()) } else { Err(RejectReason::NotFinite { value }) }
}

/// The position limit that a position is beyond.
fn broken_limit(axis: &Axis, position: f64) -> Option<f64> {
    let limits = &axis.parameters().limits;
    let broken = if position > limits.position_max { limits.position_max } else { limits.position_min };
    (!limits.contain(position)).then_some(broken)
}

fn check_position(axis: &Axis, position: f64) -> Result<(), RejectReason> {
    check_finite(position)?;
    match broken_limit(axis, position) {
        Some(limit) => Err(RejectReason::PositionLimit { position, limit }),
        None => Ok(()),
    }
}

fn check_velocity(axis: &Axis, velocity: f64) -> Result<(), RejectReason> {
    check_finite(velocity)?;
    let limit = axis.parameters().limits.velocity.copysign(velocity);
    if velocity.abs() > limit.abs() { Err(RejectReason::VelocityLimit { velocity, limit }) } else { Ok(()) }
}

fn check_torque(axis: &Axis, torque: f64) -> Result<(), RejectReason> {
    check_finite(torque)?;
    let limit = axis.parameters().limits.torque.copysign(torque);
    if torque.abs() > limit.abs() { Err(RejectReason::TorqueLimit { torque, limit }) } else { Ok(()) }
}
