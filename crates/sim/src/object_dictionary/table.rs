//! Dictionaries written by hand, for drives whose manual says more than their data sheet.

use takt_wire::canopen::eds::{AccessType, DataTypeCode};

/// One entry of such a dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectRow {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub subindex: u8,
    /// Data type, an integer.
    pub data_type: DataTypeCode,
    /// Access by SDO.
    pub access: AccessType,
    /// True if a master can map it to a PDO.
    pub is_mappable: bool,
    /// True if the device saves it.
    pub is_saved: bool,
    /// The lowest value.
    pub lowest: i64,
    /// The highest value.
    pub highest: i64,
    /// Value of a new unit.
    pub default: i64,
    /// True if the node ID is added to the default.
    pub adds_node: bool,
}

impl ObjectRow {
    /// A read-only entry with the whole range of its type.
    pub const fn read_only(index: u16, subindex: u8, data_type: DataTypeCode, default: i64) -> Self {
        let (lowest, highest) = range(data_type);
        Self {
            index,
            subindex,
            data_type,
            access: AccessType::ReadOnly,
            is_mappable: false,
            is_saved: false,
            lowest,
            highest,
            default,
            adds_node: false,
        }
    }

    /// The same with this access.
    pub const fn with_access(self, access: AccessType) -> Self {
        Self { access, ..self }
    }

    /// The same within this range.
    pub const fn within(self, [lowest, highest]: [i64; 2]) -> Self {
        Self { lowest, highest, ..self }
    }

    /// The same, mappable.
    pub const fn mappable(self) -> Self {
        Self { is_mappable: true, ..self }
    }

    /// The same, saved.
    pub const fn saved(self) -> Self {
        Self { is_saved: true, ..self }
    }

    /// The same with a default to which the node ID is added.
    pub const fn plus_node(self) -> Self {
        Self { adds_node: true, ..self }
    }

    /// The default in the device with this node ID.
    pub fn default_of(&self, node: u8) -> i64 {
        self.default + if self.adds_node { node.into() } else { 0 }
    }
}

/// INTEGER8
pub const I8: DataTypeCode = DataTypeCode(0x02);
/// INTEGER16
pub const I16: DataTypeCode = DataTypeCode(0x03);
/// INTEGER32
pub const I32: DataTypeCode = DataTypeCode(0x04);
/// UNSIGNED8
pub const U8: DataTypeCode = DataTypeCode::UNSIGNED8;
/// UNSIGNED16
pub const U16: DataTypeCode = DataTypeCode::UNSIGNED16;
/// UNSIGNED32
pub const U32: DataTypeCode = DataTypeCode::UNSIGNED32;

/// The range of an integer type, for constants: another type does not compile.
const fn range(data_type: DataTypeCode) -> (i64, i64) {
    match data_type {
        I8 => (i8::MIN as i64, i8::MAX as i64),
        I16 => (i16::MIN as i64, i16::MAX as i64),
        I32 => (i32::MIN as i64, i32::MAX as i64),
        U8 => (0, u8::MAX as i64),
        U16 => (0, u16::MAX as i64),
        U32 => (0, u32::MAX as i64),
        _ => panic!("not an integer of 8, 16 or 32 bits"),
    }
}

/// The place of an entry in a table, for constants: an unknown entry does not compile.
pub const fn place_in(table: &[ObjectRow], index: u16, subindex: u8) -> usize {
    let mut at = 0;
    while at < table.len() {
        if table[at].index == index && table[at].subindex == subindex {
            return at;
        }
        at += 1;
    }
    panic!("no such object")
}

/// Names the places that a drive itself uses: constants for entries of its table `OBJECTS`.
macro_rules! table_places {
    ($($name:ident = $index:literal : $subindex:literal;)*) => {
        $(#[doc = concat!("Object ", stringify!($index), ":", stringify!($subindex))]
        pub const $name: usize = $crate::object_dictionary::table::place_in(&OBJECTS, $index, $subindex);)*
    };
}
pub(crate) use table_places;
