//! The simulated drives of a configuration, and the buses that they are on.

use super::registry;
use crate::config::{Axis, Config, Travel};
use takt_sim::{Drive, Gravity, SimulatedBus, WireBitRates};

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
pub fn simulated_drives(config: &Config, bus: usize) -> Vec<Box<dyn Drive>> {
    // Those of a serial line are on that line.
    let axes =
        || config.axes.iter().filter(|axis| axis.bus == bus && !axis.drive.protocol.is_of_serial_line());
    let is_first = |axis: &&Axis| {
        axes().all(|other| other.node != axis.node || other.drive.node_axis >= axis.drive.node_axis)
    };
    axes().filter(is_first).map(|axis| simulated(axis, config)).collect()
}

/// Returns the simulated bus with this index in the configuration, with one drive for every axis on it.
///
/// ```
/// use takt::Config;
/// use takt::rt::{BusPort, Frame, Id, ReceiveBatch};
///
/// let config = Config::load("configs/first.toml".as_ref())?;
/// let mut bus = takt::simulated_bus(&config, 0);
/// bus.send(0, &[]); // the supply is switched on
/// let mut batch = ReceiveBatch::new();
/// let mut now_ns = 0;
/// while batch.is_empty() {
///     now_ns += 1_000_000;
///     bus.receive(now_ns, &mut batch);
/// }
/// assert_eq!(batch[0].frame, Frame::of(Id::canopen(0x700, 1), [0])); // boot-up
/// # Ok::<(), takt::ConfigError>(())
/// ```
pub fn simulated_bus(config: &Config, bus: usize) -> SimulatedBus {
    let rates = config.buses.get(bus).map_or(WireBitRates { nominal: 1_000_000, data: None }, |bus| {
        WireBitRates { nominal: bus.bit_rate, data: bus.data_bit_rate }
    });
    SimulatedBus::with_drives(rates, config.simulation.longest_gap_ns, simulated_drives(config, bus))
}
