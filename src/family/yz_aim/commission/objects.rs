//! Object dictionary of a YZ-AIM (manual 1.62, chapter VI).

use takt_wire::canopen::object::{DataType, Object};
use takt_wire::canopen::objects::*;

use crate::family::commission::dictionary::{ObjectEntry, ObjectUnit};

use super::words;

const fn u16_at(index: u16, subindex: u8, name: &'static str) -> Object {
    Object::new(index, subindex, DataType::U16, name)
}
const fn u32_at(index: u16, subindex: u8, name: &'static str) -> Object {
    Object::new(index, subindex, DataType::U32, name)
}

/// 1018:4: documented as 1 for every unit.
pub const SERIAL_NUMBER: Object = u32_at(0x1018, 4, "serial number");
/// 2600: 506 is a key that changes the bit rate.
pub const MODBUS_ENABLE: Object = u16_at(0x2600, 0, "Modbus enable");
/// 2601: writing 1 clears the alarms 12h and 14h.
pub const OUTPUT_ENABLE: Object = u16_at(0x2601, 0, "drive output enable");
/// 2604: internal; 129 is a key that changes the bit rate.
pub const FLUX_WEAKENING_ANGLE: Object = u16_at(0x2604, 0, "flux-weakening angle");
/// 260A: the values 60006 and then 60016 set the multi-turn zero.
pub const GEAR_NUMERATOR: Object = u16_at(0x260A, 0, "electronic gear numerator");
/// 260B
pub const GEAR_DENOMINATOR: Object = u16_at(0x260B, 0, "electronic gear denominator");
/// 260E
pub const ALARM: Object = u16_at(0x260E, 0, "alarm code");
/// 2614: writing 1 starts storing, 2 reports its end.
pub const TEMPERATURE: Object = u16_at(0x2612, 0, "system temperature");
/// 2615: takes effect after storing and a power cycle.
pub const SAVE_FLAG: Object = u16_at(0x2614, 0, "parameter save flag");
/// 2615: in force after storing and a power cycle.
pub const NODE_ADDRESS: Object = u16_at(0x2615, 0, "device address");
/// 2619
pub const SPECIAL_FUNCTION: Object = u16_at(0x2619, 0, "special function");
/// 261E: tens of per cent.
pub const BATTERY: Object = u16_at(0x261E, 0, "multi-turn battery level");
/// 606C by SDO: 0.1 r/min. The drive decides its length.
pub const VELOCITY: Object = Object::new(0x606C, 0, DataType::I16, "actual velocity");
/// 6078: 1/2000 A.
pub const CURRENT: Object = Object::new(0x6078, 0, DataType::I16, "actual current");
/// 6079: 1/327 V.
pub const VOLTAGE: Object = u16_at(0x6079, 0, "system voltage");
/// 6083: at 60000 and above the drive uses no ramp.
pub const ACCELERATION: Object = u32_at(0x6083, 0, "motor acceleration");
/// 6098
pub const HOMING_METHOD: Object = Object::new(0x6098, 0, DataType::U8, "homing method");
/// 60F9:1: thousandths.
pub const VELOCITY_PROPORTIONAL: Object = u16_at(0x60F9, 1, "velocity loop proportional gain");
/// 60F9:2: ms.
pub const VELOCITY_INTEGRATION: Object = u16_at(0x60F9, 2, "velocity loop integration time");
/// 60FB:1
pub const POSITION_PROPORTIONAL: Object = u16_at(0x60FB, 1, "position loop proportional gain");

