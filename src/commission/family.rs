//! The properties of each drive family for commissioning.

use takt_rt::Frame;

use super::dictionary::ObjectEntry;
use super::target::TargetDrive;
use super::{erob_canopen, yz_aim};
use crate::canopen::object::Object;

pub use crate::config::DriveFamily as Family;

impl Family {
    /// Vendor ID, object 1018:1.
    pub const fn vendor_id(self) -> u32 {
        match self {
            Self::ErobCanopen => 0x5A65_726F,
            Self::YzAim => 0x331,
        }
    }

    /// The object dictionary of this family.
    pub const fn objects(self) -> &'static [ObjectEntry] {
        match self {
            Self::ErobCanopen => erob_canopen::OBJECTS,
            Self::YzAim => yz_aim::OBJECTS,
        }
    }

    /// Describes the contents of a PDO, if known.
    pub fn process_data_words(self, target: &TargetDrive, frame: &Frame) -> Option<String> {
        match self {
            Self::ErobCanopen => erob_canopen::process_data_words(target, frame),
            Self::YzAim => yz_aim::process_data_words(target, frame),
        }
    }

    /// The meaning of an object's value in words, if it has one beyond its number.
    pub fn meaning(self, object: &Object, value: i64) -> Option<String> {
        match self {
            Self::ErobCanopen => erob_canopen::meaning(object, value),
            Self::YzAim => yz_aim::meaning(object, value),
        }
    }
}
