//! The objects of a YZ-AIM (manual 1.62, chapter VI; addresses, types and scales of its object tables).

use crate::canopen::object::{DataType, Object};
use crate::canopen::objects::*;
use crate::commission::dictionary::{Entry, Unit};

use super::{alarm, words};

const fn u16_at(index: u16, subindex: u8, name: &'static str) -> Object {
    Object::new(index, subindex, DataType::U16, name)
}
const fn u32_at(index: u16, subindex: u8, name: &'static str) -> Object {
    Object::new(index, subindex, DataType::U32, name)
}

/// 1018:4: every unit is documented as 1.
pub const SERIAL_NUMBER: Object = u32_at(0x1018, 4, "serial number");
/// 2600: takes 506 as a key in the change of the bit rate.
pub const MODBUS_ENABLE: Object = u16_at(0x2600, 0, "Modbus enable");
/// 2601: writing 1 clears the alarms 12h and 14h.
pub const OUTPUT_ENABLE: Object = u16_at(0x2601, 0, "drive output enable");
/// 2604: internal; takes 129 as a key in the change of the bit rate.
pub const FLUX_WEAKENING_ANGLE: Object = u16_at(0x2604, 0, "flux-weakening angle");
/// 260A: 60006 and then 60016 set the multi-turn zero.
pub const GEAR_NUMERATOR: Object = u16_at(0x260A, 0, "electronic gear numerator");
/// 260B
pub const GEAR_DENOMINATOR: Object = u16_at(0x260B, 0, "electronic gear denominator");
/// 260E
pub const ALARM: Object = u16_at(0x260E, 0, "alarm code");
/// 2612: °C.
pub const TEMPERATURE: Object = u16_at(0x2612, 0, "system temperature");
/// 2614: 1 starts storing, 2 tells that it is done.
pub const SAVE_FLAG: Object = u16_at(0x2614, 0, "parameter save flag");
/// 2615: in force after storing and a power cycle.
pub const NODE_ADDRESS: Object = u16_at(0x2615, 0, "device address");
/// 2619
pub const SPECIAL_FUNCTION: Object = u16_at(0x2619, 0, "special function");
/// 261E: tens of per cent.
pub const BATTERY: Object = u16_at(0x261E, 0, "multi-turn battery level");
/// 606C by SDO: 0.1 r/min. Its length is what the drive says.
pub const VELOCITY: Object = Object::new(0x606C, 0, DataType::I16, "actual velocity");
/// 6078: 1/2000 A.
pub const CURRENT: Object = Object::new(0x6078, 0, DataType::I16, "actual current");
/// 6079: 1/327 V.
pub const VOLTAGE: Object = u16_at(0x6079, 0, "system voltage");
/// 6083: 60000 and above: no ramp of the drive's own.
pub const ACCELERATION: Object = u32_at(0x6083, 0, "motor acceleration");
/// 6098
pub const HOMING_METHOD: Object = Object::new(0x6098, 0, DataType::U8, "homing method");
/// 60F9:1: thousandths.
pub const VELOCITY_PROPORTIONAL: Object = u16_at(0x60F9, 1, "velocity loop proportional gain");
/// 60F9:2: ms.
pub const VELOCITY_INTEGRATION: Object = u16_at(0x60F9, 2, "velocity loop integration time");
/// 60FB:1
pub const POSITION_PROPORTIONAL: Object = u16_at(0x60FB, 1, "position loop proportional gain");

