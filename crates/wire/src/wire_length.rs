//! How long a frame is on the wire, bit by bit (ISO 11898-1). The stuff bits are counted from the content of the frame, its
//! CRC included. So two frames with equally many bytes can take different times, as on a real bus.

use takt_rt::{Frame, FrameKind, NANOSECONDS_PER_SECOND, Nanoseconds};

/// Bits between a frame and the next one. Every length here includes them, as in the worst-case formula of Davis, Burns,
/// Bril and Lukkien (Real-Time Systems 35, 2007).
pub const INTERMISSION_BITS: u32 = 3;

/// CRC delimiter, acknowledge slot and its delimiter, end of frame, intermission: never stuffed.
const TAIL_BITS: u32 = 1 + 1 + 1 + 7 + INTERMISSION_BITS;

/// The length of one frame, from the start bit to the end of the intermission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WireLength {
    /// Bits at the bit rate of the arbitration phase.
    pub nominal_bits: u32,
    /// Bits at the bit rate of the data phase; 0 without bit-rate switching.
    pub data_bits: u32,
    /// How many of both were stuffed (CAN FD: also the fixed ones of the CRC field).
    pub stuff_bits: u32,
}

impl WireLength {
    /// Counts the bits of a frame.
    ///
    /// CAN FD: the rate is taken to change after BRS and before the CRC delimiter, at bit boundaries (the
    /// standard changes it at the sample points inside those two bits, which differs by less than one bit).
    /// Fixed stuff bits and the stuff count of the ISO CRC field are included.
    pub fn of(frame: &Frame) -> Self {
        match frame.kind() {
            FrameKind::Data | FrameKind::Remote => Self::classic(frame),
            FrameKind::Fd => Self::flexible(frame, false),
            FrameKind::FdBitRateSwitch => Self::flexible(frame, true),
        }
    }

    /// The time on the wire, intermission included, rounded up to whole nanoseconds. Without a data bit rate
    /// everything runs at `bit_rate` (bit/s).
    pub fn duration_ns(self, bit_rate: u32, data_bit_rate: Option<u32>) -> Nanoseconds {
        let data_bit_rate = data_bit_rate.unwrap_or(bit_rate);
        bits_ns(self.nominal_bits, bit_rate) + bits_ns(self.data_bits, data_bit_rate)
    }

    fn classic(frame: &Frame) -> Self {
        let (head, head_bits) = classic_head(frame);
        let payload_bits = 8 * frame.payload().len() as u32;
        let payload = u128::from(frame.first_word().swap_bytes()) >> (64 - payload_bits);
        let covered = u128::from(head) << payload_bits | payload;
        let covered_bits = head_bits + payload_bits;
        let mut crc = Crc15::default();
        // The register starts at zero, so leading zero bits change nothing and any alignment is right.
        for byte in last_bytes(&covered.to_be_bytes(), covered_bits) {
            crc.push(*byte);
        }
        let stuffed_bits = covered_bits + 15;
        let before = ALTERNATING << stuffed_bits;
        let bits = before | covered << 15 | u128::from(crc.0);
        let mut stuffing = Stuffing::default();
        for byte in last_bytes(&bits.to_be_bytes(), stuffed_bits) {
            stuffing.push_byte(*byte);
        }
        let nominal_bits = stuffed_bits + stuffing.stuffed + TAIL_BITS;
        Self { nominal_bits, data_bits: 0, stuff_bits: stuffing.stuffed }
    }

    fn flexible(frame: &Frame, has_bit_rate_switch: bool) -> Self {
        let (head, head_bits) = flexible_head(frame, has_bit_rate_switch);
        let mut stuffing = Stuffing::default();
        stuffing.push(head, head_bits);
        let head_stuffed = stuffing.stuffed;
        // ESI (error active: dominant) and the length code.
        stuffing.push(length_code(frame.length()).into(), 1 + 4);
        for &byte in frame.payload() {
            stuffing.push_byte(byte);
        }
        // Five equal bits at the very end are broken by the first fixed stuff bit, not by one of their own.
        let body_stuffed = stuffing.stuffed - head_stuffed - u32::from(stuffing.is_just_stuffed);
        // Stuff count and parity (4) and CRC, with a fixed stuff bit in front and after every fourth bit.
        let crc_bits = if frame.length() > 16 { 21 } else { 17 };
        let fixed = 1 + (4 + crc_bits) / 4;
        let body_bits = 1 + 4 + 8 * frame.payload().len() as u32 + body_stuffed + 4 + crc_bits + fixed;
        let outer_bits = head_bits + head_stuffed + TAIL_BITS;
        let stuff_bits = head_stuffed + body_stuffed + fixed;
        if has_bit_rate_switch {
            Self { nominal_bits: outer_bits, data_bits: body_bits, stuff_bits }
        } else {
            Self { nominal_bits: outer_bits + body_bits, data_bits: 0, stuff_bits }
        }
    }
}

