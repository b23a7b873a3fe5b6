//! The client side of a block download after its initiation (CiA 301, 7.2.4.3.10 to 12).

use super::abort::AbortCode;
use super::block_upload::LOST_BLOCKS;
use super::crc::checksum;
use super::exchange_step::{ExchangeStep, FinalRequest};
use super::request::SdoRequest;
use super::response::SdoResponse;
use super::transfer::{Completed, SdoError};
use super::wire::{BlockSegment, BlockSize};

const SEGMENT_BYTES: usize = 7;

#[derive(Debug)]
pub(super) struct BlockDownload {
    /// Bytes that the server has acknowledged.
    confirmed: usize,
    /// Segments of the current block that have been sent.
    sent: u8,
    block_size: BlockSize,
    has_crc: bool,
    lost_blocks: u8,
}

/// The next frame.
pub(super) enum Next {
    /// A segment; unless it ends the block, another one follows at once.
    Segment { segment: BlockSegment, ends_block: bool },
    /// The end of the transfer.
    End(SdoRequest),
}

impl BlockDownload {
    pub fn new(block_size: BlockSize, has_crc: bool) -> Self {
        Self { confirmed: 0, sent: 0, block_size, has_crc, lost_blocks: 0 }
    }

    pub fn next(&mut self, data: &[u8]) -> Next {
        let offset = self.confirmed + SEGMENT_BYTES * usize::from(self.sent);
        let rest = data.get(offset..).unwrap_or(&[]);
        let is_last = rest.len() <= SEGMENT_BYTES;
        match BlockSegment::new(self.sent.saturating_add(1), rest, is_last) {
            Some(segment) if self.confirmed < data.len() => {
                self.sent = segment.number();
                Next::Segment { segment, ends_block: is_last || self.sent >= self.block_size.segments() }
            }
            _ => Next::End(self.end(data)),
        }
    }

    fn end(&self, data: &[u8]) -> SdoRequest {
        let unused = (SEGMENT_BYTES - data.len() % SEGMENT_BYTES) % SEGMENT_BYTES;
        let crc = if self.has_crc { checksum(data) } else { 0 };
        SdoRequest::BlockDownloadEnd { unused: unused as u8, crc }
    }

    pub fn receive(&mut self, length: usize, response: Option<SdoResponse>) -> ExchangeStep {
        let is_all_confirmed = self.confirmed >= length;
        match response {
            Some(SdoResponse::BlockAcknowledge { last, block_size }) if !is_all_confirmed => {
                self.acknowledged(length, last, block_size)
            }
            Some(SdoResponse::BlockDownloadEnd) if is_all_confirmed => {
                ExchangeStep::Finish { outcome: Ok(Completed::Downloaded), final_request: FinalRequest::None }
            }
            _ => ExchangeStep::Unusable,
        }
    }

    /// Segments that were not acknowledged are sent again.
    fn acknowledged(&mut self, length: usize, last: u8, block_size: BlockSize) -> ExchangeStep {
        self.lost_blocks = if last == 0 { self.lost_blocks + 1 } else { 0 };
        if last > self.sent || self.lost_blocks >= LOST_BLOCKS {
            return ExchangeStep::fail(SdoError::BlockSequence, AbortCode::InvalidSequenceNumber);
        }
        self.confirmed = (self.confirmed + SEGMENT_BYTES * usize::from(last)).min(length);
        self.block_size = block_size;
        self.sent = 0;
        ExchangeStep::Send
    }
}
