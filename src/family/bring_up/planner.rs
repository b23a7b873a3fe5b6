//! Objects by which a drive bounds its motion: read back, since a drive that keeps narrower bounds than the axis does not move or stop as
//! planned.

use takt_wire::canopen::object::Object;
use takt_wire::canopen::objects::{
    MAX_ACCELERATION, MAX_DECELERATION, MAX_MOTOR_SPEED, MAX_PROFILE_VELOCITY, MOTION_PROFILE_TYPE,
    PROFILE_ACCELERATION, PROFILE_DECELERATION, PROFILE_JERK, PROFILE_VELOCITY, QUICK_STOP_DECELERATION,
    SOFTWARE_LIMIT_HIGHEST, SOFTWARE_LIMIT_LOWEST,
};

use super::axis_session::{AxisSession, StepResult};
use super::axis_units::{
    SiUnit, acceleration_units, jerk_units, motor_speed_units, position_counts, profile_velocity_units,
};
use super::check::Check;
use super::configuration_file::{raise_unless_in_file, write_unless_in_file};
use crate::config::{Axis, Control};
use crate::family;

/// Object 6086: trapezoidal. Other profiles need a longer way to stop for the same deceleration.
const LINEAR_RAMP: i64 = 0;

/// A condition for the value of an object, from the limits of an axis.
struct Requirement {
    object: Object,
    needed: Check,
    unit: Option<SiUnit>,
}

impl Requirement {
    const fn new(object: Object, needed: Check, unit: SiUnit) -> Self {
        Self { object, needed, unit: Some(unit) }
    }
}

/// The objects by which the drive of an axis plans in the profile modes, and what the limits of the axis need of each. None in modes that
/// follow set-points.
fn of_profile(axis: &Axis) -> Vec<Requirement> {
    let has = |wanted: Control| axis.controls().any(|control| *control == wanted);
    let plans = has(Control::ProfilePosition) || has(Control::ProfileVelocity);
    if !plans && !has(Control::ProfileTorque) {
        return vec![];
    }
    let limits = &axis.limits;
    let (velocity, by_velocity) =
        (profile_velocity_units(axis, limits.velocity), SiUnit::profile_velocity(axis));
    let (deceleration, by_acceleration) =
        (acceleration_units(axis, limits.deceleration), SiUnit::acceleration(axis));
    let mut requirements = vec![
        Requirement::new(QUICK_STOP_DECELERATION, Check::AtLeast(deceleration), by_acceleration),
        Requirement::new(MAX_DECELERATION, Check::BoundAbove(deceleration), by_acceleration),
    ];
    if plans {
        let acceleration = Check::AtMost(acceleration_units(axis, limits.acceleration));
        requirements.extend([
            Requirement::new(PROFILE_ACCELERATION, acceleration, by_acceleration),
            Requirement::new(PROFILE_DECELERATION, Check::AtLeast(deceleration), by_acceleration),
            Requirement { object: MOTION_PROFILE_TYPE, needed: Check::Equals(LINEAR_RAMP), unit: None },
            Requirement::new(MAX_PROFILE_VELOCITY, Check::BoundAbove(velocity), by_velocity),
        ]);
        requirements.extend(of_jerk(axis));
    }
    if has(Control::ProfilePosition) {
        requirements.push(Requirement::new(PROFILE_VELOCITY, Check::AtMost(velocity), by_velocity));
    }
    requirements
}

/// The jerk, where the drive has one and no object by which its ramps are linear.
fn of_jerk(axis: &Axis) -> Vec<Requirement> {
    let limits = &axis.limits;
    let limits_jerk = family::of(&axis.drive)
        .data_sheet(&axis.drive)
        .is_some_and(|sheet| sheet.has(PROFILE_JERK[0].address) && !sheet.has(MOTION_PROFILE_TYPE.address));
    if !limits_jerk {
        return vec![];
    }
    // A ramp of the deceleration at jerk j makes the way to stop longer by v·a/2j, which the following error limit has room for.
    let jerk = limits.velocity * limits.deceleration / (2.0 * axis.following_error.limit);
    let needed = Check::BoundAbove(jerk_units(axis, jerk.min(limits.jerk)));
    PROFILE_JERK.map(|object| Requirement::new(object, needed, SiUnit::jerk(axis))).into()
}

/// The software position limits that leave room for those of the axis.
fn software_limits(axis: &Axis) -> [(Object, Check); 2] {
    let limits =
        [axis.limits.position_min, axis.limits.position_max].map(|limit| position_counts(axis, limit));
    let [lowest, highest] = if axis.reversed { [limits[1], limits[0]] } else { limits };
    // A count is not a position beyond them: a limit may be written rounded either way.
    let (lowest, highest) = (lowest.ceil() as i64, highest.floor() as i64);
    [(SOFTWARE_LIMIT_LOWEST, Check::AtMost(lowest)), (SOFTWARE_LIMIT_HIGHEST, Check::AtLeast(highest))]
}

/// Sets what bounds the drive's planner as the limits of the axis need it, unless the configuration file has it, and reads it all back;
/// in every mode also the bounds of position and speed that the drive keeps by itself.
/// A drive that would need a longer way to stop than planned, be faster than allowed, or stop before the limits of the axis is refused.
pub(crate) async fn check(c: &AxisSession<'_>) -> StepResult {
    c.step(
        "planner of the drive",
        "choose limits of the axis that this value allows, or change the value (in the file named by `dcf`, if it has the object)",
    );
    let (axis, limits) = (c.axis, &c.axis.limits);
    let requirements = of_profile(axis);
    if !requirements.is_empty() {
        for (object, least) in
            [(MAX_ACCELERATION, limits.acceleration), (MAX_DECELERATION, limits.deceleration)]
        {
            raise_unless_in_file(c, object, acceleration_units(axis, least)).await?;
        }
        write_unless_in_file(c, MOTION_PROFILE_TYPE, LINEAR_RAMP).await?;
    }
    for Requirement { object, needed, unit } in requirements {
        c.compare_optional(object, needed, unit).await?;
    }
    bounds(c).await
}

/// Compares the bounds that hold in every mode (CiA 402: software position limit and max motor speed).
async fn bounds(c: &AxisSession<'_>) -> StepResult {
    let axis = c.axis;
    if may_have(axis, &[SOFTWARE_LIMIT_LOWEST, SOFTWARE_LIMIT_HIGHEST]) {
        let are_off = |lowest, highest| axis.drive.empty_software_limits_are_off && lowest >= highest;
        c.compare_bounds(software_limits(axis), SiUnit::position(axis), are_off).await?;
    }
    if may_have(axis, &[MAX_MOTOR_SPEED]) {
        let needed = Check::BoundAbove(motor_speed_units(axis, axis.limits.velocity));
        c.compare_optional(MAX_MOTOR_SPEED, needed, Some(SiUnit::motor_speed(axis))).await?;
    }
    Ok(())
}

/// Returns `true` if the data sheet of the drive has one of these objects, or if there is no data sheet.
fn may_have(axis: &Axis, objects: &[Object]) -> bool {
    let sheet = family::of(&axis.drive).data_sheet(&axis.drive);
    sheet.is_none_or(|sheet| objects.iter().any(|object| sheet.has(object.address)))
}
