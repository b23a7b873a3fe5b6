//! What bounds the motion that a drive plans by itself, in the profile modes: read back, since the way to stop relies on it.

use super::axis_session::{AxisSession, StepResult};
use super::axis_units::{acceleration_units, profile_velocity_units};
use super::check::Check;
use super::configuration_file::{raise_unless_in_file, write_unless_in_file};
use crate::canopen::object::Object;
use crate::canopen::objects::{
    MAX_ACCELERATION, MAX_DECELERATION, MAX_PROFILE_VELOCITY, MOTION_PROFILE_TYPE, PROFILE_ACCELERATION,
    PROFILE_DECELERATION, PROFILE_VELOCITY, QUICK_STOP_DECELERATION,
};
use crate::config::{Axis, Control};

/// Object 6086: trapezoidal. Other profiles need a longer way to stop for the same deceleration.
const LINEAR_RAMP: i64 = 0;

/// The objects by which the drive of an axis plans, and what the limits of the axis need of each. None in modes that follow set-points.
pub(crate) fn requirements(axis: &Axis) -> Vec<(Object, Check)> {
    let has = |wanted: Control| axis.controls().any(|control| *control == wanted);
    let plans = has(Control::ProfilePosition) || has(Control::ProfileVelocity);
    if !plans && !has(Control::ProfileTorque) {
        return vec![];
    }
    let limits = &axis.limits;
    let velocity = profile_velocity_units(axis, limits.velocity);
    let deceleration = acceleration_units(axis, limits.deceleration);
    let mut requirements = vec![
        (QUICK_STOP_DECELERATION, Check::AtLeast(deceleration)),
        (MAX_DECELERATION, Check::BoundAbove(deceleration)),
    ];
    if plans {
        requirements.extend([
            (PROFILE_ACCELERATION, Check::AtMost(acceleration_units(axis, limits.acceleration))),
            (PROFILE_DECELERATION, Check::AtLeast(deceleration)),
            (MOTION_PROFILE_TYPE, Check::Equals(LINEAR_RAMP)),
            (MAX_PROFILE_VELOCITY, Check::BoundAbove(velocity)),
        ]);
    }
    if has(Control::ProfilePosition) {
        requirements.push((PROFILE_VELOCITY, Check::AtMost(velocity)));
    }
    requirements
}

/// Sets what bounds the drive's planner as the limits of the axis need it, unless the configuration file has it, and reads it all back.
/// A drive that would need a longer way to stop than planned, or be faster than allowed, is refused.
pub(crate) async fn check(c: &AxisSession<'_>) -> StepResult {
    let requirements = requirements(c.axis);
    if requirements.is_empty() {
        return Ok(());
    }
    c.step(
        "planner of the drive",
        "choose limits of the axis that this value allows, or change the value (in the file named by `dcf`, if it has the object)",
    );
    let limits = &c.axis.limits;
    for (object, least) in [(MAX_ACCELERATION, limits.acceleration), (MAX_DECELERATION, limits.deceleration)]
    {
        raise_unless_in_file(c, object, acceleration_units(c.axis, least)).await?;
    }
    write_unless_in_file(c, MOTION_PROFILE_TYPE, LINEAR_RAMP).await?;
    for (object, needed) in requirements {
        c.compare_optional(object, needed).await?;
    }
    Ok(())
}