/// What the drive has, PDO parameters apart.
pub const OBJECTS: &[Entry] = &[
    Entry::read(DEVICE_TYPE, Unit::None),
    Entry::read(SYNC_COB_ID, Unit::None),
    Entry::write(CONSUMER_HEARTBEAT_TIME, Unit::None),
    Entry::write(PRODUCER_HEARTBEAT_TIME, Unit::Of(1.0, "ms")),
    Entry::read(VENDOR_ID, Unit::None),
    Entry::read(PRODUCT_CODE, Unit::None),
    Entry::read(REVISION_NUMBER, Unit::None),
    Entry::read(SERIAL_NUMBER, Unit::None),
    Entry::write(MODBUS_ENABLE, Unit::None),
    Entry::write(OUTPUT_ENABLE, Unit::None),
    Entry::write(FLUX_WEAKENING_ANGLE, Unit::None),
    Entry::write(u16_at(0x2609, 0, "DIR polarity"), Unit::None),
    Entry::write(GEAR_NUMERATOR, Unit::None),
    Entry::write(GEAR_DENOMINATOR, Unit::None),
    Entry::write(Object::new(0x260C, 0, DataType::I32, "incremental position"), Unit::None),
    Entry::read(ALARM, Unit::None),
    Entry::read(TEMPERATURE, Unit::Of(1.0, "°C")),
    Entry::read(Object::new(0x2613, 0, DataType::I16, "system output PWM"), Unit::Of(100.0 / 32_768.0, "%")),
    Entry::write(SAVE_FLAG, Unit::None),
    Entry::write(NODE_ADDRESS, Unit::None),
    Entry::write(u16_at(0x2618, 0, "maximum output at standstill"), Unit::Of(0.1, "%")),
    Entry::write(SPECIAL_FUNCTION, Unit::None),
    Entry::write(u16_at(0x261C, 0, "CAN sync control word"), Unit::None),
    Entry::write(u16_at(0x261D, 0, "maximum allowed current"), Unit::Of(0.001, "A")),
    Entry::read(BATTERY, Unit::Of(10.0, "%")),
    Entry::write(CONTROLWORD, Unit::None),
    Entry::read(STATUSWORD, Unit::None),
    Entry::write(MODES_OF_OPERATION, Unit::None),
    Entry::read(Object::new(0x6063, 0, DataType::I32, "position actual internal value"), Unit::Position),
    Entry::read(POSITION_ACTUAL_VALUE, Unit::Position),
    Entry::read(VELOCITY, Unit::VelocityTenth),
    Entry::read(CURRENT, Unit::Of(1.0 / 2000.0, "A")),
    Entry::read(VOLTAGE, Unit::Of(1.0 / 327.0, "V")),
    Entry::write(TARGET_POSITION, Unit::Position),
    Entry::write(PROFILE_VELOCITY, Unit::Velocity),
    Entry::write(ACCELERATION, Unit::Acceleration),
    Entry::write(HOMING_METHOD, Unit::None),
    Entry::write(VELOCITY_PROPORTIONAL, Unit::Of(0.001, "")),
    Entry::write(VELOCITY_INTEGRATION, Unit::Of(1.0, "ms")),
    Entry::write(POSITION_PROPORTIONAL, Unit::None),
    Entry::write(u16_at(0x60FB, 2, "velocity feed-forward"), Unit::Of(1.0 / 327.0, "V/(1000 r/min)")),
    Entry::read(u16_at(0x60FD, 0, "digital input state"), Unit::None),
    Entry::write(TARGET_VELOCITY, Unit::Velocity),
];

/// What a value means beside its number.
pub fn meaning(object: &Object, value: i64) -> Option<String> {
    match object.address.index {
        0x6040 => Some(words::controlword(value as u16)),
        0x6041 => Some(words::statusword(value as u16)),
        0x6060 => words::mode(value).map(str::to_owned),
        0x260E => Some(alarm::Alarm::of(value as u16).to_string()),
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

    /// The object list that the specification's tables were made into.
    const LIST: &str = include_str!("../../../tests/vectors/yz-aim-objects.csv");

    #[test]
    fn every_object_is_one_of_the_manual_with_its_length_and_access() {
        for entry in OBJECTS {
            let address = entry.object.address;
            let key = format!("{:04X},{:02X},", address.index, address.subindex);
            let row = LIST.lines().find(|row| row.starts_with(&key));
            let row = row.unwrap_or_else(|| panic!("{} is not in the list", entry.object));
            let fields: Vec<&str> = row.split(',').collect();
            assert_eq!(fields[2], (8 * entry.object.data_type.length()).to_string(), "{}", entry.object);
            let is_written = entry.permission == crate::commission::dictionary::Permission::Write;
            assert_eq!(fields[3] == "rw", is_written, "{}", entry.object);
        }
    }
}
