//! Object dictionary of an eRob with CANopen firmware, with units (vendor's EDS, CiA 402, field experience).

use crate::family::commission::dictionary::{ObjectEntry, ObjectUnit};
use crate::family::commission::profile::objects::*;
use crate::family::commission::profile::words::statusword_words;
use crate::family::commission::target::TargetDrive;
use takt_rt::{Frame, Id};
use takt_wire::canopen::object::{DataType, Object};
use takt_wire::canopen::objects::*;

/// 22A2: °C.
pub const TEMPERATURE: Object = Object::new(0x22A2, 0, DataType::U16, "temperature");
/// 2242: writing 1 clears the multi-turn battery fault and the turn count.
pub const MULTI_TURN_RESET: Object = Object::new(0x2242, 0, DataType::U16, "reset of the multi-turn count");
/// 6065: INTEGER32 on this drive; CiA 402 has UNSIGNED32.
pub const FOLLOWING_ERROR_WINDOW: Object = Object::new(0x6065, 0, DataType::I32, "following error window");

const fn i32_at(index: u16, subindex: u8, name: &'static str) -> Object {
    Object::new(index, subindex, DataType::I32, name)
}
const fn u32_at(index: u16, subindex: u8, name: &'static str) -> Object {
    Object::new(index, subindex, DataType::U32, name)
}
const fn i16_at(index: u16, subindex: u8, name: &'static str) -> Object {
    Object::new(index, subindex, DataType::I16, name)
}
const fn u16_at(index: u16, subindex: u8, name: &'static str) -> Object {
    Object::new(index, subindex, DataType::U16, name)
}