/// The objects of the drive, without the PDO parameters.
pub const OBJECTS: &[ObjectEntry] = &[
    ObjectEntry::read(DEVICE_TYPE, ObjectUnit::None),
    ObjectEntry::read(SYNC_COB_ID, ObjectUnit::None),
    ObjectEntry::write(CONSUMER_HEARTBEAT_TIME, ObjectUnit::None),
    ObjectEntry::write(PRODUCER_HEARTBEAT_TIME, ObjectUnit::Of(1.0, "ms")),
    ObjectEntry::read(VENDOR_ID, ObjectUnit::None),
    ObjectEntry::read(PRODUCT_CODE, ObjectUnit::None),
    ObjectEntry::read(REVISION_NUMBER, ObjectUnit::None),
    ObjectEntry::read(SERIAL_NUMBER, ObjectUnit::None),
    ObjectEntry::write(MODBUS_ENABLE, ObjectUnit::None),
    ObjectEntry::write(OUTPUT_ENABLE, ObjectUnit::None),
    ObjectEntry::write(FLUX_WEAKENING_ANGLE, ObjectUnit::None),
    ObjectEntry::write(u16_at(0x2609, 0, "DIR polarity"), ObjectUnit::None),
    ObjectEntry::write(GEAR_NUMERATOR, ObjectUnit::None),
    ObjectEntry::write(GEAR_DENOMINATOR, ObjectUnit::None),
    ObjectEntry::write(Object::new(0x260C, 0, DataType::I32, "incremental position"), ObjectUnit::None),
    ObjectEntry::read(ALARM, ObjectUnit::None),
    ObjectEntry::read(TEMPERATURE, ObjectUnit::Of(1.0, "°C")),
    ObjectEntry::read(
        Object::new(0x2613, 0, DataType::I16, "system output PWM"),
        ObjectUnit::Of(100.0 / 32_768.0, "%"),
    ),
    ObjectEntry::write(SAVE_FLAG, ObjectUnit::None),
    ObjectEntry::write(NODE_ADDRESS, ObjectUnit::None),
    ObjectEntry::write(u16_at(0x2618, 0, "maximum output at standstill"), ObjectUnit::Of(0.1, "%")),
    ObjectEntry::write(SPECIAL_FUNCTION, ObjectUnit::None),
    ObjectEntry::write(u16_at(0x261C, 0, "CAN sync control word"), ObjectUnit::None),
    ObjectEntry::write(u16_at(0x261D, 0, "maximum allowed current"), ObjectUnit::Of(0.001, "A")),
    ObjectEntry::read(BATTERY, ObjectUnit::Of(10.0, "%")),
    ObjectEntry::write(CONTROLWORD, ObjectUnit::None),
    ObjectEntry::read(STATUSWORD, ObjectUnit::None),
    ObjectEntry::write(MODES_OF_OPERATION, ObjectUnit::None),
    ObjectEntry::read(
        Object::new(0x6063, 0, DataType::I32, "position actual internal value"),
        ObjectUnit::Position,
    ),
    ObjectEntry::read(POSITION_ACTUAL_VALUE, ObjectUnit::Position),
    ObjectEntry::read(VELOCITY, ObjectUnit::VelocityTenth),
    ObjectEntry::read(CURRENT, ObjectUnit::Of(1.0 / 2000.0, "A")),
    ObjectEntry::read(VOLTAGE, ObjectUnit::Of(1.0 / 327.0, "V")),
    ObjectEntry::write(TARGET_POSITION, ObjectUnit::Position),
    ObjectEntry::write(PROFILE_VELOCITY, ObjectUnit::Velocity),
    ObjectEntry::write(ACCELERATION, ObjectUnit::Acceleration),
    ObjectEntry::write(HOMING_METHOD, ObjectUnit::None),
    ObjectEntry::write(VELOCITY_PROPORTIONAL, ObjectUnit::Of(0.001, "")),
    ObjectEntry::write(VELOCITY_INTEGRATION, ObjectUnit::Of(1.0, "ms")),
    ObjectEntry::write(POSITION_PROPORTIONAL, ObjectUnit::None),
    ObjectEntry::write(
        u16_at(0x60FB, 2, "velocity feed-forward"),
        ObjectUnit::Of(1.0 / 327.0, "V/(1000 r/min)"),
    ),
    ObjectEntry::read(u16_at(0x60FD, 0, "digital input state"), ObjectUnit::None),
    ObjectEntry::write(TARGET_VELOCITY, ObjectUnit::Velocity),
];

/// The meaning of an object's value in words.
pub fn meaning(object: &Object, value: i64) -> Option<String> {
    match object.address.index {
        0x6040 => Some(words::controlword(value as u16)),
        0x6041 => Some(words::statusword(value as u16)),
        0x6060 => words::mode(value).map(str::to_owned),
        0x260E => Some(crate::family::yz_aim::Alarm::of(value as u16).to_string()),
        0x2614 => words::save_flag(value).map(str::to_owned),
        0x2619 => Some(words::special_function(value)),
        0x260A => words::gear_key(value).map(str::to_owned),
        0x1016 if object.address.subindex == 1 => Some(words::consumer_heartbeat(value as u32)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The object list made from the tables of the specification.
    const LIST: &str = include_str!("../../../../tests/vectors/yz-aim-objects.csv");

    #[test]
    fn every_object_is_in_the_manual_with_the_same_length_and_access() {
        for entry in OBJECTS {
            let address = entry.object.address;
            let key = format!("{:04X},{:02X},", address.index, address.subindex);
            let row = LIST.lines().find(|row| row.starts_with(&key));
            let row = row.unwrap_or_else(|| panic!("{} is not in the list", entry.object));
            let fields: Vec<&str> = row.split(',').collect();
            assert_eq!(fields[2], (8 * entry.object.data_type.length()).to_string(), "{}", entry.object);
            let is_written = entry.permission == crate::family::commission::dictionary::Permission::Write;
            assert_eq!(fields[3] == "rw", is_written, "{}", entry.object);
        }
    }
}
