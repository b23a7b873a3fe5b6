//! What the rest of takt asks of a described drive: its errors in words, and the drive that stands in for it.

use std::f64::consts::TAU;

use takt_rt::{FrameFormat, Nanoseconds, OperationMode};
use takt_wire::bit_fields::FieldDevice;
use takt_wire::canopen::object::{DataType, ObjectAddress};

use crate::config::{Axis, Bus};
use crate::family::DataSheet;
use takt_sim::bit_fields::FieldSimulationParameters;
use takt_sim::plant::JointParameters;

/// There are no objects.
impl DataSheet for FieldDevice {
    fn has(&self, _: ObjectAddress) -> bool {
        false
    }

    fn is_writable(&self, _: ObjectAddress) -> bool {
        false
    }

    fn data_type(&self, _: ObjectAddress) -> Option<DataType> {
        None
    }

    fn adds_mode(&self, _: OperationMode) -> bool {
        false
    }

    fn own_errors(&self) -> &[(u16, String)] {
        &self.description.errors
    }

    fn storing_ns(&self) -> Option<Nanoseconds> {
        None
    }

    fn sdo_reply_ns(&self) -> Option<Nanoseconds> {
        None
    }
}

/// The simulated drive of an axis.
pub fn parameters(axis: &Axis, device: &FieldDevice, bus: Option<&Bus>) -> FieldSimulationParameters {
    let direction = if axis.reversed { -1.0 } else { 1.0 };
    FieldSimulationParameters {
        device: device.clone(),
        motor_id: axis.node,
        joint: JointParameters {
            inertia: axis.joint.inertia(),
            viscous_friction: axis.joint.viscous_friction(),
            coulomb_friction: axis.joint.coulomb_friction(),
            friction_shape: axis.simulated.friction,
            // Such a motor has no brake.
            brake_torque: 0.0,
        },
        initial_position: axis.simulated.initial_position,
        peak_torque: axis.simulated.peak_torque,
        highest_velocity: 1.5 * axis.limits.velocity,
        shaft_per_joint: direction * axis.gear_ratio * TAU / axis.travel.per_turn(),
        zero_turns: f64::from(axis.zero_counts) / axis.counts_per_turn,
        power_up_ns: axis.power_up_ns,
        bit_rates: bus.map(|bus| {
            let is_classic = device.description.command.format == FrameFormat::Classic;
            [bus.bit_rate, bus.data_bit_rate.filter(|_| !is_classic).unwrap_or(bus.bit_rate)]
        }),
    }
}
