//! The objects of an eRob with CANopen firmware, with their units (vendor's EDS, CiA 402, and what real units do).

use crate::canopen::object::{DataType, Object};
use crate::canopen::objects::*;
use crate::commission::dictionary::{Entry, Unit};
use crate::commission::subject::Subject;
use crate::drive::mode_words;

use super::state;
use takt_rt::{Frame, Id, OperationMode};

/// 1001
pub const ERROR_REGISTER: Object = Object::new(0x1001, 0, DataType::U8, "error register");
/// 1003:0
pub const ERROR_HISTORY_COUNT: Object =
    Object::new(0x1003, 0, DataType::U8, "error history, number of entries");
/// 1003:1 and up, the newest first.
pub const fn error_history(entry: u8) -> Object {
    Object::new(0x1003, entry, DataType::U32, "error history")
}
/// 1010:1
pub const STORE: Object = Object::new(0x1010, 1, DataType::U32, "store parameters");
/// 22A2: °C.
pub const TEMPERATURE: Object = Object::new(0x22A2, 0, DataType::U16, "temperature");
/// 2242: 1 clears the fault of the multi-turn battery, and the count of turns.
pub const MULTI_TURN_RESET: Object = Object::new(0x2242, 0, DataType::U16, "reset of the multi-turn count");
/// 6065: the joint calls this INTEGER32.
pub const FOLLOWING_ERROR_WINDOW: Object = Object::new(0x6065, 0, DataType::I32, "following error window");
/// 6077: per mille of the rated torque.
pub const TORQUE_ACTUAL_VALUE: Object = Object::new(0x6077, 0, DataType::I16, "torque actual value");
/// 6078: per mille of the rated current.
pub const CURRENT_ACTUAL_VALUE: Object = Object::new(0x6078, 0, DataType::I16, "current actual value");
/// 6079: mV.
pub const DC_LINK_VOLTAGE: Object = Object::new(0x6079, 0, DataType::U32, "DC link circuit voltage");
/// 607C
pub const HOME_OFFSET: Object = Object::new(0x607C, 0, DataType::I32, "home offset");
/// 6098
pub const HOMING_METHOD: Object = Object::new(0x6098, 0, DataType::I8, "homing method");

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

