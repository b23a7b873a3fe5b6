//! Fields of frames, bit by bit: slow, plain, and independent of the codec of the cycle.

use takt_rt::{BitRange, ByteOrder, Number};
use takt_wire::bit_fields::FieldDescription;

/// The place of a bit: byte, and bit of the byte counted from its lowest one.
fn place(bit: usize, order: ByteOrder) -> (usize, usize) {
    match order {
        ByteOrder::BigEndian => (bit / 8, 7 - bit % 8),
        ByteOrder::LittleEndian => (bit / 8, bit % 8),
    }
}

/// The bits of a range, the most significant one first.
fn places(range: BitRange, order: ByteOrder) -> impl Iterator<Item = (usize, usize)> {
    let (first, width) = (usize::from(range.at), usize::from(range.width));
    (0..width).map(move |step| match order {
        ByteOrder::BigEndian => place(first + step, order),
        ByteOrder::LittleEndian => place(first + width - 1 - step, order),
    })
}

/// The bits of a field, the most significant one first.
fn all<V>(field: &FieldDescription<V>, order: ByteOrder) -> impl Iterator<Item = (usize, usize)> {
    places(field.bits.high, order).chain(field.bits.low.into_iter().flat_map(move |low| places(low, order)))
}

/// The number in a field of a payload.
pub fn read<V>(field: &FieldDescription<V>, order: ByteOrder, payload: &[u8]) -> f64 {
    let bits = all(field, order).fold(0u64, |bits, (byte, bit)| {
        let one = payload.get(byte).map_or(0, |byte| byte >> bit & 1);
        bits << 1 | u64::from(one)
    });
    match field.number {
        Number::Float => f32::from_bits(bits as u32).into(),
        Number::Unsigned => bits as f64,
        Number::Signed => {
            let is_negative = bits >> (field.width() - 1) & 1 == 1;
            bits as f64 - if is_negative { f64::from(field.width()).exp2() } else { 0.0 }
        }
    }
}

/// Writes a number into a field of a payload: the nearest one that it can have.
pub fn write<V>(field: &FieldDescription<V>, order: ByteOrder, number: f64, payload: &mut [u8]) {
    let (lowest, highest) = field.code_range();
    let number = number.clamp(lowest, highest);
    let bits = match field.number {
        Number::Float => u64::from((number as f32).to_bits()),
        Number::Unsigned | Number::Signed => number.round() as i64 as u64,
    };
    let width = field.width();
    for ((byte, bit), place) in all(field, order).zip(1..) {
        let one = (bits >> (width - place) & 1) as u8;
        if let Some(byte) = payload.get_mut(byte) {
            *byte = *byte & !(1 << bit) | one << bit;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use takt_rt::{
        BitField, CommandValue, CommandValues, FieldBits, FieldFrame, FrameFormat, Id, LinearScale,
    };

    use takt_wire::bit_fields::{Amount, DescribedScale, FieldUnit};

    proptest! {
        /// Two codecs that have nothing in common agree.
        #[test]
        fn the_bits_are_those_of_the_cycles_codec(
            at in 0..40u16,
            width in 1..33u8,
            low in prop::option::of(1..16u8),
            is_signed in any::<bool>(),
            is_big in any::<bool>(),
            number in -5e9f64..5e9,
        ) {
            let order = if is_big { ByteOrder::BigEndian } else { ByteOrder::LittleEndian };
            let high = BitRange { at, width };
            let low = low.map(|width| BitRange { at: 96, width });
            let bits = FieldBits { high, low };
            let number_kind = if is_signed { Number::Signed } else { Number::Unsigned };
            let scale = DescribedScale { codes: 1.0, are: Amount::Number(1.0), unit: FieldUnit::Codes, zero: 0.0 };
            let field = FieldDescription { value: (), bits, number: number_kind, scale, codes: None };
            let mut payload = [0; 16];
            write(&field, order, number, &mut payload);
            let compiled = BitField {
                value: CommandValue::Position,
                bits,
                number: number_kind,
                scale: LinearScale::ONE,
                codes: None,
            };
            let id = Id::canopen(0, 1);
            let frame = FieldFrame::compile(id, FrameFormat::Fd, 16, order, &[compiled]).unwrap();
            let mut values = CommandValues::default();
            values.set(CommandValue::Position, number);
            let by_cycle = frame.frame(&values);
            prop_assert_eq!(by_cycle.payload(), payload);
            let (lowest, highest) = field.code_range();
            prop_assert_eq!(read(&field, order, &payload), number.clamp(lowest, highest).round());
        }
    }
}
