//! What commissioning knows of the families of drives.

use takt_rt::Frame;

use super::dictionary::Entry;
use super::line::Manners;
use super::subject::Subject;
use super::{erob_canopen, yz_aim};
use crate::canopen::object::Object;
use crate::canopen::sdo::Timing;

pub use crate::config::DriveFamily as Family;

impl Family {
    /// Every family.
    pub const ALL: [Self; 2] = [Self::ErobCanopen, Self::YzAim];

    /// Object 1018:1.
    pub const fn vendor_id(self) -> u32 {
        match self {
            Self::ErobCanopen => 0x5A65_726F,
            Self::YzAim => 0x331,
        }
    }

    /// How its SDO server wants to be spoken to. A YZ-AIM drops requests that overlap or come too soon.
    pub const fn manners(self) -> Manners {
        let timing = Timing { reply_timeout_ns: 100_000_000, retries: 2 };
        match self {
            Self::ErobCanopen => Manners { timing, gap_ns: 0, has_short_replies: false },
            Self::YzAim => Manners { timing, gap_ns: 2_000_000, has_short_replies: true },
        }
    }

    /// The objects that a drive of this family has.
    pub const fn objects(self) -> &'static [Entry] {
        match self {
            Self::ErobCanopen => erob_canopen::OBJECTS,
            Self::YzAim => yz_aim::OBJECTS,
        }
    }

    /// What a PDO of the drive holds, where that is known.
    pub fn process_data_words(self, subject: &Subject, frame: &Frame) -> Option<String> {
        match self {
            Self::ErobCanopen => erob_canopen::process_data_words(subject, frame),
            Self::YzAim => yz_aim::process_data_words(subject, frame),
        }
    }

    /// What a value of an object means, in words, where it has more meaning than its number.
    pub fn meaning(self, object: &Object, value: i64) -> Option<String> {
        match self {
            Self::ErobCanopen => erob_canopen::meaning(object, value),
            Self::YzAim => yz_aim::meaning(object, value),
        }
    }
}
