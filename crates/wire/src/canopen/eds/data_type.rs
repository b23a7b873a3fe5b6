//! The data types of object dictionaries (CiA 301, table 44).

/// The code of a data type. Codes that the standard does not define belong to the manufacturer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DataTypeCode(pub u16);

/// The kind of a type's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueKind {
    /// Unsigned integers with this number of bits.
    Unsigned(u8),
    /// Signed integers with this number of bits.
    Signed(u8),
    /// Floating-point numbers of 32 or 64 bits (IEEE 754).
    Real(u8),
    /// Text.
    Text,
    /// Bytes.
    Bytes,
    /// Unknown.
    Other,
}

const NAMES: [(u16, &str, ValueKind); 28] = [
    (0x01, "BOOLEAN", ValueKind::Unsigned(1)),
    (0x02, "INTEGER8", ValueKind::Signed(8)),
    (0x03, "INTEGER16", ValueKind::Signed(16)),
    (0x04, "INTEGER32", ValueKind::Signed(32)),
    (0x05, "UNSIGNED8", ValueKind::Unsigned(8)),
    (0x06, "UNSIGNED16", ValueKind::Unsigned(16)),
    (0x07, "UNSIGNED32", ValueKind::Unsigned(32)),
    (0x08, "REAL32", ValueKind::Real(32)),
    (0x09, "VISIBLE_STRING", ValueKind::Text),
    (0x0A, "OCTET_STRING", ValueKind::Bytes),
    (0x0B, "UNICODE_STRING", ValueKind::Text),
    (0x0C, "TIME_OF_DAY", ValueKind::Unsigned(48)),
    (0x0D, "TIME_DIFFERENCE", ValueKind::Unsigned(48)),
    (0x0F, "DOMAIN", ValueKind::Other),
    (0x10, "INTEGER24", ValueKind::Signed(24)),
    (0x11, "REAL64", ValueKind::Real(64)),
    (0x12, "INTEGER40", ValueKind::Signed(40)),
    (0x13, "INTEGER48", ValueKind::Signed(48)),
    (0x14, "INTEGER56", ValueKind::Signed(56)),
    (0x15, "INTEGER64", ValueKind::Signed(64)),
    (0x16, "UNSIGNED24", ValueKind::Unsigned(24)),
    (0x18, "UNSIGNED40", ValueKind::Unsigned(40)),
    (0x19, "UNSIGNED48", ValueKind::Unsigned(48)),
    (0x1A, "UNSIGNED56", ValueKind::Unsigned(56)),
    (0x1B, "UNSIGNED64", ValueKind::Unsigned(64)),
    (0x20, "PDO_COMMUNICATION_PARAMETER", ValueKind::Other),
    (0x21, "PDO_MAPPING", ValueKind::Other),
    (0x23, "IDENTITY", ValueKind::Other),
];

impl DataTypeCode {
    /// UNSIGNED8
    pub const UNSIGNED8: Self = Self(0x05);
    /// UNSIGNED16
    pub const UNSIGNED16: Self = Self(0x06);
    /// UNSIGNED32
    pub const UNSIGNED32: Self = Self(0x07);
    /// UNICODE_STRING
    pub const UNICODE_STRING: Self = Self(0x0B);
    /// DOMAIN
    pub const DOMAIN: Self = Self(0x0F);

    /// The type with this name in the standard, in any case.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        NAMES.iter().find(|(_, known, _)| known.eq_ignore_ascii_case(name)).map(|(code, ..)| Self(*code))
    }

    /// The kind of its values.
    pub fn kind(self) -> ValueKind {
        NAMES.iter().find(|(code, ..)| *code == self.0).map_or(ValueKind::Other, |(.., kind)| *kind)
    }

    /// The length of a value in bits, if it is fixed.
    pub fn bits(self) -> Option<u8> {
        match self.kind() {
            ValueKind::Unsigned(bits) | ValueKind::Signed(bits) | ValueKind::Real(bits) => Some(bits),
            ValueKind::Text | ValueKind::Bytes | ValueKind::Other => None,
        }
    }

    /// The range of an integer type.
    pub fn range(self) -> Option<(i128, i128)> {
        match self.kind() {
            ValueKind::Unsigned(bits) => Some((0, (1 << bits) - 1)),
            ValueKind::Signed(bits) => Some((-(1 << (bits - 1)), (1 << (bits - 1)) - 1)),
            _ => None,
        }
    }

    /// The type of a standard object (CiA 301; CiA 402 for the objects that takt uses), for files without this
    /// information.
    pub(super) fn of_standard_object(index: u16, subindex: u8) -> Option<Self> {
        Some(Self(match (index, subindex) {
            (0x1000 | 0x1002 | 0x1005..=0x1007 | 0x1012..=0x1014, 0) => 0x07,
            (0x1001 | 0x1019, 0) => 0x05,
            (0x1008..=0x100A, 0) => 0x09,
            (0x100C | 0x1015 | 0x1017, 0) => 0x06,
            (0x100D, 0) => 0x05,
            (0x1400..=0x15FF | 0x1800..=0x19FF, 1) => 0x07,
            (0x1400..=0x15FF | 0x1800..=0x19FF, 2 | 4 | 6) => 0x05,
            (0x1400..=0x15FF | 0x1800..=0x19FF, 3 | 5) => 0x06,
            (0x1003 | 0x1010 | 0x1011 | 0x1016 | 0x1018 | 0x1600..=0x17FF | 0x1A00..=0x1BFF, 1..) => 0x07,
            (0x1029, 1..) => 0x05,
            (0x603F | 0x6040 | 0x6041 | 0x6072, 0) => 0x06,
            (0x6060 | 0x6061, 0) => 0x02,
            (0x605A..=0x605E | 0x6071 | 0x6074 | 0x6077 | 0x6078, 0) => 0x03,
            (0x6062..=0x6064 | 0x606B | 0x606C | 0x607A | 0x607C | 0x60F4 | 0x60FF, 0) => 0x04,
            (0x6065 | 0x6067 | 0x6075 | 0x6076 | 0x607F..=0x6085 | 0x60FD | 0x6502, 0) => 0x07,
            _ => return None,
        }))
    }
}

impl std::fmt::Display for DataTypeCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match NAMES.iter().find(|(code, ..)| *code == self.0) {
            Some((_, name, _)) => f.pad(name),
            None => f.pad(&format!("type 0x{:04X}", self.0)),
        }
    }
}
