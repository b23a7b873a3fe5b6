//! The joint of a simulated drive, as the axis describes it.

use crate::config::Axis;
use takt_sim::plant::{Encoder, JointParameters};

/// The brake holds so much more than the peak torque.
const BRAKE_TO_PEAK_TORQUE: f64 = 2.0;

/// Inertia, friction and brake of the joint of an axis.
pub(super) fn mechanics(axis: &Axis) -> JointParameters {
    JointParameters {
        inertia: axis.joint.inertia(),
        viscous_friction: axis.joint.viscous_friction(),
        coulomb_friction: axis.joint.coulomb_friction(),
        friction_shape: axis.simulated.friction,
        brake_torque: BRAKE_TO_PEAK_TORQUE * axis.simulated.peak_torque,
    }
}

/// The encoder at the joint of an axis.
pub(super) fn encoder(axis: &Axis) -> Encoder {
    Encoder { counts_per_unit: counts_per_unit(axis), zero_counts: axis.zero_counts.into() }
}

/// Counts of the drive for one radian (metre) of the joint; negative when the counts go down.
pub(super) fn counts_per_unit(axis: &Axis) -> f64 {
    let direction = if axis.reversed { -1.0 } else { 1.0 };
    direction * axis.counts_per_turn * axis.gear_ratio / axis.travel.per_turn()
}
