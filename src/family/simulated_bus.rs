//! The simulated drives of a configuration, and the buses that they are on.

use super::registry;
use crate::config::{Axis, Config, Travel};
use crate::sim::{Drive, Gravity, SimulatedBus, WireBitRates};

/// The drive that simulates an axis, the first of its node, under its gravity.
fn simulated(axis: &Axis, config: &Config) -> Box<dyn Drive> {
    let mut drive = registry::of(&axis.drive).simulated(axis, config);
    drive.set_gravity(gravity(axis));
    drive
}

/// What gravity does to the joint of an axis.
pub(super) fn gravity(axis: &Axis) -> Gravity {
    match axis.travel {
        Travel::Rotary => Gravity::Pendulum(axis.simulated.gravity),
        Travel::Linear { .. } => Gravity::Weight(axis.simulated.gravity),
    }
}

/// The drives that simulate the axes of a bus, one for each node, with all of its axes.
pub(crate) fn simulated_drives(config: &Config, bus: usize) -> Vec<Box<dyn Drive>> {
    // Those of a serial line are on that line.
    let axes =
        || config.axes.iter().filter(|axis| axis.bus == bus && !axis.drive.protocol.is_of_serial_line());
    let is_first = |axis: &&Axis| {
        axes().all(|other| other.node != axis.node || other.drive.node_axis >= axis.drive.node_axis)
    };
    axes().filter(is_first).map(|axis| simulated(axis, config)).collect()
}

impl SimulatedBus {
    /// The bus with this index in the configuration, with one drive for every axis on it.
    pub fn new(config: &Config, bus: usize) -> Self {
        let rates = config.buses.get(bus).map_or(WireBitRates { nominal: 1_000_000, data: None }, |bus| {
            WireBitRates { nominal: bus.bit_rate, data: bus.data_bit_rate }
        });
        Self::with_drives(rates, config.simulation.longest_gap_ns, simulated_drives(config, bus))
    }
}
