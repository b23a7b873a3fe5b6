//! The layout of a frame of bit fields: described as data, checked, and compiled to shifts and masks.

use core::fmt;

use arrayvec::ArrayVec;

use super::values::FieldValue;

/// The longest frame with a layout, in bytes.
pub const MAX_FIELD_BYTES: usize = 16;
/// The most fields in a frame.
pub const MAX_FIELDS: usize = 12;
/// The widest integer: a 64-bit floating-point number holds it without rounding.
const WIDEST_BITS: u32 = 53;
/// The width of [`Number::Float`].
const FLOAT_BITS: u32 = 32;

/// A field of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BitField<V> {
    /// What it carries.
    pub value: V,
    /// Where it lies.
    pub bits: FieldBits,
    /// What kind of number it is.
    pub number: Number,
    /// How a value becomes that number.
    pub scale: LinearScale,
    /// The codes that may be sent, where not all of them may; what is beyond is limited to them.
    pub codes: Option<CodeRange>,
}

/// Where a field lies: in one range of bits, or in two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldBits {
    /// Its bits, or the higher ones.
    pub high: BitRange,
    /// Its lower bits, where they lie elsewhere.
    pub low: Option<BitRange>,
}

/// Neighbouring bits, counted as [`ByteOrder`] says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRange {
    /// The first bit, from 0.
    pub at: u16,
    /// How many.
    pub width: u8,
}

impl FieldBits {
    /// `width` bits from bit `at` on.
    pub const fn of(at: u16, width: u8) -> Self {
        Self { high: BitRange { at, width }, low: None }
    }

    /// The higher bits there, the lower ones here.
    pub const fn split(high: BitRange, low: BitRange) -> Self {
        Self { high, low: Some(low) }
    }
}

/// The order of the bytes of all fields of a frame, by which their bits are counted, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum ByteOrder {
    /// The most significant byte comes first. Bit 0 is the highest bit of byte 0, and a field begins with its highest bit.
    BigEndian,
    /// The least significant byte comes first. Bit 0 is the lowest bit of byte 0, and a field begins with its lowest bit.
    LittleEndian,
}

/// What kind of number a field is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum Number {
    /// An integer without a sign.
    Unsigned,
    /// An integer in two's complement.
    Signed,
    /// An IEEE 754 number of 32 bits.
    Float,
}

/// A value becomes the number `value · codes_per_unit + zero_code`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearScale {
    /// Codes for one unit of the value. Not zero; negative where the drive counts the other way.
    pub codes_per_unit: f64,
    /// The code of zero.
    pub zero_code: f64,
}

impl LinearScale {
    /// The code is the value.
    pub const ONE: Self = Self { codes_per_unit: 1.0, zero_code: 0.0 };

    /// A signed value as an unsigned number of `bits` bits, whose middle is zero: so many units are half of the range.
    pub const fn centred(bits: u8, full_scale: f64) -> Self {
        let half = (1u64 << ((bits as u32).saturating_sub(1) & 63)) as f64;
        Self { codes_per_unit: half / full_scale, zero_code: half }
    }
}

/// A range of codes, with both ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodeRange {
    /// The lowest code.
    pub lowest: i64,
    /// The highest code.
    pub highest: i64,
}

/// Why a layout cannot be. Fields are named by their place in the list, from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LayoutError {
    /// More than [`MAX_FIELDS`] fields.
    TooManyFields {
        /// How many were given.
        given: usize,
    },
    /// The frame has no byte, more than [`MAX_FIELD_BYTES`], or a length that its kind of frame does not have.
    Length {
        /// The length in bytes.
        bytes: usize,
    },
    /// A field of no bit, of more than 53, or a floating-point number that has not 32.
    Width {
        /// The field.
        field: usize,
        /// Its width in bits.
        bits: u32,
    },
    /// A field ends beyond the frame.
    Outside {
        /// The field.
        field: usize,
        /// The bit behind its last one.
        end: u32,
        /// The bits of the frame.
        bits: u32,
    },
    /// Two fields have a bit in common, or the two ranges of one field have.
    Overlap {
        /// The field that comes second.
        field: usize,
        /// The other one, which may be the same.
        with: usize,
    },
    /// Two fields carry the same value.
    Repeated {
        /// The field that comes second.
        field: usize,
    },
    /// A scale of zero, or with what is no finite number.
    Scale {
        /// The field.
        field: usize,
    },
    /// The codes that may be sent are not among those of the field, or are none.
    Codes {
        /// The field.
        field: usize,
        /// The codes.
        codes: CodeRange,
    },
}

impl core::error::Error for LayoutError {}

