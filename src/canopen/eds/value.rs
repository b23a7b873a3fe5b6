//! Values of objects: as files write them, and as SDO carries them.

use super::data_type::{DataType, ValueKind};
use super::number::{self, Number, Oddity};

/// A value as a file says it.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A whole number, of any type of whole numbers, or of an object whose type is not known.
    Number(Number),
    /// A floating-point number.
    Real(f64),
    /// A text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
}

/// Why a text is no value of a type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Misfit {
    /// It is no number.
    NotANumber,
    /// It is no list of bytes in hexadecimal.
    NotBytes,
    /// The number is outside the type.
    OutOfRange { value: i128 },
}

impl Value {
    /// Reads a value of a type.
    pub(super) fn read(text: &str, data_type: Option<DataType>) -> Result<(Self, Option<Oddity>), Misfit> {
        match data_type.map_or(ValueKind::Other, DataType::kind) {
            ValueKind::Text => Ok((Self::Text(text.to_owned()), None)),
            ValueKind::Bytes => bytes(text).map(|bytes| (Self::Bytes(bytes), None)).ok_or(Misfit::NotBytes),
            ValueKind::Real(bits) => {
                real(text, bits).map(|real| (Self::Real(real), None)).ok_or(Misfit::NotANumber)
            }
            ValueKind::Unsigned(_) | ValueKind::Signed(_) => whole(text, data_type),
            ValueKind::Other => Ok(match number::read(text) {
                Some(reading) => (Self::Number(reading.number), reading.oddity),
                None => (Self::Text(text.to_owned()), None),
            }),
        }
    }

    /// The number for a node, where it is a whole one.
    pub fn number(&self, node: Option<u8>) -> Option<i128> {
        match self {
            Self::Number(number) => number.at(node),
            _ => None,
        }
    }

    /// The bytes that SDO carries, low byte first; `None` when the value depends on a node and none is given, when it does
    /// not fit the type, or when the type has no such values.
    pub fn encode(&self, data_type: DataType, node: Option<u8>) -> Option<Vec<u8>> {
        match (self, data_type.kind()) {
            (Self::Number(number), ValueKind::Unsigned(bits) | ValueKind::Signed(bits)) => {
                let value = number.at(node)?;
                let (low, high) = data_type.range()?;
                let length = usize::from(bits).div_ceil(8);
                (low..=high).contains(&value).then(|| value.to_le_bytes().into_iter().take(length).collect())
            }
            (Self::Real(real), ValueKind::Real(32)) => Some((*real as f32).to_le_bytes().into()),
            (Self::Real(real), ValueKind::Real(_)) => Some(real.to_le_bytes().into()),
            (Self::Text(text), ValueKind::Text) if data_type == DataType::UNICODE_STRING => {
                Some(text.encode_utf16().flat_map(u16::to_le_bytes).collect())
            }
            // VISIBLE_STRING is ISO 646: what is beyond has no bytes.
            (Self::Text(text), ValueKind::Text) => text.is_ascii().then(|| text.clone().into_bytes()),
            (Self::Bytes(bytes), ValueKind::Bytes) => Some(bytes.clone()),
            _ => None,
        }
    }
}

fn whole(text: &str, data_type: Option<DataType>) -> Result<(Value, Option<Oddity>), Misfit> {
    let reading = number::read(text).ok_or(Misfit::NotANumber)?;
    let Some((low, high)) = data_type.and_then(DataType::range) else {
        return Ok((Value::Number(reading.number), reading.oddity));
    };
    let mut number = reading.number;
    let width = high - low + 1;
    // A pattern of bits: the upper half of them are the negative numbers.
    if reading.is_pattern && low < 0 && number.constant > high && number.constant < width {
        number.constant -= width;
    }
    // The highest node number must fit too.
    let highest = number.constant + if number.adds_node { 127 } else { 0 };
    if number.constant < low || highest > high {
        return Err(Misfit::OutOfRange { value: number.constant });
    }
    Ok((Value::Number(number), reading.oddity))
}

/// Hexadecimal is the pattern of bits.
fn real(text: &str, bits: u8) -> Option<f64> {
    if let Some(reading) = number::read(text).filter(|reading| reading.is_pattern) {
        let pattern = reading.number.at(None)?;
        return Some(match bits {
            32 => f32::from_bits(u32::try_from(pattern).ok()?).into(),
            _ => f64::from_bits(u64::try_from(pattern).ok()?),
        });
    }
    text.parse().ok()
}

/// Pairs of hexadecimal digits, with or without blanks between them, perhaps after `0x`.
fn bytes(text: &str) -> Option<Vec<u8>> {
    let text = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")).unwrap_or(text);
    let digits: Vec<u32> =
        text.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_digit(16)).collect::<Option<_>>()?;
    if !digits.len().is_multiple_of(2) {
        return None;
    }
    Some(
        digits
            .chunks_exact(2)
            .map(|pair| pair.iter().fold(0, |byte, digit| byte << 4 | *digit as u8))
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTEGER32: DataType = DataType(0x04);
    const REAL32: DataType = DataType(0x08);

    fn encoded(text: &str, data_type: DataType) -> Result<Option<Vec<u8>>, Misfit> {
        Value::read(text, Some(data_type)).map(|(value, _)| value.encode(data_type, Some(2)))
    }

    #[test]
    fn numbers_become_as_many_bytes_as_their_type_has() {
        assert_eq!(encoded("$NODEID+0x180", DataType::UNSIGNED32), Ok(Some(vec![0x82, 1, 0, 0])));
        assert_eq!(encoded("-2", INTEGER32), Ok(Some(vec![0xFE, 0xFF, 0xFF, 0xFF])));
        assert_eq!(encoded("0xFFFFFFFE", INTEGER32), Ok(Some(vec![0xFE, 0xFF, 0xFF, 0xFF])));
        assert_eq!(encoded("1", DataType(0x01)), Ok(Some(vec![1])));
        assert_eq!(encoded("0x123456", DataType(0x16)), Ok(Some(vec![0x56, 0x34, 0x12])));
    }

    #[test]
    fn numbers_outside_their_type_are_refused() {
        assert_eq!(encoded("256", DataType::UNSIGNED8), Err(Misfit::OutOfRange { value: 256 }));
        assert_eq!(encoded("-1", DataType::UNSIGNED8), Err(Misfit::OutOfRange { value: -1 }));
        assert_eq!(encoded("4294967295", INTEGER32), Err(Misfit::OutOfRange { value: 4_294_967_295 }));
        assert_eq!(encoded("$NODEID+200", DataType::UNSIGNED8), Err(Misfit::OutOfRange { value: 200 }));
        assert_eq!(encoded("fast", INTEGER32), Err(Misfit::NotANumber));
    }

    #[test]
    fn reals_texts_and_bytes_have_their_own_forms() {
        assert_eq!(encoded("1.5", REAL32), Ok(Some(1.5_f32.to_le_bytes().into())));
        assert_eq!(encoded("0x3FC00000", REAL32), Ok(Some(1.5_f32.to_le_bytes().into())));
        assert_eq!(encoded("abc", DataType(0x09)), Ok(Some(b"abc".into())));
        assert_eq!(encoded("ab", DataType::UNICODE_STRING), Ok(Some(b"a\0b\0".into())));
        assert_eq!(encoded("01 a0 FF", DataType(0x0A)), Ok(Some(vec![0x01, 0xA0, 0xFF])));
        assert_eq!(encoded("01a", DataType(0x0A)), Err(Misfit::NotBytes));
    }
}
