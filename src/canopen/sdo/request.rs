//! What a client sends.

use takt_rt::{Frame, Id};

use super::abort::AbortCode;
use super::wire::{
    self, BLOCK_CONSUMER, BLOCK_PRODUCER, BlockSize, CRC_SUPPORTED, EXPEDITED, Expedited, LAST,
    SPECIFIER_SHIFT, Segment, TOGGLE,
};
use crate::canopen::object::ObjectAddress;
use crate::canopen::{function_code, node_of};

const DOWNLOAD_SEGMENT: u8 = 0;
const DOWNLOAD: u8 = 1;
const UPLOAD: u8 = 2;
const UPLOAD_SEGMENT: u8 = 3;

/// A frame from client to server (CiA 301, 7.2.4.3). Bits that the standard reserves are sent as zero and not looked
/// at when reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Write this object; here is the data.
    DownloadExpedited {
        /// The object.
        object: ObjectAddress,
        /// Its new value.
        data: Expedited,
    },
    /// Write this object; the data follows in segments.
    DownloadSegmented {
        /// The object.
        object: ObjectAddress,
        /// How many bytes will follow, if that is told.
        size: Option<u32>,
    },
    /// A piece of the data that is being written.
    DownloadSegment {
        /// Alternates, beginning with `false`.
        toggle: bool,
        /// The piece.
        data: Segment,
        /// Whether it is the last one.
        is_last: bool,
    },
    /// Read this object.
    Upload {
        /// The object.
        object: ObjectAddress,
    },
    /// Send the next piece of the data that is being read.
    UploadSegment {
        /// Alternates, beginning with `false`.
        toggle: bool,
    },
    /// Read this object in blocks.
    BlockUpload {
        /// The object.
        object: ObjectAddress,
        /// How many segments to send before waiting for an acknowledgement.
        block_size: BlockSize,
        /// Whether the client can check the checksum.
        has_crc: bool,
    },
    /// Begin to send the blocks.
    BlockUploadStart,
    /// A block has come, or the beginning of it.
    BlockAcknowledge {
        /// The last segment that came in order; 0 for none.
        last: u8,
        /// How many segments the next block may have.
        block_size: BlockSize,
    },
    /// All blocks have come and are right.
    BlockUploadEnd,
    /// Write this object in blocks.
    BlockDownload {
        /// The object.
        object: ObjectAddress,
        /// How many bytes will follow, if that is told.
        size: Option<u32>,
        /// Whether the client can make the checksum.
        has_crc: bool,
    },
    /// All blocks have been sent.
    BlockDownloadEnd {
        /// How many bytes of the last segment do not count: 0 to 7.
        unused: u8,
        /// The checksum of all data; 0 when it was not agreed on.
        crc: u16,
    },
    /// Give the transfer up.
    Abort {
        /// The object that was being transferred.
        object: ObjectAddress,
        /// Why.
        code: AbortCode,
    },
}

impl Request {
    /// The frame that carries this request to `node` (1 to 127).
    pub fn frame(self, node: u8) -> Frame {
        let bytes = match self {
            Self::DownloadExpedited { object, data } => data.encode(DOWNLOAD, object),
            Self::DownloadSegmented { object, size } => wire::with_size(DOWNLOAD, object, size),
            Self::DownloadSegment { toggle, data, is_last } => data.encode(DOWNLOAD_SEGMENT, toggle, is_last),
            Self::Upload { object } => wire::with_address(UPLOAD << SPECIFIER_SHIFT, object, [0; 4]),
            Self::UploadSegment { toggle } => {
                let toggle = if toggle { TOGGLE } else { 0 };
                [UPLOAD_SEGMENT << SPECIFIER_SHIFT | toggle, 0, 0, 0, 0, 0, 0, 0]
            }
            Self::BlockUpload { object, block_size, has_crc } => {
                wire::block_consumer_initiation(object, block_size, has_crc)
            }
            Self::BlockUploadStart => [BLOCK_CONSUMER << SPECIFIER_SHIFT | 3, 0, 0, 0, 0, 0, 0, 0],
            Self::BlockAcknowledge { last, block_size } => wire::block_acknowledgement(last, block_size),
            Self::BlockUploadEnd => [BLOCK_CONSUMER << SPECIFIER_SHIFT | 1, 0, 0, 0, 0, 0, 0, 0],
            Self::BlockDownload { object, size, has_crc } => {
                wire::block_producer_initiation(object, size, has_crc)
            }
            Self::BlockDownloadEnd { unused, crc } => wire::block_end(unused, crc),
            Self::Abort { object, code } => {
                wire::with_address(wire::ABORT << SPECIFIER_SHIFT, object, code.number().to_le_bytes())
            }
        };
        Frame::of(Id::canopen(function_code::SDO_REQUEST, node), bytes)
    }

