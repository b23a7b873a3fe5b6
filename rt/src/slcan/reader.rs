//! Cuts the bytes of a serial line into lines, and reads them.

use arrayvec::ArrayVec;

use super::command::Command;
use super::frame_line::{LINE_BYTES, LineError, decode_frame, is_frame};
use crate::frame::Frame;

const CR: u8 = b'\r';
const LF: u8 = b'\n';
const BEL: u8 = 0x07;

/// Collects the bytes of a serial line up to the end of a line. It holds one line, however many bytes come without an end.
#[derive(Clone, Debug, Default)]
pub struct LineReader {
    line: ArrayVec<u8, LINE_BYTES>,
    state: Collecting,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Collecting {
    /// The line continues.
    #[default]
    Open,
    /// The line was handed out; the next byte begins another one.
    Ended,
    /// The line is too long; its bytes are left out until it ends.
    TooLong,
}

/// A line as it has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RawLine<'a> {
    /// The characters before CR. Empty where CR came alone, which is how an adapter accepts a command.
    Text(&'a [u8]),
    /// BEL: the adapter refuses a command or a frame.
    Refusal,
    /// A line with more characters than any line can have.
    TooLong,
}

impl LineReader {
    /// Takes the next byte of the serial line. Returns the line that it ends.
    pub fn push(&mut self, byte: u8) -> Option<RawLine<'_>> {
        if self.state == Collecting::Ended {
            self.clear();
        }
        match byte {
            LF => None,
            // An adapter sends BEL without CR. What was collected before it is the rest of a disturbed line.
            BEL => {
                self.clear();
                Some(RawLine::Refusal)
            }
            CR if self.state == Collecting::TooLong => {
                self.clear();
                Some(RawLine::TooLong)
            }
            CR => {
                self.state = Collecting::Ended;
                Some(RawLine::Text(&self.line))
            }
            byte => {
                if self.line.try_push(byte).is_err() {
                    self.state = Collecting::TooLong;
                }
                None
            }
        }
    }

    /// Forgets what was collected.
    pub fn clear(&mut self) {
        self.line.clear();
        self.state = Collecting::Open;
    }
}

/// What an adapter sends to its host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdapterLine {
    /// A frame from the bus.
    Frame(Frame),
    /// The adapter accepts a command (CR) or a frame (`z`, `Z`).
    Accepted,
    /// The adapter refuses a command or a frame (BEL).
    Refused,
    /// The answer to a question: version, serial number or status.
    Information,
}

impl AdapterLine {
    /// Reads a line from an adapter.
    ///
    /// # Errors
    /// See [`LineError`].
    pub fn decode(line: RawLine<'_>) -> Result<Self, LineError> {
        match line {
            RawLine::Refusal => Ok(Self::Refused),
            RawLine::TooLong => Err(LineError::TooLong),
            RawLine::Text([] | [b'z' | b'Z']) => Ok(Self::Accepted),
            RawLine::Text([b'V' | b'v' | b'N' | b'F', ..]) => Ok(Self::Information),
            RawLine::Text(text) => decode_frame(text).map(Self::Frame),
        }
    }
}

/// What a host sends to an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostLine {
    /// A frame for the bus.
    Frame(Frame),
    /// A command to the adapter.
    Command(Command),
    /// An empty line. Hosts send it to end a line that was begun before them.
    Empty,
}

impl HostLine {
    /// Reads a line from a host.
    ///
    /// # Errors
    /// See [`LineError`].
    pub fn decode(line: RawLine<'_>) -> Result<Self, LineError> {
        match line {
            RawLine::Refusal => Err(LineError::UnknownKind { letter: BEL }),
            RawLine::TooLong => Err(LineError::TooLong),
            RawLine::Text([]) => Ok(Self::Empty),
            RawLine::Text(text @ [letter, ..]) if is_frame(*letter) => decode_frame(text).map(Self::Frame),
            RawLine::Text(text) => Command::decode(text).map(Self::Command),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::frame::Id;
    use crate::slcan::encode_frame;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn from_adapter(reader: &mut LineReader, bytes: &[u8]) -> Vec<Result<AdapterLine, LineError>> {
        bytes.iter().filter_map(|byte| reader.push(*byte).map(AdapterLine::decode)).collect()
    }

    fn frame() -> Frame {
        Frame::of(Id::base(0x181).unwrap(), [0x37, 0x12])
    }

    #[test]
    fn answers_and_frames_come_apart_and_line_feeds_are_ignored() {
        let mut reader = LineReader::default();
        let lines = from_adapter(&mut reader, b"\r\nz\r\nZ\rV1013\r\x07t18123712\r\nt18123712\r");
        assert_eq!(
            lines,
            [
                Ok(AdapterLine::Accepted),
                Ok(AdapterLine::Accepted),
                Ok(AdapterLine::Accepted),
                Ok(AdapterLine::Information),
                Ok(AdapterLine::Refused),
                Ok(AdapterLine::Frame(frame())),
                Ok(AdapterLine::Frame(frame())),
            ]
        );
    }

    #[test]
    fn a_line_that_comes_in_pieces_is_read_when_it_ends() {
        let mut reader = LineReader::default();
        assert_eq!(from_adapter(&mut reader, b"t1812"), []);
        assert_eq!(from_adapter(&mut reader, b"3712"), []);
        assert_eq!(from_adapter(&mut reader, b"\r"), [Ok(AdapterLine::Frame(frame()))]);
    }

    #[test]
    fn noise_without_an_end_is_one_line_that_is_too_long_and_the_next_one_is_read() {
        let mut reader = LineReader::default();
        assert_eq!(from_adapter(&mut reader, &[b'A'; 10_000]), []);
        let lines = from_adapter(&mut reader, b"\rt18123712\r");
        assert_eq!(lines, [Err(LineError::TooLong), Ok(AdapterLine::Frame(frame()))]);
    }

    #[test]
    fn the_host_of_an_adapter_sends_commands_and_frames() {
        let mut reader = LineReader::default();
        let bytes = b"\rC\rS8\rO\r\nt18123712\rq\r\x07";
        let lines: Vec<_> =
            bytes.iter().filter_map(|byte| reader.push(*byte).map(HostLine::decode)).collect();
        let rate = super::super::BitRate::of(1_000_000).unwrap();
        assert_eq!(
            lines,
            [
                Ok(HostLine::Empty),
                Ok(HostLine::Command(Command::Close)),
                Ok(HostLine::Command(Command::SetBitRate(rate))),
                Ok(HostLine::Command(Command::Open)),
                Ok(HostLine::Frame(frame())),
                Err(LineError::UnknownKind { letter: b'q' }),
                Err(LineError::UnknownKind { letter: BEL }),
            ]
        );
    }

    proptest! {
        #[test]
        fn whatever_comes_on_the_line_a_frame_behind_it_is_read(noise in prop::collection::vec(any::<u8>(), 0..400)) {
            let mut reader = LineReader::default();
            from_adapter(&mut reader, &noise);
            from_adapter(&mut reader, b"\r");
            prop_assert_eq!(from_adapter(&mut reader, &encode_frame(&frame())), [Ok(AdapterLine::Frame(frame()))]);
            for byte in noise {
                let _ = reader.push(byte).map(HostLine::decode);
            }
        }
    }
}
