//! Any CiA 402 drive, by its electronic data sheet: `drive = "cia402"`, `eds = "my-drive.eds"`.
//!
//! The data sheet (EDS or DCF) says which modes the drive has, which objects its PDOs can carry, how it counts, and what it lacks.
//! A small file beside it says in what the drive deviates from the sheet (`quirks = "my-drive.toml"`, see `drives/`).

mod bring_up;
mod commission;
mod device;
mod remarks;
mod simulated;
mod starting;
mod turns;

pub use device::Device;
use remarks::remarks;
pub use starting::{name_by_sheet, starting_configuration};

use std::path::PathBuf;

use takt_rt::{Frame, Id, MappedObject};

use super::bring_up::AxisSession;
use super::commission::dictionary::ObjectEntry;
use super::commission::{DriveTask, Failure, TargetDrive, Task, over_sdo, profile};
use super::scan::{FoundDevice, NodeIdentity, Recognised, StartingKeys};
use super::{DataSheet, Family, SettingUp};
use crate::config::{Axis, Config, ConfiguredFamily, DriveFacts, DriveFamily, FamilyKeys};
use bring_up::Sheet;
use takt_sim::Drive;
use takt_wire::canopen::object::Object;
use takt_wire::canopen::objects::PdoDirection;

/// The family.
#[derive(Clone, Copy, Debug)]
pub struct Cia402;

const FACTS: DriveFacts = DriveFacts::standard("cia402", "CiA 402 drive");

/// The number of the device profile.
const PROFILE: u32 = 402;

/// A drive of which nothing is known but what the standard says.
pub fn undescribed() -> DriveFamily {
    static STANDARD: DriveFacts = FACTS;
    DriveFamily::of_family(&STANDARD)
}

/// The drive that a data sheet describes.
pub fn drive(device: Device) -> DriveFamily {
    DriveFamily::of_drive(device.facts(FACTS), device)
}

/// The drive that a data sheet describes, with these counts of a turn instead of those of the data sheet, if they are given.
pub fn drive_with(device: Device, counts_per_turn: Option<f64>) -> DriveFamily {
    let facts = device.facts(FACTS);
    let counts_per_turn = counts_per_turn.or(facts.counts_per_turn);
    DriveFamily::of_drive(DriveFacts { counts_per_turn, ..facts }, device)
}

/// The data sheet of an axis of this family.
///
/// # Panics
/// The drive of the axis is of another family.
pub fn device(axis: &Axis) -> &Device {
    axis.drive.description().expect("a drive of this family is made from its data sheet")
}

impl ConfiguredFamily for Cia402 {
    fn word(&self) -> &'static str {
        FACTS.word
    }

    fn read(&self, keys: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        let quirks: Option<PathBuf> = keys.path("quirks");
        let node_axis = keys.node_axis();
        keys.require("eds", "the electronic data sheet of the drive: eds = \"my-drive.eds\"");
        let eds = keys.path("eds")?;
        let node_axis = node_axis?;
        let device = match Device::load(&eds, quirks.as_deref()) {
            Ok(device) => device,
            Err(reason) => {
                keys.refuse(
                    "eds",
                    eds.display().to_string(),
                    format!("the data sheet of a CiA 402 drive: {reason}"),
                );
                return None;
            }
        };
        let axes = device.axes();
        match device.of_axis(node_axis) {
            Ok(device) => Some(drive(device)),
            Err(reason) => {
                keys.refuse("node_axis", node_axis.to_string(), format!("1 to {axes}: {reason}"));
                None
            }
        }
    }
}

impl Family for Cia402 {
    /// Nothing is known of a drive without its data sheet but what the standard says.
    fn unconfigured(&self) -> Option<DriveFamily> {
        None
    }

    /// By the device profile in the lower half of object 1000.
    fn recognises(&self, identity: &NodeIdentity) -> Option<Recognised> {
        let is_drive = identity.device_type.is_some_and(|device_type| device_type & 0xFFFF == PROFILE);
        is_drive.then_some(Recognised::ByProfile)
    }

    fn starting_keys(&self, found: &FoundDevice) -> Option<StartingKeys> {
        Some(starting::keys(found))
    }

    fn configure<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async move { sheet(c).configure().await })
    }

    fn start<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async move { sheet(c).start().await })
    }

    fn shut_down<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async move { sheet(c).shut_down().await })
    }

    fn remarks(&self, axis: &Axis) -> Vec<&'static str> {
        remarks(device(axis))
    }

    fn pdo_id(&self, axis: &Axis, direction: PdoDirection, number: u16) -> Option<Id> {
        device(axis).pdo_id(direction, number, axis.node)
    }

    fn mappable_objects(&self, axis: &Axis, number: u8) -> usize {
        device(axis).mappable_objects(number)
    }

    fn can_pass_over(&self, axis: &Axis, dummy: MappedObject) -> bool {
        device(axis).dictionary.dummies.iter().any(|code| code.0 == dummy.index)
    }

    fn data_sheet<'d>(&self, drive: &'d DriveFamily) -> Option<&'d dyn DataSheet> {
        let device: &Device = drive.description()?;
        Some(device)
    }

    fn objects(&self) -> &'static [ObjectEntry] {
        profile::objects::STANDARD
    }

    fn meaning(&self, drive: &DriveFamily, object: &Object, value: i64) -> Option<String> {
        profile::objects::meaning(drive, object, value)
    }

    fn commission(&self, target: TargetDrive, task: Task) -> Result<DriveTask<Frame>, Failure> {
        over_sdo(target, task, commission::carry_out)
    }

    fn simulated(&self, axis: &Axis, config: &Config) -> Box<dyn Drive> {
        simulated::drive(axis, device(axis), config)
    }
}

/// The bring-up by the data sheet of the axis.
fn sheet<'a>(c: &'a AxisSession<'a>) -> Sheet<'a> {
    Sheet { c, device: device(c.axis) }
}
