//! The object dictionary of the eRob's CANopen firmware by its EDS. Objects that are not in the EDS do not exist here.
//! Unknown defaults are 0, or as noted.

use takt_wire::canopen::eds::{AccessType, DataTypeCode};

use crate::object_dictionary::table::{I8, I16, I32, ObjectRow, U8, U16, U32, table_places};

use AccessType::{ReadWrite, WriteOnly};

/// Read-only.
const fn ro(index: u16, subindex: u8, data_type: DataTypeCode, default: i64) -> ObjectRow {
    ObjectRow::read_only(index, subindex, data_type, default)
}

/// Read-only and mappable.
const fn ro_pdo(index: u16, data_type: DataTypeCode, default: i64) -> ObjectRow {
    ro(index, 0, data_type, default).mappable()
}

/// A parameter: read, written, saved.
const fn rw(index: u16, subindex: u8, data_type: DataTypeCode, default: i64) -> ObjectRow {
    ro(index, subindex, data_type, default).with_access(ReadWrite).saved()
}

/// A parameter that is also mappable.
const fn rw_pdo(index: u16, subindex: u8, data_type: DataTypeCode, default: i64) -> ObjectRow {
    rw(index, subindex, data_type, default).mappable()
}

/// A command or set-point: read, written, mappable, never saved.
const fn command(index: u16, data_type: DataTypeCode, default: i64) -> ObjectRow {
    ro_pdo(index, data_type, default).with_access(ReadWrite)
}

const NO_LIMIT: i64 = u32::MAX as i64;
const INVALID: i64 = 1 << 31;
const MAPS_6040: i64 = 0x6040_0010;
const MAPS_6041: i64 = 0x6041_0010;

