//! CAN frames that are always valid: 11- and 29-bit identifiers, data and remote frames of classic CAN (ISO 11898-1), and CAN FD
//! frames of up to 64 bytes.

use core::fmt;

/// An 11-bit (base) or 29-bit (extended) identifier.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Id(u32);

const EXTENDED: u32 = 1 << 31;
const BASE_MASK: u32 = 0x7FF;
const EXTENDED_MASK: u32 = 0x1FFF_FFFF;

impl Id {
    /// An 11-bit identifier, 0 to 0x7FF.
    ///
    /// # Errors
    /// [`FrameError::IdOutOfRange`] for a larger number.
    pub const fn base(id: u32) -> Result<Self, FrameError> {
        if id <= BASE_MASK { Ok(Self(id)) } else { Err(FrameError::IdOutOfRange { id, limit: BASE_MASK }) }
    }

    /// A 29-bit identifier, 0 to 0x1FFF_FFFF.
    ///
    /// # Errors
    /// [`FrameError::IdOutOfRange`] for a larger number.
    pub const fn extended(id: u32) -> Result<Self, FrameError> {
        if id <= EXTENDED_MASK {
            Ok(Self(id | EXTENDED))
        } else {
            Err(FrameError::IdOutOfRange { id, limit: EXTENDED_MASK })
        }
    }

    /// The identifier `function + node` of the pre-defined connection set of CANopen (CiA 301, 7.3.3). Both numbers are cut to
    /// their bits (`function` to 0x780, the node ID to 0x7F), so the result is always a valid 11-bit identifier.
    pub const fn canopen(function: u16, node: u8) -> Self {
        Self((function as u32 & 0x780) | (node as u32 & 0x7F))
    }

    /// Returns `true` if one of the constructors can make it. An identifier that was decoded from bytes need not be such.
    #[cfg(feature = "checkpoint")]
    pub fn is_valid(self) -> bool {
        let number = self.value();
        let made = if self.is_extended() { Self::extended(number) } else { Self::base(number) };
        made == Ok(self)
    }

    /// The number of the identifier. An 11-bit and a 29-bit identifier can have the same number.
    pub const fn value(self) -> u32 {
        self.0 & EXTENDED_MASK
    }

    /// Returns `true` if this is a 29-bit identifier.
    pub const fn is_extended(self) -> bool {
        self.0 & EXTENDED != 0
    }

    /// The priority in the arbitration: the smaller key wins. An 11-bit identifier wins against the 29-bit identifiers that begin
    /// with the same 11 bits, because its RTR and IDE bits are dominant.
    pub const fn arbitration_key(self) -> u64 {
        if self.is_extended() {
            let id = self.value() as u64;
            (id >> 18) << 20 | 1 << 19 | (id & 0x3_FFFF)
        } else {
            (self.value() as u64) << 20
        }
    }
}

impl fmt::Debug for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_extended() { write!(f, "{:08X}", self.value()) } else { write!(f, "{:03X}", self.value()) }
    }
}

/// What is wrong with an identifier or a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The identifier is larger than its field.
    IdOutOfRange {
        /// The identifier that was given.
        id: u32,
        /// The largest identifier of this kind.
        limit: u32,
    },
    /// No frame of this kind has this length.
    Length {
        /// The length that was given, in bytes.
        length: usize,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::IdOutOfRange { id, limit } => {
                write!(f, "identifier 0x{id:X} is out of range: expected 0 to 0x{limit:X}")
            }
            Self::Length { length } => write!(
                f,
                "no frame has {length} bytes: expected 0 to 8, or 12, 16, 20, 24, 32, 48 or 64 for CAN FD"
            ),
        }
    }
}

impl core::error::Error for FrameError {}

/// The four kinds of frame on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub enum FrameKind {
    /// A classic data frame, 0 to 8 bytes.
    Data = 0,
    /// A classic remote frame (RTR): a length, no data.
    Remote = 1,
    /// A CAN FD frame at one bit rate.
    Fd = 2,
    /// A CAN FD frame with bit-rate switching (BRS): its data phase has the second, faster bit rate.
    FdBitRateSwitch = 3,
}

/// The three kinds of frame that carry data, with the numbers of [`FrameKind`]: then one becomes the other without an instruction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub enum FrameFormat {
    /// A classic data frame, 0 to 8 bytes.
    #[default]
    Classic = 0,
    /// A CAN FD frame at one bit rate.
    Fd = 2,
    /// A CAN FD frame with bit-rate switching (BRS).
    FdBitRateSwitch = 3,
}

