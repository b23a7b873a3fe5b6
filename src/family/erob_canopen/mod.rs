//! ZeroErr eRob with CANopen firmware (eRunner manual 1.7, chapter 5, and field experience).

mod bring_up;
mod commission;
mod errors;
mod facts;
mod simulated;

pub use errors::{MULTI_TURN_BATTERY, error_text};
pub use facts::FACTS;
pub use simulated::simulated_parameters;

use takt_rt::Frame;
use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::canopen::object::Object;
use takt_wire::erob_can::entries;
use takt_wire::erob_can::frame::{self, Request};

use super::scan::{FoundDevice, StartingKeys};
use super::{Family, OtherProtocol, SettingUp, coded, erob, erob_can, standard_error};
use crate::config::{Axis, Config, ConfiguredFamily, DriveFamily, FamilyKeys};
use crate::family::bring_up::AxisSession;
use crate::family::commission::dictionary::ObjectEntry;
use crate::family::commission::{DriveTask, Failure, TargetDrive, Task, over_sdo, profile};
use crate::words::Words;
use takt_sim::Drive;
use takt_sim::erob::ErobJoint;

/// The family.
#[derive(Clone, Copy, Debug)]
pub struct ErobCanopen;

impl ConfiguredFamily for ErobCanopen {
    fn word(&self) -> &'static str {
        FACTS.word
    }

    fn read(&self, _: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        Some(super::EROB_CANOPEN)
    }
}

impl Family for ErobCanopen {
    fn unconfigured(&self) -> Option<DriveFamily> {
        Some(super::EROB_CANOPEN)
    }

    fn maker(&self) -> Option<&'static str> {
        Some(erob_can::MAKER)
    }

    fn starting_keys(&self, _: &FoundDevice) -> Option<StartingKeys> {
        Some(StartingKeys::default())
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

    /// The vendor's own protocol of firmware without CANopen. The request 0x0002 reads the position and changes nothing.
    /// Above node ID 63 its identifiers are those of other nodes' SDO.
    fn other_protocol(&self, node: u8) -> Option<OtherProtocol> {
        let read = Request::Read(entries::ACTUAL_POSITION.address);
        (1..=63).contains(&node).then(|| OtherProtocol {
            name: "vendor's custom CAN protocol",
            request: read.frame(node),
            answer: frame::reply_id(node),
            cure: "its firmware has no CANopen: name it with `--family erob-can`, or load CANopen firmware into it",
        })
    }

    fn error_words(&self, code: u16) -> Words {
        if ErrorCode(code) == MULTI_TURN_BATTERY {
            return coded(code, Words::bilingual(erob::BATTERY_LOW));
        }
        standard_error(code)
    }

    fn error_cure(&self, code: u16) -> Option<&'static str> {
        errors::error_advice(ErrorCode(code))
    }

    fn instead_of_lss(&self) -> Option<&'static str> {
        Some(
            "the node ID of an eRob is set with the vendor's tool or its own CAN protocol, and its bit rate is always 1 Mbit/s",
        )
    }

    fn objects(&self) -> &'static [ObjectEntry] {
        commission::OBJECTS
    }

    fn meaning(&self, drive: &DriveFamily, object: &Object, value: i64) -> Option<String> {
        profile::objects::meaning(drive, object, value)
    }

    fn process_data_words(&self, target: &TargetDrive, frame: &Frame) -> Option<String> {
        commission::process_data_words(target, frame)
    }

    fn commission(&self, target: TargetDrive, task: Task) -> Result<DriveTask<Frame>, Failure> {
        over_sdo(target, task, commission::carry_out)
    }

    fn simulated(&self, axis: &Axis, config: &Config) -> Box<dyn Drive> {
        Box::new(ErobJoint::new(simulated_parameters(axis, &config.simulation)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_probe_in_the_vendors_protocol_reads_the_position_and_uses_no_other_nodes_identifiers() {
        let request = ErobCanopen.other_protocol(2).unwrap();
        assert_eq!(format!("{:?}", request.request), "642#0002");
        assert_eq!(request.answer.value(), 0x5C2);
        assert_eq!(ErobCanopen.other_protocol(64), None);
    }
}
