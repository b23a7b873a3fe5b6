//! What a server sends.

use takt_rt::{Frame, Id};

use super::abort::AbortCode;
use super::wire::{
    self, BLOCK_CONSUMER, BLOCK_PRODUCER, BlockSize, CRC_SUPPORTED, EXPEDITED, Expedited, LAST,
    SPECIFIER_SHIFT, Segment, TOGGLE,
};
use crate::canopen::object::ObjectAddress;
use crate::canopen::{function_code, node_of};

const UPLOAD_SEGMENT: u8 = 0;
const DOWNLOAD_SEGMENT: u8 = 1;
const UPLOAD: u8 = 2;
const DOWNLOAD: u8 = 3;

/// A frame from server to client (CiA 301, 7.2.4.3). Bits that the standard reserves are sent as zero and not looked
/// at when reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// This is the object's value.
    UploadExpedited {
        /// The object.
        object: ObjectAddress,
        /// Its value.
        data: Expedited,
    },
    /// The object's value will come in segments.
    UploadSegmented {
        /// The object.
        object: ObjectAddress,
        /// How many bytes will come, if that is told.
        size: Option<u32>,
    },
    /// A piece of the data that is being read.
    UploadSegment {
        /// That of the request.
        toggle: bool,
        /// The piece.
        data: Segment,
        /// Whether it is the last one.
        is_last: bool,
    },
    /// The object has been written, or its segments may come.
    DownloadAccepted {
        /// The object.
        object: ObjectAddress,
    },
    /// The segment has been taken.
    DownloadSegmentAccepted {
        /// That of the request.
        toggle: bool,
    },
    /// The object's value will come in blocks.
    BlockUpload {
        /// The object.
        object: ObjectAddress,
        /// How many bytes will come, if that is told.
        size: Option<u32>,
        /// Whether the server can make the checksum.
        has_crc: bool,
    },
    /// All blocks have been sent.
    BlockUploadEnd {
        /// How many bytes of the last segment do not count: 0 to 7.
        unused: u8,
        /// The checksum of all data; 0 when it was not agreed on.
        crc: u16,
    },
    /// Blocks may come.
    BlockDownload {
        /// The object.
        object: ObjectAddress,
        /// How many segments to send before waiting for an acknowledgement.
        block_size: BlockSize,
        /// Whether the server can check the checksum.
        has_crc: bool,
    },
    /// A block has come, or the beginning of it.
    BlockAcknowledge {
        /// The last segment that came in order; 0 for none.
        last: u8,
        /// How many segments the next block may have.
        block_size: BlockSize,
    },
    /// All blocks have come and are right.
    BlockDownloadEnd,
    /// The transfer is given up.
    Abort {
        /// The object that was being transferred.
        object: ObjectAddress,
        /// Why.
        code: AbortCode,
    },
}

impl Response {
    /// The frame that carries this response from `node` (1 to 127).
    pub fn frame(self, node: u8) -> Frame {
        let bytes = match self {
            Self::UploadExpedited { object, data } => data.encode(UPLOAD, object),
            Self::UploadSegmented { object, size } => wire::with_size(UPLOAD, object, size),
            Self::UploadSegment { toggle, data, is_last } => data.encode(UPLOAD_SEGMENT, toggle, is_last),
            Self::DownloadAccepted { object } => {
                wire::with_address(DOWNLOAD << SPECIFIER_SHIFT, object, [0; 4])
            }
            Self::DownloadSegmentAccepted { toggle } => {
                let toggle = if toggle { TOGGLE } else { 0 };
                [DOWNLOAD_SEGMENT << SPECIFIER_SHIFT | toggle, 0, 0, 0, 0, 0, 0, 0]
            }
            Self::BlockUpload { object, size, has_crc } => {
                wire::block_producer_initiation(object, size, has_crc)
            }
            Self::BlockUploadEnd { unused, crc } => wire::block_end(unused, crc),
            Self::BlockDownload { object, block_size, has_crc } => {
                wire::block_consumer_initiation(object, block_size, has_crc)
            }
            Self::BlockAcknowledge { last, block_size } => wire::block_acknowledgement(last, block_size),
            Self::BlockDownloadEnd => [BLOCK_CONSUMER << SPECIFIER_SHIFT | 1, 0, 0, 0, 0, 0, 0, 0],
            Self::Abort { object, code } => {
                wire::with_address(wire::ABORT << SPECIFIER_SHIFT, object, code.number().to_le_bytes())
            }
        };
        Frame::of(Id::canopen(function_code::SDO_RESPONSE, node), bytes)
    }