/// The objects of the drive, without the PDO parameters.
pub const OBJECTS: &[ObjectEntry] = &[
    ObjectEntry::read(DEVICE_TYPE, ObjectUnit::None),
    ObjectEntry::read(ERROR_REGISTER, ObjectUnit::None),
    ObjectEntry::write(ERROR_HISTORY_COUNT, ObjectUnit::None),
    ObjectEntry::read(error_history(1), ObjectUnit::None),
    ObjectEntry::read(error_history(2), ObjectUnit::None),
    ObjectEntry::read(error_history(3), ObjectUnit::None),
    ObjectEntry::read(error_history(4), ObjectUnit::None),
    ObjectEntry::write(SYNC_COB_ID, ObjectUnit::None),
    ObjectEntry::write(COMMUNICATION_CYCLE_PERIOD, ObjectUnit::Of(1.0, "µs")),
    ObjectEntry::write(STORE, ObjectUnit::None),
    ObjectEntry::write(CONSUMER_HEARTBEAT_TIME, ObjectUnit::None),
    ObjectEntry::write(PRODUCER_HEARTBEAT_TIME, ObjectUnit::Of(1.0, "ms")),
    ObjectEntry::read(VENDOR_ID, ObjectUnit::None),
    ObjectEntry::read(PRODUCT_CODE, ObjectUnit::None),
    ObjectEntry::read(REVISION_NUMBER, ObjectUnit::None),
    ObjectEntry::write(COMMUNICATION_ERROR_BEHAVIOUR, ObjectUnit::None),
    ObjectEntry::read(i32_at(0x20A0, 0, "load encoder"), ObjectUnit::None),
    ObjectEntry::read(i16_at(0x2205, 0, "analogue input"), ObjectUnit::None),
    ObjectEntry::read(i32_at(0x2240, 0, "motor encoder"), ObjectUnit::None),
    ObjectEntry::read(i32_at(0x2241, 0, "encoder difference"), ObjectUnit::None),
    ObjectEntry::write(MULTI_TURN_RESET, ObjectUnit::None),
    ObjectEntry::read(TEMPERATURE, ObjectUnit::Of(1.0, "°C")),
    ObjectEntry::write(u16_at(0x2380, 1, "current loop gain 1"), ObjectUnit::None),
    ObjectEntry::write(u16_at(0x2380, 2, "current loop gain 2"), ObjectUnit::None),
    ObjectEntry::write(u16_at(0x2381, 1, "velocity loop gain 1"), ObjectUnit::None),
    ObjectEntry::write(u16_at(0x2381, 2, "velocity loop gain 2"), ObjectUnit::None),
    ObjectEntry::write(u16_at(0x2382, 1, "position loop gain 1"), ObjectUnit::None),
    ObjectEntry::write(u16_at(0x2382, 2, "position loop gain 2"), ObjectUnit::None),
    ObjectEntry::write(u32_at(0x3B60, 0, "velocity error window"), ObjectUnit::Velocity),
    ObjectEntry::read(i32_at(0x3B69, 0, "torque estimate"), ObjectUnit::Of(0.001, "Nm")),
    ObjectEntry::read(ERROR_CODE, ObjectUnit::None),
    ObjectEntry::write(CONTROLWORD, ObjectUnit::None),
    ObjectEntry::read(STATUSWORD, ObjectUnit::None),
    ObjectEntry::write(i16_at(0x605B, 0, "shutdown option code"), ObjectUnit::None),
    ObjectEntry::write(i16_at(0x605E, 0, "fault reaction option code"), ObjectUnit::None),
    ObjectEntry::write(MODES_OF_OPERATION, ObjectUnit::None),
    ObjectEntry::read(MODES_OF_OPERATION_DISPLAY, ObjectUnit::None),
    ObjectEntry::read(i32_at(0x6062, 0, "position demand value"), ObjectUnit::Position),
    ObjectEntry::read(POSITION_ACTUAL_VALUE, ObjectUnit::Position),
    ObjectEntry::write(FOLLOWING_ERROR_WINDOW, ObjectUnit::Distance),
    ObjectEntry::write(i32_at(0x6067, 0, "position window"), ObjectUnit::Distance),
    ObjectEntry::write(i16_at(0x6068, 0, "position window time"), ObjectUnit::Of(1.0, "ms")),
    ObjectEntry::read(i32_at(0x606B, 0, "velocity demand value"), ObjectUnit::Velocity),
    ObjectEntry::read(VELOCITY_ACTUAL_VALUE, ObjectUnit::Velocity),
    ObjectEntry::write(i16_at(0x606D, 0, "velocity window"), ObjectUnit::Velocity),
    ObjectEntry::write(i16_at(0x606E, 0, "velocity window time"), ObjectUnit::Of(1.0, "ms")),
    ObjectEntry::write(u16_at(0x606F, 0, "velocity threshold"), ObjectUnit::Velocity),
    ObjectEntry::write(TARGET_TORQUE, ObjectUnit::Torque),
    ObjectEntry::read(i16_at(0x6074, 0, "torque demand value"), ObjectUnit::Torque),
    ObjectEntry::read(MOTOR_RATED_CURRENT, ObjectUnit::Of(0.001, "A")),
    ObjectEntry::read(MOTOR_RATED_TORQUE, ObjectUnit::Of(0.001, "Nm")),
    ObjectEntry::read(TORQUE_ACTUAL_VALUE, ObjectUnit::Torque),
    ObjectEntry::read(CURRENT_ACTUAL_VALUE, ObjectUnit::Torque),
    ObjectEntry::read(DC_LINK_VOLTAGE, ObjectUnit::Of(0.001, "V")),
    ObjectEntry::write(TARGET_POSITION, ObjectUnit::Position),
    ObjectEntry::write(HOME_OFFSET, ObjectUnit::Distance),
    ObjectEntry::write(i32_at(0x607D, 1, "software position limit, lowest"), ObjectUnit::Position),
    ObjectEntry::write(i32_at(0x607D, 2, "software position limit, highest"), ObjectUnit::Position),
    ObjectEntry::write(u32_at(0x607F, 0, "max profile velocity"), ObjectUnit::Velocity),
    ObjectEntry::write(u32_at(0x6080, 0, "max motor speed"), ObjectUnit::None),
    ObjectEntry::write(PROFILE_VELOCITY, ObjectUnit::Velocity),
    ObjectEntry::write(PROFILE_ACCELERATION, ObjectUnit::Acceleration),
    ObjectEntry::write(PROFILE_DECELERATION, ObjectUnit::Acceleration),
    ObjectEntry::write(QUICK_STOP_DECELERATION, ObjectUnit::Acceleration),
    ObjectEntry::write(i16_at(0x6086, 0, "motion profile type"), ObjectUnit::None),
    ObjectEntry::write(u32_at(0x6087, 0, "torque slope"), ObjectUnit::None),
    ObjectEntry::write(HOMING_METHOD, ObjectUnit::None),
    ObjectEntry::write(u32_at(0x6099, 1, "homing speed, to the switch"), ObjectUnit::Velocity),
    ObjectEntry::write(u32_at(0x6099, 2, "homing speed, to the zero"), ObjectUnit::Velocity),
    ObjectEntry::write(u32_at(0x609A, 0, "homing acceleration"), ObjectUnit::Acceleration),
    ObjectEntry::write(POSITION_OFFSET, ObjectUnit::Distance),
    ObjectEntry::write(VELOCITY_OFFSET, ObjectUnit::Velocity),
    ObjectEntry::write(TORQUE_OFFSET, ObjectUnit::Torque),
    ObjectEntry::write(INTERPOLATION_TIME_PERIOD, ObjectUnit::None),
    ObjectEntry::write(INTERPOLATION_TIME_INDEX, ObjectUnit::None),
    ObjectEntry::write(u32_at(0x60C5, 0, "max acceleration"), ObjectUnit::Acceleration),
    ObjectEntry::write(u32_at(0x60C6, 0, "max deceleration"), ObjectUnit::Acceleration),
    ObjectEntry::read(i32_at(0x60F4, 0, "following error actual value"), ObjectUnit::Distance),
    ObjectEntry::read(u32_at(0x60FD, 0, "digital inputs"), ObjectUnit::None),
    ObjectEntry::write(TARGET_VELOCITY, ObjectUnit::Velocity),
    ObjectEntry::read(SUPPORTED_DRIVE_MODES, ObjectUnit::None),
];

/// Describes TPDO1: with the default mapping and with takt's, the statusword comes first.
pub fn process_data_words(s: &TargetDrive, frame: &Frame) -> Option<String> {
    let word = u16::from_le_bytes(frame.payload().get(..2)?.try_into().ok()?);
    (frame.id() == Id::canopen(0x180, s.node))
        .then(|| format!("TPDO1: statusword 0x{word:04X}: {}", statusword_words(word)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_sim::erob::OBJECTS as SIMULATED;

    #[test]
    fn every_object_has_the_same_length_in_the_simulated_drive() {
        for entry in OBJECTS {
            let address = entry.object.address;
            let simulated = SIMULATED
                .iter()
                .find(|object| (object.index, object.subindex) == (address.index, address.subindex));
            let simulated = simulated.unwrap_or_else(|| panic!("{} is unknown", entry.object));
            let bits = simulated.data_type.bits().map(usize::from);
            assert_eq!(bits, Some(8 * entry.object.data_type.length()), "{}", entry.object);
        }
    }
}
