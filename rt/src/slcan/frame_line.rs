//! A frame as a line of text.

use core::fmt;

use arrayvec::ArrayVec;

use crate::frame::{Frame, FrameKind, Id};

/// The longest line in bytes, with its CR: a CAN FD frame of 64 bytes with a 29-bit identifier and a time stamp.
pub const LINE_BYTES: usize = 1 + 8 + 1 + 2 * Frame::MAX_BYTES + STAMP_DIGITS + 1;

/// The digits of a time stamp, which an adapter of LAWICEL appends to received frames when `Z1` is set.
const STAMP_DIGITS: usize = 4;

/// A line as it is sent, with its CR.
pub type LineText = ArrayVec<u8, LINE_BYTES>;

/// What is wrong with a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineError {
    /// The line has no characters.
    Empty,
    /// The line is longer than any line can be.
    TooLong,
    /// The first letter is neither that of a frame nor that of a command.
    UnknownKind {
        /// The letter.
        letter: u8,
    },
    /// A command has a wrong parameter, or one that it does not take.
    Parameter,
    /// A character that must be a hexadecimal digit is another one.
    NotHexadecimal {
        /// The character.
        character: u8,
    },
    /// A 29-bit identifier is larger than its field.
    Identifier {
        /// The identifier.
        id: u32,
    },
    /// A frame of this kind cannot have this length code.
    LengthCode {
        /// The code, 0 to 15.
        code: u8,
    },
    /// The length code asks for another number of digits than the line has.
    Digits {
        /// The digits behind the length code.
        found: usize,
        /// The digits that the length code asks for.
        expected: usize,
    },
}

impl fmt::Display for LineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(f, "an empty line"),
            Self::TooLong => write!(f, "a line of more than {LINE_BYTES} characters"),
            Self::UnknownKind { letter } => write!(f, "no line begins with '{}'", letter.escape_ascii()),
            Self::Parameter => write!(f, "the command has a wrong parameter"),
            Self::NotHexadecimal { character } => {
                write!(f, "'{}' is no hexadecimal digit", character.escape_ascii())
            }
            Self::Identifier { id } => write!(f, "identifier 0x{id:X} is out of range"),
            Self::LengthCode { code } => write!(f, "no frame of this kind has the length code {code:X}"),
            Self::Digits { found, expected } => {
                write!(f, "{found} digits of data where the length asks for {expected}")
            }
        }
    }
}

impl core::error::Error for LineError {}

/// The line of a frame, with its CR.
pub fn encode_frame(frame: &Frame) -> LineText {
    let id = frame.id();
    let letter = match frame.kind() {
        FrameKind::Data => b't',
        FrameKind::Remote => b'r',
        FrameKind::Fd => b'd',
        FrameKind::FdBitRateSwitch => b'b',
    };
    let mut line = LineText::new();
    // A line holds the longest frame, so none of these can fail.
    let mut push = |byte: u8| {
        let _ = line.try_push(byte);
    };
    push(if id.is_extended() { letter.to_ascii_uppercase() } else { letter });
    let digits = id_digits(id.is_extended());
    for place in (0..digits).rev() {
        push(digit((id.value() >> (4 * place)) as u8));
    }
    push(digit(length_code(frame.length())));
    for byte in frame.payload() {
        push(digit(byte >> 4));
        push(digit(*byte));
    }
    push(b'\r');
    line
}

