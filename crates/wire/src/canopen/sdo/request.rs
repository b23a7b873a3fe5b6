//! Requests of an SDO client.

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

/// A frame from client to server (CiA 301, 7.2.4.3). Reserved bits are sent as zero and ignored when decoding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoRequest {
    /// Expedited download.
    DownloadExpedited {
        /// The object.
        object: ObjectAddress,
        /// Its new value.
        data: Expedited,
    },
    /// Initiate a segmented download.
    DownloadSegmented {
        /// The object.
        object: ObjectAddress,
        /// The announced size in bytes, if indicated.
        size: Option<u32>,
    },
    /// A segment of a download.
    DownloadSegment {
        /// The toggle bit, beginning with `false`.
        toggle: bool,
        /// The segment's data.
        data: Segment,
        /// True if it is the last one.
        is_last: bool,
    },
    /// Initiate an upload.
    Upload {
        /// The object.
        object: ObjectAddress,
    },
    /// Request the next segment of an upload.
    UploadSegment {
        /// The toggle bit, beginning with `false`.
        toggle: bool,
    },
    /// Initiate a block upload.
    BlockUpload {
        /// The object.
        object: ObjectAddress,
        /// Number of segments in a block.
        block_size: BlockSize,
        /// True if the client supports the CRC.
        has_crc: bool,
    },
    /// Start a block upload.
    BlockUploadStart,
    /// Acknowledge a block, in full or in part.
    BlockAcknowledge {
        /// The last segment that arrived in order; 0 for none.
        last: u8,
        /// Number of segments in the next block.
        block_size: BlockSize,
    },
    /// End a block upload.
    BlockUploadEnd,
    /// Initiate a block download.
    BlockDownload {
        /// The object.
        object: ObjectAddress,
        /// The announced size in bytes, if indicated.
        size: Option<u32>,
        /// True if the client supports the CRC.
        has_crc: bool,
    },
    /// End a block download.
    BlockDownloadEnd {
        /// Number of unused bytes in the last segment: 0 to 7.
        unused: u8,
        /// The CRC of all data; 0 if it is not used.
        crc: u16,
    },
    /// Abort the transfer.
    Abort {
        /// The object of the transfer.
        object: ObjectAddress,
        /// The abort code.
        code: AbortCode,
    },
}

impl SdoRequest {
    /// The frame of this request to a node ID (1 to 127).
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

    /// Decodes node ID and request; `None` for other frames. The segments of a block look like other requests: decode
    /// them with [`BlockSegment`](super::BlockSegment) during a block.
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
                size: wire::indicated_block_size(bytes),
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
        fn a_decoded_request_is_encoded_and_decoded_to_the_same(bytes: [u8; 8], node in 1..=127u8) {
            let id = Id::canopen(function_code::SDO_REQUEST, node);
            if let Some((sender, request)) = SdoRequest::decode(&Frame::of(id, bytes)) {
                prop_assert_eq!(sender, node);
                prop_assert_eq!(SdoRequest::decode(&request.frame(node)), Some((node, request)));
            }
        }
    }

    #[test]
    fn frames_that_cannot_be_requests_are_not_decoded() {
        let id = Id::canopen(function_code::SDO_REQUEST, 2);
        assert_eq!(SdoRequest::decode(&Frame::of(id, [0x40, 0x61, 0x60, 0, 0, 0, 0])), None, "seven bytes");
        assert_eq!(SdoRequest::decode(&Frame::remote(id, 8).unwrap()), None, "remote frame");
        assert_eq!(SdoRequest::decode(&Frame::of(id, [0xA4, 0, 0, 0, 0, 0, 0, 0])), None, "no segments");
        assert_eq!(
            SdoRequest::decode(&Frame::of(id, [0xE0, 0, 0, 0, 0, 0, 0, 0])),
            None,
            "no such specifier"
        );
        let server = Id::canopen(function_code::SDO_RESPONSE, 2);
        assert_eq!(SdoRequest::decode(&Frame::of(server, [0x40; 8])), None, "other identifier");
    }
}
