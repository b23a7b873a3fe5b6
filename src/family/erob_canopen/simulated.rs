//! The simulated module of an axis.

use takt_sim::erob::ErobParameters;
use takt_sim::plant::{Encoder, JointParameters};

use crate::config::{Axis, Control, Simulation, Travel};

/// Returns the parameters of the module that simulates an axis.
pub fn simulated_parameters(axis: &Axis, simulation: &Simulation) -> ErobParameters {
    let travel_per_turn = match axis.travel {
        Travel::Rotary => std::f64::consts::TAU,
        Travel::Linear { lead_m } => lead_m,
    };
    let direction = if axis.reversed { -1.0 } else { 1.0 };
    let joint = &axis.simulated;
    ErobParameters {
        node: axis.node,
        joint: JointParameters {
            inertia: axis.joint.inertia(),
            viscous_friction: axis.joint.viscous_friction(),
            coulomb_friction: axis.joint.coulomb_friction(),
            friction_shape: axis.simulated.friction,
            brake_torque: 2.0 * joint.peak_torque,
        },
        encoder: Encoder {
            counts_per_unit: direction * axis.counts_per_turn * axis.gear_ratio / travel_per_turn,
            zero_counts: axis.zero_counts.into(),
        },
        counts_per_turn: axis.counts_per_turn,
        initial_position: joint.initial_position,
        rated_torque: axis.rated_torque(),
        peak_torque: joint.peak_torque,
        highest_velocity: 1.5 * axis.limits.velocity,
        power_up_ns: axis.power_up_ns,
        feedback_delay_ns: axis.feedback_delay_ns,
        has_battery: true,
        has_interpolated_position: axis.control == Control::Interpolated,
        is_upload_segmented: false,
        seed: simulation.seed,
    }
}
