//! The mode of an axis, and the loops that the controller closes for it.

use super::entry::{Bounds, Entry};
use super::section::Section;
use super::travel::Quantities;
use crate::config::defaults;
use crate::config::model::{Control, DriveFamily, SimulatedJoint};
use crate::config::quantity::Quantity;
use crate::drive::yz_aim;

/// The mode, with the gains of the loop that it needs. The gains of the other loops are checked and not used, so that
/// the mode can be changed in one line.
pub fn control(
    section: &mut Section<'_>,
    drive: Option<DriveFamily>,
    q: Quantities,
    joint: &SimulatedJoint,
) -> Option<Control> {
    let velocity_loop = velocity_loop(section.section("velocity_loop"));
    let torque_loop = torque_loop(section.section("torque_loop"), q, joint);
    let modes = [
        ("csp", Control::Position),
        ("csv", velocity_loop),
        ("cst", torque_loop),
        ("ip", Control::Interpolated),
        ("pp", Control::ProfilePosition),
        ("pv", Control::ProfileVelocity),
        ("pt", Control::ProfileTorque),
    ];
    match (section.get("mode"), drive) {
        (Some(entry), Some(DriveFamily::YzAim)) => {
            let own: Vec<_> = modes.into_iter().filter(|(_, control)| yz_aim::has_mode(control)).collect();
            entry.choice(&own)
        }
        (Some(entry), _) => entry.choice(&modes),
        (None, Some(DriveFamily::YzAim)) => Some(Control::Interpolated),
        (None, _) => Some(Control::Position),
    }
}

fn velocity_loop(mut section: Section<'_>) -> Control {
    let gain =
        section.get("position_gain").and_then(|entry| entry.quantity(Quantity::GAIN, Bounds::Positive));
    section.finish();
    Control::Velocity { position_gain: gain.unwrap_or(defaults::POSITION_GAIN) }
}

fn torque_loop(mut section: Section<'_>, q: Quantities, joint: &SimulatedJoint) -> Control {
    let mut value = |key, quantity, bounds| {
        section.get(key).and_then(|entry: Entry<'_>| entry.quantity(quantity, bounds))
    };
    let bandwidth =
        value("bandwidth", Quantity::GAIN, Bounds::Positive).unwrap_or(defaults::TORQUE_LOOP_BANDWIDTH);
    let inertia = value("inertia", q.inertia, Bounds::NotNegative).unwrap_or(joint.inertia);
    let stiffness = value("stiffness", q.stiffness, Bounds::Positive);
    let damping = value("damping", q.damping, Bounds::NotNegative);
    let viscous_friction = value("viscous_friction", q.damping, Bounds::NotNegative);
    let coulomb_friction = value("coulomb_friction", q.effort, Bounds::NotNegative);
    section.finish();
    Control::Torque {
        stiffness: stiffness.unwrap_or(inertia * bandwidth * bandwidth),
        damping: damping.unwrap_or(2.0 * inertia * bandwidth),
        inertia,
        viscous_friction: viscous_friction.unwrap_or(joint.viscous_friction),
        coulomb_friction: coulomb_friction.unwrap_or(joint.coulomb_friction),
    }
}
