//! The drive that stands in for an axis on a simulated bus, made from the same data sheet.

use super::device::Device;
use crate::config::{Axis, Simulation};
use crate::sim::Drive;
use crate::sim::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters};
use crate::sim::homing_switches::ReferenceSwitches;
use crate::sim::plant::{Encoder, JointParameters};

/// The simulated drive of an axis.
pub fn drive(axis: &Axis, device: &Device, simulation: &Simulation) -> Box<dyn Drive> {
    let parameters = parameters(axis, device, simulation);
    Box::new(Cia402Drive::new(parameters).expect("the data sheet was checked when it was read"))
}

fn parameters(axis: &Axis, device: &Device, simulation: &Simulation) -> Cia402Parameters {
    let direction = if axis.reversed { -1.0 } else { 1.0 };
    let joint = &axis.simulated;
    Cia402Parameters {
        sheet: device.dictionary.clone(),
        node: axis.node,
        quirks: device.quirks.clone(),
        axes: vec![Cia402AxisParameters {
            joint: JointParameters {
                inertia: axis.joint.inertia(),
                viscous_friction: axis.joint.viscous_friction(),
                coulomb_friction: axis.joint.coulomb_friction(),
                brake_torque: 2.0 * joint.peak_torque,
            },
            encoder: Encoder {
                counts_per_unit: direction * axis.counts_per_turn * axis.gear_ratio / axis.travel.per_turn(),
                zero_counts: axis.zero_counts.into(),
            },
            counts_per_turn: axis.counts_per_turn,
            initial_position: joint.initial_position,
            rated_torque: axis.rated_torque(),
            peak_torque: joint.peak_torque,
            highest_velocity: 1.5 * axis.limits.velocity,
            switches: ReferenceSwitches::default(),
            end_stops: None,
        }],
        power_up_ns: axis.power_up_ns,
        feedback_delay_ns: axis.feedback_delay_ns,
        seed: simulation.seed,
    }
}