/// Reads the line of a frame, without its CR. It may have a time stamp, which is left out.
///
/// # Errors
/// See [`LineError`].
pub fn decode_frame(line: &[u8]) -> Result<Frame, LineError> {
    let (letter, rest) = line.split_first().ok_or(LineError::Empty)?;
    let (kind, is_extended) = kind(*letter).ok_or(LineError::UnknownKind { letter: *letter })?;
    let digits = id_digits(is_extended);
    let (id, rest) = rest.split_at_checked(digits).ok_or(missing(rest, digits))?;
    let id = number(id)?;
    let id = if is_extended { Id::extended(id) } else { Id::base(id) }
        .map_err(|_| LineError::Identifier { id })?;
    let (code, data) = rest.split_first().ok_or(missing(rest, 1))?;
    let code = value(*code)?;
    let is_fd = matches!(kind, FrameKind::Fd | FrameKind::FdBitRateSwitch);
    let length = if is_fd || code <= 8 { length(code) } else { return Err(LineError::LengthCode { code }) };
    let carried = if kind == FrameKind::Remote { 0 } else { length };
    let digits = 2 * carried;
    let (payload, stamp) = data.split_at_checked(digits).ok_or(missing(data, digits))?;
    if !matches!(stamp.len(), 0 | STAMP_DIGITS) {
        return Err(missing(data, digits));
    }
    number(stamp)?;
    let mut bytes = [0; Frame::MAX_BYTES];
    for (byte, pair) in bytes.iter_mut().zip(payload.chunks_exact(2)) {
        *byte = number(pair)? as u8;
    }
    let bytes = bytes.get(..carried).unwrap_or_default();
    let frame = match kind {
        FrameKind::Data => Frame::data(id, bytes),
        FrameKind::Remote => Frame::remote(id, code),
        FrameKind::Fd => Frame::fd(id, bytes, false),
        FrameKind::FdBitRateSwitch => Frame::fd(id, bytes, true),
    };
    frame.map_err(|_| LineError::LengthCode { code })
}

/// Returns `true` if a line that begins with this letter is a frame.
pub(super) const fn is_frame(letter: u8) -> bool {
    kind(letter).is_some()
}

const fn kind(letter: u8) -> Option<(FrameKind, bool)> {
    let kind = match letter.to_ascii_lowercase() {
        b't' => FrameKind::Data,
        b'r' => FrameKind::Remote,
        b'd' => FrameKind::Fd,
        b'b' => FrameKind::FdBitRateSwitch,
        _ => return None,
    };
    Some((kind, letter.is_ascii_uppercase()))
}

const fn id_digits(is_extended: bool) -> usize {
    if is_extended { 8 } else { 3 }
}

const FD_LENGTHS: [u8; 7] = [12, 16, 20, 24, 32, 48, 64];

/// The length code (DLC) of a length that a frame can have.
fn length_code(length: usize) -> u8 {
    let short = length.min(8) as u8;
    FD_LENGTHS.iter().zip(9..).find(|(fd, _)| usize::from(**fd) == length).map_or(short, |(_, code)| code)
}

/// The length of a length code, 0 to 15.
fn length(code: u8) -> usize {
    let fd = code.checked_sub(9).and_then(|place| FD_LENGTHS.get(usize::from(place)));
    usize::from(fd.copied().unwrap_or(code))
}

/// The hexadecimal digit of the low four bits.
const fn digit(value: u8) -> u8 {
    let value = value & 0xF;
    if value < 10 { b'0' + value } else { b'A' + (value - 10) }
}

fn value(character: u8) -> Result<u8, LineError> {
    let value = char::from(character).to_digit(16).and_then(|value| u8::try_from(value).ok());
    value.ok_or(LineError::NotHexadecimal { character })
}

/// The number of at most eight hexadecimal digits.
fn number(digits: &[u8]) -> Result<u32, LineError> {
    digits.iter().try_fold(0, |number, character| Ok(number << 4 | u32::from(value(*character)?)))
}

