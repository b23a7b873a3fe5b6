//! The objects of CiA 301 and CiA 402 that commissioning knows by name, with their units.

use takt_rt::OperationMode;
use takt_wire::canopen::emcy::ErrorRegister;
use takt_wire::canopen::object::{DataType, Object};
use takt_wire::canopen::objects::*;

use super::words::{controlword_words, modes_words, statusword_words};
use crate::config::DriveFamily;
use crate::family::commission::dictionary::{ObjectEntry, ObjectUnit};
use crate::family::drive_error_words;

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
/// 1011:1
pub const RESTORE: Object = Object::new(0x1011, 1, DataType::U32, "restore default parameters");
/// The signature for 1010:1: "save" in little-endian order.
pub const SAVE_SIGNATURE: i64 = 0x6576_6173;
/// The signature for 1011:1: "load" in little-endian order.
pub const LOAD_SIGNATURE: i64 = 0x6461_6F6C;
/// 6007: what the drive does when the controller is gone.
pub const ABORT_CONNECTION_OPTION: Object =
    Object::new(0x6007, 0, DataType::I16, "abort connection option code");
/// 6067: where the target counts as reached, in counts.
pub const POSITION_WINDOW: Object = Object::new(0x6067, 0, DataType::U32, "position window");
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
/// 6099:1
pub const HOMING_SPEED_SWITCH: Object = Object::new(0x6099, 1, DataType::U32, "homing speed, to the switch");
/// 6099:2
pub const HOMING_SPEED_ZERO: Object = Object::new(0x6099, 2, DataType::U32, "homing speed, to the zero");

const fn object(index: u16, subindex: u8, data_type: DataType, name: &'static str) -> Object {
    Object::new(index, subindex, data_type, name)
}