impl FrameFormat {
    /// The kind of such a frame.
    pub const fn kind(self) -> FrameKind {
        match self {
            Self::Classic => FrameKind::Data,
            Self::Fd => FrameKind::Fd,
            Self::FdBitRateSwitch => FrameKind::FdBitRateSwitch,
        }
    }
}

/// One CAN or CAN FD frame.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Frame {
    id: Id,
    kind: FrameKind,
    length: u8,
    data: [u8; Frame::MAX_BYTES],
}

impl Frame {
    /// The longest payload of any frame, in bytes.
    pub const MAX_BYTES: usize = 64;

    /// A classic data frame of 0 to 8 bytes.
    ///
    /// # Errors
    /// [`FrameError::Length`] for more bytes.
    pub fn data(id: Id, bytes: &[u8]) -> Result<Self, FrameError> {
        if bytes.len() > 8 {
            return Err(FrameError::Length { length: bytes.len() });
        }
        Ok(Self::filled(id, FrameKind::Data, bytes))
    }

    /// A data frame of the first `length` of these bytes, behind which the others are 0; of all of them if it is larger.
    #[inline]
    pub(crate) fn packed(id: Id, format: FrameFormat, bytes: [u8; 8], length: usize) -> Self {
        let mut data = [0; Self::MAX_BYTES];
        if let Some(first) = data.first_chunk_mut() {
            *first = bytes;
        }
        Self { id, kind: format.kind(), length: length.min(bytes.len()) as u8, data }
    }

    /// This frame with the bits of the first eight bytes of another one set, too.
    pub(crate) fn with_bits_of(&self, other: &Self) -> Self {
        let mut data = self.data;
        if let Some(first) = data.first_chunk_mut() {
            *first = (self.first_word() | other.first_word()).to_le_bytes();
        }
        Self { data, ..*self }
    }

    /// A classic data frame of 0 to 8 bytes. The compiler checks the length.
    #[inline]
    pub fn of<const N: usize>(id: Id, bytes: [u8; N]) -> Self {
        const { assert!(N <= 8) };
        Self::filled(id, FrameKind::Data, &bytes)
    }

    /// A remote frame that asks for `length` (0 to 8) bytes.
    ///
    /// # Errors
    /// [`FrameError::Length`] for a larger length.
    pub fn remote(id: Id, length: u8) -> Result<Self, FrameError> {
        if length > 8 {
            return Err(FrameError::Length { length: length.into() });
        }
        Ok(Self { id, kind: FrameKind::Remote, length, data: [0; Self::MAX_BYTES] })
    }

    /// A CAN FD frame of 0 to 8, 12, 16, 20, 24, 32, 48 or 64 bytes: the lengths that a DLC can express.
    ///
    /// # Errors
    /// [`FrameError::Length`] for another length.
    pub fn fd(id: Id, bytes: &[u8], bit_rate_switch: bool) -> Result<Self, FrameError> {
        if !matches!(bytes.len(), 0..=8 | 12 | 16 | 20 | 24 | 32 | 48 | 64) {
            return Err(FrameError::Length { length: bytes.len() });
        }
        let kind = if bit_rate_switch { FrameKind::FdBitRateSwitch } else { FrameKind::Fd };
        Ok(Self::filled(id, kind, bytes))
    }

    #[inline]
    pub(crate) fn filled(id: Id, kind: FrameKind, bytes: &[u8]) -> Self {
        let mut data = [0; Self::MAX_BYTES];
        for (to, from) in data.iter_mut().zip(bytes) {
            *to = *from;
        }
        Self { id, kind, length: bytes.len().min(Self::MAX_BYTES) as u8, data }
    }

    /// Returns `true` if one of the constructors can make it. A frame that was decoded from bytes of another process need not be such.
    #[cfg(feature = "checkpoint")]
    pub fn is_valid(&self) -> bool {
        let made = match self.kind {
            FrameKind::Data => Self::data(self.id, self.payload()),
            FrameKind::Remote => Self::remote(self.id, self.length),
            FrameKind::Fd => Self::fd(self.id, self.payload(), false),
            FrameKind::FdBitRateSwitch => Self::fd(self.id, self.payload(), true),
        };
        self.id.is_valid() && made.is_ok_and(|made| made == *self && made.data == self.data)
    }

    /// The identifier.
    pub const fn id(&self) -> Id {
        self.id
    }

