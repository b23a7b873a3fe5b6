//! The drive that stands in for an axis on a simulated bus, or on an interface by `takt sim`.

use super::facts::ENABLED_FROM_NS;
use crate::config::{Axis, FamilyKeys};
use crate::family::simulated_joint::{encoder, mechanics};
use crate::sim::Drive;
use crate::sim::erob_can::{ErobCanDrive, ErobCanParameters, ErrorForm};

/// From a request to its reply: up to 1 ms in the captures of the manual.
const REPLY_NS: u64 = 500_000;
/// Torque of a turn of the field for one ampere where the axis says nothing of it: that of an eRob70 with a ratio of 100.
const TORQUE_PER_AMPERE: f64 = 31.0 / 6.3;

/// In what firmware differs, as far as the simulation can show it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Firmware {
    /// Whether the velocity limit of torque control (0204) is taken while the motor is enabled. By the manual it is not; a program
    /// of the vendor writes it in every loop while enabled, so there seems to be firmware that takes it.
    takes_velocity_limit_while_enabled: bool,
}

impl Firmware {
    /// Reads the keys of the simulated drive. `None`: something is wrong with them, which has been reported.
    pub fn read(keys: &mut FamilyKeys<'_, '_>) -> Option<Self> {
        let takes_velocity_limit_while_enabled = keys.simulated_flag("takes_velocity_limit_while_enabled")?;
        Some(Self { takes_velocity_limit_while_enabled })
    }
}

/// The drive that simulates an axis. It has been switched on for as long as it needs to be enabled.
pub fn drive(axis: &Axis) -> Box<dyn Drive> {
    let firmware = axis.drive.description::<Firmware>().copied().unwrap_or_default();
    let joint = &axis.simulated;
    Box::new(ErobCanDrive::new(ErobCanParameters {
        node: axis.node,
        joint: mechanics(axis),
        encoder: encoder(axis),
        counts_per_turn: axis.counts_per_turn,
        initial_position: joint.initial_position,
        peak_torque: joint.peak_torque,
        torque_per_ampere: TORQUE_PER_AMPERE,
        highest_velocity: 1.5 * axis.limits.velocity,
        ready_ns: axis.power_up_ns.min(ENABLED_FROM_NS),
        reply_ns: REPLY_NS,
        has_battery: true,
        has_brake: true,
        error_form: ErrorForm::Printed,
        has_free_velocity_limit: firmware.takes_velocity_limit_while_enabled,
    }))
}