/// A part of a line has other digits than it must have.
const fn missing(found: &[u8], expected: usize) -> LineError {
    LineError::Digits { found: found.len(), expected }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::format;
    use std::string::{String, ToString};

    fn text(frame: &Frame) -> String {
        String::from_utf8(encode_frame(frame).to_vec()).unwrap()
    }

    fn any_frame() -> impl Strategy<Value = Frame> {
        let id = prop_oneof![
            (0u32..=0x7FF).prop_map(|id| Id::base(id).unwrap()),
            (0u32..=0x1FFF_FFFF).prop_map(|id| Id::extended(id).unwrap()),
        ];
        let length =
            prop::sample::select([0usize, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64].as_slice());
        (id, length, any::<[u8; 64]>(), 0..4).prop_map(|(id, length, bytes, kind)| {
            match kind {
                0 => Frame::data(id, &bytes[..length.min(8)]),
                1 => Frame::remote(id, length.min(8) as u8),
                kind => Frame::fd(id, &bytes[..length], kind == 3),
            }
            .unwrap()
        })
    }

    proptest! {
        #[test]
        fn every_frame_comes_back_as_it_was_written(frame in any_frame()) {
            let line = encode_frame(&frame);
            let (end, line) = line.split_last().unwrap();
            prop_assert_eq!(*end, b'\r');
            prop_assert_eq!(decode_frame(line), Ok(frame));
            let lower = line.split_first().map(|(letter, rest)| [&[*letter], rest.to_ascii_lowercase().as_slice()].concat());
            prop_assert_eq!(decode_frame(&lower.unwrap()), Ok(frame));
        }

        #[test]
        fn whatever_a_line_holds_it_is_read_without_panic(line in prop::collection::vec(any::<u8>(), 0..160)) {
            let _ = decode_frame(&line);
        }

        #[test]
        fn a_line_with_a_character_more_or_less_is_no_frame(frame in any_frame(), more in 0usize..4) {
            let line = encode_frame(&frame);
            let (_, line) = line.split_last().unwrap();
            prop_assert!(decode_frame(&line[..line.len() - 1]).is_err());
            if more > 0 {
                prop_assert!(decode_frame(&[line, &b"0000"[..more]].concat()).is_err());
            }
        }
    }

    #[test]
    fn frames_of_each_kind_are_written_as_the_adapters_write_them() {
        let (base, extended) = (Id::base(0x1A).unwrap(), Id::extended(0x1A).unwrap());
        assert_eq!(text(&Frame::of(base, [0xAB, 1])), "t01A2AB01\r");
        assert_eq!(text(&Frame::of(extended, [])), "T0000001A0\r");
        assert_eq!(text(&Frame::remote(base, 8).unwrap()), "r01A8\r");
        assert_eq!(text(&Frame::remote(extended, 0).unwrap()), "R0000001A0\r");
        assert_eq!(
            text(&Frame::fd(base, &[0xFF; 12], false).unwrap()),
            format!("d01A9{}\r", "FF".repeat(12))
        );
        assert_eq!(
            text(&Frame::fd(extended, &[1; 64], true).unwrap()),
            format!("B0000001AF{}\r", "01".repeat(64))
        );
    }

    #[test]
    fn the_longest_line_has_room_for_a_time_stamp_and_its_end() {
        let longest = Frame::fd(Id::extended(0x1FFF_FFFF).unwrap(), &[0xFF; 64], true).unwrap();
        assert_eq!(encode_frame(&longest).len() + STAMP_DIGITS, LINE_BYTES);
    }

    #[test]
    fn the_time_stamp_of_a_received_frame_is_left_out() {
        let id = Id::base(0x100).unwrap();
        assert_eq!(decode_frame(b"t100211223F0A"), Ok(Frame::of(id, [0x11, 0x22])));
        assert_eq!(decode_frame(b"r10081234"), Ok(Frame::remote(id, 8).unwrap()));
    }

    #[test]
    fn what_is_wrong_with_a_line_is_named() {
        for (line, error) in [
            (&b""[..], LineError::Empty),
            (b"x", LineError::UnknownKind { letter: b'x' }),
            (b"t12", LineError::Digits { found: 2, expected: 3 }),
            (b"t123", LineError::Digits { found: 0, expected: 1 }),
            (b"t8001AA", LineError::Identifier { id: 0x800 }),
            (b"T200000000", LineError::Identifier { id: 0x2000_0000 }),
            (b"t1G31AA", LineError::NotHexadecimal { character: b'G' }),
            (b"t1231AG", LineError::NotHexadecimal { character: b'G' }),
            (b"t1239", LineError::LengthCode { code: 9 }),
            (b"r123A", LineError::LengthCode { code: 0xA }),
            (b"t1232AA", LineError::Digits { found: 2, expected: 4 }),
            (b"t1230AA", LineError::Digits { found: 2, expected: 0 }),
            (b"t1230AAZZ", LineError::NotHexadecimal { character: b'Z' }),
        ] {
            assert_eq!(decode_frame(line), Err(error), "{line:?}");
        }
        let error = decode_frame(b"\x01").unwrap_err();
        assert_eq!(error.to_string(), r"no line begins with '\x01'");
    }
}
