//! A simulated eRob that commands move, without its protocol.

use std::f64::consts::TAU;

use takt::sim::commanded_module::ModuleParameters;
use takt::sim::plant::{Encoder, JointParameters};

/// Its encoder has 524288 counts per turn, and the zero of the joint. It can be enabled as soon as it is switched on.
pub fn module() -> ModuleParameters {
    ModuleParameters {
        joint: JointParameters {
            inertia: 0.3,
            viscous_friction: 2.0,
            coulomb_friction: 4.0,
            friction_shape: takt::config::FrictionShape::Constant,
            brake_torque: 60.0,
        },
        encoder: Encoder { counts_per_unit: 524_288.0 / TAU, zero_counts: 0.0 },
        counts_per_turn: 524_288.0,
        initial_position: 0.0,
        peak_torque: 60.0,
        torque_per_ampere: 31.0 / 6.3,
        highest_velocity: 3.0,
        ready_ns: 0,
        has_battery: true,
    }
}
