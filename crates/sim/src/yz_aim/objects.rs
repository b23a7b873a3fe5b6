//! The object dictionary by the manual's chapter VI, with the entries that CiA 301 implies. Other objects do not exist
//! here. The manual gives few defaults outside the communication parameters; the others are from a new unit.

use takt_wire::canopen::eds::{AccessType, DataTypeCode};

use crate::object_dictionary::table::{I8, I16, I32, ObjectRow, U8, U16, U32, table_places};

const FULL_8: [i64; 2] = [0, 0xFF];
const FULL_16: [i64; 2] = [0, 0xFFFF];
const SIGNED_32: [i64; 2] = [i32::MIN as i64, i32::MAX as i64];

/// The type of a length in bits; a range below 0 makes it signed.
const fn integer(bits: u8, lowest: i64) -> DataTypeCode {
    match (bits, lowest < 0) {
        (8, false) => U8,
        (16, false) => U16,
        (32, false) => U32,
        (8, true) => I8,
        (16, true) => I16,
        (32, true) => I32,
        _ => panic!("not a length of the manual"),
    }
}

/// Read-only and unsigned.
const fn ro(index: u16, subindex: u8, bits: u8, default: i64) -> ObjectRow {
    ObjectRow::read_only(index, subindex, integer(bits, 0), default)
}

/// A measured value: read-only, within a range.
const fn measured(index: u16, bits: u8, range: [i64; 2]) -> ObjectRow {
    ObjectRow::read_only(index, 0, integer(bits, range[0]), 0).within(range)
}

/// A command, set-point or switch: readable and writable, never stored.
const fn command(index: u16, subindex: u8, bits: u8, range: [i64; 2], default: i64) -> ObjectRow {
    let data_type = integer(bits, range[0]);
    ObjectRow::read_only(index, subindex, data_type, default).within(range).with_access(AccessType::ReadWrite)
}

/// A parameter: readable, writable, stored.
const fn rw(index: u16, subindex: u8, bits: u8, range: [i64; 2], default: i64) -> ObjectRow {
    command(index, subindex, bits, range, default).saved()
}

