//! The common parts of requests and responses: addresses, and data of at most four or seven bytes.

use takt_rt::{Frame, FrameKind};

use crate::canopen::object::ObjectAddress;

/// Position of the command specifier in the first byte (ccs of requests, scs of responses).
pub(super) const SPECIFIER_SHIFT: u8 = 5;
/// Bit 1 of the first byte of an initiation: expedited, the data is in this frame.
pub(super) const EXPEDITED: u8 = 0x02;
/// Bit 0 of the first byte of an initiation: the size is indicated.
pub(super) const SIZE_INDICATED: u8 = 0x01;
/// Bit 4 of the first byte of a segment: the toggle bit, beginning with 0.
pub(super) const TOGGLE: u8 = 0x10;
/// Bit 0 of the first byte of a segment: the last one.
pub(super) const LAST: u8 = 0x01;
/// The command specifier of an abort, in both directions.
pub(super) const ABORT: u8 = 4;

/// The command specifier of the receiver of blocks: the server of a block download, the client of a block upload.
pub(super) const BLOCK_CONSUMER: u8 = 5;
/// The command specifier of the sender of blocks: the server of a block upload, the client of a block download.
pub(super) const BLOCK_PRODUCER: u8 = 6;
/// Bit 2 of the first byte of a block initiation: the sender supports the CRC.
pub(super) const CRC_SUPPORTED: u8 = 0x04;
/// Bit 1 of the first byte of a block initiation by the producer: the size is indicated.
pub(super) const BLOCK_SIZE_INDICATED: u8 = 0x02;

/// The eight bytes of an SDO frame; `None` for other frames.
pub(super) fn eight_bytes(frame: &Frame) -> Option<[u8; 8]> {
    if frame.kind() != FrameKind::Data {
        return None;
    }
    frame.payload().try_into().ok()
}

/// An initiation or an abort: first byte, address, four bytes.
pub(super) fn with_address(first: u8, object: ObjectAddress, [a, b, c, d]: [u8; 4]) -> [u8; 8] {
    let [low, high] = object.index.to_le_bytes();
    [first, low, high, object.subindex, a, b, c, d]
}

/// The address in an initiation or an abort.
pub(super) fn address([_, low, high, subindex, ..]: [u8; 8]) -> ObjectAddress {
    ObjectAddress::new(u16::from_le_bytes([low, high]), subindex)
}

/// The last four bytes of an initiation or an abort.
pub(super) fn tail([_, _, _, _, a, b, c, d]: [u8; 8]) -> [u8; 4] {
    [a, b, c, d]
}

/// The size in a segmented initiation, if indicated.
pub(super) fn size(bytes: [u8; 8]) -> Option<u32> {
    (bytes[0] & SIZE_INDICATED != 0).then(|| u32::from_le_bytes(tail(bytes)))
}

/// The bytes of a segmented initiation.
pub(super) fn with_size(specifier: u8, object: ObjectAddress, size: Option<u32>) -> [u8; 8] {
    let flags = if size.is_some() { SIZE_INDICATED } else { 0 };
    with_address(specifier << SPECIFIER_SHIFT | flags, object, size.unwrap_or(0).to_le_bytes())
}

/// Data of an expedited transfer: one to four bytes, or four bytes without an indicated size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Expedited {
    bytes: [u8; 4],
    length: Option<u8>,
}

impl Expedited {
    /// One to four bytes; `None` for any other number.
    pub fn of(data: &[u8]) -> Option<Self> {
        if !(1..=4).contains(&data.len()) {
            return None;
        }
        let mut bytes = [0; 4];
        bytes.iter_mut().zip(data).for_each(|(to, from)| *to = *from);
        Some(Self { bytes, length: Some(data.len() as u8) })
    }

    /// The bytes; all four when the size is not indicated.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length.unwrap_or(4).into()).unwrap_or(&self.bytes)
    }

    /// Returns `true` if the size is indicated.
    pub const fn is_size_indicated(&self) -> bool {
        self.length.is_some()
    }

    pub(super) fn encode(self, specifier: u8, object: ObjectAddress) -> [u8; 8] {
        let flags = match self.length {
            Some(length) => (4 - length) << 2 | EXPEDITED | SIZE_INDICATED,
            None => EXPEDITED,
        };
        with_address(specifier << SPECIFIER_SHIFT | flags, object, self.bytes)
    }

    pub(super) fn decode(bytes: [u8; 8]) -> Self {
        let length = (bytes[0] & SIZE_INDICATED != 0).then_some(4 - (bytes[0] >> 2 & 0x03));
        Self { bytes: tail(bytes), length }
    }
}

/// The data of one segment: none to seven bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    bytes: [u8; 7],
    length: u8,
}

impl Segment {
    /// The largest number of bytes in a segment.
    pub const MAX_BYTES: usize = 7;

