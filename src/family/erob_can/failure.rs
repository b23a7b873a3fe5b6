//! Why a task with a drive has failed, as commissioning shows it.

use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::erob_can::client::{RequestError, RequestFailure};

use super::follower::UNKNOWN_REFUSAL;
use crate::family::commission::Failure;

/// What helps after an error of the drive.
pub const FAULT_CURE: &str =
    "mend the cause, then use `clear-fault`; switch the power off and on if the error stays";

impl From<RequestError> for Failure {
    fn from(error: RequestError) -> Self {
        let cure = match error.failure {
            RequestFailure::NoReply => {
                Some("the drive no longer answers: check its supply, the wiring and the bus load")
            }
            RequestFailure::Refused(None) => {
                Some("read the error code of the drive with `info`: it does not say why it refuses this")
            }
            RequestFailure::Refused(Some(_)) | RequestFailure::WrongReply(_) => error.cure(),
        };
        Self::Request { what: error.to_string(), cure }
    }
}

/// An error in words: of the drive, index 001F, or why it refuses to be enabled. The eRunner manual has no list of the codes of
/// index 001F; codes of CiA 402 are likely.
pub fn error_words(code: u16) -> String {
    if code == 0 {
        return "none".to_owned();
    }
    /// What CiA 402 says of other codes.
    const UNKNOWN: &str = "unknown error";
    if let Some(words) = takt_wire::erob_can::error_code::ErrorCode(code).words() {
        return format!("0x{code:04X} (the drive refuses to be enabled: {words})");
    }
    if code == UNKNOWN_REFUSAL {
        return "the drive refuses to be enabled, and does not say why".to_owned();
    }
    let list = "the list is in the eRob user manual, appendix 2";
    match ErrorCode(code).words() {
        UNKNOWN => format!("0x{code:04X} ({list})"),
        words => format!("0x{code:04X} ({words}, if it is a code of CiA 402; {list})"),
    }
}
