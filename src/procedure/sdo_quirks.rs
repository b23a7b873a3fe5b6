//! Timing and deviations of a drive's SDO server.

use takt_rt::Nanoseconds;
use takt_wire::canopen::sdo::{SdoError, SdoTiming};

/// Timing and deviations of a drive's SDO server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoQuirks {
    /// Reply timeout and retries.
    pub timing: SdoTiming,
    /// Minimum pause between a reply and the next request.
    pub gap_ns: Nanoseconds,
    /// True if replies may be shorter than eight bytes, with trailing zeros left out.
    pub has_short_replies: bool,
    /// True if a number may come with another length than that of its object's type.
    pub has_other_lengths: bool,
    /// True if the drive does not answer at all for an object that it does not have.
    pub is_silent_if_absent: bool,
}

impl SdoQuirks {
    /// A server that keeps to CiA 301.
    pub const fn standard() -> Self {
        Self {
            timing: SdoTiming { reply_timeout_ns: 100_000_000, retries: 2 },
            gap_ns: 0,
            has_short_replies: false,
            has_other_lengths: false,
            is_silent_if_absent: false,
        }
    }

    /// Returns `true` if this error means that the drive does not have the object.
    pub fn means_absent(&self, error: SdoError) -> bool {
        match error {
            SdoError::Aborted(code) => code.means_absent(),
            SdoError::NoReply { .. } => self.is_silent_if_absent,
            _ => false,
        }
    }
}
