//! The client side of a block upload after its initiation (CiA 301, 7.2.4.3.13 to 15).

use super::abort::AbortCode;
use super::crc::checksum;
use super::exchange_step::{ExchangeStep, FinalRequest};
use super::request::SdoRequest;
use super::response::SdoResponse;
use super::transfer::{Completed, MAX_UPLOAD_BYTES, SdoError, Uploaded};
use super::wire::{BlockSegment, BlockSize};

const BLOCK_SIZE: BlockSize = BlockSize::FOR_UPLOADS;
/// Number of consecutive blocks without any segment after which the transfer fails.
pub(super) const LOST_BLOCKS: u8 = 3;

#[derive(Debug)]
pub(super) struct BlockUpload {
    bytes: Vec<u8>,
    size: Option<u32>,
    has_crc: bool,
    /// The last segment of the current block that arrived in order.
    last: u8,
    lost_blocks: u8,
    stage: Stage,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Start,
    Segments,
    Acknowledge { is_complete: bool },
    End,
}

impl BlockUpload {
    pub fn new(size: Option<u32>, has_crc: bool) -> Self {
        Self { bytes: vec![], size, has_crc, last: 0, lost_blocks: 0, stage: Stage::Start }
    }

    /// The request that is due.
    pub fn next_request(&mut self) -> SdoRequest {
        match self.stage {
            Stage::Start | Stage::Segments => {
                self.stage = Stage::Segments;
                SdoRequest::BlockUploadStart
            }
            Stage::Acknowledge { is_complete } => {
                let acknowledgement =
                    SdoRequest::BlockAcknowledge { last: self.last, block_size: BLOCK_SIZE };
                self.last = 0;
                self.stage = if is_complete { Stage::End } else { Stage::Segments };
                acknowledgement
            }
            Stage::End => SdoRequest::BlockUploadEnd,
        }
    }

    pub fn receive(&mut self, bytes: [u8; 8], response: Option<SdoResponse>) -> ExchangeStep {
        match (self.stage, BlockSegment::decode(bytes), response) {
            (Stage::Segments, Some(segment), _) => self.segment(segment),
            (Stage::End, _, Some(SdoResponse::BlockUploadEnd { unused, crc })) => self.end(unused, crc),
            _ => ExchangeStep::Unusable,
        }
    }

    /// A segment out of order is dropped; the acknowledgement at the end of the block makes the server repeat it.
    fn segment(&mut self, segment: BlockSegment) -> ExchangeStep {
        let is_in_order = segment.number() == self.last + 1;
        if is_in_order {
            self.bytes.extend_from_slice(&segment.data());
            self.last = segment.number();
        }
        if self.bytes.len() > MAX_UPLOAD_BYTES + segment.data().len() {
            return ExchangeStep::too_long();
        }
        if !segment.is_last() && segment.number() < BLOCK_SIZE.segments() {
            return ExchangeStep::Wait;
        }
        self.lost_blocks = if self.last == 0 { self.lost_blocks + 1 } else { 0 };
        if self.lost_blocks >= LOST_BLOCKS {
            return ExchangeStep::fail(SdoError::BlockSequence, AbortCode::InvalidSequenceNumber);
        }
        self.stage = Stage::Acknowledge { is_complete: segment.is_last() && is_in_order };
        ExchangeStep::Send
    }

    fn end(&mut self, unused: u8, crc: u16) -> ExchangeStep {
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.truncate(bytes.len().saturating_sub(unused.into()));
        if bytes.len() > MAX_UPLOAD_BYTES {
            return ExchangeStep::too_long();
        }
        let received = bytes.len() as u32;
        if let Some(announced) = self.size.filter(|announced| *announced != received) {
            return ExchangeStep::fail(
                SdoError::SizeMismatch { announced, received },
                AbortCode::LengthMismatch,
            );
        }
        let computed = checksum(&bytes);
        if self.has_crc && computed != crc {
            return ExchangeStep::fail(SdoError::Checksum { computed, received: crc }, AbortCode::CrcError);
        }
        let outcome = Ok(Completed::Uploaded(Uploaded { bytes, is_size_known: true }));
        ExchangeStep::Finish { outcome, final_request: FinalRequest::BlockUploadEnd }
    }
}