/// Bits before a frame that fill its first byte: they end with a recessive one, so that the start bit begins a run, and need no stuffing.
const ALTERNATING: u128 = u128::MAX / 3;

/// The bytes with the low `bits` bits of a number, the highest first.
fn last_bytes(number: &[u8; 16], bits: u32) -> &[u8] {
    &number[number.len() - bits.div_ceil(8) as usize..]
}

/// The time of so many bits, rounded up to whole nanoseconds.
pub fn bits_ns(bits: u32, bit_rate: u32) -> Nanoseconds {
    (u64::from(bits) * NANOSECONDS_PER_SECOND).div_ceil(u64::from(bit_rate.max(1)))
}

/// From the start bit to the length code, and how many bits that is.
fn classic_head(frame: &Frame) -> (u64, u32) {
    let id = u64::from(frame.id().value());
    let remote = u64::from(frame.kind() == FrameKind::Remote);
    let length = frame.length() as u64 & 0xF;
    if frame.id().is_extended() {
        // SOF, 11 bits, SRR = 1, IDE = 1, 18 bits, RTR, r1, r0, DLC
        let base = id >> 18;
        let rest = id & 0x3_FFFF;
        ((((base << 2 | 0b11) << 18 | rest) << 3 | remote << 2) << 4 | length, 1 + 11 + 2 + 18 + 3 + 4)
    } else {
        // SOF, 11 bits, RTR, IDE = 0, r0, DLC
        ((id << 3 | remote << 2) << 4 | length, 1 + 11 + 3 + 4)
    }
}

/// From the start bit to BRS, and how many bits that is.
fn flexible_head(frame: &Frame, has_bit_rate_switch: bool) -> (u64, u32) {
    let id = u64::from(frame.id().value());
    // FDF = 1, res = 0, BRS
    let tail = 0b100 | u64::from(has_bit_rate_switch);
    if frame.id().is_extended() {
        // SOF, 11 bits, SRR = 1, IDE = 1, 18 bits, RRS = 0
        let base = id >> 18;
        let rest = id & 0x3_FFFF;
        ((((base << 2 | 0b11) << 18 | rest) << 1) << 3 | tail, 1 + 11 + 2 + 18 + 1 + 3)
    } else {
        // SOF, 11 bits, RRS = 0, IDE = 0
        (((id << 2) << 3) | tail, 1 + 11 + 2 + 3)
    }
}

fn length_code(bytes: usize) -> u8 {
    match bytes {
        0..=8 => bytes as u8,
        9..=12 => 9,
        13..=16 => 10,
        17..=20 => 11,
        21..=24 => 12,
        25..=32 => 13,
        33..=48 => 14,
        _ => 15,
    }
}

/// Counts the bits that a transmitter inserts: after five equal bits one of the other value, which itself counts
/// as the first of the next run.
#[derive(Clone, Copy, Default)]
struct Stuffing {
    /// The run of equal bits at the end: its length, 0 to 4, and in the lowest bit its level.
    run: u8,
    stuffed: u32,
    /// True if a stuff bit follows the last bit pushed.
    is_just_stuffed: bool,
}

/// The runs that a bit can follow.
const RUNS: usize = 10;
/// What a byte does after each run: see [`after_byte`].
const STUFFING_TABLE: [[u8; 256]; RUNS] = {
    let mut table = [[0; 256]; RUNS];
    let mut run = 0;
    while run < RUNS {
        let mut byte = 0;
        while byte < 256 {
            table[run][byte] = after_byte(run as u8, byte as u8);
            byte += 1;
        }
        run += 1;
    }
    table
};

/// The run after one more bit, and whether a stuff bit came behind it.
const fn after_bit(run: u8, bit: u8) -> (u8, bool) {
    let length = if bit == run & 1 { (run >> 1) + 1 } else { 1 };
    if length == 5 { (1 << 1 | bit ^ 1, true) } else { (length << 1 | bit, false) }
}

/// The run after eight more bits, with bit 4 if a stuff bit came behind the last one; from bit 5 on the number of stuff
/// bits.
const fn after_byte(mut run: u8, byte: u8) -> u8 {
    let mut stuffed = 0;
    let mut is_stuffed = false;
    let mut left = 8;
    while left > 0 {
        left -= 1;
        (run, is_stuffed) = after_bit(run, byte >> left & 1);
        stuffed += is_stuffed as u8;
    }
    stuffed << 5 | (is_stuffed as u8) << 4 | run
}

