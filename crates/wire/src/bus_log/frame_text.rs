//! A frame as text, in the notation of `cansend` and of candump logs.

use std::fmt;

use takt_rt::{Frame, FrameError, Id};

/// What is wrong with the text of a frame, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameTextError {
    /// The place of the first wrong byte in the text.
    pub at: usize,
    /// What is wrong.
    pub problem: FrameTextProblem,
}

/// What is wrong with the text of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameTextProblem {
    /// There is no `#` between identifier and data.
    NoHash,
    /// The identifier has neither 3 nor 8 digits.
    IdDigits {
        /// How many it has.
        digits: usize,
    },
    /// The identifier is larger than its field.
    Id(FrameError),
    /// A sign that is no hexadecimal digit.
    NoDigit {
        /// The sign.
        sign: char,
    },
    /// The last byte has one digit.
    HalfByte,
    /// No frame of this kind has so many bytes.
    Length {
        /// How many there are.
        bytes: usize,
        /// True if it is a CAN FD frame.
        is_fd: bool,
    },
    /// There is no digit of flags behind `##`.
    NoFlags,
    /// The length behind `R` is not one digit from 0 to 8.
    RemoteLength,
    /// A length code behind `_`, which is beyond the data.
    LengthCode,
}

impl fmt::Display for FrameTextProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoHash => write!(f, "there is no `#` between the identifier and the data: 123#DEADBEEF"),
            Self::IdDigits { digits } => write!(
                f,
                "the identifier has {digits} digits: an 11-bit one has 3 (07F), a 29-bit one has 8 (0000007F)"
            ),
            Self::Id(error) => write!(f, "{error}"),
            Self::NoDigit { sign } => write!(f, "`{}` is no hexadecimal digit", sign.escape_default()),
            Self::HalfByte => write!(f, "the last byte has one digit instead of two"),
            Self::Length { bytes, is_fd: false } => {
                write!(
                    f,
                    "{bytes} bytes: a classic frame has at most 8; one of CAN FD begins with `##` and its flags"
                )
            }
            Self::Length { bytes, is_fd: true } => write!(
                f,
                "{bytes} bytes: a CAN FD frame has 0 to 8, 12, 16, 20, 24, 32, 48 or 64; append zeros"
            ),
            Self::NoFlags => write!(
                f,
                "one hexadecimal digit of flags belongs behind `##`: 0, or 1 for bit-rate switching (123##1DEAD)"
            ),
            Self::RemoteLength => {
                write!(f, "behind `R` belongs nothing, or a length from 0 to 8: 701#R, 601#R8")
            }
            Self::LengthCode => {
                write!(f, "a length code behind `_` is not supported: the data has the length")
            }
        }
    }
}

impl std::error::Error for FrameTextError {}

impl fmt::Display for FrameTextError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.problem.fmt(f)
    }
}

/// Reads `123#DEADBEEF` (also `123#DE.AD.BE.EF`), `00000123#…` with a 29-bit identifier, `123#R` and `123#R4` for remote frames,
/// `123##1DEAD` for CAN FD: bit 0 of the flags is the bit-rate switch, the others are of the sender's controller and do not count.
///
/// # Errors
/// [`FrameTextError`]: what is wrong, and where.
pub fn parse(text: &str) -> Result<Frame, FrameTextError> {
    let wrong = |at, problem| Err(FrameTextError { at, problem });
    let Some((digits, rest)) = text.split_once('#') else {
        return wrong(text.len(), FrameTextProblem::NoHash);
    };
    let id = identifier(digits)?;
    let begin = digits.len() + 1;
    if let Some(behind) = rest.strip_prefix('#') {
        let flags = behind.chars().next().and_then(|flags| flags.to_digit(16));
        let Some(flags) = flags else { return wrong(begin + 1, FrameTextProblem::NoFlags) };
        let data = behind.get(1..).unwrap_or_default();
        let (bytes, length) = bytes(data, begin + 2, true)?;
        let bytes = bytes.get(..length).unwrap_or_default();
        return Frame::fd(id, bytes, flags & 1 != 0)
            .or(wrong(begin + 2, FrameTextProblem::Length { bytes: length, is_fd: true }));
    }
    if let Some(length) = rest.strip_prefix(['R', 'r']) {
        let number = match length {
            "" => Ok(0),
            length => length.parse::<u8>(),
        };
        let frame =
            number.ok().filter(|_| length.len() < 2).and_then(|length| Frame::remote(id, length).ok());
        let problem =
            if length.contains('_') { FrameTextProblem::LengthCode } else { FrameTextProblem::RemoteLength };
        return frame.map_or(wrong(begin + 1, problem), Ok);
    }
    let (bytes, length) = bytes(rest, begin, false)?;
    let bytes = bytes.get(..length).unwrap_or_default();
    Frame::data(id, bytes).or(wrong(begin, FrameTextProblem::Length { bytes: length, is_fd: false }))
}