/// Every entry, in ascending order.
pub const OBJECTS: [ObjectRow; 217] = [
    ro(0x1000, 0, U32, 0x0042_0192),
    ro(0x1001, 0, U8, 0).mappable(),
    ro(0x1003, 0, U8, 0).with_access(ReadWrite),
    ro(0x1003, 1, U32, 0),
    ro(0x1003, 2, U32, 0),
    ro(0x1003, 3, U32, 0),
    ro(0x1003, 4, U32, 0),
    rw(0x1005, 0, U32, 0x80),
    rw(0x1006, 0, U32, 0),
    rw(0x100C, 0, U16, 0),
    rw(0x100D, 0, U8, 0),
    ro(0x1010, 0, U8, 1),
    ro(0x1010, 1, U32, 1).with_access(ReadWrite),
    ro(0x1014, 0, U32, 0x80).plus_node(),
    ro(0x1016, 0, U8, 1),
    rw(0x1016, 1, U32, 0),
    rw(0x1017, 0, U16, 0),
    ro(0x1018, 0, U8, 3),
    ro(0x1018, 1, U32, 0x5A65_726F),
    ro(0x1018, 2, U32, 0x2648_3052),
    ro(0x1018, 3, U32, 0x0002_0111),
    ro(0x1029, 0, U8, 1),
    rw(0x1029, 1, U8, 0),
    ro(0x1200, 0, U8, 2),
    ro(0x1200, 1, U32, 0x600).plus_node(),
    ro(0x1200, 2, U32, 0x580).plus_node(),
    // RPDO communication: identifier, transmission type, inhibit time (100 µs), event timer (ms).
    ro(0x1400, 0, U8, 5),
    rw(0x1400, 1, U32, 0x200).plus_node(),
    rw(0x1400, 2, U8, 255),
    rw(0x1400, 3, U16, 0),
    rw(0x1400, 5, U16, 0),
    ro(0x1401, 0, U8, 5),
    rw(0x1401, 1, U32, INVALID + 0x300).plus_node(),
    rw(0x1401, 2, U8, 255),
    rw(0x1401, 3, U16, 0),
    rw(0x1401, 5, U16, 0),
    ro(0x1402, 0, U8, 5),
    rw(0x1402, 1, U32, INVALID + 0x400).plus_node(),
    rw(0x1402, 2, U8, 255),
    rw(0x1402, 3, U16, 0),
    rw(0x1402, 5, U16, 0),
    ro(0x1403, 0, U8, 5),
    rw(0x1403, 1, U32, INVALID + 0x500).plus_node(),
    rw(0x1403, 2, U8, 255),
    rw(0x1403, 3, U16, 0),
    rw(0x1403, 5, U16, 0),
    // RPDO mapping
    rw(0x1600, 0, U8, 1),
    rw(0x1600, 1, U32, MAPS_6040),
    rw(0x1600, 2, U32, 0),
    rw(0x1600, 3, U32, 0),
    rw(0x1600, 4, U32, 0),
    rw(0x1600, 5, U32, 0),
    rw(0x1600, 6, U32, 0),
    rw(0x1600, 7, U32, 0),
    rw(0x1600, 8, U32, 0),
    rw(0x1601, 0, U8, 2),
    rw(0x1601, 1, U32, MAPS_6040),
    rw(0x1601, 2, U32, 0x607A_0020),
    rw(0x1601, 3, U32, 0),
    rw(0x1601, 4, U32, 0),
    rw(0x1601, 5, U32, 0),
    rw(0x1601, 6, U32, 0),
    rw(0x1601, 7, U32, 0),
    rw(0x1601, 8, U32, 0),
    rw(0x1602, 0, U8, 2),
    rw(0x1602, 1, U32, MAPS_6040),
    rw(0x1602, 2, U32, 0x60FF_0020),
    rw(0x1602, 3, U32, 0),
    rw(0x1602, 4, U32, 0),
    rw(0x1602, 5, U32, 0),
    rw(0x1602, 6, U32, 0),
    rw(0x1602, 7, U32, 0),
    rw(0x1602, 8, U32, 0),
    rw(0x1603, 0, U8, 0),
    rw(0x1603, 1, U32, 0),
    rw(0x1603, 2, U32, 0),
    rw(0x1603, 3, U32, 0),
    rw(0x1603, 4, U32, 0),
    rw(0x1603, 5, U32, 0),
    rw(0x1603, 6, U32, 0),
    rw(0x1603, 7, U32, 0),
    rw(0x1603, 8, U32, 0),
    // TPDO communication
    ro(0x1800, 0, U8, 5),
    rw(0x1800, 1, U32, 0x180).plus_node(),
    rw(0x1800, 2, U8, 255),
    rw(0x1800, 3, U16, 0),
    rw(0x1800, 5, U16, 0),
    ro(0x1801, 0, U8, 5),
    rw(0x1801, 1, U32, INVALID + 0x280).plus_node(),
    rw(0x1801, 2, U8, 255),
    rw(0x1801, 3, U16, 0),
    rw(0x1801, 5, U16, 0),
    ro(0x1802, 0, U8, 5),
    rw(0x1802, 1, U32, INVALID + 0x380).plus_node(),
    rw(0x1802, 2, U8, 255),
    rw(0x1802, 3, U16, 0),
    rw(0x1802, 5, U16, 0),
    ro(0x1803, 0, U8, 5),
    rw(0x1803, 1, U32, INVALID + 0x480).plus_node(),
    rw(0x1803, 2, U8, 255),
    rw(0x1803, 3, U16, 0),
    rw(0x1803, 5, U16, 0),
    // TPDO mapping
    rw(0x1A00, 0, U8, 1),
    rw(0x1A00, 1, U32, MAPS_6041),
    rw(0x1A00, 2, U32, 0),
    rw(0x1A00, 3, U32, 0),
    rw(0x1A00, 4, U32, 0),
    rw(0x1A00, 5, U32, 0),
    rw(0x1A00, 6, U32, 0),
    rw(0x1A00, 7, U32, 0),
    rw(0x1A00, 8, U32, 0),
    rw(0x1A01, 0, U8, 2),
    rw(0x1A01, 1, U32, MAPS_6041),
    rw(0x1A01, 2, U32, 0x6064_0020),
    rw(0x1A01, 3, U32, 0),
    rw(0x1A01, 4, U32, 0),
    rw(0x1A01, 5, U32, 0),
    rw(0x1A01, 6, U32, 0),
    rw(0x1A01, 7, U32, 0),
    rw(0x1A01, 8, U32, 0),
    rw(0x1A02, 0, U8, 2),
    rw(0x1A02, 1, U32, MAPS_6041),
    rw(0x1A02, 2, U32, 0x606C_0020),
    rw(0x1A02, 3, U32, 0),
    rw(0x1A02, 4, U32, 0),
    rw(0x1A02, 5, U32, 0),
    rw(0x1A02, 6, U32, 0),
    rw(0x1A02, 7, U32, 0),
    rw(0x1A02, 8, U32, 0),
    rw(0x1A03, 0, U8, 0),
    rw(0x1A03, 1, U32, 0),
    rw(0x1A03, 2, U32, 0),
    rw(0x1A03, 3, U32, 0),
    rw(0x1A03, 4, U32, 0),
    rw(0x1A03, 5, U32, 0),
    rw(0x1A03, 6, U32, 0),
    rw(0x1A03, 7, U32, 0),
    rw(0x1A03, 8, U32, 0),
    // Manufacturer's own
    ro_pdo(0x20A0, I32, 0),
    ro_pdo(0x2205, I16, 0),
    ro_pdo(0x2240, I32, 0),                       // motor encoder
    ro_pdo(0x2241, I32, 0),                       // encoder difference
    ro(0x2242, 0, U16, 0).with_access(WriteOnly), // 1 clears the battery fault; type and access are guesses
    ro(0x22A2, 0, U16, 0),                        // temperature
    ro(0x2380, 0, U8, 2),
    rw(0x2380, 1, U16, 0), // gains; their scale is not known, and they have no effect here
    rw(0x2380, 2, U16, 0),
    ro(0x2381, 0, U8, 2),
    rw(0x2381, 1, U16, 0),
    rw(0x2381, 2, U16, 0),
    ro(0x2382, 0, U8, 2),
    rw(0x2382, 1, U16, 0),
    rw(0x2382, 2, U16, 0),
    rw(0x3B60, 0, U32, 0),  // velocity error window
    ro_pdo(0x3B69, I32, 0), // torque estimate, mN·m
    // Drive profile
    ro_pdo(0x603F, U16, 0),
    command(0x6040, U16, 0),
    ro_pdo(0x6041, U16, 0),
    rw(0x605B, 0, I16, 0),
    rw(0x605E, 0, I16, 2),
    command(0x6060, I8, 0),
    ro_pdo(0x6061, I8, 0),
    ro_pdo(0x6062, I32, 0),
    ro_pdo(0x6064, I32, 0),
    rw_pdo(0x6065, 0, I32, -1), // all ones: no window (CiA 402)
    rw_pdo(0x6067, 0, I32, 100),
    rw_pdo(0x6068, 0, I16, 0),
    command(0x606B, I32, 0),
    ro_pdo(0x606C, I32, 0),
    rw_pdo(0x606D, 0, I16, 100),
    rw_pdo(0x606E, 0, I16, 0),
    rw_pdo(0x606F, 0, U16, 0),
    command(0x6071, I16, 0),
    ro_pdo(0x6074, I16, 0),
    ro_pdo(0x6075, U32, 0),
    ro_pdo(0x6076, U32, 0),
    ro_pdo(0x6077, I16, 0),
    ro_pdo(0x6078, I16, 0),
    ro_pdo(0x6079, U32, 48_000),
    command(0x607A, I32, 0),
    rw_pdo(0x607C, 0, I32, 0),
    ro(0x607D, 0, U8, 2),
    rw_pdo(0x607D, 1, I32, i32::MIN as i64),
    rw_pdo(0x607D, 2, I32, i32::MAX as i64),
    rw_pdo(0x607F, 0, U32, NO_LIMIT), // the drive's own maximum speed stands above it
    rw_pdo(0x6080, 0, U32, 0),
    rw_pdo(0x6081, 0, U32, 10_000),
    rw_pdo(0x6083, 0, U32, 200),
    rw_pdo(0x6084, 0, U32, 200),
    rw_pdo(0x6085, 0, U32, 200),
    rw_pdo(0x6086, 0, I16, 0),
    rw_pdo(0x6087, 0, U32, 1_000),
    ro(0x6093, 0, U8, 2),
    rw_pdo(0x6093, 1, U32, 1),
    rw_pdo(0x6093, 2, U32, 1),
    rw_pdo(0x6098, 0, I8, 0),
    ro(0x6099, 0, U8, 2),
    rw_pdo(0x6099, 1, U32, 100),
    rw_pdo(0x6099, 2, U32, 20),
    rw_pdo(0x609A, 0, U32, 100),
    command(0x60B0, I32, 0),
    command(0x60B1, I32, 0),
    command(0x60B2, I16, 0),
    command(0x60C0, I16, 0),
    ro(0x60C1, 0, U8, 2),
    ro(0x60C1, 1, I16, 0).with_access(ReadWrite).mappable(),
    ro(0x60C1, 2, I16, 0).with_access(ReadWrite).mappable(),
    ro(0x60C2, 0, U8, 2),
    rw_pdo(0x60C2, 1, U8, 1),
    rw(0x60C2, 2, I8, -3),
    rw_pdo(0x60C5, 0, U32, NO_LIMIT),
    rw_pdo(0x60C6, 0, U32, NO_LIMIT),
    rw_pdo(0x60F2, 0, U16, 0),
    ro_pdo(0x60F4, I32, 0),
    ro_pdo(0x60FD, U32, 0),
    command(0x60FF, I32, 0),
    ro_pdo(0x6502, U32, 909),
];

