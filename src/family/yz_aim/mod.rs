//! YZ-AIM integrated servos, CANopen edition (manual v1.62, and field experience).
//!
//! The PDO mapping is fixed. The drive has no mode display (6061) and no emergency messages, and it does not answer SDO
//! requests for unknown objects.

mod alarm;
mod bring_up;
mod commission;
mod facts;
mod process_data;
mod simulated;

pub use alarm::{Alarm, Clearing};
pub use facts::{HIGHEST_SPEED_RPM, NO_RAMP, STANDSTILL, device, drive};
pub(crate) use process_data::answers_sync;
pub use simulated::simulated_parameters;

use takt_rt::Frame;
use takt_wire::canopen::object::Object;

use super::scan::{FoundDevice, StartingKeys};
use super::cia402::Device;
use super::{DataSheet, Family, MappingMatch, SettingUp};
use crate::config::{Axis, Config, ConfiguredFamily, DriveFamily, FamilyKeys};
use crate::family::bring_up::{AxisSession, ProcessData};
use crate::family::commission::dictionary::ObjectEntry;
use crate::family::commission::{DriveTask, Failure, TargetDrive, Task, over_sdo, profile};
use crate::procedure::SdoQuirks;
use crate::words::Words;
use takt_sim::Drive;
use takt_sim::yz_aim::YzAimJoint;

/// The family.
#[derive(Clone, Copy, Debug)]
pub struct YzAim;

impl ConfiguredFamily for YzAim {
    fn word(&self) -> &'static str {
        "yz-aim"
    }

    fn read(&self, _: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        Some(super::YZ_AIM)
    }
}

impl Family for YzAim {
    fn unconfigured(&self) -> Option<DriveFamily> {
        Some(super::YZ_AIM)
    }

    fn maker(&self) -> Option<&'static str> {
        Some(&device().quirks.drive.vendor)
    }

    fn starting_keys(&self, _: &FoundDevice) -> Option<StartingKeys> {
        let ratio = "gear_ratio = 1  # YOURS: turns of the motor for one turn of the joint";
        Some(StartingKeys {
            axis: vec![ratio.to_owned()],
            cycle_period: Some("2 ms"),
            ..StartingKeys::default()
        })
    }

    fn process_data(&self, axis: &Axis) -> ProcessData {
        process_data::fixed(axis)
    }

    fn mapping_match(&self) -> MappingMatch {
        MappingMatch::ByNumber
    }

    fn configure<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(bring_up::configure(c))
    }

    fn start<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(bring_up::start(c))
    }

    fn shut_down<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(bring_up::shut_down(c))
    }

    fn error_words(&self, code: u16) -> Words {
        Alarm::of(code).words()
    }

    fn error_cure(&self, code: u16) -> Option<&'static str> {
        Some(Alarm::of(code).advice().unwrap_or(super::error_words::UNKNOWN))
    }

    fn instead_of_lss(&self) -> Option<&'static str> {
        device().quirks.instead_of_lss
    }

    /// A YZ-AIM drops requests that overlap or follow too soon, shortens its replies, and does not answer for objects that
    /// it does not have. The manual gives 606C two lengths (A27), so the length of the reply counts.
    fn sdo_quirks(&self) -> SdoQuirks {
        SdoQuirks {
            gap_ns: 2_000_000,
            has_short_replies: true,
            has_other_lengths: true,
            ..SdoQuirks::standard()
        }
    }

    fn data_sheet<'d>(&self, drive: &'d DriveFamily) -> Option<&'d dyn DataSheet> {
        let device: &Device = drive.description()?;
        Some(device)
    }

    fn objects(&self) -> &'static [ObjectEntry] {
        profile::objects::STANDARD
    }

    fn meaning(&self, _: &DriveFamily, object: &Object, value: i64) -> Option<String> {
        commission::meaning(object, value)
    }

    fn process_data_words(&self, target: &TargetDrive, frame: &Frame) -> Option<String> {
        commission::process_data_words(target, frame)
    }

    fn commission(&self, target: TargetDrive, task: Task) -> Result<DriveTask<Frame>, Failure> {
        over_sdo(target, task, commission::carry_out)
    }

    fn simulated(&self, axis: &Axis, config: &Config) -> Box<dyn Drive> {
        let bit_rate = config.buses.get(axis.bus).map_or(1_000_000, |bus| bus.bit_rate);
        Box::new(YzAimJoint::new(simulated_parameters(axis, bit_rate, &config.simulation)))
    }
}
