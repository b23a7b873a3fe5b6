//! The standard objects that a bring-up uses: communication profile (CiA 301) and drive profile (CiA 402).

use super::object::{DataType, Object, ObjectAddress};

/// 1000: device type, with the profile number in its low 16 bits.
pub const DEVICE_TYPE: Object = Object::new(0x1000, 0, DataType::U32, "device type");
/// 1005: the identifier of SYNC; bit 30 makes the device the SYNC producer.
pub const SYNC_COB_ID: Object = Object::new(0x1005, 0, DataType::U32, "COB-ID SYNC");
/// 1006: the period of SYNC in µs.
pub const COMMUNICATION_CYCLE_PERIOD: Object =
    Object::new(0x1006, 0, DataType::U32, "communication cycle period");
/// 100C: the time in ms from one request of node guarding to the next.
pub const GUARD_TIME: Object = Object::new(0x100C, 0, DataType::U16, "guard time");
/// 100D: the life time of node guarding in guard times.
pub const LIFE_TIME_FACTOR: Object = Object::new(0x100D, 0, DataType::U8, "life time factor");
/// 1016:1: node ID (bits 16 to 22) and timeout in ms (bits 0 to 15) of the heartbeat that the device consumes.
pub const CONSUMER_HEARTBEAT_TIME: Object = Object::new(0x1016, 1, DataType::U32, "consumer heartbeat time");
/// 1017: the period of the device's own heartbeat in ms.
pub const PRODUCER_HEARTBEAT_TIME: Object = Object::new(0x1017, 0, DataType::U16, "producer heartbeat time");
/// 1018:1
pub const VENDOR_ID: Object = Object::new(0x1018, 1, DataType::U32, "vendor ID");
/// 1018:2
pub const PRODUCT_CODE: Object = Object::new(0x1018, 2, DataType::U32, "product code");
/// 1018:3
pub const REVISION_NUMBER: Object = Object::new(0x1018, 3, DataType::U32, "revision number");
/// 1029:1: the NMT state after a communication error, see [`error_behaviour`].
pub const COMMUNICATION_ERROR_BEHAVIOUR: Object =
    Object::new(0x1029, 1, DataType::U8, "error behaviour on communication error");

/// 603F
pub const ERROR_CODE: Object = Object::new(0x603F, 0, DataType::U16, "error code");
/// 6040
pub const CONTROLWORD: Object = Object::new(0x6040, 0, DataType::U16, "controlword");
/// 6041
pub const STATUSWORD: Object = Object::new(0x6041, 0, DataType::U16, "statusword");
/// 605A: the reaction to a quick stop.
pub const QUICK_STOP_OPTION_CODE: Object = Object::new(0x605A, 0, DataType::I16, "quick stop option code");
/// 6060
pub const MODES_OF_OPERATION: Object = Object::new(0x6060, 0, DataType::I8, "modes of operation");
/// 6061
pub const MODES_OF_OPERATION_DISPLAY: Object =
    Object::new(0x6061, 0, DataType::I8, "modes of operation display");
/// 6064
pub const POSITION_ACTUAL_VALUE: Object = Object::new(0x6064, 0, DataType::I32, "position actual value");
/// 606C
pub const VELOCITY_ACTUAL_VALUE: Object = Object::new(0x606C, 0, DataType::I32, "velocity actual value");
/// 6071: per mille of the rated torque.
pub const TARGET_TORQUE: Object = Object::new(0x6071, 0, DataType::I16, "target torque");
/// 6072: per mille of the rated torque.
pub const MAX_TORQUE: Object = Object::new(0x6072, 0, DataType::U16, "max torque");
/// 6075: mA.
pub const MOTOR_RATED_CURRENT: Object = Object::new(0x6075, 0, DataType::U32, "motor rated current");
/// 6076: mN·m.
pub const MOTOR_RATED_TORQUE: Object = Object::new(0x6076, 0, DataType::U32, "motor rated torque");
/// 607A
pub const TARGET_POSITION: Object = Object::new(0x607A, 0, DataType::I32, "target position");
/// 6081
pub const PROFILE_VELOCITY: Object = Object::new(0x6081, 0, DataType::U32, "profile velocity");
/// 6083
pub const PROFILE_ACCELERATION: Object = Object::new(0x6083, 0, DataType::U32, "profile acceleration");
/// 6084
pub const PROFILE_DECELERATION: Object = Object::new(0x6084, 0, DataType::U32, "profile deceleration");
/// 607D:1
pub const SOFTWARE_LIMIT_LOWEST: Object =
    Object::new(0x607D, 1, DataType::I32, "software position limit, lowest");
/// 607D:2
pub const SOFTWARE_LIMIT_HIGHEST: Object =
    Object::new(0x607D, 2, DataType::I32, "software position limit, highest");
