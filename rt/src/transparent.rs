//! CAN FD frames of 16 bytes on an RS-485 line, as a transparent converter between the two has them: 21 bytes at 1 Mbaud.
//!
//! A frame is an identifier of one byte, 16 bytes of data, and the CRC-32 of both (IEEE 802.3), least significant byte first. It has no
//! beginning that could be recognised: the CRC alone says where a frame is. This module has no input or output.

use arrayvec::ArrayVec;

use crate::frame::{Frame, FrameKind, Id};

/// The baud rate of the line, which cannot be changed.
pub const BAUD_RATE: u32 = 1_000_000;
/// The data of a frame.
pub const DATA_BYTES: usize = 16;
/// The bytes of a frame.
pub const FRAME_BYTES: usize = 1 + DATA_BYTES + CRC_BYTES;
const CRC_BYTES: usize = 4;

/// A frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TransparentFrame {
    /// In a request, the identifier of the motor. In a reply, the identifier that the motor replies to.
    pub id: u8,
    /// The data of the CAN FD frame.
    pub data: [u8; DATA_BYTES],
}

impl TransparentFrame {
    /// The bytes of the frame.
    pub fn encode(&self) -> [u8; FRAME_BYTES] {
        let mut content = [0; 1 + DATA_BYTES];
        for (to, from) in content.iter_mut().zip([self.id].iter().chain(&self.data)) {
            *to = *from;
        }
        let crc = crc32fast::hash(&content).to_le_bytes();
        let mut bytes = [0; FRAME_BYTES];
        for (to, from) in bytes.iter_mut().zip(content.iter().chain(&crc)) {
            *to = *from;
        }
        bytes
    }

    /// The frame as the converter has it on the line; `None` for a frame that it does not carry: another length, another kind, or an
    /// identifier above 255.
    pub fn of(frame: &Frame) -> Option<Self> {
        let id =
            u8::try_from(frame.id().value()).ok().filter(|_| frame.is_fd() && !frame.id().is_extended())?;
        Some(Self { id, data: frame.payload().try_into().ok()? })
    }

    /// The frame on the bus.
    pub fn frame(&self) -> Frame {
        // Eight bits are always those of an 11-bit identifier.
        let id = Id::base(self.id.into()).unwrap_or(Id::canopen(0, 0));
        Frame::filled(id, FrameKind::Fd, &self.data)
    }

    /// Reads the bytes of a frame; `None` if their CRC is wrong.
    pub fn decode(bytes: &[u8; FRAME_BYTES]) -> Option<Self> {
        let (content, end) = bytes.split_at_checked(1 + DATA_BYTES)?;
        let (id, data) = content.split_first()?;
        let is_sound = crc32fast::hash(content).to_le_bytes() == end;
        is_sound.then_some(Self { id: *id, data: data.try_into().ok()? })
    }
}

/// Finds the frames among the bytes of the line. After a disturbed byte it finds the next whole frame.
#[derive(Clone, Debug, Default)]
pub struct FrameReader {
    window: ArrayVec<u8, FRAME_BYTES>,
    frames: u64,
    discarded: u64,
}

impl FrameReader {
    /// Takes the next byte of the line. Returns the frame that it completes.
    pub fn push(&mut self, byte: u8) -> Option<TransparentFrame> {
        if self.window.is_full() {
            // No frame begins with the oldest byte.
            self.window.remove(0);
            self.discarded += 1;
        }
        self.window.push(byte);
        let bytes: &[u8; FRAME_BYTES] = self.window.as_slice().try_into().ok()?;
        let frame = TransparentFrame::decode(bytes)?;
        self.window.clear();
        self.frames += 1;
        Some(frame)
    }

    /// Forgets the beginning of a frame. A request that waits for a reply begins with this.
    pub fn clear(&mut self) {
        self.discarded += self.window.len() as u64;
        self.window.clear();
    }

    /// Frames found so far.
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// Bytes that belonged to no frame.
    pub const fn discarded(&self) -> u64 {
        self.discarded
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn any_frame() -> impl Strategy<Value = TransparentFrame> {
        (any::<u8>(), any::<[u8; DATA_BYTES]>()).prop_map(|(id, data)| TransparentFrame { id, data })
    }

    fn read(reader: &mut FrameReader, bytes: &[u8]) -> Vec<TransparentFrame> {
        bytes.iter().filter_map(|byte| reader.push(*byte)).collect()
    }

    proptest! {
        #[test]
        fn every_frame_comes_back_whatever_comes_before_it(frame in any_frame(), noise in prop::collection::vec(any::<u8>(), 0..60)) {
            let mut reader = FrameReader::default();
            let before = read(&mut reader, &noise).len();
            prop_assert_eq!(read(&mut reader, &frame.encode()), [frame]);
            prop_assert_eq!(reader.frames() as usize, before + 1);
            prop_assert_eq!(reader.discarded() as usize, noise.len() - before * FRAME_BYTES);
        }

        #[test]
        fn a_frame_with_a_wrong_bit_is_none_and_the_next_one_is_read(frame in any_frame(), bit in 0usize..8 * FRAME_BYTES) {
            let mut reader = FrameReader::default();
            let mut disturbed = frame.encode();
            disturbed[bit / 8] ^= 1 << (bit % 8);
            prop_assert_eq!(TransparentFrame::decode(&disturbed), None);
            prop_assert_eq!(read(&mut reader, &disturbed), []);
            prop_assert_eq!(read(&mut reader, &frame.encode()), [frame]);
        }
    }

    #[test]
    fn a_byte_that_is_lost_costs_one_frame() {
        let frame = TransparentFrame { id: 1, data: [7; DATA_BYTES] };
        let mut reader = FrameReader::default();
        assert_eq!(read(&mut reader, &frame.encode()[1..]), []);
        assert_eq!(read(&mut reader, &[frame.encode(), frame.encode()].concat()), [frame, frame]);
        assert_eq!(reader.discarded(), 20);
    }

    #[test]
    fn only_frames_of_16_bytes_with_a_short_identifier_are_carried() {
        let id = |id| Id::base(id).unwrap();
        let long = Frame::fd(id(1), &[7; DATA_BYTES], false).unwrap();
        let carried = TransparentFrame::of(&long).unwrap();
        assert_eq!((carried.id, carried.frame()), (1, long));
        let others = [
            Frame::fd(id(0x100), &[7; DATA_BYTES], false).unwrap(),
            Frame::fd(Id::extended(1).unwrap(), &[7; DATA_BYTES], false).unwrap(),
            Frame::fd(id(1), &[7; 12], false).unwrap(),
            Frame::data(id(1), &[7; 8]).unwrap(),
        ];
        assert!(others.iter().all(|other| TransparentFrame::of(other).is_none()));
    }

    #[test]
    fn an_idle_line_is_no_frame() {
        let mut reader = FrameReader::default();
        assert_eq!(read(&mut reader, &[0; 1_000]), []);
        assert_eq!(read(&mut reader, &[0xFF; 1_000]), []);
        reader.clear();
        assert_eq!(reader.discarded(), 2_000);
    }
}
