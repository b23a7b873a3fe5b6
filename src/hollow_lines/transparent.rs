//! The RS-485 module in transparent mode: frames of 21 bytes at 1 Mbaud (section 7.1 of the manual).
//!
//! A frame is an identifier, 16 bytes of data, and the CRC-32 of both, least significant byte first. It has no beginning that
//! could be recognised: the CRC alone says where a frame is.

use arrayvec::ArrayVec;

use super::motor_data::DATA_BYTES;

/// The baud rate of the line, which cannot be changed.
pub const BAUD_RATE: u32 = 1_000_000;
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
        let mut bytes = [0; FRAME_BYTES];
        let (content, end) = bytes.split_at_mut(1 + DATA_BYTES);
        let (id, data) = content.split_at_mut(1);
        id.copy_from_slice(&[self.id]);
        data.copy_from_slice(&self.data);
        end.copy_from_slice(&crc32fast::hash(content).to_le_bytes());
        bytes
    }

    /// Reads the bytes of a frame; `None` if their CRC is wrong.
    pub fn decode(bytes: &[u8; FRAME_BYTES]) -> Option<Self> {
        let (content, end) = bytes.split_at(1 + DATA_BYTES);
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
    use super::*;
    use proptest::prelude::*;

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
    fn an_idle_line_is_no_frame() {
        let mut reader = FrameReader::default();
        assert_eq!(read(&mut reader, &[0; 1_000]), []);
        assert_eq!(read(&mut reader, &[0xFF; 1_000]), []);
        reader.clear();
        assert_eq!(reader.discarded(), 2_000);
    }
}
