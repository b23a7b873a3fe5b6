//! ZeroErr eRob whose RS-485 line speaks Modbus-RTU (eRob Modbus-RTU manual 1.5).
//!
//! The line is too slow for the cycle: procedures move such a drive, one request at a time.
//!
//! - [`registers`]: the table of registers.
//! - [`fault_code`]: the codes of faults in words.
//! - [`drive`]: the registers of one drive, by a session.
//! - [`motion`]: the motions of the manual, with their steps and waits.
//! - [`commands`]: what is done with a drive beside motions: saving, faults, the encoder, the communication time-out.
//! - [`follower`]: an axis of a group, led by velocities beside the cycle.
//! - `commission`: what `takt drive` does with it.

pub mod commands;
mod commission;
pub mod drive;
mod facts;
pub mod fault_code;
#[cfg_attr(not(feature = "internals"), allow(dead_code, unnameable_types, reason = "no axis uses it yet"))]
pub mod follower;
pub mod motion;
pub mod registers;
mod selection;

pub use facts::FACTS;

use std::f64::consts::TAU;

use takt_rt::Frame;

use super::commission::{DriveTask, Failure, TargetDrive, Task};
use super::{Family, NamedEntry, SettingUp};
use crate::config::{Axis, Config, ConfiguredFamily, DriveFamily, FamilyKeys, FrictionShape};
use crate::family::bring_up::{AxisSession, ProcessData};
use crate::modbus::frame::SlaveAddress;
use crate::modbus::line_timing::LineTiming;
use crate::sim::Drive;
use crate::sim::erob_modbus::{ErobModbusDrive, ErobModbusParameters, SimulatedLine};
use crate::sim::plant::{Encoder, JointParameters};
use crate::sim::serial_line::DevicesOnLine;
use fault_code::FaultCode;

/// The family.
#[derive(Clone, Copy, Debug)]
pub struct ErobModbus;

impl ConfiguredFamily for ErobModbus {
    fn word(&self) -> &'static str {
        FACTS.word
    }

    fn read(&self, keys: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        keys.refuse(
            "drive",
            format!("\"{}\"", FACTS.word),
            "a drive on a CAN bus; one on a serial line is commissioned by `takt drive --bus serial:/dev/ttyUSB0`",
        );
        None
    }
}

impl Family for ErobModbus {
    fn unconfigured(&self) -> Option<DriveFamily> {
        Some(DriveFamily::of_family(&FACTS))
    }

    /// It has none.
    fn process_data(&self, _: &Axis) -> ProcessData {
        ProcessData::default()
    }

    /// It has no object dictionary, and nothing to set up by one.
    fn configure<'a>(&'a self, _: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async { Ok(()) })
    }

    /// As [`Family::configure`].
    fn start<'a>(&'a self, _: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async { Ok(()) })
    }

    /// As [`Family::configure`].
    fn shut_down<'a>(&'a self, _: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async { Ok(()) })
    }

    fn error_words(&self, code: u16) -> String {
        match code {
            0 => "none".to_owned(),
            code => format!("0x{code:04X} ({})", FaultCode(code).words()),
        }
    }

    fn error_cure(&self, code: u16) -> Option<&'static str> {
        Some(FaultCode(code).cure())
    }

    fn instead_of_lss(&self) -> Option<&'static str> {
        Some(
            "an eRob with Modbus-RTU has `takt drive … set-id`, and its bit rate is the register \"bit rate\" (0x0001)",
        )
    }

    fn entries(&self, _: &DriveFamily) -> Vec<NamedEntry> {
        selection::entries()
    }

    fn commission(&self, _: TargetDrive, _: Task) -> Result<DriveTask<Frame>, Failure> {
        Err(Failure::Unsuitable(
            "an eRob with Modbus-RTU is on a serial line: name it, for example --bus serial:/dev/ttyUSB0"
                .to_owned(),
        ))
    }

    fn commission_on_line(
        &self,
        target: TargetDrive,
        task: Task,
        bit_rate: u32,
    ) -> Option<Result<DriveTask<Vec<u8>>, Failure>> {
        Some(commission::begin(target, task, bit_rate))
    }

    fn simulated_line(&self, addresses: &[u8]) -> Option<Result<Box<dyn DevicesOnLine>, String>> {
        Some(simulated_line(addresses))
    }

    /// A module that hears nothing of the bus.
    fn simulated(&self, axis: &Axis, _: &Config) -> Box<dyn Drive> {
        let direction = if axis.reversed { -1.0 } else { 1.0 };
        let counts_per_unit = direction * axis.counts_per_turn * axis.gear_ratio / axis.travel.per_turn();
        let peak_torque = axis.simulated.peak_torque;
        Box::new(ErobModbusDrive::new(ErobModbusParameters {
            address: axis.node,
            bit_rate_code: 4,
            joint: JointParameters {
                inertia: axis.joint.inertia(),
                viscous_friction: axis.joint.viscous_friction(),
                coulomb_friction: axis.joint.coulomb_friction(),
                friction_shape: axis.simulated.friction,
                brake_torque: 2.0 * peak_torque,
            },
            encoder: Encoder { counts_per_unit, zero_counts: axis.zero_counts.into() },
            counts_per_turn: axis.counts_per_turn,
            initial_position: axis.simulated.initial_position,
            peak_torque,
            torque_per_ampere: TORQUE_PER_AMPERE,
            highest_velocity: 1.5 * axis.limits.velocity,
            ready_ns: axis.power_up_ns,
            reply_ns: REPLY_NS,
            has_battery: true,
            has_torque_sensor: false,
        }))
    }
}

/// Modules of the size eRob80H120 on a line at 115200 bit/s.
fn simulated_line(addresses: &[u8]) -> Result<Box<dyn DevicesOnLine>, String> {
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
            reply_ns: REPLY_NS,
            has_battery: true,
            has_torque_sensor: false,
        }));
    }
    Ok(Box::new(SimulatedLine::lenient(LineTiming::new(115_200), PAUSE_NS, drives)))
}

/// A program on a pseudo-terminal may write a frame in pieces so far apart.
const PAUSE_NS: u64 = 20_000_000;
/// Torque for one ampere where the axis says nothing of it: that of an eRob80 with a ratio of 120.
const TORQUE_PER_AMPERE: f64 = 31.0 / 6.3;
/// From a request to its reply. Not published.
const REPLY_NS: u64 = 1_000_000;
