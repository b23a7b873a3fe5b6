//! The longest time that a frame can take on the wire: every field of its format, the most stuff bits that these fields can need,
//! and the intermission, which no other frame can use.

use takt_rt::FrameKind;

/// The properties of a frame that decide its longest time on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameShape {
    /// Its kind.
    pub kind: FrameKind,
    /// True if its identifier has 29 bits.
    pub is_extended: bool,
    /// Its length in bytes, as in its length code.
    pub length: usize,
}

impl FrameShape {
    /// A classic data frame with an 11-bit identifier.
    pub const fn classic(length: usize) -> Self {
        Self { kind: FrameKind::Data, is_extended: false, length }
    }
}

/// The bits of a frame at each of both bit rates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitCount {
    /// Bits at the nominal bit rate.
    pub nominal: u32,
    /// Bits at the bit rate of the data phase.
    pub data: u32,
}

/// The bits that are never stuffed: CRC delimiter, acknowledge slot and its delimiter, end of frame, intermission.
const TAIL: u32 = 1 + 1 + 1 + 7 + 3;

/// The most bits that a frame of this shape can have, intermission included.
///
/// Classic frames: start of frame, identifier, RTR, IDE and reserved bits, length code, data and CRC are stuffed. Beside the data
/// these are 54 bits with a 29-bit identifier, and 34 otherwise. S such bits need at most (S − 1) / 4 stuff bits, because a
/// stuff bit is the first of the next five bits (Davis, Burns, Bril and Lukkien, Real-Time Systems 35, 2007).
///
/// CAN FD (ISO 11898-1:2015): the same rule holds from the start of frame to the end of the data. Then follow the stuff count with
/// its parity (4 bits) and a CRC of 17 bits (21 above 16 bytes), with a fixed stuff bit before them and after every
/// fourth bit. The bit rate changes within BRS and within the CRC delimiter. Both bits count as nominal here.
pub fn worst_case_bits(shape: FrameShape) -> BitCount {
    let length = u32::try_from(shape.length).unwrap_or(u32::MAX / 16);
    match shape.kind {
        FrameKind::Data => BitCount { nominal: classic_bits(shape.is_extended, length), data: 0 },
        FrameKind::Remote => BitCount { nominal: classic_bits(shape.is_extended, 0), data: 0 },
        FrameKind::FdBitRateSwitch => flexible_bits(shape.is_extended, length),
        FrameKind::Fd => {
            let BitCount { nominal, data } = flexible_bits(shape.is_extended, length);
            BitCount { nominal: nominal + data, data: 0 }
        }
    }
}

fn classic_bits(is_extended: bool, data_bytes: u32) -> u32 {
    let stuffable = if is_extended { 54 } else { 34 } + 8 * data_bytes;
    stuffable + most_stuff_bits(stuffable) + TAIL
}

fn flexible_bits(is_extended: bool, data_bytes: u32) -> BitCount {
    // Start of frame, identifier, (SRR, IDE, 18 bits,) RRS, IDE or none, FDF, res, BRS.
    let head = if is_extended { 36 } else { 17 };
    // ESI and length code.
    let body = 1 + 4 + 8 * data_bytes;
    let stuff_in_head = most_stuff_bits(head);
    let stuff_in_body = most_stuff_bits(head + body) - stuff_in_head;
    let check = 4 + if data_bytes > 16 { 21 } else { 17 };
    let fixed_stuff = 1 + check / 4;
    BitCount { nominal: head + stuff_in_head + TAIL, data: body + stuff_in_body + check + fixed_stuff }
}

fn most_stuff_bits(stuffable: u32) -> u32 {
    (stuffable - 1) / 4
}

/// The bit rates of a bus in bit/s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRates {
    /// The bit rate of classic frames and of the arbitration phase.
    pub nominal: u32,
    /// The bit rate of the data phase of CAN FD frames with bit-rate switching.
    pub data: u32,
}

impl BitRates {
    /// The duration of these bits, rounded up to whole nanoseconds.
    pub fn duration_ns(self, bits: BitCount) -> u64 {
        bits_ns(bits.nominal, self.nominal) + bits_ns(bits.data, self.data)
    }

    /// The duration of one bit of the arbitration phase, rounded up to whole nanoseconds.
    pub fn bit_ns(self) -> u64 {
        bits_ns(1, self.nominal)
    }
}