    /// Reads the node and the response of a frame; `None` when it is none. The segments of a block look like other
    /// responses: they are read with [`BlockSegment`](super::BlockSegment) where they are due.
    pub fn decode(frame: &Frame) -> Option<(u8, Self)> {
        let node = node_of(frame, function_code::SDO_RESPONSE)?;
        Some((node, Self::from_bytes(wire::eight_bytes(frame)?)?))
    }

    fn from_bytes(bytes: [u8; 8]) -> Option<Self> {
        let object = wire::address(bytes);
        let toggle = bytes[0] & TOGGLE != 0;
        Some(match bytes[0] >> SPECIFIER_SHIFT {
            UPLOAD_SEGMENT => {
                Self::UploadSegment { toggle, data: Segment::decode(bytes), is_last: bytes[0] & LAST != 0 }
            }
            DOWNLOAD_SEGMENT => Self::DownloadSegmentAccepted { toggle },
            UPLOAD if bytes[0] & EXPEDITED != 0 => {
                Self::UploadExpedited { object, data: Expedited::decode(bytes) }
            }
            UPLOAD => Self::UploadSegmented { object, size: wire::size(bytes) },
            DOWNLOAD => Self::DownloadAccepted { object },
            wire::ABORT if bytes[0] == wire::ABORT << SPECIFIER_SHIFT => {
                let code = AbortCode::from_number(u32::from_le_bytes(wire::tail(bytes)));
                Self::Abort { object, code }
            }
            BLOCK_CONSUMER => match bytes[0] & 0x03 {
                0 => Self::BlockDownload {
                    object,
                    block_size: BlockSize::new(bytes[4])?,
                    has_crc: bytes[0] & CRC_SUPPORTED != 0,
                },
                1 => Self::BlockDownloadEnd,
                2 => Self::BlockAcknowledge { last: bytes[1], block_size: BlockSize::new(bytes[2])? },
                _ => return None,
            },
            BLOCK_PRODUCER if bytes[0] & 0x01 == 0 => Self::BlockUpload {
                object,
                size: wire::block_size_told(bytes),
                has_crc: bytes[0] & CRC_SUPPORTED != 0,
            },
            BLOCK_PRODUCER => {
                let (unused, crc) = wire::read_block_end(bytes);
                Self::BlockUploadEnd { unused, crc }
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
            let id = Id::canopen(function_code::SDO_RESPONSE, node);
            if let Some((sender, response)) = Response::decode(&Frame::of(id, bytes)) {
                prop_assert_eq!(sender, node);
                prop_assert_eq!(Response::decode(&response.frame(node)), Some((node, response)));
            }
        }
    }

    #[test]
    fn frames_that_cannot_be_responses_are_refused() {
        let id = Id::canopen(function_code::SDO_RESPONSE, 2);
        assert_eq!(Response::decode(&Frame::of(id, [0x60, 0x60, 0x60, 0])), None, "four bytes");
        assert_eq!(Response::decode(&Frame::of(id, [0xE0, 0, 0, 0, 0, 0, 0, 0])), None, "no such specifier");
        assert_eq!(Response::decode(&Frame::of(Id::canopen(0x580, 0), [0x60; 8])), None, "no node");
    }
}
