//! An object of a device's object dictionary: address, data type and name.

use std::fmt;

/// Index and sub-index of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ObjectAddress {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub subindex: u8,
}

impl ObjectAddress {
    /// The object `index:subindex`.
    pub const fn new(index: u16, subindex: u8) -> Self {
        Self { index, subindex }
    }
}

impl fmt::Display for ObjectAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}:{:02X}", self.index, self.subindex)
    }
}

/// The integer types of CiA 301 and CiA 402 objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DataType {
    /// UNSIGNED8
    U8,
    /// INTEGER8
    I8,
    /// UNSIGNED16
    U16,
    /// INTEGER16
    I16,
    /// UNSIGNED32
    U32,
    /// INTEGER32
    I32,
}

impl DataType {
    /// The length in bytes.
    pub const fn length(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 => 4,
        }
    }

    /// The type with this length and the sign of this one; `None` if there is none.
    pub const fn of_length(self, length: usize) -> Option<Self> {
        let is_signed = matches!(self, Self::I8 | Self::I16 | Self::I32);
        Some(match (length, is_signed) {
            (1, true) => Self::I8,
            (1, false) => Self::U8,
            (2, true) => Self::I16,
            (2, false) => Self::U16,
            (4, true) => Self::I32,
            (4, false) => Self::U32,
            _ => return None,
        })
    }

    /// Encodes a value, little-endian; `None` when it does not fit the type.
    pub fn encode(self, value: i64) -> Option<Vec<u8>> {
        Some(match self {
            Self::U8 => u8::try_from(value).ok()?.to_le_bytes().into(),
            Self::I8 => i8::try_from(value).ok()?.to_le_bytes().into(),
            Self::U16 => u16::try_from(value).ok()?.to_le_bytes().into(),
            Self::I16 => i16::try_from(value).ok()?.to_le_bytes().into(),
            Self::U32 => u32::try_from(value).ok()?.to_le_bytes().into(),
            Self::I32 => i32::try_from(value).ok()?.to_le_bytes().into(),
        })
    }

    /// Decodes a value; `None` when the number of bytes differs from the type's.
    pub fn decode(self, bytes: &[u8]) -> Option<i64> {
        Some(match self {
            Self::U8 => u8::from_le_bytes(bytes.try_into().ok()?).into(),
            Self::I8 => i8::from_le_bytes(bytes.try_into().ok()?).into(),
            Self::U16 => u16::from_le_bytes(bytes.try_into().ok()?).into(),
            Self::I16 => i16::from_le_bytes(bytes.try_into().ok()?).into(),
            Self::U32 => u32::from_le_bytes(bytes.try_into().ok()?).into(),
            Self::I32 => i32::from_le_bytes(bytes.try_into().ok()?).into(),
        })
    }
}

/// An object with a numeric value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Object {
    /// Index and sub-index.
    pub address: ObjectAddress,
    /// The data type.
    pub data_type: DataType,
    /// The name for people.
    pub name: &'static str,
}

impl Object {
    /// The object `index:subindex`.
    pub const fn new(index: u16, subindex: u8, data_type: DataType, name: &'static str) -> Self {
        Self { address: ObjectAddress::new(index, subindex), data_type, name }
    }

    /// A value as text: identifiers, words and masks in hexadecimal, quantities in decimal.
    pub fn show(&self, value: i64) -> String {
        let is_pattern = matches!(
            self.address.index,
            0x1000 | 0x1005 | 0x1016 | 0x1018 | 0x1400..=0x1BFF | 0x603F | 0x6040 | 0x6041 | 0x6502
        );
        if is_pattern && value >= 0 && self.data_type.length() > 1 {
            format!("0x{value:0width$X}", width = 2 * self.data_type.length())
        } else {
            value.to_string()
        }
    }
}

impl fmt::Display for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.address, self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TYPES: [DataType; 6] =
        [DataType::U8, DataType::I8, DataType::U16, DataType::I16, DataType::U32, DataType::I32];

    proptest! {
        #[test]
        fn a_value_that_fits_a_type_survives_encoding(value: i64, data_type in 0..TYPES.len(), shift in 0..64u32) {
            let (value, data_type) = (value >> shift, TYPES[data_type]);
            if let Some(bytes) = data_type.encode(value) {
                prop_assert_eq!(bytes.len(), data_type.length());
                prop_assert_eq!(data_type.decode(&bytes), Some(value));
            }
        }

        #[test]
        fn a_wrong_number_of_bytes_is_not_decoded(bytes in prop::collection::vec(any::<u8>(), 0..10)) {
            for data_type in TYPES {
                prop_assert_eq!(data_type.decode(&bytes).is_some(), bytes.len() == data_type.length());
            }
        }
    }

    #[test]
    fn values_outside_a_type_are_refused() {
        assert_eq!(DataType::U16.encode(70_000), None);
        assert_eq!(DataType::I8.encode(-129), None);
        assert_eq!(DataType::U32.encode(-1), None);
    }

    #[test]
    fn identifiers_are_shown_in_hexadecimal_and_quantities_in_decimal() {
        let cob_id = Object::new(0x1400, 1, DataType::U32, "RPDO COB-ID");
        let velocity = Object::new(0x60FF, 0, DataType::I32, "target velocity");
        assert_eq!(cob_id.show(0x8000_0202), "0x80000202");
        assert_eq!(velocity.show(-5566), "-5566");
        assert_eq!(cob_id.to_string(), "1400:01 (RPDO COB-ID)");
    }
}
