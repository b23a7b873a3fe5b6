//! One transfer from its initiation to its end, without regard to time.

use takt_rt::{Frame, Id};

use super::abort::AbortCode;
use super::block_download::{BlockDownload, Next};
use super::block_upload::BlockUpload;
use super::request::Request;
use super::response::Response;
use super::transfer::{Completed, MAX_UPLOAD_BYTES, SdoError, Transfer, Uploaded};
use super::wire::{self, BlockSize, Expedited, Segment};
use crate::canopen::function_code;
use crate::canopen::object::ObjectAddress;

#[derive(Debug)]
pub(super) struct Exchange {
    transfer: Transfer,
    phase: Phase,
}

#[derive(Debug)]
enum Phase {
    Initiate,
    UploadSegments { bytes: Vec<u8>, size: Option<u32>, toggle: bool },
    DownloadSegments { sent: usize, toggle: bool },
    BlockUpload(BlockUpload),
    BlockDownload(BlockDownload),
}

/// What a frame does to an exchange.
#[derive(Debug)]
pub(super) enum Step {
    /// It is no answer.
    Unusable,
    /// It is part of an answer.
    Wait,
    /// The next frame is due.
    Send,
    /// The server does not know this kind of transfer: begin with a simpler one.
    BeginSimpler,
    /// The transfer is over.
    Finish { outcome: Result<Completed, SdoError>, parting: Parting },
}

/// The last word about a transfer that is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parting {
    /// The server knows.
    Nothing,
    /// The client gives it up.
    Abort(AbortCode),
    /// All blocks have come.
    BlockUploadEnd,
}

impl Parting {
    pub fn request(self, object: ObjectAddress) -> Option<Request> {
        match self {
            Self::Nothing => None,
            Self::Abort(code) => Some(Request::Abort { object, code }),
            Self::BlockUploadEnd => Some(Request::BlockUploadEnd),
        }
    }
}

impl Step {
    pub fn fail(error: SdoError, code: AbortCode) -> Self {
        Self::Finish { outcome: Err(error), parting: Parting::Abort(code) }
    }

    pub fn too_long() -> Self {
        Self::fail(SdoError::TooLong { limit: MAX_UPLOAD_BYTES as u32 }, AbortCode::OutOfMemory)
    }

    fn uploaded(bytes: Vec<u8>, is_size_known: bool) -> Self {
        let outcome = Ok(Completed::Uploaded(Uploaded { bytes, is_size_known }));
        Self::Finish { outcome, parting: Parting::Nothing }
    }

    fn downloaded() -> Self {
        Self::Finish { outcome: Ok(Completed::Downloaded), parting: Parting::Nothing }
    }
}

impl Exchange {
    pub fn new(transfer: Transfer) -> Self {
        let transfer = match transfer {
            Transfer::BlockDownload { object, data } if data.len() <= 4 => {
                Transfer::Download { object, data }
            }
            transfer => transfer,
        };
        Self { transfer, phase: Phase::Initiate }
    }

    pub fn object(&self) -> ObjectAddress {
        self.transfer.object()
    }

    pub fn is_initiating(&self) -> bool {
        matches!(self.phase, Phase::Initiate)
    }

    /// Whether the server may be waiting for more than an initiation.
    pub fn is_server_in_transfer(&self) -> bool {
        let is_done_at_once =
            matches!(self.initiation(), Request::DownloadExpedited { .. } | Request::Upload { .. });
        !self.is_initiating() || !is_done_at_once
    }

    pub fn begin_again(&mut self) {
        self.phase = Phase::Initiate;
    }

    /// The kind of transfer that every server knows.
    pub fn begin_simpler(&mut self) {
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
        self.phase = Phase::Initiate;
    }

    /// The frame that is due, and whether an answer is due then (else another frame).
    pub fn next_frame(&mut self, node: u8) -> (Frame, bool) {
        let request = match (&mut self.phase, &self.transfer) {
            (Phase::UploadSegments { toggle, .. }, _) => Request::UploadSegment { toggle: *toggle },
            (Phase::DownloadSegments { sent, toggle }, Transfer::Download { data, .. }) => {
                let rest = data.get(*sent..).unwrap_or(&[]);
                let is_last = rest.len() <= Segment::MAX_BYTES;
                Request::DownloadSegment { toggle: *toggle, data: Segment::first_of(rest), is_last }
            }
            (Phase::BlockUpload(block), _) => block.next_request(),
            (Phase::BlockDownload(block), Transfer::BlockDownload { data, .. }) => match block.next(data) {
                Next::Segment { segment, ends_block } => {
                    let id = Id::canopen(function_code::SDO_REQUEST, node);
                    return (Frame::of(id, segment.encode()), ends_block);
                }
                Next::End(request) => request,
            },
            _ => self.initiation(),
        };
        (request.frame(node), true)
    }

