//! Why a task with a drive has failed, as commissioning shows it.

use super::follower::UNKNOWN_REFUSAL;
use super::motion::MotionFailure;
use crate::canopen::emcy::ErrorCode;
use crate::erob_can::client::{RequestError, RequestFailure};
use crate::family::commission::{Failure, TargetDrive};

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

/// The failure of a motion of this drive.
pub fn of_motion(target: &TargetDrive, failure: MotionFailure) -> Failure {
    let words = failure.to_string();
    match failure {
        MotionFailure::Request(error) => error.into(),
        MotionFailure::Drive { code } => faulted(target, code),
        MotionFailure::TooLong { .. } => Failure::Request {
            what: words,
            cure: Some("check whether something blocks the joint, and the profile in the drive"),
        },
        MotionFailure::NotStopped { .. } => {
            Failure::Request { what: words, cure: Some("use the emergency stop") }
        }
        MotionFailure::Limit(failure) => failure,
    }
}

/// The drive shows an error, index 001F.
pub fn faulted(target: &TargetDrive, code: i32) -> Failure {
    Failure::Faulted { what: target.error_words(code as u16), advice: Some(FAULT_CURE) }
}

/// An error in words: of the drive, index 001F, or why it refuses to be enabled. The eRunner manual has no list of the codes of
/// index 001F; codes of CiA 402 are likely.
pub fn error_words(code: u16) -> String {
    if code == 0 {
        return "none".to_owned();
    }
    /// What CiA 402 says of other codes.
    const UNKNOWN: &str = "unknown error";
    if let Some(words) = crate::erob_can::error_code::ErrorCode(code).words() {
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
