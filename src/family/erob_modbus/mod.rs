//! ZeroErr eRob whose RS-485 line speaks Modbus-RTU (eRob Modbus-RTU manual 1.5).
//!
//! The line is too slow for the cycle: procedures move such a drive, one request at a time, and an axis follows its group beside the
//! cycle.
//!
//! - [`register`], [`registers`]: a register on the wire, and the table of them.
//! - [`fault_code`]: the codes of faults in words.
//! - [`drive`]: the registers of one drive, by a session.
//! - `commanded`: the sequences of the manual, as the motions of [`erob`](super::erob) carry them out.
//! - [`commands`]: what is done with a drive beside motions: saving, faults, the encoder, the communication time-out.
//! - `axis`, [`follower`], [`line`]: an axis of a group, led by velocities beside the cycle, and the drives of a line by turns.
//! - [`budget`]: how often each of them is spoken to.
//! - `commission`: what `takt drive` does with it.
//! - `simulated`: the drives that stand in for axes.

mod axis;
pub mod budget;
mod commanded;
pub mod commands;
mod commission;
pub mod drive;
mod facts;
pub mod fault_code;
pub mod follower;
pub mod line;
pub mod register;
pub mod registers;
mod scan;
mod simulated;

pub use facts::FACTS;

use takt_rt::Frame;

use super::commission::{DriveTask, Failure, TargetDrive, Task};
use super::scan::{FoundDevice, StartingKeys};
use super::{
    Family, LookingAtSlave, NamedEntry, OffCycleBudget, OffCycleLine, SettingUp, SignOfLife, Unwatched,
    Watchdog, coded, erob_can,
};
use crate::config::{Axis, Config, ConfiguredFamily, DriveFamily, FamilyKeys};
use crate::family::bring_up::{AxisSession, ProcessData};
use crate::family::erob::selection;
use crate::procedure::ModbusSession;
use crate::words::Words;
use axis::LineKeys;
use budget::LineBudget;
use fault_code::FaultCode;
use line::FollowedLine;
use register::Register;
use takt_sim::{DevicesOnLine, Drive};
use takt_wire::modbus::frame::SlaveAddress;

/// The family.
#[derive(Clone, Copy, Debug)]
pub struct ErobModbus;

impl ConfiguredFamily for ErobModbus {
    fn word(&self) -> &'static str {
        FACTS.word
    }

    fn read(&self, keys: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        Some(DriveFamily::of_drive(FACTS, LineKeys::read(keys)))
    }

    fn is_on_serial_line(&self) -> bool {
        FACTS.protocol.is_of_serial_line()
    }
}

impl Family for ErobModbus {
    fn unconfigured(&self) -> Option<DriveFamily> {
        Some(DriveFamily::of_family(&FACTS))
    }

    fn has_statusword(&self) -> bool {
        false
    }

    fn maker(&self) -> Option<&'static str> {
        Some(erob_can::MAKER)
    }

    fn recognises_on_line<'a>(
        &'a self,
        session: &'a ModbusSession,
        bit_rate: u32,
    ) -> Option<LookingAtSlave<'a>> {
        Some(Box::pin(scan::look(session, bit_rate)))
    }

    fn starting_keys(&self, _: &FoundDevice) -> Option<StartingKeys> {
        let timeout =
            "communication_timeout = \"500 ms\"  # YOURS: its motor stops so long after the last request";
        Some(StartingKeys { axis: vec![timeout.to_owned()], ..StartingKeys::default() })
    }

    /// It has none.
    fn process_data(&self, _: &Axis) -> ProcessData {
        ProcessData::default()
    }

    fn off_cycle_line(&self, config: &Config, bus: usize) -> Option<Box<dyn OffCycleLine>> {
        let budget = LineBudget::of(config, bus)?;
        let round_ns = budget.round_ns();
        let slaves = config
            .axes_of_bus(bus)
            .map(|axis| Some((SlaveAddress::new(axis.node)?, axis::follower_parameters(axis, round_ns))))
            .collect::<Option<Vec<_>>>()?;
        Some(Box::new(FollowedLine::new(budget.timing(), slaves)))
    }

    fn off_cycle_budget(&self, axis: &Axis, config: &Config) -> Option<OffCycleBudget> {
        Some(LineBudget::of(config, axis.bus)?.of_drive())
    }

    fn stops_by_itself_after(&self, axis: &Axis, _: &Config) -> Result<Watchdog, Unwatched> {
        match LineKeys::of(axis).communication_timeout_ms {
            0 => Err(Unwatched::TimeoutOff),
            ms => Ok(Watchdog::new(SignOfLife::Request, Some(u64::from(ms) * 1_000_000))),
        }
    }

    fn remarks(&self, axis: &Axis) -> Vec<&'static str> {
        let unknown = "what its motor does after the communication time-out (0x0FA2) stands in no manual: try it without a load before \
                       you rely on it";
        match LineKeys::of(axis).communication_timeout_ms {
            0 => vec![],
            _ => vec![unknown],
        }
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

    fn error_words(&self, code: u16) -> Words {
        match code {
            0 => "none".into(),
            code => coded(code, Words::bilingual(FaultCode(code).bilingual())),
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
        selection::entries::<Register>()
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
        Some(simulated::line(addresses))
    }

    fn simulated_axes_on_line(&self, config: &Config, bus: usize) -> Option<Box<dyn DevicesOnLine>> {
        Some(Box::new(simulated::line_of_axes(config, bus)))
    }

    /// A module that hears nothing of the bus.
    fn simulated(&self, axis: &Axis, config: &Config) -> Box<dyn Drive> {
        Box::new(simulated::drive(axis, config))
    }
}