/// The objects that CiA 301 and CiA 402 define, without the PDO parameters.
pub const STANDARD: &[ObjectEntry] = &[
    ObjectEntry::read(DEVICE_TYPE, ObjectUnit::None),
    ObjectEntry::read(ERROR_REGISTER, ObjectUnit::None),
    ObjectEntry::write(ERROR_HISTORY_COUNT, ObjectUnit::None),
    ObjectEntry::read(error_history(1), ObjectUnit::None),
    ObjectEntry::read(error_history(2), ObjectUnit::None),
    ObjectEntry::read(error_history(3), ObjectUnit::None),
    ObjectEntry::read(error_history(4), ObjectUnit::None),
    ObjectEntry::write(SYNC_COB_ID, ObjectUnit::None),
    ObjectEntry::write(COMMUNICATION_CYCLE_PERIOD, ObjectUnit::Of(1.0, "µs")),
    ObjectEntry::write(object(0x100C, 0, DataType::U16, "guard time"), ObjectUnit::Of(1.0, "ms")),
    ObjectEntry::write(object(0x100D, 0, DataType::U8, "life time factor"), ObjectUnit::None),
    ObjectEntry::write(STORE, ObjectUnit::None),
    ObjectEntry::write(RESTORE, ObjectUnit::None),
    ObjectEntry::write(object(0x1014, 0, DataType::U32, "COB-ID EMCY"), ObjectUnit::None),
    ObjectEntry::write(CONSUMER_HEARTBEAT_TIME, ObjectUnit::None),
    ObjectEntry::write(PRODUCER_HEARTBEAT_TIME, ObjectUnit::Of(1.0, "ms")),
    ObjectEntry::read(VENDOR_ID, ObjectUnit::None),
    ObjectEntry::read(PRODUCT_CODE, ObjectUnit::None),
    ObjectEntry::read(REVISION_NUMBER, ObjectUnit::None),
    ObjectEntry::read(object(0x1018, 4, DataType::U32, "serial number"), ObjectUnit::None),
    ObjectEntry::write(COMMUNICATION_ERROR_BEHAVIOUR, ObjectUnit::None),
    ObjectEntry::write(ABORT_CONNECTION_OPTION, ObjectUnit::None),
    ObjectEntry::read(ERROR_CODE, ObjectUnit::None),
    ObjectEntry::write(CONTROLWORD, ObjectUnit::None),
    ObjectEntry::read(STATUSWORD, ObjectUnit::None),
    ObjectEntry::write(QUICK_STOP_OPTION_CODE, ObjectUnit::None),
    ObjectEntry::write(object(0x605B, 0, DataType::I16, "shutdown option code"), ObjectUnit::None),
    ObjectEntry::write(object(0x605C, 0, DataType::I16, "disable operation option code"), ObjectUnit::None),
    ObjectEntry::write(object(0x605D, 0, DataType::I16, "halt option code"), ObjectUnit::None),
    ObjectEntry::write(object(0x605E, 0, DataType::I16, "fault reaction option code"), ObjectUnit::None),
    ObjectEntry::write(MODES_OF_OPERATION, ObjectUnit::None),
    ObjectEntry::read(MODES_OF_OPERATION_DISPLAY, ObjectUnit::None),
    ObjectEntry::read(object(0x6062, 0, DataType::I32, "position demand value"), ObjectUnit::Position),
    ObjectEntry::read(POSITION_ACTUAL_VALUE, ObjectUnit::Position),
    ObjectEntry::write(object(0x6065, 0, DataType::U32, "following error window"), ObjectUnit::Distance),
    ObjectEntry::write(object(0x6066, 0, DataType::U16, "following error time"), ObjectUnit::Of(1.0, "ms")),
    ObjectEntry::write(POSITION_WINDOW, ObjectUnit::Distance),
    ObjectEntry::write(object(0x6068, 0, DataType::U16, "position window time"), ObjectUnit::Of(1.0, "ms")),
    ObjectEntry::read(object(0x606B, 0, DataType::I32, "velocity demand value"), ObjectUnit::Velocity),
    ObjectEntry::read(VELOCITY_ACTUAL_VALUE, ObjectUnit::Velocity),
    ObjectEntry::write(object(0x606D, 0, DataType::U16, "velocity window"), ObjectUnit::Velocity),
    ObjectEntry::write(object(0x606E, 0, DataType::U16, "velocity window time"), ObjectUnit::Of(1.0, "ms")),
    ObjectEntry::write(object(0x606F, 0, DataType::U16, "velocity threshold"), ObjectUnit::Velocity),
    ObjectEntry::write(TARGET_TORQUE, ObjectUnit::Torque),
    ObjectEntry::write(MAX_TORQUE, ObjectUnit::Torque),
    ObjectEntry::write(object(0x6073, 0, DataType::U16, "max current"), ObjectUnit::None),
    ObjectEntry::read(object(0x6074, 0, DataType::I16, "torque demand value"), ObjectUnit::Torque),
    ObjectEntry::write(MOTOR_RATED_CURRENT, ObjectUnit::Of(0.001, "A")),
    ObjectEntry::write(MOTOR_RATED_TORQUE, ObjectUnit::Of(0.001, "Nm")),
    ObjectEntry::read(TORQUE_ACTUAL_VALUE, ObjectUnit::Torque),
    ObjectEntry::read(CURRENT_ACTUAL_VALUE, ObjectUnit::None),
    ObjectEntry::read(DC_LINK_VOLTAGE, ObjectUnit::Of(0.001, "V")),
    ObjectEntry::write(TARGET_POSITION, ObjectUnit::Position),
    ObjectEntry::write(HOME_OFFSET, ObjectUnit::Distance),
    ObjectEntry::write(
        object(0x607D, 1, DataType::I32, "software position limit, lowest"),
        ObjectUnit::Position,
    ),
    ObjectEntry::write(
        object(0x607D, 2, DataType::I32, "software position limit, highest"),
        ObjectUnit::Position,
    ),
    ObjectEntry::write(object(0x607E, 0, DataType::U8, "polarity"), ObjectUnit::None),
    ObjectEntry::write(MAX_PROFILE_VELOCITY, ObjectUnit::ProfileVelocity),
    ObjectEntry::write(object(0x6080, 0, DataType::U32, "max motor speed"), ObjectUnit::Of(1.0, "r/min")),
    ObjectEntry::write(PROFILE_VELOCITY, ObjectUnit::ProfileVelocity),
    ObjectEntry::write(PROFILE_ACCELERATION, ObjectUnit::Acceleration),
    ObjectEntry::write(PROFILE_DECELERATION, ObjectUnit::Acceleration),
    ObjectEntry::write(QUICK_STOP_DECELERATION, ObjectUnit::Acceleration),
    ObjectEntry::write(MOTION_PROFILE_TYPE, ObjectUnit::None),
    ObjectEntry::write(object(0x6087, 0, DataType::U32, "torque slope"), ObjectUnit::None),
    ObjectEntry::write(object(0x608F, 1, DataType::U32, "encoder increments"), ObjectUnit::None),
    ObjectEntry::write(object(0x608F, 2, DataType::U32, "motor revolutions"), ObjectUnit::None),
    ObjectEntry::write(object(0x6091, 1, DataType::U32, "gear, motor revolutions"), ObjectUnit::None),
    ObjectEntry::write(object(0x6091, 2, DataType::U32, "gear, shaft revolutions"), ObjectUnit::None),
    ObjectEntry::write(object(0x6092, 1, DataType::U32, "feed"), ObjectUnit::None),
    ObjectEntry::write(object(0x6092, 2, DataType::U32, "feed, shaft revolutions"), ObjectUnit::None),
    ObjectEntry::write(HOMING_METHOD, ObjectUnit::None),
    ObjectEntry::write(HOMING_SPEED_SWITCH, ObjectUnit::ProfileVelocity),
    ObjectEntry::write(HOMING_SPEED_ZERO, ObjectUnit::ProfileVelocity),
    ObjectEntry::write(object(0x609A, 0, DataType::U32, "homing acceleration"), ObjectUnit::Acceleration),
    ObjectEntry::write(object(0x60A8, 0, DataType::U32, "unit of positions"), ObjectUnit::None),
    ObjectEntry::write(object(0x60A9, 0, DataType::U32, "unit of velocities"), ObjectUnit::None),
    ObjectEntry::write(POSITION_OFFSET, ObjectUnit::Distance),
    ObjectEntry::write(VELOCITY_OFFSET, ObjectUnit::Velocity),
    ObjectEntry::write(TORQUE_OFFSET, ObjectUnit::Torque),
    ObjectEntry::write(INTERPOLATION_TIME_PERIOD, ObjectUnit::None),
    ObjectEntry::write(INTERPOLATION_TIME_INDEX, ObjectUnit::None),
    ObjectEntry::write(MAX_ACCELERATION, ObjectUnit::Acceleration),
    ObjectEntry::write(MAX_DECELERATION, ObjectUnit::Acceleration),
    ObjectEntry::read(object(0x60F4, 0, DataType::I32, "following error actual value"), ObjectUnit::Distance),
    ObjectEntry::read(object(0x60FD, 0, DataType::U32, "digital inputs"), ObjectUnit::None),
    ObjectEntry::write(object(0x60FE, 1, DataType::U32, "digital outputs"), ObjectUnit::None),
    ObjectEntry::write(TARGET_VELOCITY, ObjectUnit::Velocity),
    ObjectEntry::read(SUPPORTED_DRIVE_MODES, ObjectUnit::None),
];

/// The meaning of an object's value in words.
pub fn meaning(drive: &DriveFamily, object: &Object, value: i64) -> Option<String> {
    match object.address.index {
        0x6040 => Some(controlword_words(value as u16)),
        0x6041 => Some(statusword_words(value as u16)),
        0x6060 | 0x6061 => {
            let mode = i8::try_from(value).ok().and_then(OperationMode::from_number)?;
            Some(mode.name().to_owned())
        }
        0x6502 => Some(modes_words(value as u32)),
        0x603F => Some(drive_error_words(drive, value as u16).to_string()),
        0x1003 if object.address.subindex > 0 => Some(drive_error_words(drive, value as u16).to_string()),
        0x1001 => Some(ErrorRegister(value as u8).to_string()),
        0x1016 if object.address.subindex == 1 => Some(match value & 0xFFFF {
            0 => "heartbeat watchdog off".to_owned(),
            time_ms => format!("monitors the heartbeat of node {}, timeout {time_ms} ms", value >> 16 & 0x7F),
        }),
        0x1010 if value == SAVE_SIGNATURE => Some("\"save\"".to_owned()),
        0x1011 if value == LOAD_SIGNATURE => Some("\"load\"".to_owned()),
        _ => None,
    }
}