/// What the drive has, PDO parameters apart.
pub const OBJECTS: &[Entry] = &[
    Entry::read(DEVICE_TYPE, Unit::None),
    Entry::read(ERROR_REGISTER, Unit::None),
    Entry::write(ERROR_HISTORY_COUNT, Unit::None),
    Entry::read(error_history(1), Unit::None),
    Entry::read(error_history(2), Unit::None),
    Entry::read(error_history(3), Unit::None),
    Entry::read(error_history(4), Unit::None),
    Entry::write(SYNC_COB_ID, Unit::None),
    Entry::write(COMMUNICATION_CYCLE_PERIOD, Unit::Of(1.0, "µs")),
    Entry::write(STORE, Unit::None),
    Entry::write(CONSUMER_HEARTBEAT_TIME, Unit::None),
    Entry::write(PRODUCER_HEARTBEAT_TIME, Unit::Of(1.0, "ms")),
    Entry::read(VENDOR_ID, Unit::None),
    Entry::read(PRODUCT_CODE, Unit::None),
    Entry::read(REVISION_NUMBER, Unit::None),
    Entry::write(COMMUNICATION_ERROR_BEHAVIOUR, Unit::None),
    Entry::read(i32_at(0x20A0, 0, "load encoder"), Unit::None),
    Entry::read(i16_at(0x2205, 0, "analogue input"), Unit::None),
    Entry::read(i32_at(0x2240, 0, "motor encoder"), Unit::None),
    Entry::read(i32_at(0x2241, 0, "encoder difference"), Unit::None),
    Entry::write(MULTI_TURN_RESET, Unit::None),
    Entry::read(TEMPERATURE, Unit::Of(1.0, "°C")),
    Entry::write(u16_at(0x2380, 1, "current loop gain 1"), Unit::None),
    Entry::write(u16_at(0x2380, 2, "current loop gain 2"), Unit::None),
    Entry::write(u16_at(0x2381, 1, "velocity loop gain 1"), Unit::None),
    Entry::write(u16_at(0x2381, 2, "velocity loop gain 2"), Unit::None),
    Entry::write(u16_at(0x2382, 1, "position loop gain 1"), Unit::None),
    Entry::write(u16_at(0x2382, 2, "position loop gain 2"), Unit::None),
    Entry::write(u32_at(0x3B60, 0, "velocity error window"), Unit::Velocity),
    Entry::read(i32_at(0x3B69, 0, "torque estimate"), Unit::Of(0.001, "Nm")),
    Entry::read(ERROR_CODE, Unit::None),
    Entry::write(CONTROLWORD, Unit::None),
    Entry::read(STATUSWORD, Unit::None),
    Entry::write(i16_at(0x605B, 0, "shutdown option code"), Unit::None),
    Entry::write(i16_at(0x605E, 0, "fault reaction option code"), Unit::None),
    Entry::write(MODES_OF_OPERATION, Unit::None),
    Entry::read(MODES_OF_OPERATION_DISPLAY, Unit::None),
    Entry::read(i32_at(0x6062, 0, "position demand value"), Unit::Position),
    Entry::read(POSITION_ACTUAL_VALUE, Unit::Position),
    Entry::write(FOLLOWING_ERROR_WINDOW, Unit::Distance),
    Entry::write(i32_at(0x6067, 0, "position window"), Unit::Distance),
    Entry::write(i16_at(0x6068, 0, "position window time"), Unit::Of(1.0, "ms")),
    Entry::read(i32_at(0x606B, 0, "velocity demand value"), Unit::Velocity),
    Entry::read(VELOCITY_ACTUAL_VALUE, Unit::Velocity),
    Entry::write(i16_at(0x606D, 0, "velocity window"), Unit::Velocity),
    Entry::write(i16_at(0x606E, 0, "velocity window time"), Unit::Of(1.0, "ms")),
    Entry::write(u16_at(0x606F, 0, "velocity threshold"), Unit::Velocity),
    Entry::write(TARGET_TORQUE, Unit::Torque),
    Entry::read(i16_at(0x6074, 0, "torque demand value"), Unit::Torque),
    Entry::read(MOTOR_RATED_CURRENT, Unit::Of(0.001, "A")),
    Entry::read(MOTOR_RATED_TORQUE, Unit::Of(0.001, "Nm")),
    Entry::read(TORQUE_ACTUAL_VALUE, Unit::Torque),
    Entry::read(CURRENT_ACTUAL_VALUE, Unit::Torque),
    Entry::read(DC_LINK_VOLTAGE, Unit::Of(0.001, "V")),
    Entry::write(TARGET_POSITION, Unit::Position),
    Entry::write(HOME_OFFSET, Unit::Distance),
    Entry::write(i32_at(0x607D, 1, "software position limit, lowest"), Unit::Position),
    Entry::write(i32_at(0x607D, 2, "software position limit, highest"), Unit::Position),
    Entry::write(u32_at(0x607F, 0, "max profile velocity"), Unit::Velocity),
    Entry::write(u32_at(0x6080, 0, "max motor speed"), Unit::None),
    Entry::write(PROFILE_VELOCITY, Unit::Velocity),
    Entry::write(PROFILE_ACCELERATION, Unit::Acceleration),
    Entry::write(PROFILE_DECELERATION, Unit::Acceleration),
    Entry::write(QUICK_STOP_DECELERATION, Unit::Acceleration),
    Entry::write(i16_at(0x6086, 0, "motion profile type"), Unit::None),
    Entry::write(u32_at(0x6087, 0, "torque slope"), Unit::None),
    Entry::write(HOMING_METHOD, Unit::None),
    Entry::write(u32_at(0x6099, 1, "homing speed, to the switch"), Unit::Velocity),
    Entry::write(u32_at(0x6099, 2, "homing speed, to the zero"), Unit::Velocity),
    Entry::write(u32_at(0x609A, 0, "homing acceleration"), Unit::Acceleration),
    Entry::write(POSITION_OFFSET, Unit::Distance),
    Entry::write(VELOCITY_OFFSET, Unit::Velocity),
    Entry::write(TORQUE_OFFSET, Unit::Torque),
    Entry::write(INTERPOLATION_TIME_PERIOD, Unit::None),
    Entry::write(INTERPOLATION_TIME_INDEX, Unit::None),
    Entry::write(u32_at(0x60C5, 0, "max acceleration"), Unit::Acceleration),
    Entry::write(u32_at(0x60C6, 0, "max deceleration"), Unit::Acceleration),
    Entry::read(i32_at(0x60F4, 0, "following error actual value"), Unit::Distance),
    Entry::read(u32_at(0x60FD, 0, "digital inputs"), Unit::None),
    Entry::write(TARGET_VELOCITY, Unit::Velocity),
    Entry::read(SUPPORTED_DRIVE_MODES, Unit::None),
];

/// What a value means beside its number.
pub fn meaning(object: &Object, value: i64) -> Option<String> {
    match object.address.index {
        0x6040 => Some(state::controlword_words(value as u16)),
        0x6041 => Some(state::statusword_words(value as u16)),
        0x6060 | 0x6061 => {
            let mode = i8::try_from(value).ok().and_then(OperationMode::from_number)?;
            Some(mode_words(mode).to_owned())
        }
        0x6502 => Some(state::modes_words(value as u32)),
        0x603F => Some(state::error_words(value as u16).to_owned()),
        0x1003 if object.address.subindex > 0 => Some(state::error_words(value as u16).to_owned()),
        0x1001 => Some(crate::canopen::emcy::ErrorRegister(value as u8).to_string()),
        0x1016 if object.address.subindex == 1 => Some(match value & 0xFFFF {
            0 => "no master is watched".to_owned(),
            time_ms => format!("node {} is watched, {time_ms} ms", value >> 16 & 0x7F),
        }),
        0x1010 if value == state::SAVE_SIGNATURE => Some("\"save\"".to_owned()),
        _ => None,
    }
}

/// What TPDO1 holds, as it is mapped by default and by takt: the statusword first.
pub fn process_data_words(s: &Subject, frame: &Frame) -> Option<String> {
    let word = u16::from_le_bytes(frame.payload().get(..2)?.try_into().ok()?);
    (frame.id() == Id::canopen(0x180, s.node))
        .then(|| format!("TPDO1: statusword 0x{word:04X}: {}", state::statusword_words(word)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::erob::OBJECTS as SIMULATED;

    #[test]
    fn every_object_is_one_of_the_simulated_drive_with_the_same_length() {
        for entry in OBJECTS {
            let address = entry.object.address;
            let simulated = SIMULATED
                .iter()
                .find(|object| (object.index, object.subindex) == (address.index, address.subindex));
            let simulated = simulated.unwrap_or_else(|| panic!("{} is unknown", entry.object));
            assert_eq!(simulated.data_type.bytes(), entry.object.data_type.length(), "{}", entry.object);
        }
    }
}