    /// The kind of the frame.
    pub const fn kind(&self) -> FrameKind {
        self.kind
    }

    /// Returns `true` if this is a CAN FD frame, with or without bit-rate switching.
    pub const fn is_fd(&self) -> bool {
        matches!(self.kind, FrameKind::Fd | FrameKind::FdBitRateSwitch)
    }

    /// The length in bytes: of the payload, or for a remote frame of the payload that it asks for.
    pub const fn length(&self) -> usize {
        self.length as usize
    }

    /// The payload; empty for a remote frame.
    pub fn payload(&self) -> &[u8] {
        let carried = if matches!(self.kind, FrameKind::Remote) { 0 } else { self.length() };
        self.data.get(..carried).unwrap_or(&[])
    }

    /// The first eight payload bytes as a number, low byte first. Missing bytes are zero. PDOs and SDOs are decoded from this number
    /// without a check of the length.
    pub fn first_word(&self) -> u64 {
        let [a, b, c, d, e, f, g, h, ..] = self.data;
        u64::from_le_bytes([a, b, c, d, e, f, g, h])
    }
}

impl PartialEq for Frame {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
            && self.kind == other.kind
            && self.length == other.length
            && self.payload() == other.payload()
    }
}

impl Eq for Frame {}

impl fmt::Debug for Frame {
    /// Writes `181#3712`, `601#R8` or `123##101`, as candump and cansend do.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}#", self.id)?;
        match self.kind {
            FrameKind::Remote => return write!(f, "R{}", self.length),
            FrameKind::Fd => write!(f, "#0")?,
            FrameKind::FdBitRateSwitch => write!(f, "#1")?,
            FrameKind::Data => {}
        }
        self.payload().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::format;
    use std::string::ToString;

    #[test]
    fn identifiers_outside_their_field_are_refused() {
        assert_eq!(Id::base(0x800), Err(FrameError::IdOutOfRange { id: 0x800, limit: 0x7FF }));
        assert!(Id::base(0x7FF).is_ok());
        assert!(Id::extended(0x2000_0000).is_err());
        assert!(Id::extended(0x1FFF_FFFF).unwrap().is_extended());
    }

    #[test]
    fn a_base_identifier_wins_against_the_extended_ones_that_begin_with_it() {
        let base = Id::base(0x123).unwrap();
        let extended = Id::extended(0x123 << 18).unwrap();
        let higher_priority = Id::extended(0x122 << 18 | 0x3_FFFF).unwrap();
        assert!(base.arbitration_key() < extended.arbitration_key());
        assert!(higher_priority.arbitration_key() < base.arbitration_key());
    }

    #[test]
    fn only_lengths_that_the_bus_can_carry_are_accepted() {
        let id = Id::canopen(0x180, 5);
        assert!(Frame::data(id, &[0; 9]).is_err());
        assert!(Frame::remote(id, 9).is_err());
        for length in 0..=65 {
            let allowed = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64].contains(&length);
            assert_eq!(Frame::fd(id, &[0; 65][..length], true).is_ok(), allowed, "{length} bytes");
        }
    }

    #[test]
    fn a_remote_frame_has_a_length_and_no_payload() {
        let frame = Frame::remote(Id::canopen(0x700, 1), 1).unwrap();
        assert_eq!((frame.length(), frame.payload()), (1, &[][..]));
    }

    #[test]
    fn frames_print_as_candump_writes_them() {
        let id = Id::base(0x181).unwrap();
        assert_eq!(format!("{:?}", Frame::of(id, [0x37, 0x12])), "181#3712");
        assert_eq!(format!("{:?}", Frame::remote(id, 8).unwrap()), "181#R8");
        assert_eq!(
            format!("{:?}", Frame::fd(Id::extended(0x123).unwrap(), &[1], true).unwrap()),
            "00000123##101"
        );
    }

    #[test]
    fn errors_say_what_was_given_and_what_was_expected() {
        assert_eq!(
            Id::base(0x800).unwrap_err().to_string(),
            "identifier 0x800 is out of range: expected 0 to 0x7FF"
        );
        let text = Frame::data(Id::canopen(0x180, 5), &[0; 9]).unwrap_err().to_string();
        assert!(text.starts_with("no frame has 9 bytes"), "{text}");
    }

    #[test]
    fn the_first_word_is_little_endian() {
        assert_eq!(Frame::of(Id::canopen(0x180, 1), [1, 2, 3]).first_word(), 0x03_02_01);
    }
}
