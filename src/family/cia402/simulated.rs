//! The drive that stands in for an axis on a simulated bus, made from the same data sheet.

use super::device::Device;
use crate::config::{Axis, Config, Simulation};
use crate::family::simulated_bus::gravity;
use takt_sim::Drive;
use takt_sim::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters};
use takt_sim::homing_switches::ReferenceSwitches;
use takt_sim::plant::{Encoder, JointParameters};

/// The simulated drive of an axis, with the other axes of its node.
pub fn drive(axis: &Axis, device: &Device, config: &Config) -> Box<dyn Drive> {
    let axes = axes(axis, config);
    let parameters = parameters(axis, &axes, device, &config.simulation);
    let mut drive = Cia402Drive::new(parameters).expect("the data sheet was checked when it was read");
    for (number, axis) in axes.iter().enumerate() {
        drive.set_axis_gravity(number, gravity(axis));
    }
    Box::new(drive)
}

/// The parameters of the drive that simulates an axis, with the other axes of its node.
///
/// # Panics
/// The drive of the axis is of another family.
#[doc(hidden)]
pub fn simulated_parameters(axis: &Axis, config: &Config) -> Cia402Parameters {
    parameters(axis, &axes(axis, config), super::device(axis), &config.simulation)
}

/// The axes of the node of an axis.
fn axes<'a>(axis: &'a Axis, config: &'a Config) -> Vec<&'a Axis> {
    (1..=last_axis(axis, config)).map(|number| stand_in(number, axis, config)).collect()
}

fn of_node<'a>(axis: &Axis, config: &'a Config) -> impl Iterator<Item = &'a Axis> {
    let node = (axis.bus, axis.node);
    config.axes.iter().filter(move |other| (other.bus, other.node) == node)
}

fn last_axis(axis: &Axis, config: &Config) -> u8 {
    of_node(axis, config).map(|other| other.drive.node_axis).max().unwrap_or(1)
}

/// The axis of the node that has this number. One that the configuration does not have is like `axis`, and nobody moves it.
fn stand_in<'a>(number: u8, axis: &'a Axis, config: &'a Config) -> &'a Axis {
    of_node(axis, config).find(|other| other.drive.node_axis == number).unwrap_or(axis)
}

fn parameters(axis: &Axis, axes: &[&Axis], device: &Device, simulation: &Simulation) -> Cia402Parameters {
    Cia402Parameters {
        sheet: device.dictionary.clone(),
        node: axis.node,
        quirks: device.quirks.clone(),
        axes: axes.iter().map(|axis| axis_parameters(axis)).collect(),
        power_up_ns: axis.power_up_ns,
        feedback_delay_ns: axis.feedback_delay_ns,
        seed: simulation.seed,
    }
}

fn axis_parameters(axis: &Axis) -> Cia402AxisParameters {
    let direction = if axis.reversed { -1.0 } else { 1.0 };
    let joint = &axis.simulated;
    Cia402AxisParameters {
        joint: JointParameters {
            inertia: axis.joint.inertia(),
            viscous_friction: axis.joint.viscous_friction(),
            coulomb_friction: axis.joint.coulomb_friction(),
            friction_shape: axis.simulated.friction,
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
    }
}