/// Places of the entries that the drive itself uses.
pub mod at {
    use super::{OBJECTS, table_places};

    table_places! {
        CYCLE_PERIOD = 0x1006:0;
        ERROR_BEHAVIOUR = 0x1029:1;
        MOTOR_ENCODER = 0x2240:0;
        BATTERY_RESET = 0x2242:0;
        TEMPERATURE = 0x22A2:0;
        TORQUE_ESTIMATE = 0x3B69:0;
        ERROR_CODE = 0x603F:0;
        CONTROLWORD = 0x6040:0;
        STATUSWORD = 0x6041:0;
        SHUTDOWN_OPTION = 0x605B:0;
        FAULT_REACTION_OPTION = 0x605E:0;
        OPERATION_MODE = 0x6060:0;
        OPERATION_MODE_DISPLAY = 0x6061:0;
        POSITION_DEMAND = 0x6062:0;
        POSITION = 0x6064:0;
        FOLLOWING_ERROR_WINDOW = 0x6065:0;
        POSITION_WINDOW = 0x6067:0;
        POSITION_WINDOW_TIME = 0x6068:0;
        VELOCITY_DEMAND = 0x606B:0;
        VELOCITY = 0x606C:0;
        VELOCITY_WINDOW = 0x606D:0;
        VELOCITY_WINDOW_TIME = 0x606E:0;
        TARGET_TORQUE = 0x6071:0;
        TORQUE_DEMAND = 0x6074:0;
        RATED_CURRENT = 0x6075:0;
        RATED_TORQUE = 0x6076:0;
        TORQUE = 0x6077:0;
        CURRENT = 0x6078:0;
        TARGET_POSITION = 0x607A:0;
        POSITION_MIN = 0x607D:1;
        POSITION_MAX = 0x607D:2;
        MAX_PROFILE_VELOCITY = 0x607F:0;
        PROFILE_VELOCITY = 0x6081:0;
        PROFILE_ACCELERATION = 0x6083:0;
        PROFILE_DECELERATION = 0x6084:0;
        QUICK_STOP_DECELERATION = 0x6085:0;
        TORQUE_SLOPE = 0x6087:0;
        POSITION_OFFSET = 0x60B0:0;
        VELOCITY_OFFSET = 0x60B1:0;
        TORQUE_OFFSET = 0x60B2:0;
        INTERPOLATION_PERIOD = 0x60C2:1;
        INTERPOLATION_EXPONENT = 0x60C2:2;
        MAX_ACCELERATION = 0x60C5:0;
        MAX_DECELERATION = 0x60C6:0;
        FOLLOWING_ERROR = 0x60F4:0;
        TARGET_VELOCITY = 0x60FF:0;
        SUPPORTED_MODES = 0x6502:0;
    }
}