    /// Reads the node and the request of a frame; `None` when it is none. The segments of a block look like other
    /// requests: they are read with [`BlockSegment`](super::BlockSegment) where they are due.
    pub fn decode(frame: &Frame) -> Option<(u8, Self)> {
        let node = node_of(frame, function_code::SDO_REQUEST)?;
        Some((node, Self::from_bytes(wire::eight_bytes(frame)?)?))
    }

    fn from_bytes(bytes: [u8; 8]) -> Option<Self> {
        let object = wire::address(bytes);
        let toggle = bytes[0] & TOGGLE != 0;
        Some(match bytes[0] >> SPECIFIER_SHIFT {
            DOWNLOAD_SEGMENT => {
                Self::DownloadSegment { toggle, data: Segment::decode(bytes), is_last: bytes[0] & LAST != 0 }
            }
            DOWNLOAD if bytes[0] & EXPEDITED != 0 => {
                Self::DownloadExpedited { object, data: Expedited::decode(bytes) }
            }
            DOWNLOAD => Self::DownloadSegmented { object, size: wire::size(bytes) },
            UPLOAD => Self::Upload { object },
            UPLOAD_SEGMENT => Self::UploadSegment { toggle },
            wire::ABORT if bytes[0] == wire::ABORT << SPECIFIER_SHIFT => {
                let code = AbortCode::from_number(u32::from_le_bytes(wire::tail(bytes)));
                Self::Abort { object, code }
            }
            BLOCK_CONSUMER => match bytes[0] & 0x03 {
                0 => Self::BlockUpload {
                    object,
                    block_size: BlockSize::new(bytes[4])?,
                    has_crc: bytes[0] & CRC_SUPPORTED != 0,
                },
                1 => Self::BlockUploadEnd,
                2 => Self::BlockAcknowledge { last: bytes[1], block_size: BlockSize::new(bytes[2])? },
                _ => Self::BlockUploadStart,
            },
            BLOCK_PRODUCER if bytes[0] & 0x01 == 0 => Self::BlockDownload {
                object,
                size: wire::block_size_told(bytes),
                has_crc: bytes[0] & CRC_SUPPORTED != 0,
            },
            BLOCK_PRODUCER => {
                let (unused, crc) = wire::read_block_end(bytes);
                Self::BlockDownloadEnd { unused, crc }
            }
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_read_from_any_frame_is_read_again_from_its_own_frame(bytes: [u8; 8], node in 1..=127u8) {
            let id = Id::canopen(function_code::SDO_REQUEST, node);
            if let Some((sender, request)) = Request::decode(&Frame::of(id, bytes)) {
                prop_assert_eq!(sender, node);
                prop_assert_eq!(Request::decode(&request.frame(node)), Some((node, request)));
            }
        }
    }

    #[test]
    fn frames_that_cannot_be_requests_are_refused() {
        let id = Id::canopen(function_code::SDO_REQUEST, 2);
        assert_eq!(Request::decode(&Frame::of(id, [0x40, 0x61, 0x60, 0, 0, 0, 0])), None, "seven bytes");
        assert_eq!(Request::decode(&Frame::remote(id, 8).unwrap()), None, "remote frame");
        assert_eq!(Request::decode(&Frame::of(id, [0xA4, 0, 0, 0, 0, 0, 0, 0])), None, "no segments");
        assert_eq!(Request::decode(&Frame::of(id, [0xE0, 0, 0, 0, 0, 0, 0, 0])), None, "no such specifier");
        let server = Id::canopen(function_code::SDO_RESPONSE, 2);
        assert_eq!(Request::decode(&Frame::of(server, [0x40; 8])), None, "other identifier");
    }
}
