//! How many bits a frame has on the wire (ISO 11898-1), apart from the bits that are stuffed for its content.
//!
//! The real-time thread counts these for the bus load. Stuff bits depend on the content and on the CRC of each frame. A
//! simulated bus counts them exactly, outside the real-time thread.

use crate::frame::{Frame, FrameKind};

/// The bits of a frame without stuff bits, from the start bit to the end of the intermission.
///
/// A classic frame of `n` bytes has 47 + 8·n bits with an 11-bit identifier, and 67 + 8·n with a 29-bit identifier. On the
/// wire, stuffing makes it longer by at most one bit in four of its first 34 + 8·n (54 + 8·n) bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnstuffedLength {
    /// Bits at the bit rate of the arbitration phase.
    pub nominal_bits: u32,
    /// Bits at the bit rate of the data phase; 0 without bit-rate switching.
    pub data_bits: u32,
}

/// CRC delimiter, acknowledge slot and its delimiter, end of frame, intermission.
const TAIL_BITS: u32 = 1 + 1 + 1 + 7 + 3;

impl UnstuffedLength {
    /// Counts the bits of a frame, in a time that does not depend on its content.
    ///
    /// CAN FD: the fixed stuff bits and the stuff count of the CRC field are counted, because every frame has them. The bit
    /// rate is taken to change after BRS and before the CRC delimiter.
    pub const fn of(frame: &Frame) -> Self {
        let is_extended = frame.id().is_extended();
        let payload_bits = 8 * frame.length() as u32; // At most 64 bytes, by its type.
        match frame.kind() {
            FrameKind::Data => {
                Self { nominal_bits: classic_frame_bits(is_extended) + payload_bits, data_bits: 0 }
            }
            FrameKind::Remote => Self { nominal_bits: classic_frame_bits(is_extended), data_bits: 0 },
            FrameKind::Fd => Self {
                nominal_bits: flexible_head_bits(is_extended) + flexible_body_bits(payload_bits) + TAIL_BITS,
                data_bits: 0,
            },
            FrameKind::FdBitRateSwitch => Self {
                nominal_bits: flexible_head_bits(is_extended) + TAIL_BITS,
                data_bits: flexible_body_bits(payload_bits),
            },
        }
    }
}

/// A classic frame without payload.
const fn classic_frame_bits(is_extended: bool) -> u32 {
    // SOF, 11 bits, (SRR, IDE, 18 bits,) RTR, IDE or r1, r0, DLC; CRC.
    let head = if is_extended { 1 + 11 + 2 + 18 + 3 + 4 } else { 1 + 11 + 3 + 4 };
    head + 15 + TAIL_BITS
}

/// A CAN FD frame from the start bit to BRS.
const fn flexible_head_bits(is_extended: bool) -> u32 {
    // SOF, 11 bits, (SRR, IDE, 18 bits,) RRS, IDE or none, FDF, res, BRS.
    if is_extended { 1 + 11 + 2 + 18 + 1 + 3 } else { 1 + 11 + 2 + 3 }
}

/// A CAN FD frame from ESI to the end of the CRC.
const fn flexible_body_bits(payload_bits: u32) -> u32 {
    // The CRC has 17 bits up to 16 bytes, and 21 above. The stuff count and its parity have 4.
    let check = 4 + if payload_bits > 8 * 16 { 21 } else { 17 };
    // One fixed stuff bit in front, and one after every fourth bit.
    let fixed_stuff = 1 + check / 4;
    1 + 4 + payload_bits + check + fixed_stuff
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Id;

    const BASE: Id = Id::canopen(0x180, 1);

    fn bits(frame: Frame) -> (u32, u32) {
        let UnstuffedLength { nominal_bits, data_bits } = UnstuffedLength::of(&frame);
        (nominal_bits, data_bits)
    }

    #[test]
    fn classic_frames_have_as_many_bits_as_the_published_formula_says() {
        for length in 0..=8 {
            let payload = 8 * length as u32;
            assert_eq!(bits(Frame::data(BASE, &[0; 8][..length]).unwrap()), (47 + payload, 0));
            let extended = Id::extended(0x1234_5678).unwrap();
            assert_eq!(bits(Frame::data(extended, &[0; 8][..length]).unwrap()), (67 + payload, 0));
        }
    }

    #[test]
    fn a_remote_frame_has_no_payload_on_the_wire() {
        assert_eq!(bits(Frame::remote(BASE, 8).unwrap()), (47, 0));
    }

    #[test]
    fn a_bit_rate_switch_moves_the_payload_and_the_check_bits_to_the_data_rate() {
        for (length, body) in
            [(0, 5 + 21 + 6), (8, 5 + 64 + 21 + 6), (16, 5 + 128 + 21 + 6), (20, 5 + 160 + 25 + 7)]
        {
            let frame = |switch| Frame::fd(BASE, &[0; 64][..length], switch).unwrap();
            assert_eq!(bits(frame(true)), (17 + 13, body), "{length} bytes");
            assert_eq!(bits(frame(false)), (17 + 13 + body, 0), "{length} bytes");
        }
    }

    #[test]
    fn the_length_does_not_depend_on_the_content() {
        let zeros = Frame::of(BASE, [0; 8]);
        assert_eq!(bits(zeros), bits(Frame::of(BASE, [0x55; 8])));
    }
}
