//! The drives that stand in for axes on a simulated line, or behind a pseudo-terminal by `takt sim`.

use std::f64::consts::TAU;

use takt_wire::modbus::frame::SlaveAddress;
use takt_wire::modbus::line_timing::LineTiming;

use crate::config::{Axis, Config, FrictionShape};
use crate::family::erob::simulated::{TORQUE_PER_AMPERE, module};
use crate::family::simulated_bus::gravity;
use takt_sim::commanded_module::ModuleParameters;
use takt_sim::erob_modbus::{ErobModbusDrive, ErobModbusParameters, SimulatedLine};
use takt_sim::plant::{Encoder, JointParameters};
use takt_sim::{DevicesOnLine, Drive};

/// A program on a pseudo-terminal may write a frame in pieces so far apart.
const PAUSE_NS: u64 = 20_000_000;
/// From a request to its reply. Not published.
const REPLY_NS: u64 = 1_000_000;

/// The codes of the bit rates: register 0x0001.
const fn bit_rate_code(bit_rate: u32) -> u16 {
    match bit_rate {
        9_600 => 1,
        19_200 => 2,
        38_400 => 3,
        _ => 4,
    }
}

/// The module of an axis.
pub fn drive(axis: &Axis, config: &Config) -> ErobModbusDrive {
    let bit_rate = config.buses.get(axis.bus).map_or(0, |bus| bus.bit_rate);
    ErobModbusDrive::new(ErobModbusParameters {
        address: axis.node,
        bit_rate_code: bit_rate_code(bit_rate),
        module: module(axis),
        reply_ns: REPLY_NS,
        has_torque_sensor: false,
    })
}

/// The modules of the axes of a line.
pub fn line_of_axes(config: &Config, bus: usize) -> SimulatedLine {
    let drives = config.axes_of_bus(bus).map(|axis| {
        let mut drive = drive(axis, config);
        drive.set_gravity(gravity(axis));
        drive
    });
    let bit_rate = config.buses.get(bus).map_or(0, |bus| bus.bit_rate);
    SimulatedLine::new(LineTiming::new(bit_rate), drives.collect())
}

/// Modules of the size eRob80H120 on a line at 115200 bit/s.
pub fn line(addresses: &[u8]) -> Result<Box<dyn DevicesOnLine>, String> {
    let mut drives = vec![];
    for (place, address) in addresses.iter().enumerate() {
        if SlaveAddress::new(*address).is_none() {
            return Err(format!("a slave has an address from 1 to 247, not {address}"));
        }
        if addresses[..place].contains(address) {
            return Err(format!("two slaves cannot have the address {address}"));
        }
        drives.push(ErobModbusDrive::new(ErobModbusParameters {
            address: *address,
            bit_rate_code: 4,
            module: ModuleParameters {
                joint: JointParameters {
                    inertia: 0.647,
                    viscous_friction: 2.0,
                    coulomb_friction: 4.0,
                    friction_shape: FrictionShape::HarmonicDrive,
                    brake_torque: 140.0,
                },
                encoder: Encoder { counts_per_unit: 524_288.0 / TAU, zero_counts: 0.0 },
                counts_per_turn: 524_288.0,
                initial_position: 0.0,
                peak_torque: 70.0,
                torque_per_ampere: TORQUE_PER_AMPERE,
                highest_velocity: 2.618,
                ready_ns: 0,
                has_battery: true,
            },
            reply_ns: REPLY_NS,
            has_torque_sensor: false,
        }));
    }
    Ok(Box::new(SimulatedLine::lenient(LineTiming::new(115_200), PAUSE_NS, drives)))
}
