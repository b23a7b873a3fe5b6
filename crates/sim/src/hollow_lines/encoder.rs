//! The hollow encoder.

use takt_rt::Nanoseconds;
use takt_wire::hollow_lines::encoder::REQUEST;
use takt_wire::hollow_lines::transparent::{FrameReader, TransparentFrame};

use crate::serial_device::SerialDevice;

/// An encoder that stands.
pub struct Encoder {
    reader: FrameReader,
    /// Counts within a turn.
    position: u32,
}

impl Encoder {
    /// An encoder that stands at this position, in counts.
    pub fn new(position: u32) -> Self {
        Self { reader: FrameReader::default(), position }
    }
}

impl SerialDevice for Encoder {
    fn receive(&mut self, _now_ns: Nanoseconds, byte: u8, answer: &mut Vec<u8>) {
        if self.reader.push(byte) == Some(REQUEST) {
            let mut data = REQUEST.data;
            if let Some(position) = data.get_mut(1..5) {
                position.copy_from_slice(&self.position.to_be_bytes());
            }
            answer.extend(TransparentFrame { id: REQUEST.id, data }.encode());
        }
    }

    fn advance(&mut self, _now_ns: Nanoseconds, _answer: &mut Vec<u8>) -> Nanoseconds {
        Nanoseconds::MAX
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_answers_the_request_of_the_manual_with_the_reply_of_the_manual() {
        let mut encoder = Encoder::new(678_257);
        let mut answer = vec![];
        REQUEST.encode().into_iter().for_each(|byte| encoder.receive(0, byte, &mut answer));
        let printed = [&[1, 0, 0, 0x0A, 0x59, 0x71][..], &[0; 11], &[0x67, 0x10, 0x8E, 0xAD]].concat();
        assert_eq!(answer, printed);
    }
}
