//! The simulated servo of an axis.

use std::f64::consts::TAU;
use std::sync::Arc;

use takt_sim::homing_switches::{HomingSwitches, Switch};
use takt_sim::plant::{EndStops, JointParameters};
use takt_sim::yz_aim::{Gearing, Model, YzAimParameters};

use super::device;
use crate::config::{Axis, Control, Simulation, Travel};

/// Returns the parameters of the servo that simulates an axis. Interpolation is stored if the axis uses it. Limit switches are just beyond
/// the axis' limits, the lower one at DIR and the upper one at PU, with end stops behind them.
pub fn simulated_parameters(axis: &Axis, bit_rate: u32, simulation: &Simulation) -> YzAimParameters {
    let travel_per_turn = match axis.travel {
        Travel::Rotary => TAU,
        Travel::Linear { lead_m } => lead_m,
    };
    let gearing = Gearing {
        ratio: axis.gear_ratio,
        travel_per_turn,
        is_reversed: axis.reversed,
        zero_counts: axis.zero_counts.into(),
    };
    let own = &axis.simulated;
    let joint = JointParameters {
        inertia: axis.joint.inertia(),
        viscous_friction: axis.joint.viscous_friction(),
        coulomb_friction: axis.joint.coulomb_friction(),
        friction_shape: axis.simulated.friction,
        brake_torque: 0.0,
    };
    let limits = &axis.limits;
    let margin = 0.02 * (limits.position_max - limits.position_min);
    let mut quirks = device().quirks.clone();
    quirks.power_up = own.power_up;
    let sheet = Arc::new(device().dictionary.clone());
    YzAimParameters {
        bit_rate,
        end_stops: Some(EndStops {
            lowest: limits.position_min - 2.0 * margin,
            highest: limits.position_max + 2.0 * margin,
        }),
        switches: HomingSwitches {
            dir: Some(Switch::below(limits.position_min - margin)),
            pu: Some(Switch::above(limits.position_max + margin)),
        },
        initial_position: own.initial_position,
        rated_torque: axis.rated_torque(),
        peak_torque: own.peak_torque,
        maximum_speed_rpm: 3000.0,
        special_function: if axis.control == Control::Interpolated { 7 } else { 0 },
        power_up_ns: axis.power_up_ns,
        feedback_delay_ns: axis.feedback_delay_ns,
        seed: simulation.seed,
        ..YzAimParameters::new((sheet, quirks), axis.node, Model::Aim57x30C, gearing, joint)
    }
}