    /// The first bytes of `data`, as many as fit.
    pub fn first_of(data: &[u8]) -> Self {
        let mut bytes = [0; Self::MAX_BYTES];
        bytes.iter_mut().zip(data).for_each(|(to, from)| *to = *from);
        Self { bytes, length: data.len().min(Self::MAX_BYTES) as u8 }
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length.into()).unwrap_or(&self.bytes)
    }

    pub(super) fn encode(self, specifier: u8, toggle: bool, is_last: bool) -> [u8; 8] {
        let toggle = if toggle { TOGGLE } else { 0 };
        let last = if is_last { LAST } else { 0 };
        let unused = (Self::MAX_BYTES as u8 - self.length) << 1;
        let [a, b, c, d, e, f, g] = self.bytes;
        [specifier << SPECIFIER_SHIFT | toggle | unused | last, a, b, c, d, e, f, g]
    }

    pub(super) fn decode([first, a, b, c, d, e, f, g]: [u8; 8]) -> Self {
        Self { bytes: [a, b, c, d, e, f, g], length: Self::MAX_BYTES as u8 - (first >> 1 & 0x07) }
    }
}

/// Number of segments in a block: 1 to 127.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockSize(u8);

impl BlockSize {
    /// The block size that the client requests. 32 frames last 4 ms at 1 Mbit/s, which leaves the bus to others. With
    /// such sequence numbers, the first byte of a late segment never looks like an initiation.
    pub(super) const FOR_UPLOADS: Self = Self(32);

    /// `None` outside 1 to 127.
    pub const fn new(segments: u8) -> Option<Self> {
        match segments {
            1..=127 => Some(Self(segments)),
            _ => None,
        }
    }

    /// The number of segments.
    pub const fn segments(self) -> u8 {
        self.0
    }
}

/// One segment of a block. Outside a block its bytes have another meaning, so it is decoded only during a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockSegment {
    number: u8,
    data: [u8; 7],
    is_last: bool,
}

impl BlockSegment {
    const LAST: u8 = 0x80;

    /// Segment `number` of its block, with the first seven bytes of `data`, filled with zeros. `is_last`: it is the
    /// last segment of the transfer. `None` when the number is not 1 to 127.
    pub fn new(number: u8, data: &[u8], is_last: bool) -> Option<Self> {
        let number = BlockSize::new(number)?.segments();
        let mut bytes = [0; 7];
        bytes.iter_mut().zip(data).for_each(|(to, from)| *to = *from);
        Some(Self { number, data: bytes, is_last })
    }

    /// Its sequence number in the block, counted from 1.
    pub const fn number(self) -> u8 {
        self.number
    }

    /// Its seven bytes; some of the last segment may be unused.
    pub const fn data(self) -> [u8; 7] {
        self.data
    }

    /// Returns `true` if it is the last one of the transfer.
    pub const fn is_last(self) -> bool {
        self.is_last
    }

    /// Encodes it.
    pub const fn encode(self) -> [u8; 8] {
        let [a, b, c, d, e, f, g] = self.data;
        let last = if self.is_last { Self::LAST } else { 0 };
        [self.number | last, a, b, c, d, e, f, g]
    }

    /// Decodes it; `None` when the number is 0, which during a block can only be an abort.
    pub fn decode([first, a, b, c, d, e, f, g]: [u8; 8]) -> Option<Self> {
        Self::new(first & !Self::LAST, &[a, b, c, d, e, f, g], first & Self::LAST != 0)
    }
}

/// Encodes the end of a block transfer: number of unused bytes in the last segment, and CRC.
pub(super) fn block_end(unused: u8, crc: u16) -> [u8; 8] {
    let [low, high] = crc.to_le_bytes();
    [BLOCK_PRODUCER << SPECIFIER_SHIFT | (unused & 0x07) << 2 | 1, low, high, 0, 0, 0, 0, 0]
}

/// Decodes the unused bytes and the CRC of the end of a block transfer.
pub(super) fn read_block_end([first, low, high, ..]: [u8; 8]) -> (u8, u16) {
    (first >> 2 & 0x07, u16::from_le_bytes([low, high]))
}

/// Encodes the initiation by the producer.
pub(super) fn block_producer_initiation(object: ObjectAddress, size: Option<u32>, has_crc: bool) -> [u8; 8] {
    let crc = if has_crc { CRC_SUPPORTED } else { 0 };
    let indicated = if size.is_some() { BLOCK_SIZE_INDICATED } else { 0 };
    let first = BLOCK_PRODUCER << SPECIFIER_SHIFT | crc | indicated;
    with_address(first, object, size.unwrap_or(0).to_le_bytes())
}

/// The size in the producer's initiation, if indicated.
pub(super) fn indicated_block_size(bytes: [u8; 8]) -> Option<u32> {
    (bytes[0] & BLOCK_SIZE_INDICATED != 0).then(|| u32::from_le_bytes(tail(bytes)))
}

/// Encodes the initiation by the consumer.
pub(super) fn block_consumer_initiation(object: ObjectAddress, size: BlockSize, has_crc: bool) -> [u8; 8] {
    let crc = if has_crc { CRC_SUPPORTED } else { 0 };
    with_address(BLOCK_CONSUMER << SPECIFIER_SHIFT | crc, object, [size.segments(), 0, 0, 0])
}

/// Encodes a consumer's acknowledgement: the last segment in order, and the size of the next block.
pub(super) fn block_acknowledgement(last: u8, next: BlockSize) -> [u8; 8] {
    [BLOCK_CONSUMER << SPECIFIER_SHIFT | 2, last, next.segments(), 0, 0, 0, 0, 0]
}