impl Stuffing {
    /// Takes the low `count` bits of `bits`, the highest of them first.
    fn push(&mut self, bits: u64, count: u32) {
        for bit in (0..count).rev() {
            (self.run, self.is_just_stuffed) = after_bit(self.run, (bits >> bit & 1) as u8);
            self.stuffed += u32::from(self.is_just_stuffed);
        }
    }

    /// Takes eight bits, the highest first.
    fn push_byte(&mut self, byte: u8) {
        let after = STUFFING_TABLE[usize::from(self.run)][usize::from(byte)];
        self.run = after & 0xF;
        self.is_just_stuffed = after & 0x10 != 0;
        self.stuffed += u32::from(after >> 5);
    }
}

/// The 15-bit CRC of classic frames, polynomial 0x4599, a byte at a time.
#[derive(Clone, Copy, Default)]
struct Crc15(u16);

const CRC15_TABLE: [u16; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut register = (byte as u16) << 7;
        let mut bit = 0;
        while bit < 8 {
            register = (register << 1) ^ if register & 0x4000 != 0 { 0x4599 } else { 0 };
            bit += 1;
        }
        table[byte] = register & 0x7FFF;
        byte += 1;
    }
    table
};

impl Crc15 {
    fn push(&mut self, byte: u8) {
        let row = usize::from((self.0 >> 7) as u8 ^ byte);
        self.0 = (self.0 << 8 & 0x7FFF) ^ CRC15_TABLE[row];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use takt_rt::{Id, UnstuffedLength};

    use crate::frame_time::stuff_bits_of;

    /// The bits of a classic frame up to and with the CRC, one by one, as the standard writes them.
    fn bits_of(frame: &Frame) -> Vec<bool> {
        let mut bits = vec![];
        let mut push =
            |value: u64, count: u32| (0..count).rev().for_each(|bit| bits.push(value >> bit & 1 == 1));
        let id = u64::from(frame.id().value());
        let remote = u64::from(frame.kind() == FrameKind::Remote);
        push(0, 1);
        if frame.id().is_extended() {
            push(id >> 18, 11);
            push(0b11, 2);
            push(id, 18);
            push(remote, 1);
            push(0, 2);
        } else {
            push(id, 11);
            push(remote, 1);
            push(0, 2);
        }
        push(frame.length() as u64, 4);
        frame.payload().iter().for_each(|byte| push((*byte).into(), 8));
        let mut register = 0u16;
        for bit in &bits {
            let next = *bit != (register & 0x4000 != 0);
            register = register << 1 & 0x7FFF;
            if next {
                register ^= 0x4599;
            }
        }
        (0..15).rev().for_each(|bit| bits.push(register >> bit & 1 == 1));
        bits
    }

    #[test]
    fn sync_takes_51_bits_as_counted_by_hand() {
        // Start bit and 080: 0000 1 and seven zeros; RTR, IDE, r0 and DLC: seven more; the CRC is x^29 modulo the
        // polynomial, 001 1100 0000 0101. So: 0000 1 (16 zeros) 111 (7 zeros) 1 0 1. Of the 16 zeros the 5th, 10th
        // and 15th are followed by a stuff bit, of the 7 the 5th: 4 stuff bits, 34 + 4 + 13 bits.
        let sync = Frame::of(Id::canopen(0x080, 0), []);
        let crc = bits_of(&sync)[19..].iter().fold(0u16, |value, bit| value << 1 | u16::from(*bit));
        let length = WireLength::of(&sync);
        assert_eq!((crc, length.stuff_bits, length.nominal_bits), (0x1C05, 4, 51));
        assert_eq!(length.duration_ns(1_000_000, None), 51_000);
    }

    #[test]
    fn alternating_bits_need_no_stuffing_and_equal_ones_the_most() {
        let mut stuffing = Stuffing::default();
        stuffing.push(ALTERNATING as u64, 64);
        assert_eq!(stuffing.stuffed, 0);
        let mut stuffing = Stuffing::default();
        stuffing.push(0, 25);
        assert_eq!(stuffing.stuffed, 5);
        // 11111 0000 1111 0000: after the first five every four more, since a stuff bit begins the next run.
        let mut stuffing = Stuffing::default();
        stuffing.push(0b1_1111_0000_1111_0000, 17);
        assert_eq!(stuffing.stuffed, 4);
    }

    #[test]
    fn a_frame_with_bit_rate_switching_spends_its_payload_at_the_data_rate() {
        let frame = Frame::fd(Id::canopen(0x180, 5), &[0x5A; 64], true).unwrap();
        let length = WireLength::of(&frame);
        let single = WireLength::of(&Frame::fd(frame.id(), frame.payload(), false).unwrap());
        assert!(length.data_bits > 64 * 8 && length.nominal_bits < 40);
        assert_eq!(single.data_bits, 0);
        assert!(length.duration_ns(1_000_000, Some(5_000_000)) < single.duration_ns(1_000_000, None) / 3);
    }

    #[test]
    fn an_fd_frame_of_alternating_bits_has_the_fixed_length_of_the_standard() {
        // Identifier and payload need no dynamic stuffing: 17 + 5 + 64 + 27 (CRC field of 17) + 10 + 3 bits, and the
        // CRC delimiter.
        let frame = Frame::fd(Id::base(0x555).unwrap(), &[0x55; 8], false).unwrap();
        let length = WireLength::of(&frame);
        assert_eq!(length.nominal_bits, 17 + 5 + 64 + 4 + 17 + 6 + 13);
        assert_eq!(length.stuff_bits, 6);
    }

    proptest! {
        #[test]
        fn every_classic_frame_is_as_long_as_its_bits_say(id in 0u32..1 << 29, extended: bool, remote: bool, data in proptest::collection::vec(any::<u8>(), 0..=8)) {
            let id = if extended { Id::extended(id).unwrap() } else { Id::base(id & 0x7FF).unwrap() };
            let frame = if remote {
                Frame::remote(id, data.len() as u8).unwrap()
            } else {
                Frame::data(id, &data).unwrap()
            };
            let bits = bits_of(&frame);
            let stuffed = stuff_bits_of(&bits);
            let length = WireLength::of(&frame);
            prop_assert_eq!(length.stuff_bits, stuffed);
            prop_assert_eq!(length.nominal_bits, bits.len() as u32 + stuffed + TAIL_BITS);
        }

        #[test]
        fn the_bus_load_of_the_loop_counts_every_bit_but_those_stuffed_for_the_content(
            id in 0u32..1 << 29, extended: bool, kind in 0u8..4, length in 0usize..16, bytes: [u8; 64],
        ) {
            let id = if extended { Id::extended(id).unwrap() } else { Id::base(id & 0x7FF).unwrap() };
            let lengths = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
            let frame = match kind {
                0 => Frame::data(id, &bytes[..length.min(8)]),
                1 => Frame::remote(id, length.min(8) as u8),
                _ => Frame::fd(id, &bytes[..lengths[length]], kind == 3),
            }
            .unwrap();
            let (exact, unstuffed) = (WireLength::of(&frame), UnstuffedLength::of(&frame));
            let fixed = match (frame.is_fd(), frame.length() > 16) {
                (false, _) => 0,
                (true, false) => 6,
                (true, true) => 7,
            };
            prop_assert_eq!(
                exact.nominal_bits + exact.data_bits + fixed - exact.stuff_bits,
                unstuffed.nominal_bits + unstuffed.data_bits
            );
            prop_assert!(unstuffed.nominal_bits <= exact.nominal_bits && unstuffed.data_bits <= exact.data_bits);
        }

        #[test]
        fn no_frame_is_longer_than_the_worst_case_formula(id in 0u32..0x800, data in proptest::collection::vec(any::<u8>(), 0..=8)) {
            let frame = Frame::data(Id::base(id).unwrap(), &data).unwrap();
            let bits = 8 * data.len() as u32;
            let worst = bits + 47 + (34 + bits - 1) / 4;
            let length = WireLength::of(&frame).nominal_bits;
            prop_assert!((bits + 47..=worst).contains(&length));
        }

        #[test]
        fn an_fd_frame_lies_between_no_dynamic_stuffing_and_every_fourth_bit(
            id in 0u32..0x800, bytes in 0usize..=8, data: [u8; 64], switch: bool,
        ) {
            let bytes = [0, 3, 8, 12, 16, 20, 32, 48, 64][bytes];
            let frame = Frame::fd(Id::base(id).unwrap(), &data[..bytes], switch).unwrap();
            let length = WireLength::of(&frame);
            let (crc, fixed) = if bytes > 16 { (21, 7) } else { (17, 6) };
            let unstuffed = 17 + 5 + 8 * bytes as u32;
            let least = unstuffed + 4 + crc + fixed + 13;
            let total = length.nominal_bits + length.data_bits;
            prop_assert!(total >= least && total <= least + (unstuffed - 1) / 4);
        }
    }
}