/// Returns `true` if an object is a measured or demanded value, which changes all the time.
pub fn is_measured(index: u16) -> bool {
    matches!(
        index,
        0x2240 | 0x2241 | 0x3B69 | 0x6062 | 0x6064 | 0x606B | 0x606C | 0x6074 | 0x6077 | 0x6078 | 0x60F4
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object_dictionary::SimulatedDictionary;
    use crate::sdo_reply::AbortCode;
    use takt_wire::canopen::object::ObjectAddress;

    fn dictionary() -> SimulatedDictionary {
        SimulatedDictionary::of_table(&OBJECTS, 5)
    }

    #[test]
    fn the_table_is_in_order_and_every_index_begins_with_subindex_0() {
        for pair in OBJECTS.windows(2) {
            let key = |object: &ObjectRow| (object.index, object.subindex);
            assert!(key(&pair[0]) < key(&pair[1]), "{:04X}:{}", pair[1].index, pair[1].subindex);
            assert!(pair[0].index == pair[1].index || pair[1].subindex == 0, "{:04X}", pair[1].index);
        }
    }

    #[test]
    fn objects_that_the_firmware_lacks_do_not_exist() {
        let find = |index, subindex| dictionary().find(ObjectAddress::new(index, subindex));
        for index in [0x1011, 0x1015, 0x1019, 0x605A, 0x605C, 0x605D, 0x6063, 0x6072, 0x607E, 0x60FE, 0x6007]
        {
            assert_eq!(find(index, 0), Err(AbortCode::NoObject), "{index:04X}");
        }
        assert_eq!(find(0x1018, 4), Err(AbortCode::NoSubindex));
        assert_eq!(find(0x1800, 4), Err(AbortCode::NoSubindex));
        assert_eq!(find(0x1800, 6), Err(AbortCode::NoSubindex));
    }

    #[test]
    fn default_mappings_contain_mappable_objects_of_the_right_length() {
        let dictionary = dictionary();
        let mappings = OBJECTS.iter().filter(|object| {
            matches!(object.index, 0x1600..=0x1603 | 0x1A00..=0x1A03)
                && object.subindex > 0
                && object.default != 0
        });
        let mut count = 0;
        for mapping in mappings {
            let value = mapping.default;
            let place = dictionary.place((value >> 16) as u16, (value >> 8) as u8).unwrap();
            assert!(OBJECTS[place].is_mappable);
            assert_eq!(dictionary.entry(place).length * 8, (value & 0xFF) as usize);
            count += 1;
        }
        assert_eq!(count, 10);
    }

    #[test]
    fn cob_id_defaults_contain_the_node_id() {
        let number = |index, subindex| dictionary().number_at(dictionary().place(index, subindex));
        assert_eq!(number(0x1400, 1), Some(0x205));
        assert_eq!(number(0x1801, 1), Some(0x8000_0285));
        assert_eq!(number(0x1014, 0), Some(0x85));
    }
}
