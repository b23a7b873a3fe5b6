//! Why a task with a drive has failed, as commissioning shows it.

use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::erob_can::client::{RequestError, RequestFailure};

use super::follower::UNKNOWN_REFUSAL;
use crate::family::commission::Failure;
use crate::words;
use crate::words::Words;

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
pub fn error_words(code: u16) -> Words {
    let number = format!("0x{code:04X}");
    if let Some(why) = takt_wire::erob_can::error_code::ErrorCode(code).bilingual() {
        return words!(
            "{number} (the drive refuses to be enabled: {why})",
            number,
            why = Words::bilingual(why)
        );
    }
    match (code, ErrorCode(code).bilingual()) {
        (0, _) => "none".into(),
        (UNKNOWN_REFUSAL, _) => "the drive refuses to be enabled, and does not say why".into(),
        (_, ("unknown error", _)) => {
            words!("{number} (the list is in the eRob user manual, appendix 2)", number)
        }
        (_, name) => words!(
            "{number} ({name}, if it is a code of CiA 402; the list is in the eRob user manual, appendix 2)",
            number,
            name = Words::bilingual(name)
        ),
    }
}