impl fmt::Display for LayoutError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooManyFields { given } => {
                write!(f, "{given} fields, but a frame takes no more than {MAX_FIELDS}")
            }
            Self::Length { bytes } => write!(f, "no such frame has {bytes} bytes"),
            Self::Width { field, bits } => write!(
                f,
                "field {field} is {bits} bits wide: expected 1 to {WIDEST_BITS}, or {FLOAT_BITS} for a floating-point number"
            ),
            Self::Outside { field, end, bits } => {
                write!(f, "field {field} ends at bit {end}, but the frame has {bits} bits")
            }
            Self::Overlap { field, with } if field == with => {
                write!(f, "the two ranges of field {field} have a bit in common")
            }
            Self::Overlap { field, with } => write!(f, "fields {with} and {field} have a bit in common"),
            Self::Repeated { field } => {
                write!(f, "field {field} carries what an earlier one carries already")
            }
            Self::Scale { field } => {
                write!(
                    f,
                    "the scale of field {field} must be of finite numbers, and its codes per unit not zero"
                )
            }
            Self::Codes { field, codes: CodeRange { lowest, highest } } => {
                write!(f, "field {field} cannot have all codes from {lowest} to {highest}")
            }
        }
    }
}

/// Neighbouring bits, compiled: `mask` bits of the payload from bit `shift`, which are the bits of the code from bit `above`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
struct Part {
    shift: u8,
    above: u8,
    mask: u64,
}

/// A field, compiled.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
struct Field {
    slot: u8,
    width: u8,
    number: Number,
    parts: [Part; 2],
    codes_per_unit: f64,
    zero_code: f64,
    lowest: f64,
    highest: f64,
}

/// The compiled layout of a frame.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct FrameLayout {
    fields: ArrayVec<Field, MAX_FIELDS>,
    bytes: u8,
    order: ByteOrder,
}

impl FrameLayout {
    /// Compiles the layout of a frame of `bytes` bytes. Bits without a field are sent as zero.
    ///
    /// # Errors
    /// What is wrong with a field, and which it is.
    pub fn compile<V: FieldValue>(
        bytes: usize,
        order: ByteOrder,
        fields: &[BitField<V>],
    ) -> Result<Self, LayoutError> {
        if !(1..=MAX_FIELD_BYTES).contains(&bytes) {
            return Err(LayoutError::Length { bytes });
        }
        let mut taken: ArrayVec<u128, MAX_FIELDS> = ArrayVec::new();
        let mut compiled = ArrayVec::new();
        for (field, own) in fields.iter().enumerate() {
            let (fields_before, full) = (fields.get(..field).unwrap_or_default(), fields.len());
            if !own.value.may_repeat()
                && fields_before.iter().any(|other| other.value.slot() == own.value.slot())
            {
                return Err(LayoutError::Repeated { field });
            }
            let parts = parts_of(field, &own.bits, bytes, order)?;
            let [high, low] = parts.map(|part| u128::from(part.mask) << part.shift);
            if high & low != 0 {
                return Err(LayoutError::Overlap { field, with: field });
            }
            if let Some(with) = taken.iter().position(|other| other & (high | low) != 0) {
                return Err(LayoutError::Overlap { field, with });
            }
            let too_many = LayoutError::TooManyFields { given: full };
            taken.try_push(high | low).map_err(|_| too_many)?;
            compiled.try_push(compiled_field(field, own, parts)?).map_err(|_| too_many)?;
        }
        Ok(Self { fields: compiled, bytes: bytes as u8, order })
    }

    /// The length of the frame in bytes.
    pub fn length(&self) -> usize {
        self.bytes.into()
    }

    /// Returns `true` if a field has this slot.
    pub(super) fn carries(&self, slot: u8) -> bool {
        self.fields.iter().any(|field| field.slot == slot)
    }

    /// What one code of a field is, in the unit of its value; 0 where there is no such field, or codes are not whole numbers.
    pub(super) fn unit_of(&self, slot: u8) -> f64 {
        let is_counted = |field: &&Field| field.slot == slot && field.number != Number::Float;
        self.fields.iter().find(is_counted).map_or(0.0, |field| 1.0 / field.codes_per_unit)
    }

    /// Packs values, each by the slot of its field. The first [`FrameLayout::length`] bytes count.
    #[inline]
    pub(super) fn pack(&self, values: &[f64]) -> [u8; MAX_FIELD_BYTES] {
        let mut word = 0;
        for field in &self.fields {
            let code = field.code(values.get(usize::from(field.slot)).copied().unwrap_or(0.0));
            for part in &field.parts {
                word |= u128::from(code >> (part.above & 63) & part.mask) << (part.shift & 127);
            }
        }
        match self.order {
            ByteOrder::BigEndian => word.to_be_bytes(),
            ByteOrder::LittleEndian => word.to_le_bytes(),
        }
    }