/// Reads an identifier: 3 digits for 11 bits, 8 for 29.
///
/// # Errors
/// [`FrameTextError`]
pub fn identifier(digits: &str) -> Result<Id, FrameTextError> {
    if let Some((at, sign)) = digits.char_indices().find(|(_, sign)| !sign.is_ascii_hexdigit()) {
        return Err(FrameTextError { at, problem: FrameTextProblem::NoDigit { sign } });
    }
    let number = u32::from_str_radix(digits, 16).unwrap_or(u32::MAX);
    let id = match digits.len() {
        3 => Id::base(number),
        8 => Id::extended(number),
        digits => return Err(FrameTextError { at: 0, problem: FrameTextProblem::IdDigits { digits } }),
    };
    id.map_err(|error| FrameTextError { at: 0, problem: FrameTextProblem::Id(error) })
}

/// Reads bytes, which dots may separate. What is more than a frame can have is counted and not kept.
fn bytes(text: &str, begin: usize, is_fd: bool) -> Result<([u8; Frame::MAX_BYTES], usize), FrameTextError> {
    let mut bytes = [0; Frame::MAX_BYTES];
    let (mut length, mut half) = (0, None);
    for (at, sign) in text.char_indices() {
        let wrong = |problem| FrameTextError { at: begin + at, problem };
        let digit = match sign {
            '.' if half.is_none() => continue,
            '.' => return Err(wrong(FrameTextProblem::HalfByte)),
            '_' if half.is_none() => return Err(wrong(FrameTextProblem::LengthCode)),
            sign => sign.to_digit(16).ok_or(wrong(FrameTextProblem::NoDigit { sign }))? as u8,
        };
        half = match half {
            None => Some(digit),
            Some(high) => {
                if let Some(byte) = bytes.get_mut(length) {
                    *byte = high << 4 | digit;
                }
                length += 1;
                None
            }
        };
    }
    if half.is_some() {
        return Err(FrameTextError { at: begin + text.len(), problem: FrameTextProblem::HalfByte });
    }
    let most = if is_fd { Frame::MAX_BYTES } else { 8 };
    if length > most {
        let problem = FrameTextProblem::Length { bytes: length, is_fd };
        return Err(FrameTextError { at: begin, problem });
    }
    Ok((bytes, length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn frames_of_every_kind_are_read_as_cansend_reads_them() {
        // The examples of cansend's own help.
        for (text, shown) in [
            ("5A1#11.2233.44556677.88", "5A1#1122334455667788"),
            ("123#DEADBEEF", "123#DEADBEEF"),
            ("5aa#", "5AA#"),
            ("123##1", "123##1"),
            ("213##311223344", "213##111223344"),
            ("1F334455#1122334455667788", "1F334455#1122334455667788"),
            ("123#R", "123#R0"),
            ("00000123#R3", "00000123#R3"),
        ] {
            assert_eq!(parse(text).map(|frame| format!("{frame:?}")).as_deref(), Ok(shown), "{text}");
        }
    }

    #[test]
    fn what_is_wrong_is_named_with_its_place() {
        for (text, at, words) in [
            ("123", 3, "there is no `#`"),
            ("12#00", 0, "the identifier has 2 digits"),
            ("8FF#00", 0, "identifier 0x8FF is out of range"),
            ("20000000#00", 0, "identifier 0x20000000 is out of range"),
            ("12G#00", 2, "`G` is no hexadecimal digit"),
            ("123#0", 5, "the last byte has one digit"),
            ("123#0.11", 5, "the last byte has one digit"),
            ("123#00zz", 6, "`z` is no hexadecimal digit"),
            ("123#112233445566778899", 4, "9 bytes: a classic frame has at most 8"),
            ("123##", 5, "one hexadecimal digit of flags"),
            ("123##0112233445566778899", 6, "9 bytes: a CAN FD frame has"),
            ("123#R9", 5, "behind `R` belongs nothing, or a length"),
            ("123#R8_9", 5, "a length code behind `_`"),
            ("123#1122_9", 8, "a length code behind `_`"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.to_string().starts_with(words), "{text}: {error}");
            assert_eq!(error.at, at, "{text}: {error}");
        }
    }

    proptest! {
        #[test]
        fn what_is_read_is_shown_and_read_as_the_same(text in "[0-9A-F]{3}#{1,2}[0-9A-Fa-fR._]{0,20}|\\PC{0,20}") {
            if let Ok(frame) = parse(&text) {
                prop_assert_eq!(parse(&format!("{frame:?}")), Ok(frame));
            }
        }
    }
}