/// Every entry, in ascending order.
pub const OBJECTS: [ObjectRow; 109] = [
    ro(0x1000, 0, 32, 0x0002_0192),
    ro(0x1001, 0, 8, 0),
    ro(0x1005, 0, 32, 0x80),
    ro(0x1016, 0, 8, 1),
    rw(0x1016, 1, 32, [0, 0x007F_FFFF], 0x007F_07D0),
    rw(0x1017, 0, 16, FULL_16, 1000),
    ro(0x1018, 0, 8, 4),
    ro(0x1018, 1, 32, 0x331),
    ro(0x1018, 2, 32, 1),
    ro(0x1018, 3, 32, 0x100),
    ro(0x1018, 4, 32, 1),
    ro(0x1400, 0, 8, 2),
    ro(0x1400, 1, 32, 0x200).plus_node(),
    rw(0x1400, 2, 8, FULL_8, 255),
    ro(0x1401, 0, 8, 2),
    ro(0x1401, 1, 32, 0x300).plus_node(),
    rw(0x1401, 2, 8, FULL_8, 255),
    ro(0x1402, 0, 8, 2),
    ro(0x1402, 1, 32, 0x400).plus_node(),
    rw(0x1402, 2, 8, FULL_8, 255),
    ro(0x1403, 0, 8, 2),
    ro(0x1403, 1, 32, 0x500).plus_node(),
    rw(0x1403, 2, 8, FULL_8, 1),
    ro(0x1600, 0, 8, 3),
    ro(0x1600, 1, 32, 0x6040_0010),
    ro(0x1600, 2, 32, 0x6060_0008),
    ro(0x1600, 3, 32, 0x607A_0020),
    ro(0x1601, 0, 8, 2),
    ro(0x1601, 1, 32, 0x607A_0020),
    ro(0x1601, 2, 32, 0x6081_0020),
    ro(0x1602, 0, 8, 3),
    ro(0x1602, 1, 32, 0x6040_0010),
    ro(0x1602, 2, 32, 0x6060_0008),
    ro(0x1602, 3, 32, 0x60FF_0020),
    ro(0x1603, 0, 8, 1),
    ro(0x1603, 1, 32, 0x607A_0020),
    ro(0x1800, 0, 8, 5),
    ro(0x1800, 1, 32, 0x180).plus_node(),
    rw(0x1800, 2, 8, FULL_8, 255),
    rw(0x1800, 3, 16, FULL_16, 0),
    ro(0x1800, 4, 16, 0),
    rw(0x1800, 5, 16, FULL_16, 100),
    ro(0x1801, 0, 8, 5),
    ro(0x1801, 1, 32, 0x280).plus_node(),
    rw(0x1801, 2, 8, FULL_8, 1),
    rw(0x1801, 3, 16, FULL_16, 1),
    ro(0x1801, 4, 16, 0),
    rw(0x1801, 5, 16, FULL_16, 0),
    ro(0x1802, 0, 8, 5),
    ro(0x1802, 1, 32, 0x380).plus_node(),
    rw(0x1802, 2, 8, FULL_8, 255),
    rw(0x1802, 3, 16, FULL_16, 3),
    ro(0x1802, 4, 16, 0),
    rw(0x1802, 5, 16, FULL_16, 100),
    ro(0x1803, 0, 8, 5),
    ro(0x1803, 1, 32, 0x480).plus_node(),
    rw(0x1803, 2, 8, FULL_8, 255),
    rw(0x1803, 3, 16, FULL_16, 3),
    ro(0x1803, 4, 16, 0),
    rw(0x1803, 5, 16, FULL_16, 0),
    ro(0x1A00, 0, 8, 2),
    ro(0x1A00, 1, 32, 0x6064_0020),
    ro(0x1A00, 2, 32, 0x6041_0010),
    ro(0x1A01, 0, 8, 2),
    ro(0x1A01, 1, 32, 0x6064_0020),
    ro(0x1A01, 2, 32, 0x6041_0010),
    ro(0x1A02, 0, 8, 2),
    ro(0x1A02, 1, 32, 0x6064_0020),
    ro(0x1A02, 2, 32, 0x606C_0020),
    ro(0x1A03, 0, 8, 2),
    ro(0x1A03, 1, 32, 0x6064_0020),
    ro(0x1A03, 2, 32, 0x6041_0010),
    command(0x2600, 0, 16, [0, 506], 0),      // Modbus enable
    command(0x2601, 0, 16, [0, 1], 1),        // Drive output enable
    rw(0x2604, 0, 16, [0, 306], 0),           // Flux-weakening angle
    rw(0x2609, 0, 16, [0, 1], 0),             // DIR polarity
    rw(0x260A, 0, 16, FULL_16, 32_768),       // Electronic gear numerator
    rw(0x260B, 0, 16, [1, 65_535], 8192),     // Electronic gear denominator
    command(0x260C, 0, 32, SIGNED_32, 0),     // Incremental position
    ro(0x260E, 0, 16, 0),                     // Alarm code
    measured(0x2612, 16, [0, 100]),           // System temperature
    measured(0x2613, 16, [-32_768, 32_767]),  // System output PWM
    command(0x2614, 0, 16, [0, 2], 0),        // Parameter save flag
    rw(0x2615, 0, 16, [1, 127], 1),           // Device address (node id)
    rw(0x2618, 0, 16, [0, 609], 603),         // Maximum output at standstill
    rw(0x2619, 0, 16, [0, 32_768], 0),        // Special function
    rw(0x261C, 0, 16, FULL_16, 0),            // CAN communication sync control word
    rw(0x261D, 0, 16, [0, 10_009], 10_000),   // Maximum allowed current
    measured(0x261E, 16, [0, 10]),            // Multi-turn battery level
    command(0x6040, 0, 16, FULL_16, 0),       // Controlword
    ro(0x6041, 0, 16, 0),                     // Statusword
    command(0x6060, 0, 8, [1, 7], 1),         // Mode of operation
    measured(0x6063, 32, SIGNED_32),          // Actual position (internal)
    measured(0x6064, 32, SIGNED_32),          // Actual position
    measured(0x606C, 16, [-30_000, 30_000]),  // Actual velocity
    measured(0x6078, 16, [0, 32_767]),        // Actual current
    measured(0x6079, 16, [0, 32_767]),        // System (DC link) voltage
    command(0x607A, 0, 32, SIGNED_32, 0),     // Target position buffer
    rw(0x6081, 0, 32, [0, 3000], 1000),       // Profile (trapezoid) velocity
    rw(0x6083, 0, 32, FULL_16, 20_000),       // Motor acceleration
    rw(0x6098, 0, 8, [17, 22], 17),           // Homing method
    ro(0x60F9, 0, 8, 2),                      // Velocity loop parameters number of entries
    rw(0x60F9, 1, 16, [0, 10_000], 1000),     // Velocity loop proportional gain
    rw(0x60F9, 2, 16, [2, 2000], 20),         // Velocity loop integration time
    ro(0x60FB, 0, 8, 2),                      // Position loop parameters number of entries
    rw(0x60FB, 1, 16, [60, 30_000], 1000),    // Position loop proportional gain
    rw(0x60FB, 2, 16, [0, 3924], 327),        // Velocity feed-forward
    ro(0x60FD, 0, 16, 0),                     // Digital input state
    command(0x60FF, 0, 32, [-3000, 3000], 0), // Velocity-mode target speed
];

