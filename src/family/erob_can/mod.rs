//! ZeroErr eRob whose firmware speaks the vendor's own CAN protocol (eRunner manual 1.7, chapters 4 and 7).
//!
//! The protocol is too slow and too loose for the cycle: procedures move such a drive, one request at a time, and an axis follows
//! its group beside the cycle.
//!
//! - `commanded`: the sequences of the manual, as the motions of [`erob`](super::erob) carry them out.
//! - [`module`]: what a module tells of itself, saving, the brake, and the encoder.
//! - `commission`: what `takt drive` does with it.
//! - [`follower`]: an axis that follows the reference of its group.
//! - `simulated`: the drive that stands in for an axis.

mod commanded;
mod commission;
mod facts;
mod failure;
pub mod follower;
pub mod module;
mod scan;
pub mod session;
mod simulated;

pub use facts::FACTS;
pub use scan::MAKER;

use takt_rt::{Frame, Id};

use super::commission::{DriveTask, Failure, TargetDrive, Task};
use super::scan::{FoundDevice, OwnProtocol, StartingKeys};
use super::{
    Family, FrameWords, NamedEntry, OffCycleBudget, OffCycleDrive, OtherProtocol, SettingUp, Unwatched,
    Watchdog,
};
use crate::config::{Axis, Config, ConfiguredFamily, DriveFamily, FamilyKeys};
use crate::family::bring_up::{AxisSession, ProcessData};
use crate::family::erob::selection;
use crate::words::Words;
use follower::Follower;
use takt_sim::Drive;
use takt_wire::canopen::function_code;
use takt_wire::canopen::objects::DEVICE_TYPE;
use takt_wire::canopen::sdo::SdoRequest;
use takt_wire::erob_can::entries::{self, Entry};
use takt_wire::erob_can::frame::Request;

/// The family.
#[derive(Clone, Copy, Debug)]
pub struct ErobCan;

impl ConfiguredFamily for ErobCan {
    fn word(&self) -> &'static str {
        FACTS.word
    }

    fn read(&self, keys: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        Some(DriveFamily::of_drive(FACTS, simulated::Firmware::read(keys)?))
    }
}

impl Family for ErobCan {
    fn unconfigured(&self) -> Option<DriveFamily> {
        Some(DriveFamily::of_family(&FACTS))
    }

    fn has_statusword(&self) -> bool {
        false
    }

    fn maker(&self) -> Option<&'static str> {
        Some(MAKER)
    }

    fn own_protocols(&self) -> &'static [&'static dyn OwnProtocol] {
        &[&scan::OwnScan]
    }

    fn starting_keys(&self, _: &FoundDevice) -> Option<StartingKeys> {
        // In each period of its bus a report of the drive is expected.
        Some(StartingKeys { bus: vec!["period = \"10 ms\"".to_owned()], ..StartingKeys::default() })
    }

    /// It has none.
    fn process_data(&self, _: &Axis) -> ProcessData {
        ProcessData::default()
    }

    fn off_cycle(&self, axis: &Axis, config: &Config) -> Option<Box<dyn OffCycleDrive>> {
        Some(Box::new(Follower::new(axis, config.cycle.period_ns)?))
    }

    fn off_cycle_stop_frame(&self, axis: &Axis) -> Option<Frame> {
        Some(Request::Write(entries::MOTOR_ENABLE.address, 0).frame(axis.node))
    }

    fn off_cycle_budget(&self, axis: &Axis, config: &Config) -> Option<OffCycleBudget> {
        Some(follower::budget(config.cycle.period_ns, config.buses.get(axis.bus)?.bit_rate))
    }

    fn stops_by_itself_after(&self, _: &Axis, _: &Config) -> Result<Watchdog, Unwatched> {
        Err(Unwatched::NoWatchdog)
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

    fn other_protocol(&self, _: &DriveFamily, node: u8) -> Option<OtherProtocol> {
        Some(OtherProtocol {
            name: "CANopen",
            request: SdoRequest::Upload { object: DEVICE_TYPE.address }.frame(node),
            answer: Id::canopen(function_code::SDO_RESPONSE, node),
            cure: "its firmware is the one for CANopen: name it with `--family erob-canopen`",
        })
    }

    fn error_words(&self, code: u16) -> Words {
        failure::error_words(code)
    }

    fn error_cure(&self, _: u16) -> Option<&'static str> {
        Some(failure::FAULT_CURE)
    }

    fn instead_of_lss(&self) -> Option<&'static str> {
        Some(
            "an eRob with its own CAN protocol has `takt drive … set-id`, and its bit rate is always 1 Mbit/s",
        )
    }

    fn entries(&self, _: &DriveFamily) -> Vec<NamedEntry> {
        selection::entries::<Entry>()
    }

    fn frame_words(&self, target: TargetDrive) -> FrameWords {
        commission::frame_words(target)
    }

    fn commission(&self, target: TargetDrive, task: Task) -> Result<DriveTask<Frame>, Failure> {
        commission::begin(target, task)
    }

    fn simulated(&self, axis: &Axis, _: &Config) -> Box<dyn Drive> {
        simulated::drive(axis)
    }
}
