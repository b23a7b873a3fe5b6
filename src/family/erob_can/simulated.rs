//! The drive that stands in for an axis on a simulated bus, or on an interface by `takt sim`.

use crate::config::{Axis, FamilyKeys};
use crate::family::erob::simulated::module;
use takt_sim::Drive;
use takt_sim::erob_can::{ErobCanDrive, ErobCanParameters, ErrorForm};

/// From a request to its reply: up to 1 ms in the captures of the manual.
const REPLY_NS: u64 = 500_000;

/// In what firmware differs, as far as the simulation can show it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Firmware {
    /// True if the velocity limit of torque control (0204) is taken while the motor is enabled. By the manual it is not; a program
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

/// The drive that simulates an axis.
pub fn drive(axis: &Axis) -> Box<dyn Drive> {
    let firmware = axis.drive.description::<Firmware>().copied().unwrap_or_default();
    Box::new(ErobCanDrive::new(ErobCanParameters {
        node: axis.node,
        module: module(axis),
        reply_ns: REPLY_NS,
        has_brake: true,
        error_form: ErrorForm::Printed,
        has_free_velocity_limit: firmware.takes_velocity_limit_while_enabled,
    }))
}
