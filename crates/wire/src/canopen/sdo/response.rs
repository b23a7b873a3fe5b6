//! Responses of an SDO server.

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

/// A frame from server to client (CiA 301, 7.2.4.3). Reserved bits are sent as zero and ignored when decoding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoResponse {
    /// Expedited upload.
    UploadExpedited {
        /// The object.
        object: ObjectAddress,
        /// Its value.
        data: Expedited,
    },
    /// A segmented upload follows.
    UploadSegmented {
        /// The object.
        object: ObjectAddress,
        /// The announced size in bytes, if indicated.
        size: Option<u32>,
    },
    /// A segment of an upload.
    UploadSegment {
        /// The toggle bit of the request.
        toggle: bool,
        /// The segment's data.
        data: Segment,
        /// True if it is the last one.
        is_last: bool,
    },
    /// The object has been written, or its segments may follow.
    DownloadAccepted {
        /// The object.
        object: ObjectAddress,
    },
    /// The segment has been received.
    DownloadSegmentAccepted {
        /// The toggle bit of the request.
        toggle: bool,
    },
    /// A block upload follows.
    BlockUpload {
        /// The object.
        object: ObjectAddress,
        /// The announced size in bytes, if indicated.
        size: Option<u32>,
        /// True if the server supports the CRC.
        has_crc: bool,
    },
    /// End a block upload.
    BlockUploadEnd {
        /// Number of unused bytes in the last segment: 0 to 7.
        unused: u8,
        /// The CRC of all data; 0 if it is not used.
        crc: u16,
    },
    /// A block download may follow.
    BlockDownload {
        /// The object.
        object: ObjectAddress,
        /// Number of segments in a block.
        block_size: BlockSize,
        /// True if the server supports the CRC.
        has_crc: bool,
    },
    /// Acknowledge a block, in full or in part.
    BlockAcknowledge {
        /// The last segment that arrived in order; 0 for none.
        last: u8,
        /// Number of segments in the next block.
        block_size: BlockSize,
    },
    /// End a block download.
    BlockDownloadEnd,
    /// Abort the transfer.
    Abort {
        /// The object of the transfer.
        object: ObjectAddress,
        /// The abort code.
        code: AbortCode,
    },
}

impl SdoResponse {
    /// The frame of this response from a node ID (1 to 127).
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

    /// Decodes node ID and response; `None` for other frames. The segments of a block look like other responses: decode
    /// them with [`BlockSegment`](super::BlockSegment) during a block.
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
                size: wire::indicated_block_size(bytes),
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
        fn a_decoded_response_is_encoded_and_decoded_to_the_same(bytes: [u8; 8], node in 1..=127u8) {
            let id = Id::canopen(function_code::SDO_RESPONSE, node);
            if let Some((sender, response)) = SdoResponse::decode(&Frame::of(id, bytes)) {
                prop_assert_eq!(sender, node);
                prop_assert_eq!(SdoResponse::decode(&response.frame(node)), Some((node, response)));
            }
        }
    }

    #[test]
    fn frames_that_cannot_be_responses_are_not_decoded() {
        let id = Id::canopen(function_code::SDO_RESPONSE, 2);
        assert_eq!(SdoResponse::decode(&Frame::of(id, [0x60, 0x60, 0x60, 0])), None, "four bytes");
        assert_eq!(
            SdoResponse::decode(&Frame::of(id, [0xE0, 0, 0, 0, 0, 0, 0, 0])),
            None,
            "no such specifier"
        );
        assert_eq!(SdoResponse::decode(&Frame::of(Id::canopen(0x580, 0), [0x60; 8])), None, "no node");
    }
}