fn bits_ns(bits: u32, bit_rate: u32) -> u64 {
    (u64::from(bits) * 1_000_000_000).div_ceil(u64::from(bit_rate.max(1)))
}

/// Counts the stuff bits that a transmitter inserts, bit by bit as the standard says: what faster ways are tested against.
#[cfg(test)]
pub(crate) fn stuff_bits_of(bits: &[bool]) -> u32 {
    let (mut last, mut run, mut stuffed) = (None, 0, 0);
    for &bit in bits {
        run = if last == Some(bit) { run + 1 } else { 1 };
        last = Some(bit);
        if run == 5 {
            stuffed += 1;
            last = Some(!bit);
            run = 1;
        }
    }
    stuffed
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn nominal(kind: FrameKind, is_extended: bool, length: usize) -> u32 {
        worst_case_bits(FrameShape { kind, is_extended, length }).nominal
    }

    #[test]
    fn classic_frames_are_as_long_as_the_published_formula_says() {
        for (length, bits) in [(0, 55), (1, 65), (4, 95), (6, 115), (7, 125), (8, 135)] {
            assert_eq!(worst_case_bits(FrameShape::classic(length)), BitCount { nominal: bits, data: 0 });
        }
        for length in 0..=8 {
            let data = 8 * length as u32;
            assert_eq!(nominal(FrameKind::Data, false, length), data + 47 + (34 + data - 1) / 4);
            assert_eq!(nominal(FrameKind::Data, true, length), data + 67 + (54 + data - 1) / 4);
        }
        assert_eq!(nominal(FrameKind::Data, true, 8), 160);
    }

    #[test]
    fn a_remote_frame_is_as_long_as_an_empty_one() {
        assert_eq!(nominal(FrameKind::Remote, false, 8), 55);
    }

    #[test]
    fn flexible_frames_have_their_fields_counted_once() {
        let bits = |length| {
            let shape = FrameShape { kind: FrameKind::FdBitRateSwitch, is_extended: false, length };
            worst_case_bits(shape)
        };
        // Head 17 + 4 stuff bits, tail 13; body 5 + data + stuff, 4 + 17 check bits with 6 fixed ones.
        assert_eq!(bits(0), BitCount { nominal: 34, data: 5 + 1 + 4 + 17 + 6 });
        assert_eq!(bits(8), BitCount { nominal: 34, data: 69 + 17 + 4 + 17 + 6 });
        assert_eq!(bits(16), BitCount { nominal: 34, data: 133 + 33 + 4 + 17 + 6 });
        // 21 CRC bits with 7 fixed stuff bits from 20 bytes on.
        assert_eq!(bits(20), BitCount { nominal: 34, data: 165 + 41 + 4 + 21 + 7 });
        assert_eq!(bits(64), BitCount { nominal: 34, data: 517 + 129 + 4 + 21 + 7 });
        assert_eq!(nominal(FrameKind::Fd, false, 64), 34 + 678);
    }

    #[test]
    fn times_follow_from_both_bit_rates() {
        let rates = BitRates { nominal: 1_000_000, data: 5_000_000 };
        assert_eq!(rates.duration_ns(worst_case_bits(FrameShape::classic(6))), 115_000);
        assert_eq!(rates.duration_ns(BitCount { nominal: 34, data: 678 }), 34_000 + 135_600);
        assert_eq!(BitRates { nominal: 800_000, data: 800_000 }.bit_ns(), 1_250);
        assert_eq!(BitRates { nominal: 3_000_000, data: 3_000_000 }.bit_ns(), 334);
    }

    #[test]
    fn the_most_stuff_bits_are_reached_by_a_first_run_of_five_and_runs_of_four() {
        for length in 1..700u32 {
            let worst: Vec<bool> = (0..length).map(|at| at > 0 && (at - 1) / 4 % 2 == 1).collect();
            assert_eq!(stuff_bits_of(&worst), most_stuff_bits(length), "{length} bits");
        }
    }

    proptest! {
        #[test]
        fn no_bits_need_more_stuff_bits_than_the_most(
            runs in proptest::collection::vec(1usize..7, 1..100), first: bool,
        ) {
            let bits: Vec<bool> = runs.iter().enumerate()
                .flat_map(|(index, &run)| std::iter::repeat_n(first ^ (index % 2 == 1), run))
                .collect();
            prop_assert!(stuff_bits_of(&bits) <= most_stuff_bits(bits.len() as u32));
        }
    }
}
