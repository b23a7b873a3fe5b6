//! The objects of a YZ-AIM that its tasks use (manual 1.62, chapter VI), and what values of its objects mean.

use takt_wire::canopen::object::{DataType, Object};

use super::words;

const fn u16_at(index: u16, subindex: u8, name: &'static str) -> Object {
    Object::new(index, subindex, DataType::U16, name)
}

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
/// 2612: °C.
pub const TEMPERATURE: Object = u16_at(0x2612, 0, "system temperature");
/// 2614: writing 1 starts storing, 2 reports its end.
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
pub const ACCELERATION: Object = Object::new(0x6083, 0, DataType::U32, "motor acceleration");
/// 6098
pub const HOMING_METHOD: Object = Object::new(0x6098, 0, DataType::U8, "homing method");
/// 60F9:1: thousandths.
pub const VELOCITY_PROPORTIONAL: Object = u16_at(0x60F9, 1, "velocity loop proportional gain");
/// 60F9:2: ms.
pub const VELOCITY_INTEGRATION: Object = u16_at(0x60F9, 2, "velocity loop integration time");
/// 60FB:1
pub const POSITION_PROPORTIONAL: Object = u16_at(0x60FB, 1, "position loop proportional gain");

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
