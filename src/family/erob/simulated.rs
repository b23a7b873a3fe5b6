//! The module that stands in for an axis, without its protocol.

use super::ENABLED_FROM_NS;
use crate::config::Axis;
use crate::family::simulated_joint::{encoder, mechanics};
use takt_sim::commanded_module::ModuleParameters;

/// Torque for one ampere where the axis says nothing of it: that of an eRob80 with a ratio of 120.
pub const TORQUE_PER_AMPERE: f64 = 31.0 / 6.3;

/// The module of an axis. It has been switched on for as long as it needs to be enabled, if the axis says so.
pub fn module(axis: &Axis) -> ModuleParameters {
    ModuleParameters {
        joint: mechanics(axis),
        encoder: encoder(axis),
        counts_per_turn: axis.counts_per_turn,
        initial_position: axis.simulated.initial_position,
        peak_torque: axis.simulated.peak_torque,
        torque_per_ampere: TORQUE_PER_AMPERE,
        highest_velocity: 1.5 * axis.limits.velocity,
        ready_ns: axis.power_up_ns.min(ENABLED_FROM_NS),
        has_battery: true,
    }
}
