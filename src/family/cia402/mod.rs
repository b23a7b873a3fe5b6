//! Any CiA 402 drive, by its electronic data sheet: `drive = "cia402"`, `eds = "my-drive.eds"`.
//!
//! The data sheet (EDS or DCF) says which modes the drive has, which objects its PDOs can carry, how it counts, and what it lacks.
//! A small file beside it says in what the drive deviates from the sheet (`quirks = "my-drive.toml"`, see `drives/`). Of some drives
//! both come with takt, and the drive has a name of its own.

mod bring_up;
mod commission;
mod device;
mod remarks;
mod simulated;
mod starting;
mod turns;

pub use device::Device;
use remarks::remarks;
#[doc(hidden)]
pub use simulated::simulated_parameters;
pub use starting::{name_by_sheet, starting_configuration};

use std::path::PathBuf;
use std::sync::LazyLock;

use takt_rt::{Frame, Id, MappedObject};

use super::bring_up::AxisSession;
use super::commission::dictionary::ObjectEntry;
use super::commission::profile::words::statusword_words;
use super::commission::{DriveTask, Failure, TargetDrive, Task, over_sdo, profile};
use super::scan::{FoundDevice, NodeIdentity, Recognised, StartingKeys};
use super::{DataSheet, Family, OtherProtocol, SettingUp, own_error_words, standard_error};
use crate::config::{Axis, Config, ConfiguredFamily, DriveFacts, DriveFamily, FamilyKeys};
use crate::words::Words;
use bring_up::Sheet;
use takt_sim::Drive;
use takt_wire::canopen::object::Object;
use takt_wire::canopen::objects::{PdoDirection, STATUSWORD};

/// A family: any drive by the data sheet that a configuration names, or the drive whose data sheet comes with takt.
#[derive(Clone, Copy, Debug)]
pub struct Cia402 {
    word: &'static str,
    built_in: Option<fn() -> &'static DriveFamily>,
}

/// Any drive, by its data sheet.
pub static BY_SHEET: Cia402 = Cia402 { word: FACTS.word, built_in: None };
/// eRob with CANopen firmware.
pub static EROB_CANOPEN: Cia402 = Cia402 { word: "erob-canopen", built_in: Some(erob_canopen) };

/// The eRob, by its data sheet and its quirk file.
pub fn erob_canopen() -> &'static DriveFamily {
    static DRIVE: LazyLock<DriveFamily> = LazyLock::new(|| {
        built_in(
            DriveFacts::standard("erob-canopen", "eRob"),
            include_str!("../../../configs/eds/erob-canopen.eds"),
            include_str!("../../../drives/erob-canopen.toml"),
        )
    });
    &DRIVE
}

/// A drive whose data sheet and quirk file come with takt.
pub(super) fn built_in(standard: DriveFacts, eds: &str, quirks: &str) -> DriveFamily {
    let device = Device::parse(eds, quirks).expect("the files that come with takt are right");
    DriveFamily::of_drive(device.facts(standard), device)
}

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
        self.word
    }

    fn read(&self, keys: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        if let Some(drive) = self.built_in {
            return Some(DriveFamily::built_in(drive));
        }
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
        self.built_in.map(DriveFamily::built_in)
    }

    fn maker(&self) -> Option<&'static str> {
        self.built_in_device().map(|device| device.quirks.drive.vendor.as_str())
    }

    /// One whose data sheet comes with takt by vendor and product, any other by the device profile in the lower half of object 1000.
    fn recognises(&self, identity: &NodeIdentity) -> Option<Recognised> {
        if let Some(drive) = self.unconfigured() {
            return identity.is_of(&drive.identity).then_some(Recognised::ByIdentity);
        }
        let is_drive = identity.device_type.is_some_and(|device_type| device_type & 0xFFFF == PROFILE);
        is_drive.then_some(Recognised::ByProfile)
    }

    fn starting_keys(&self, found: &FoundDevice) -> Option<StartingKeys> {
        Some(if self.built_in.is_some() { StartingKeys::default() } else { starting::keys(found) })
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

    /// Of a drive whose data sheet its user has chosen.
    fn remarks(&self, axis: &Axis) -> Vec<&'static str> {
        if self.built_in.is_some() { vec![] } else { remarks(device(axis)) }
    }

    fn other_protocol(&self, drive: &DriveFamily, node: u8) -> Option<OtherProtocol> {
        let protocol = drive.description::<Device>()?.quirks.vendor_protocol?;
        if !(1..=protocol.last_node).contains(&node) {
            return None;
        }
        let id = |first: u16| Id::base(u32::from(first) + u32::from(node)).ok();
        Some(OtherProtocol {
            name: protocol.name,
            request: Frame::of(id(protocol.request)?, protocol.bytes),
            answer: id(protocol.reply)?,
            cure: protocol.cure,
        })
    }

    fn error_words(&self, code: u16) -> Words {
        let own = self.built_in_device().map_or(&[][..], |device| &device.quirks.errors);
        own_error_words(own, code).unwrap_or_else(|| standard_error(code))
    }

    fn error_cure(&self, code: u16) -> Option<&'static str> {
        self.built_in_device()?.own_cure(code)
    }

    fn instead_of_lss(&self) -> Option<&'static str> {
        self.built_in_device()?.quirks.instead_of_lss
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

    /// The statusword, if TPDO1 begins with it: as the data sheet has it, and as takt maps it.
    fn process_data_words(&self, target: &TargetDrive, frame: &Frame) -> Option<String> {
        let device: &Device = target.drive.description()?;
        let word = u16::from_le_bytes(frame.payload().get(..2)?.try_into().ok()?);
        let is_first = frame.id() == Id::canopen(0x180, target.node)
            && device.first_mapped(PdoDirection::Transmit) == Some(STATUSWORD.address);
        is_first.then(|| format!("TPDO1: statusword 0x{word:04X}: {}", statusword_words(word)))
    }

    fn commission(&self, target: TargetDrive, task: Task) -> Result<DriveTask<Frame>, Failure> {
        over_sdo(target, task, commission::carry_out)
    }

    fn simulated(&self, axis: &Axis, config: &Config) -> Box<dyn Drive> {
        simulated::drive(axis, device(axis), config)
    }
}

impl Cia402 {
    fn built_in_device(&self) -> Option<&'static Device> {
        self.built_in?().description()
    }
}

/// The bring-up by the data sheet of the axis.
fn sheet<'a>(c: &'a AxisSession<'a>) -> Sheet<'a> {
    Sheet { c, device: device(c.axis) }
}
