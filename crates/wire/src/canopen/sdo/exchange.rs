//! The state machine of one transfer, without timing.

use takt_rt::{Frame, Id};

use super::abort::AbortCode;
use super::block_download::{BlockDownload, Next};
use super::block_upload::BlockUpload;
use super::exchange_step::{ExchangeStep, FinalRequest};
use super::request::SdoRequest;
use super::response::SdoResponse;
use super::transfer::{MAX_UPLOAD_BYTES, SdoError, Transfer};
use super::wire::{self, BlockSize, Expedited, Segment};
use crate::canopen::function_code;
use crate::canopen::object::ObjectAddress;

#[derive(Debug)]
pub(super) struct Exchange {
    transfer: Transfer,
    phase: ExchangePhase,
}

#[derive(Debug)]
enum ExchangePhase {
    Initiate,
    UploadSegments { bytes: Vec<u8>, size: Option<u32>, toggle: bool },
    DownloadSegments { sent: usize, toggle: bool },
    BlockUpload(BlockUpload),
    BlockDownload(BlockDownload),
}

impl Exchange {
    pub fn new(transfer: Transfer) -> Self {
        let transfer = match transfer {
            Transfer::BlockDownload { object, data } if data.len() <= 4 => {
                Transfer::Download { object, data }
            }
            transfer => transfer,
        };
        Self { transfer, phase: ExchangePhase::Initiate }
    }

    pub fn object(&self) -> ObjectAddress {
        self.transfer.object()
    }

    pub fn is_initiating(&self) -> bool {
        matches!(self.phase, ExchangePhase::Initiate)
    }

    /// Returns `true` if the server may be in the middle of this transfer.
    pub fn is_server_in_transfer(&self) -> bool {
        let is_done_at_once =
            matches!(self.initiation(), SdoRequest::DownloadExpedited { .. } | SdoRequest::Upload { .. });
        !self.is_initiating() || !is_done_at_once
    }

    pub fn begin_again(&mut self) {
        self.phase = ExchangePhase::Initiate;
    }

    /// Falls back to the kind of transfer that every server supports.
    pub fn fall_back(&mut self) {
        let data = match &mut self.transfer {
            Transfer::BlockDownload { data, .. } | Transfer::Download { data, .. } => {
                Some(std::mem::take(data))
            }
            Transfer::BlockUpload { .. } | Transfer::Upload { .. } => None,
        };
        let object = self.object();
        self.transfer = match data {
            Some(data) => Transfer::Download { object, data },
            None => Transfer::Upload { object },
        };
        self.phase = ExchangePhase::Initiate;
    }

    /// The frame that is due, and whether a response follows it (otherwise another frame).
    pub fn next_frame(&mut self, node: u8) -> (Frame, bool) {
        let request = match (&mut self.phase, &self.transfer) {
            (ExchangePhase::UploadSegments { toggle, .. }, _) => {
                SdoRequest::UploadSegment { toggle: *toggle }
            }
            (ExchangePhase::DownloadSegments { sent, toggle }, Transfer::Download { data, .. }) => {
                let rest = data.get(*sent..).unwrap_or(&[]);
                let is_last = rest.len() <= Segment::MAX_BYTES;
                SdoRequest::DownloadSegment { toggle: *toggle, data: Segment::first_of(rest), is_last }
            }
            (ExchangePhase::BlockUpload(block), _) => block.next_request(),
            (ExchangePhase::BlockDownload(block), Transfer::BlockDownload { data, .. }) => {
                match block.next(data) {
                    Next::Segment { segment, ends_block } => {
                        let id = Id::canopen(function_code::SDO_REQUEST, node);
                        return (Frame::of(id, segment.encode()), ends_block);
                    }
                    Next::End(request) => request,
                }
            }
            _ => self.initiation(),
        };
        (request.frame(node), true)
    }

    fn initiation(&self) -> SdoRequest {
        let size_of = |data: &[u8]| u32::try_from(data.len()).ok();
        match &self.transfer {
            Transfer::Upload { object } => SdoRequest::Upload { object: *object },
            Transfer::Download { object, data } => match Expedited::of(data) {
                Some(data) => SdoRequest::DownloadExpedited { object: *object, data },
                None => SdoRequest::DownloadSegmented { object: *object, size: size_of(data) },
            },
            Transfer::BlockUpload { object } => {
                SdoRequest::BlockUpload { object: *object, block_size: BlockSize::FOR_UPLOADS, has_crc: true }
            }
            Transfer::BlockDownload { object, data } => {
                SdoRequest::BlockDownload { object: *object, size: size_of(data), has_crc: true }
            }
        }
    }