/// 6080
pub const MAX_MOTOR_SPEED: Object = Object::new(0x6080, 0, DataType::U32, "max motor speed");
/// 607F
pub const MAX_PROFILE_VELOCITY: Object = Object::new(0x607F, 0, DataType::U32, "max profile velocity");
/// 6086
pub const MOTION_PROFILE_TYPE: Object = Object::new(0x6086, 0, DataType::I16, "motion profile type");
/// 60C5
pub const MAX_ACCELERATION: Object = Object::new(0x60C5, 0, DataType::U32, "max acceleration");
/// 60C6
pub const MAX_DECELERATION: Object = Object::new(0x60C6, 0, DataType::U32, "max deceleration");
/// 6085
pub const QUICK_STOP_DECELERATION: Object = Object::new(0x6085, 0, DataType::U32, "quick stop deceleration");
/// 60A4:1 to 60A4:4
pub const PROFILE_JERK: [Object; 4] = [profile_jerk(1), profile_jerk(2), profile_jerk(3), profile_jerk(4)];
/// 60B0
pub const POSITION_OFFSET: Object = Object::new(0x60B0, 0, DataType::I32, "position offset");
/// 60B1
pub const VELOCITY_OFFSET: Object = Object::new(0x60B1, 0, DataType::I32, "velocity offset");
/// 60B2
pub const TORQUE_OFFSET: Object = Object::new(0x60B2, 0, DataType::I16, "torque offset");
/// 60C2:1: mantissa of the set-point period.
pub const INTERPOLATION_TIME_PERIOD: Object =
    Object::new(0x60C2, 1, DataType::U8, "interpolation time period value");
/// 60C2:2: decimal exponent of the set-point period in s.
pub const INTERPOLATION_TIME_INDEX: Object = Object::new(0x60C2, 2, DataType::I8, "interpolation time index");
/// 60FF
pub const TARGET_VELOCITY: Object = Object::new(0x60FF, 0, DataType::I32, "target velocity");
/// 6502: a bit for each mode.
pub const SUPPORTED_DRIVE_MODES: Object = Object::new(0x6502, 0, DataType::U32, "supported drive modes");

const fn profile_jerk(subindex: u8) -> Object {
    Object::new(0x60A4, subindex, DataType::U32, "profile jerk")
}

/// Values of [`COMMUNICATION_ERROR_BEHAVIOUR`].
pub mod error_behaviour {
    /// Enter pre-operational, from operational.
    pub const PRE_OPERATIONAL: u8 = 0;
    /// No change.
    pub const NO_CHANGE: u8 = 1;
    /// Enter stopped.
    pub const STOPPED: u8 = 2;
}

/// 1008: a text.
pub const DEVICE_NAME: ObjectAddress = ObjectAddress::new(0x1008, 0);
/// 1009: a text.
pub const HARDWARE_VERSION: ObjectAddress = ObjectAddress::new(0x1009, 0);
/// 100A: a text.
pub const SOFTWARE_VERSION: ObjectAddress = ObjectAddress::new(0x100A, 0);

/// Bit of a PDO's COB-ID that makes the PDO invalid (CiA 301, 7.5.2.35).
pub const PDO_INVALID: u32 = 1 << 31;
/// The valid bit and the 11-bit identifier of a PDO's COB-ID. Bit 30 (no RTR) is excluded, because some devices force
/// it.
pub const PDO_IDENTITY: u32 = PDO_INVALID | 0x7FF;

/// The direction of a PDO, seen from the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PdoDirection {
    /// RPDO: the device receives it.
    Receive,
    /// TPDO: the device transmits it.
    Transmit,
}

impl PdoDirection {
    /// The name of a PDO of this direction.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Receive => "RPDO",
            Self::Transmit => "TPDO",
        }
    }
}

/// The parameters of one PDO of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoParameters {
    communication: u16,
    mapping: u16,
}

impl PdoParameters {
    /// The parameters of PDO `number`, counted from 1. Number 0 counts as 1.
    pub const fn of(direction: PdoDirection, number: u8) -> Self {
        Self::at(direction, number as u16)
    }

    /// As [`PdoParameters::of`], for up to 512 PDOs; higher numbers count as 512.
    pub const fn at(direction: PdoDirection, number: u16) -> Self {
        let offset = if number > 512 { 511 } else { number.saturating_sub(1) };
        match direction {
            PdoDirection::Receive => Self { communication: 0x1400 + offset, mapping: 0x1600 + offset },
            PdoDirection::Transmit => Self { communication: 0x1800 + offset, mapping: 0x1A00 + offset },
        }
    }

    /// Sub-index 1: COB-ID with the valid bit.
    pub const fn cob_id(self) -> Object {
        Object::new(self.communication, 1, DataType::U32, "PDO COB-ID")
    }

    /// Sub-index 2.
    pub const fn transmission_type(self) -> Object {
        Object::new(self.communication, 2, DataType::U8, "PDO transmission type")
    }

    /// Sub-index 3, in 100 µs.
    pub const fn inhibit_time(self) -> Object {
        Object::new(self.communication, 3, DataType::U16, "PDO inhibit time")
    }

    /// Sub-index 5, in ms.
    pub const fn event_timer(self) -> Object {
        Object::new(self.communication, 5, DataType::U16, "PDO event timer")
    }

    /// Sub-index 0 of the mapping: the number of mapped objects.
    pub const fn mapped_count(self) -> Object {
        Object::new(self.mapping, 0, DataType::U8, "number of mapped objects")
    }

    /// Sub-index `position` of the mapping, counted from 1.
    pub const fn mapped_object(self, position: u8) -> Object {
        Object::new(self.mapping, position, DataType::U32, "mapped object")
    }
}