/// Places of the entries that the drive itself uses.
pub mod at {
    use super::{OBJECTS, table_places};

    table_places! {
        ERROR_REGISTER = 0x1001:0;
        TPDO1_MAPPING = 0x1A00:0;
        TPDO2_MAPPING = 0x1A01:0;
        TPDO3_MAPPING = 0x1A02:0;
        TPDO4_MAPPING = 0x1A03:0;
        MODBUS_ENABLE = 0x2600:0;
        OUTPUT_ENABLE = 0x2601:0;
        FLUX_WEAKENING_ANGLE = 0x2604:0;
        GEAR_NUMERATOR = 0x260A:0;
        GEAR_DENOMINATOR = 0x260B:0;
        INCREMENTAL_POSITION = 0x260C:0;
        ALARM_CODE = 0x260E:0;
        TEMPERATURE = 0x2612:0;
        OUTPUT = 0x2613:0;
        SAVE_FLAG = 0x2614:0;
        NODE_ADDRESS = 0x2615:0;
        STANDSTILL_OUTPUT = 0x2618:0;
        SPECIAL_FUNCTION = 0x2619:0;
        MAXIMUM_CURRENT = 0x261D:0;
        BATTERY_LEVEL = 0x261E:0;
        CONTROLWORD = 0x6040:0;
        STATUSWORD = 0x6041:0;
        OPERATION_MODE = 0x6060:0;
        POSITION_INTERNAL = 0x6063:0;
        POSITION = 0x6064:0;
        VELOCITY = 0x606C:0;
        CURRENT = 0x6078:0;
        VOLTAGE = 0x6079:0;
        TARGET_POSITION = 0x607A:0;
        PROFILE_VELOCITY = 0x6081:0;
        ACCELERATION = 0x6083:0;
        HOMING_METHOD = 0x6098:0;
        INPUTS = 0x60FD:0;
        TARGET_VELOCITY = 0x60FF:0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_order() {
        for pair in OBJECTS.windows(2) {
            let key = |object: &ObjectRow| (object.index, object.subindex);
            assert!(key(&pair[0]) < key(&pair[1]), "{:04X}:{}", pair[1].index, pair[1].subindex);
        }
    }

    #[test]
    fn objects_that_real_units_lack_do_not_exist() {
        for index in [0x6061, 0x6502, 0x603F, 0x60C2, 0x6065, 0x6071, 0x6077, 0x6084, 0x1003, 0x1010] {
            assert!(OBJECTS.iter().all(|object| object.index != index), "{index:04X}");
        }
    }

    #[test]
    fn every_default_is_within_its_range() {
        for object in OBJECTS {
            assert!((object.lowest..=object.highest).contains(&object.default), "{:04X}", object.index);
        }
    }
}