    /// Unpacks a payload, each value into the slot of its field.
    ///
    /// # Errors
    /// The field, by its place, that holds no number. Nothing is changed then.
    #[inline]
    pub(super) fn unpack<const N: usize>(&self, payload: &[u8], values: &mut [f64; N]) -> Result<(), usize> {
        let mut bytes = [0; MAX_FIELD_BYTES];
        for (to, from) in bytes.iter_mut().zip(payload) {
            *to = *from;
        }
        let word = match self.order {
            ByteOrder::BigEndian => u128::from_be_bytes(bytes),
            ByteOrder::LittleEndian => u128::from_le_bytes(bytes),
        };
        let mut changed = *values;
        for (place, field) in self.fields.iter().enumerate() {
            let parts = field
                .parts
                .iter()
                .map(|part| ((word >> (part.shift & 127)) as u64 & part.mask) << (part.above & 63));
            let value = field.value(parts.fold(0, |code, part| code | part));
            if !value.is_finite() {
                return Err(place);
            }
            if let Some(to) = changed.get_mut(usize::from(field.slot)) {
                *to = value;
            }
        }
        *values = changed;
        Ok(())
    }
}

impl Field {
    /// The code of a value: the nearest one, or where that is beyond the codes that may be sent, the last of them. What is no
    /// number has the code of zero.
    #[inline]
    fn code(&self, value: f64) -> u64 {
        let value = if value.is_nan() { 0.0 } else { value };
        let code = (value * self.codes_per_unit + self.zero_code).max(self.lowest).min(self.highest);
        match self.number {
            Number::Float => u64::from((code as f32).to_bits()),
            Number::Unsigned | Number::Signed => libm::round(code) as i64 as u64,
        }
    }

    /// The value of a code.
    #[inline]
    fn value(&self, code: u64) -> f64 {
        let unused_bits = 64u32.saturating_sub(self.width.into()) & 63;
        let code = match self.number {
            Number::Float => f32::from_bits(code as u32).into(),
            Number::Unsigned => code as f64,
            Number::Signed => (((code << unused_bits) as i64) >> unused_bits) as f64,
        };
        (code - self.zero_code) / self.codes_per_unit
    }
}

/// The bits of a field, compiled: the higher ones, and the lower ones.
fn parts_of(
    field: usize,
    bits: &FieldBits,
    bytes: usize,
    order: ByteOrder,
) -> Result<[Part; 2], LayoutError> {
    let frame_bits = 8 * bytes as u32;
    let part = |range: BitRange, above: u8| {
        let end = u32::from(range.at) + u32::from(range.width);
        if !(1..=WIDEST_BITS).contains(&range.width.into()) {
            return Err(LayoutError::Width { field, bits: range.width.into() });
        }
        if end > frame_bits {
            return Err(LayoutError::Outside { field, end, bits: frame_bits });
        }
        let shift = match order {
            ByteOrder::BigEndian => 8 * MAX_FIELD_BYTES as u32 - end,
            ByteOrder::LittleEndian => range.at.into(),
        };
        Ok(Part { shift: shift as u8, above, mask: u64::MAX >> (64 - u32::from(range.width)) })
    };
    let low = bits.low.map(|low| part(low, 0)).transpose()?;
    let above = bits.low.map_or(0, |low| low.width);
    Ok([part(bits.high, above)?, low.unwrap_or_default()])
}

fn compiled_field<V: FieldValue>(
    field: usize,
    own: &BitField<V>,
    parts: [Part; 2],
) -> Result<Field, LayoutError> {
    let width = u32::from(own.bits.high.width) + own.bits.low.map_or(0, |low| low.width.into());
    let is_possible = match own.number {
        Number::Float => width == FLOAT_BITS,
        Number::Unsigned | Number::Signed => (1..=WIDEST_BITS).contains(&width),
    };
    if !is_possible {
        return Err(LayoutError::Width { field, bits: width });
    }
    let LinearScale { codes_per_unit, zero_code } = own.scale;
    if !(codes_per_unit.is_finite() && zero_code.is_finite()) || codes_per_unit == 0.0 {
        return Err(LayoutError::Scale { field });
    }
    let all = match own.number {
        Number::Float => (f32::MIN.into(), f32::MAX.into()),
        Number::Unsigned => (0.0, ((1u64 << width) - 1) as f64),
        Number::Signed => (-((1u64 << (width - 1)) as f64), ((1u64 << (width - 1)) - 1) as f64),
    };
    let (lowest, highest) = match own.codes {
        None => all,
        Some(codes) => {
            let (lowest, highest) = (codes.lowest as f64, codes.highest as f64);
            if lowest < all.0 || highest > all.1 || lowest > highest {
                return Err(LayoutError::Codes { field, codes });
            }
            (lowest, highest)
        }
    };
    let (slot, number, width) = (own.value.slot(), own.number, width as u8);
    Ok(Field { slot, width, number, parts, codes_per_unit, zero_code, lowest, highest })
}