    fn initiation(&self) -> Request {
        let size_of = |data: &[u8]| u32::try_from(data.len()).ok();
        match &self.transfer {
            Transfer::Upload { object } => Request::Upload { object: *object },
            Transfer::Download { object, data } => match Expedited::of(data) {
                Some(data) => Request::DownloadExpedited { object: *object, data },
                None => Request::DownloadSegmented { object: *object, size: size_of(data) },
            },
            Transfer::BlockUpload { object } => {
                Request::BlockUpload { object: *object, block_size: BlockSize::OF_UPLOADS, has_crc: true }
            }
            Transfer::BlockDownload { object, data } => {
                Request::BlockDownload { object: *object, size: size_of(data), has_crc: true }
            }
        }
    }

    /// Takes a frame of the server.
    pub fn receive(&mut self, frame: &Frame) -> Step {
        let Some(bytes) = wire::eight_bytes(frame) else { return Step::Unusable };
        let response = Response::decode(frame).map(|(_, response)| response);
        let wanted = self.object();
        if let Some(Response::Abort { object, code }) = response {
            return if object == wanted { self.aborted(code) } else { Step::Unusable };
        }
        match (&mut self.phase, &self.transfer) {
            (Phase::Initiate, _) => self.initiated(response),
            (Phase::UploadSegments { bytes, size, toggle }, _) => {
                uploaded_segment(bytes, *size, toggle, response)
            }
            (Phase::DownloadSegments { sent, toggle }, Transfer::Download { data, .. }) => {
                downloaded_segment(data.len(), sent, toggle, response)
            }
            (Phase::BlockUpload(block), _) => block.receive(bytes, response),
            (Phase::BlockDownload(block), Transfer::BlockDownload { data, .. }) => {
                block.receive(data.len(), response)
            }
            _ => Step::Unusable,
        }
    }

    fn aborted(&self, code: AbortCode) -> Step {
        let is_block = matches!(self.transfer, Transfer::BlockUpload { .. } | Transfer::BlockDownload { .. });
        if is_block && self.is_initiating() && code == AbortCode::CommandSpecifierUnknown {
            return Step::BeginSimpler;
        }
        Step::Finish { outcome: Err(SdoError::Aborted(code)), parting: Parting::Nothing }
    }

    fn initiated(&mut self, response: Option<Response>) -> Step {
        let wanted = self.object();
        self.phase = match (&self.transfer, response) {
            (Transfer::Upload { .. }, Some(Response::UploadExpedited { object, data }))
                if object == wanted =>
            {
                return Step::uploaded(data.bytes().into(), data.is_size_indicated());
            }
            (Transfer::Upload { .. }, Some(Response::UploadSegmented { object, size }))
                if object == wanted =>
            {
                if is_too_long(size) {
                    return Step::too_long();
                }
                Phase::UploadSegments { bytes: vec![], size, toggle: false }
            }
            (Transfer::Download { data, .. }, Some(Response::DownloadAccepted { object }))
                if object == wanted =>
            {
                if Expedited::of(data).is_some() {
                    return Step::downloaded();
                }
                Phase::DownloadSegments { sent: 0, toggle: false }
            }
            (Transfer::BlockUpload { .. }, Some(Response::BlockUpload { object, size, has_crc }))
                if object == wanted =>
            {
                if is_too_long(size) {
                    return Step::too_long();
                }
                Phase::BlockUpload(BlockUpload::new(size, has_crc))
            }
            (
                Transfer::BlockDownload { .. },
                Some(Response::BlockDownload { object, block_size, has_crc }),
            ) if object == wanted => Phase::BlockDownload(BlockDownload::new(block_size, has_crc)),
            _ => return Step::Unusable,
        };
        Step::Send
    }
}

fn is_too_long(size: Option<u32>) -> bool {
    size.is_some_and(|size| size as usize > MAX_UPLOAD_BYTES)
}

fn uploaded_segment(
    bytes: &mut Vec<u8>,
    size: Option<u32>,
    expected: &mut bool,
    response: Option<Response>,
) -> Step {
    let Some(Response::UploadSegment { toggle, data, is_last }) = response else { return Step::Unusable };
    if toggle != *expected {
        return toggle_not_alternated();
    }
    if data.bytes().is_empty() && !is_last {
        return Step::fail(SdoError::EmptySegment, AbortCode::General);
    }
    bytes.extend_from_slice(data.bytes());
    if bytes.len() > MAX_UPLOAD_BYTES {
        return Step::too_long();
    }
    let received = bytes.len() as u32;
    match size {
        Some(announced) if received > announced || (is_last && received != announced) => {
            Step::fail(SdoError::SizeMismatch { announced, received }, AbortCode::LengthMismatch)
        }
        _ if is_last => Step::uploaded(std::mem::take(bytes), true),
        _ => {
            *expected = !*expected;
            Step::Send
        }
    }
}

fn downloaded_segment(
    length: usize,
    sent: &mut usize,
    expected: &mut bool,
    response: Option<Response>,
) -> Step {
    let Some(Response::DownloadSegmentAccepted { toggle }) = response else { return Step::Unusable };
    if toggle != *expected {
        return toggle_not_alternated();
    }
    *sent = (*sent + Segment::MAX_BYTES).min(length);
    if *sent == length {
        return Step::downloaded();
    }
    *expected = !*expected;
    Step::Send
}

fn toggle_not_alternated() -> Step {
    Step::fail(SdoError::ToggleNotAlternated, AbortCode::ToggleBitNotAlternated)
}
