//! Values of objects: their text in files, and their bytes in SDO transfers.

use super::data_type::{DataTypeCode, ValueKind};
use super::number::{self, Anomaly, Number};

/// A value in a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// An integer, of an integer type or of an unknown type.
    Number(Number),
    /// A floating-point number.
    Real(f64),
    /// A text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
}

/// Why a text is not a value of a type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ValueError {
    /// It is not a number.
    NotANumber,
    /// It is not a list of bytes in hexadecimal.
    NotBytes,
    /// The number is outside the range of the type.
    OutOfRange { value: i128 },
}

impl Value {
    /// Parses a value of a type.
    pub(super) fn read(
        text: &str,
        data_type: Option<DataTypeCode>,
    ) -> Result<(Self, Option<Anomaly>), ValueError> {
        match data_type.map_or(ValueKind::Other, DataTypeCode::kind) {
            ValueKind::Text => Ok((Self::Text(text.to_owned()), None)),
            ValueKind::Bytes => {
                bytes(text).map(|bytes| (Self::Bytes(bytes), None)).ok_or(ValueError::NotBytes)
            }
            ValueKind::Real(bits) => {
                real(text, bits).map(|real| (Self::Real(real), None)).ok_or(ValueError::NotANumber)
            }
            ValueKind::Unsigned(_) | ValueKind::Signed(_) => whole(text, data_type),
            ValueKind::Other => Ok(match number::read(text) {
                Some(parsed) => (Self::Number(parsed.number), parsed.anomaly),
                None => (Self::Text(text.to_owned()), None),
            }),
        }
    }

    /// The integer for a node ID, if it is one.
    pub fn number(&self, node: Option<u8>) -> Option<i128> {
        match self {
            Self::Number(number) => number.at(node),
            _ => None,
        }
    }

    /// The little-endian bytes of an SDO transfer. `None`: the value needs a node ID and none is given, it does not fit
    /// the type, or the type has no such values.
    pub fn encode(&self, data_type: DataTypeCode, node: Option<u8>) -> Option<Vec<u8>> {
        match (self, data_type.kind()) {
            (Self::Number(number), ValueKind::Unsigned(bits) | ValueKind::Signed(bits)) => {
                let value = number.at(node)?;
                let (low, high) = data_type.range()?;
                let length = usize::from(bits).div_ceil(8);
                (low..=high).contains(&value).then(|| value.to_le_bytes().into_iter().take(length).collect())
            }
            (Self::Real(real), ValueKind::Real(32)) => Some((*real as f32).to_le_bytes().into()),
            (Self::Real(real), ValueKind::Real(_)) => Some(real.to_le_bytes().into()),
            (Self::Text(text), ValueKind::Text) if data_type == DataTypeCode::UNICODE_STRING => {
                Some(text.encode_utf16().flat_map(u16::to_le_bytes).collect())
            }
            // VISIBLE_STRING is ISO 646: other characters cannot be encoded.
            (Self::Text(text), ValueKind::Text) => text.is_ascii().then(|| text.clone().into_bytes()),
            (Self::Bytes(bytes), ValueKind::Bytes) => Some(bytes.clone()),
            _ => None,
        }
    }
}

fn whole(text: &str, data_type: Option<DataTypeCode>) -> Result<(Value, Option<Anomaly>), ValueError> {
    let parsed = number::read(text).ok_or(ValueError::NotANumber)?;
    let Some((low, high)) = data_type.and_then(DataTypeCode::range) else {
        return Ok((Value::Number(parsed.number), parsed.anomaly));
    };
    let mut number = parsed.number;
    let width = high - low + 1;
    // A bit pattern: its upper half are the negative numbers.
    if parsed.is_pattern && low < 0 && number.constant > high && number.constant < width {
        number.constant -= width;
    }
    // The value must also fit with the highest node ID.
    let highest = number.constant + if number.adds_node { 127 } else { 0 };
    if number.constant < low || highest > high {
        return Err(ValueError::OutOfRange { value: number.constant });
    }
    Ok((Value::Number(number), parsed.anomaly))
}

/// Parses a real number. Hexadecimal is its bit pattern.
fn real(text: &str, bits: u8) -> Option<f64> {
    if let Some(parsed) = number::read(text).filter(|parsed| parsed.is_pattern) {
        let pattern = parsed.number.at(None)?;
        return Some(match bits {
            32 => f32::from_bits(u32::try_from(pattern).ok()?).into(),
            _ => f64::from_bits(u64::try_from(pattern).ok()?),
        });
    }
    // A literal of C may have the suffix of a float.
    text.parse().or_else(|_| text.trim_end_matches(['f', 'F']).parse()).ok()
}

/// Parses pairs of hexadecimal digits, with or without blanks between them, optionally after `0x`.
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

    const INTEGER32: DataTypeCode = DataTypeCode(0x04);
    const REAL32: DataTypeCode = DataTypeCode(0x08);

    fn encoded(text: &str, data_type: DataTypeCode) -> Result<Option<Vec<u8>>, ValueError> {
        Value::read(text, Some(data_type)).map(|(value, _)| value.encode(data_type, Some(2)))
    }

    #[test]
    fn numbers_are_encoded_with_the_length_of_their_type() {
        assert_eq!(encoded("$NODEID+0x180", DataTypeCode::UNSIGNED32), Ok(Some(vec![0x82, 1, 0, 0])));
        assert_eq!(encoded("-2", INTEGER32), Ok(Some(vec![0xFE, 0xFF, 0xFF, 0xFF])));
        assert_eq!(encoded("0xFFFFFFFE", INTEGER32), Ok(Some(vec![0xFE, 0xFF, 0xFF, 0xFF])));
        assert_eq!(encoded("1", DataTypeCode(0x01)), Ok(Some(vec![1])));
        assert_eq!(encoded("0x123456", DataTypeCode(0x16)), Ok(Some(vec![0x56, 0x34, 0x12])));
    }

    #[test]
    fn numbers_outside_the_range_of_their_type_are_refused() {
        assert_eq!(encoded("256", DataTypeCode::UNSIGNED8), Err(ValueError::OutOfRange { value: 256 }));
        assert_eq!(encoded("-1", DataTypeCode::UNSIGNED8), Err(ValueError::OutOfRange { value: -1 }));
        assert_eq!(encoded("4294967295", INTEGER32), Err(ValueError::OutOfRange { value: 4_294_967_295 }));
        assert_eq!(
            encoded("$NODEID+200", DataTypeCode::UNSIGNED8),
            Err(ValueError::OutOfRange { value: 200 })
        );
        assert_eq!(encoded("fast", INTEGER32), Err(ValueError::NotANumber));
    }

    #[test]
    fn reals_texts_and_bytes_have_their_own_notations() {
        assert_eq!(encoded("1.5", REAL32), Ok(Some(1.5_f32.to_le_bytes().into())));
        assert_eq!(encoded("1.5f", REAL32), Ok(Some(1.5_f32.to_le_bytes().into())));
        assert_eq!(encoded("0x3FC00000", REAL32), Ok(Some(1.5_f32.to_le_bytes().into())));
        assert_eq!(encoded("abc", DataTypeCode(0x09)), Ok(Some(b"abc".into())));
        assert_eq!(encoded("ab", DataTypeCode::UNICODE_STRING), Ok(Some(b"a\0b\0".into())));
        assert_eq!(encoded("01 a0 FF", DataTypeCode(0x0A)), Ok(Some(vec![0x01, 0xA0, 0xFF])));
        assert_eq!(encoded("01a", DataTypeCode(0x0A)), Err(ValueError::NotBytes));
    }
}