    /// Receives a frame of the server.
    pub fn receive(&mut self, frame: &Frame) -> ExchangeStep {
        let Some(bytes) = wire::eight_bytes(frame) else { return ExchangeStep::Unusable };
        let response = SdoResponse::decode(frame).map(|(_, response)| response);
        let wanted = self.object();
        if let Some(SdoResponse::Abort { object, code }) = response {
            return if object == wanted { self.aborted(code) } else { ExchangeStep::Unusable };
        }
        match (&mut self.phase, &self.transfer) {
            (ExchangePhase::Initiate, _) => self.initiated(response),
            (ExchangePhase::UploadSegments { bytes, size, toggle }, _) => {
                uploaded_segment(bytes, *size, toggle, response)
            }
            (ExchangePhase::DownloadSegments { sent, toggle }, Transfer::Download { data, .. }) => {
                downloaded_segment(data.len(), sent, toggle, response)
            }
            (ExchangePhase::BlockUpload(block), _) => block.receive(bytes, response),
            (ExchangePhase::BlockDownload(block), Transfer::BlockDownload { data, .. }) => {
                block.receive(data.len(), response)
            }
            _ => ExchangeStep::Unusable,
        }
    }

    fn aborted(&self, code: AbortCode) -> ExchangeStep {
        let is_block = matches!(self.transfer, Transfer::BlockUpload { .. } | Transfer::BlockDownload { .. });
        if is_block && self.is_initiating() && code == AbortCode::CommandSpecifierUnknown {
            return ExchangeStep::FallBack;
        }
        ExchangeStep::Finish { outcome: Err(SdoError::Aborted(code)), final_request: FinalRequest::None }
    }

    fn initiated(&mut self, response: Option<SdoResponse>) -> ExchangeStep {
        let wanted = self.object();
        self.phase = match (&self.transfer, response) {
            (Transfer::Upload { .. }, Some(SdoResponse::UploadExpedited { object, data }))
                if object == wanted =>
            {
                return ExchangeStep::uploaded(data.bytes().into(), data.is_size_indicated());
            }
            (Transfer::Upload { .. }, Some(SdoResponse::UploadSegmented { object, size }))
                if object == wanted =>
            {
                if is_too_long(size) {
                    return ExchangeStep::too_long();
                }
                ExchangePhase::UploadSegments { bytes: vec![], size, toggle: false }
            }
            (Transfer::Download { data, .. }, Some(SdoResponse::DownloadAccepted { object }))
                if object == wanted =>
            {
                if Expedited::of(data).is_some() {
                    return ExchangeStep::downloaded();
                }
                ExchangePhase::DownloadSegments { sent: 0, toggle: false }
            }
            (Transfer::BlockUpload { .. }, Some(SdoResponse::BlockUpload { object, size, has_crc }))
                if object == wanted =>
            {
                if is_too_long(size) {
                    return ExchangeStep::too_long();
                }
                ExchangePhase::BlockUpload(BlockUpload::new(size, has_crc))
            }
            (
                Transfer::BlockDownload { .. },
                Some(SdoResponse::BlockDownload { object, block_size, has_crc }),
            ) if object == wanted => ExchangePhase::BlockDownload(BlockDownload::new(block_size, has_crc)),
            _ => return ExchangeStep::Unusable,
        };
        ExchangeStep::Send
    }
}

fn is_too_long(size: Option<u32>) -> bool {
    size.is_some_and(|size| size as usize > MAX_UPLOAD_BYTES)
}

fn uploaded_segment(
    bytes: &mut Vec<u8>,
    size: Option<u32>,
    expected: &mut bool,
    response: Option<SdoResponse>,
) -> ExchangeStep {
    let Some(SdoResponse::UploadSegment { toggle, data, is_last }) = response else {
        return ExchangeStep::Unusable;
    };
    if toggle != *expected {
        return toggle_not_alternated();
    }
    if data.bytes().is_empty() && !is_last {
        return ExchangeStep::fail(SdoError::EmptySegment, AbortCode::General);
    }
    bytes.extend_from_slice(data.bytes());
    if bytes.len() > MAX_UPLOAD_BYTES {
        return ExchangeStep::too_long();
    }
    let received = bytes.len() as u32;
    match size {
        Some(announced) if received > announced || (is_last && received != announced) => {
            ExchangeStep::fail(SdoError::SizeMismatch { announced, received }, AbortCode::LengthMismatch)
        }
        _ if is_last => ExchangeStep::uploaded(std::mem::take(bytes), true),
        _ => {
            *expected = !*expected;
            ExchangeStep::Send
        }
    }
}

fn downloaded_segment(
    length: usize,
    sent: &mut usize,
    expected: &mut bool,
    response: Option<SdoResponse>,
) -> ExchangeStep {
    let Some(SdoResponse::DownloadSegmentAccepted { toggle }) = response else {
        return ExchangeStep::Unusable;
    };
    if toggle != *expected {
        return toggle_not_alternated();
    }
    *sent = (*sent + Segment::MAX_BYTES).min(length);
    if *sent == length {
        return ExchangeStep::downloaded();
    }
    *expected = !*expected;
    ExchangeStep::Send
}

fn toggle_not_alternated() -> ExchangeStep {
    ExchangeStep::fail(SdoError::ToggleNotAlternated, AbortCode::ToggleBitNotAlternated)
}
