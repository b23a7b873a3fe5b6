//! The effect of a frame on a transfer, and the request with which a transfer ends.

use super::abort::AbortCode;
use super::request::SdoRequest;
use super::transfer::{Completed, MAX_UPLOAD_BYTES, SdoError, Uploaded};
use crate::canopen::object::ObjectAddress;

/// The effect of a received frame on the transfer.
#[derive(Debug)]
pub(super) enum ExchangeStep {
    /// It is not a response to this transfer.
    Unusable,
    /// It is part of a response.
    Wait,
    /// The next frame is due.
    Send,
    /// The server does not support this kind of transfer: a simpler one is used.
    FallBack,
    /// The transfer is finished.
    Finish { outcome: Result<Completed, SdoError>, final_request: FinalRequest },
}

/// The final request of a finished transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FinalRequest {
    /// None, because the server has finished the transfer.
    None,
    /// The client aborts the transfer.
    Abort(AbortCode),
    /// The client confirms the end of a block upload.
    BlockUploadEnd,
}

impl FinalRequest {
    pub fn request(self, object: ObjectAddress) -> Option<SdoRequest> {
        match self {
            Self::None => None,
            Self::Abort(code) => Some(SdoRequest::Abort { object, code }),
            Self::BlockUploadEnd => Some(SdoRequest::BlockUploadEnd),
        }
    }
}

impl ExchangeStep {
    pub fn fail(error: SdoError, code: AbortCode) -> Self {
        Self::Finish { outcome: Err(error), final_request: FinalRequest::Abort(code) }
    }

    pub fn too_long() -> Self {
        Self::fail(SdoError::TooLong { limit: MAX_UPLOAD_BYTES as u32 }, AbortCode::OutOfMemory)
    }

    pub fn uploaded(bytes: Vec<u8>, is_size_known: bool) -> Self {
        let outcome = Ok(Completed::Uploaded(Uploaded { bytes, is_size_known }));
        Self::Finish { outcome, final_request: FinalRequest::None }
    }

    pub fn downloaded() -> Self {
        Self::Finish { outcome: Ok(Completed::Downloaded), final_request: FinalRequest::None }
    }
}
