//! The object dictionary of the eRob's CANopen firmware by its EDS. Objects that are not in the EDS do not exist here.
//! Unknown defaults are 0, or as noted.

/// The data type of an object (CiA 301, 7.4.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErobDataType {
    /// INTEGER8
    I8,
    /// INTEGER16
    I16,
    /// INTEGER32
    I32,
    /// UNSIGNED8
    U8,
    /// UNSIGNED16
    U16,
    /// UNSIGNED32
    U32,
}

impl ErobDataType {
    /// The size in bytes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 => 4,
        }
    }
}

/// SDO access to an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErobAccess {
    /// Read only.
    ReadOnly,
    /// Read and write.
    ReadWrite,
    /// Write only.
    WriteOnly,
}

/// One entry of the object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErobObject {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub subindex: u8,
    /// Data type.
    pub data_type: ErobDataType,
    /// Access by SDO.
    pub access: ErobAccess,
    /// Whether a PDO can map it.
    pub is_mappable: bool,
    /// Whether "save" (1010:1) saves it.
    pub is_saved: bool,
    /// Value after the first power-up.
    pub default: u32,
    /// Whether the node ID is added to the default.
    pub adds_node: bool,
}

impl ErobObject {
    const fn new(
        index: u16,
        subindex: u8,
        data_type: ErobDataType,
        access: ErobAccess,
        default: i64,
    ) -> Self {
        let (is_mappable, is_saved, adds_node) = (false, false, false);
        Self { index, subindex, data_type, access, is_mappable, is_saved, default: default as u32, adds_node }
    }

    const fn mappable(self) -> Self {
        Self { is_mappable: true, ..self }
    }

    const fn saved(self) -> Self {
        Self { is_saved: true, ..self }
    }

    const fn plus_node(self) -> Self {
        Self { adds_node: true, ..self }
    }
}

use ErobAccess::{ReadOnly, ReadWrite, WriteOnly};
use ErobDataType::{I8, I16, I32, U8, U16, U32};

/// Read-only.
const fn ro(index: u16, subindex: u8, data_type: ErobDataType, default: i64) -> ErobObject {
    ErobObject::new(index, subindex, data_type, ReadOnly, default)
}

/// Read-only and mappable.
const fn ro_pdo(index: u16, data_type: ErobDataType, default: i64) -> ErobObject {
    ro(index, 0, data_type, default).mappable()
}

/// A parameter: read, written, saved.
const fn rw(index: u16, subindex: u8, data_type: ErobDataType, default: i64) -> ErobObject {
    ErobObject::new(index, subindex, data_type, ReadWrite, default).saved()
}

/// A parameter that is also mappable.
const fn rw_pdo(index: u16, subindex: u8, data_type: ErobDataType, default: i64) -> ErobObject {
    rw(index, subindex, data_type, default).mappable()
}

/// A command or set-point: read, written, mappable, never saved.
const fn command(index: u16, data_type: ErobDataType, default: i64) -> ErobObject {
    ErobObject::new(index, 0, data_type, ReadWrite, default).mappable()
}

const NO_LIMIT: i64 = u32::MAX as i64;
const INVALID: i64 = 1 << 31;
const MAPS_6040: i64 = 0x6040_0010;
const MAPS_6041: i64 = 0x6041_0010;

/// Every entry, in ascending order.
pub const OBJECTS: [ErobObject; 217] = [
    ro(0x1000, 0, U32, 0x0042_0192),
    ro(0x1001, 0, U8, 0).mappable(),
    ErobObject::new(0x1003, 0, U8, ReadWrite, 0),
    ro(0x1003, 1, U32, 0),
    ro(0x1003, 2, U32, 0),
    ro(0x1003, 3, U32, 0),
    ro(0x1003, 4, U32, 0),
    rw(0x1005, 0, U32, 0x80),
    rw(0x1006, 0, U32, 0),
    rw(0x100C, 0, U16, 0),
    rw(0x100D, 0, U8, 0),
    ro(0x1010, 0, U8, 1),
    ErobObject::new(0x1010, 1, U32, ReadWrite, 1),
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
    ro_pdo(0x2240, I32, 0),                        // motor encoder
    ro_pdo(0x2241, I32, 0),                        // encoder difference
    ErobObject::new(0x2242, 0, U16, WriteOnly, 0), // 1 clears the battery fault; type and access are guesses
    ro(0x22A2, 0, U16, 0),                         // temperature
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
    ErobObject::new(0x60C1, 1, I16, ReadWrite, 0).mappable(),
    ErobObject::new(0x60C1, 2, I16, ReadWrite, 0).mappable(),
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

/// The position of an entry in [`OBJECTS`], for constants: an unknown entry does not compile.
pub const fn place(index: u16, subindex: u8) -> usize {
    let mut at = 0;
    while at < OBJECTS.len() {
        if OBJECTS[at].index == index && OBJECTS[at].subindex == subindex {
            return at;
        }
        at += 1;
    }
    panic!("no such object")
}

/// The position of an entry in [`OBJECTS`].
pub fn find(index: u16, subindex: u8) -> Result<usize, Missing> {
    OBJECTS.binary_search_by_key(&(index, subindex), |object| (object.index, object.subindex)).map_err(|at| {
        // Every index begins with sub-index 0, so a neighbour has it.
        let is_known = at > 0 && OBJECTS.get(at - 1).is_some_and(|object| object.index == index);
        if is_known { Missing::Subindex } else { Missing::Index }
    })
}

/// What does not exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// The whole index.
    Index,
    /// The sub-index of an index that exists.
    Subindex,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_order_and_every_index_begins_with_subindex_0() {
        for pair in OBJECTS.windows(2) {
            let key = |object: &ErobObject| (object.index, object.subindex);
            assert!(key(&pair[0]) < key(&pair[1]), "{:04X}:{}", pair[1].index, pair[1].subindex);
            assert!(pair[0].index == pair[1].index || pair[1].subindex == 0, "{:04X}", pair[1].index);
        }
    }

    #[test]
    fn objects_that_the_firmware_lacks_do_not_exist() {
        for index in [0x1011, 0x1015, 0x1019, 0x605A, 0x605C, 0x605D, 0x6063, 0x6072, 0x607E, 0x60FE, 0x6007]
        {
            assert_eq!(find(index, 0), Err(Missing::Index), "{index:04X}");
        }
        assert_eq!(find(0x1018, 4), Err(Missing::Subindex));
        assert_eq!(find(0x1800, 4), Err(Missing::Subindex));
        assert_eq!(find(0x1800, 6), Err(Missing::Subindex));
    }

    #[test]
    fn default_mappings_contain_mappable_objects_of_the_right_length() {
        let mappings = OBJECTS.iter().filter(|object| {
            matches!(object.index, 0x1600..=0x1603 | 0x1A00..=0x1A03)
                && object.subindex > 0
                && object.default != 0
        });
        let mut count = 0;
        for mapping in mappings {
            let value = mapping.default;
            let object = OBJECTS[find((value >> 16) as u16, (value >> 8) as u8).unwrap()];
            assert!(object.is_mappable);
            assert_eq!(object.data_type.bytes() * 8, (value & 0xFF) as usize);
            count += 1;
        }
        assert_eq!(count, 10);
    }
}
