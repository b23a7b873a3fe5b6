//! Why a procedure failed.

use takt_rt::Nanoseconds;
use takt_wire::canopen::nmt::NmtState;
use takt_wire::canopen::object::{Object, ObjectAddress};
use takt_wire::canopen::sdo::{AbortCode, SdoError};

use crate::config::Quantity;
#[doc(hidden)]
pub use crate::procedure::Access;

/// Why a procedure failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// It was interrupted; the axis was stopped and disabled.
    #[error("interrupted")]
    Interrupted,
    /// No drive answers under this node ID.
    #[error("node {node} does not answer{}{}", nmt_words(*.reported), other_words(*.other_protocol))]
    Silent {
        /// The node ID.
        node: u8,
        /// The last NMT state that it has reported.
        reported: Option<NmtState>,
        /// Another protocol that did get an answer.
        other_protocol: Option<AnsweredProtocol>,
    },
    /// A transfer failed.
    #[error("{}: {error}", access.words(object))]
    Transfer {
        /// The object.
        object: Object,
        /// The attempted access.
        access: Access,
        /// Why it failed.
        error: SdoError,
    },
    /// A request in a protocol without an object dictionary failed.
    #[error("{what}")]
    Request {
        /// The request, and why it failed.
        what: String,
        /// What to do about it.
        cure: Option<&'static str>,
    },
    /// Reading a text or bytes failed.
    #[error("reading {object}: {error}")]
    TextTransfer {
        /// The object.
        object: ObjectAddress,
        /// Why it failed.
        error: SdoError,
    },
    /// An object's data has the wrong length for a number.
    #[error("reading {object}: expected {} bytes, got {received}", object.data_type.length())]
    Length {
        /// The object.
        object: Object,
        /// Number of received bytes.
        received: usize,
    },
    /// A value does not fit its object.
    #[error("{value} does not fit the {} bits of {object}", 8 * object.data_type.length())]
    DoesNotFit {
        /// The object.
        object: Object,
        /// The value.
        value: i64,
    },
    /// The drive accepted a value but holds another one.
    #[error("{object}: {} was written and accepted, {} is read back", object.show(*.written), object.show(*.received))]
    NotKept {
        /// The object.
        object: Object,
        /// The value that was written.
        written: i64,
        /// The value that was read back.
        received: i64,
    },
    /// A condition was not met in time.
    #[error("timeout waiting for {what} after {} ms; {object} is {}", waited_ns / 1_000_000, object.show(*.last))]
    NotInTime {
        /// The object.
        object: Object,
        /// What was waited for.
        what: &'static str,
        /// The value at the end.
        last: i64,
        /// How long the procedure waited.
        waited_ns: Nanoseconds,
    },
    /// Another drive than expected answers.
    #[error(
        "another drive answers: its vendor ID (1018:01) is 0x{received:08X}, a {family} has 0x{expected:08X}"
    )]
    OtherDrive {
        /// The expected family.
        family: &'static str,
        /// The family's vendor ID.
        expected: u32,
        /// The vendor ID that was read.
        received: u32,
    },
    /// The drive is in a fault, which must be cleared first.
    #[error("the drive is in a fault: {what}{}", advice_words(.advice))]
    Faulted {
        /// The fault.
        what: String,
        /// What to do about it.
        advice: Option<&'static str>,
    },
    /// The fault did not go away.
    #[error("the fault persists: {what}{}", advice_words(.advice))]
    FaultPersists {
        /// The fault.
        what: String,
        /// What to do about it.
        advice: Option<&'static str>,
    },
    /// The drive is enabled but must not be.
    #[error("the drive is enabled: disable it first")]
    Enabled,
    /// The drive left the enabled state by itself.
    #[error("the drive is no longer enabled (statusword 0x{statusword:04X})")]
    Disabled {
        /// Its statusword.
        statusword: u16,
    },
    /// A value lies outside the limits of the axis.
    #[error("{} lies outside the limits of the axis, {} to {}", quantity.show(*.value), quantity.show(*.low), quantity.show(*.high))]
    OutsideLimits {
        /// The quantity.
        quantity: Quantity,
        /// The value in SI units.
        value: f64,
        /// The lowest permitted.
        low: f64,
        /// The highest permitted.
        high: f64,
    },
    /// The axis reached a limit during the motion and was stopped.
    #[error("stopped at the limit of the axis: {} of {} to {}", quantity.show(*.value), quantity.show(*.low), quantity.show(*.high))]
    AtLimit {
        /// The quantity.
        quantity: Quantity,
        /// The value at the limit, in SI units.
        value: f64,
        /// The lowest permitted.
        low: f64,
        /// The highest permitted.
        high: f64,
    },
    /// A value is required here, because no default is known.
    #[error("{what} must be given: {why}")]
    Missing {
        /// What is missing.
        what: &'static str,
        /// Why it is needed.
        why: &'static str,
    },
    /// The axis moved while it was being enabled.
    #[error("the axis has moved by {counts} counts while it was being enabled")]
    Jumped {
        /// How far, in counts.
        counts: i64,
    },
    /// This drive does not support the task.
    #[error("{what}; {instead}")]
    Unsupported {
        /// What it does not support.
        what: String,
        /// What to do instead.
        instead: String,
    },
    /// The task was not done, because the user did not confirm it.
    #[error("{consequence}; add {option} to do it")]
    NeedsConsent {
        /// What the task would cause.
        consequence: &'static str,
        /// The option that confirms it.
        option: &'static str,
    },
    /// Homing failed.
    #[error("homing failed: {0}")]
    Homing(&'static str),
    /// The request itself is not valid.
    #[error("{0}")]
    Unsuitable(String),
    /// The drive confirmed a value but behaves otherwise.
    #[error("{0}")]
    Contradicted(String),
}

fn nmt_words(reported: Option<NmtState>) -> String {
    reported.map_or_else(String::new, |state| format!("; the last state that it has reported is {state}"))
}

fn other_words(answered: Option<AnsweredProtocol>) -> String {
    answered
        .map_or_else(String::new, |AnsweredProtocol { name, .. }| format!(", but it did answer the {name}"))
}

/// A protocol in which a drive did answer, other than the expected one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnsweredProtocol {
    /// Its name.
    pub name: &'static str,
    /// What to do then.
    pub cure: &'static str,
}

fn advice_words(advice: &Option<&'static str>) -> String {
    advice.map_or_else(String::new, |advice| format!("; {advice}"))
}

impl Failure {
    /// Returns `true` if the drive reports that the object does not exist.
    pub(crate) fn means_absent(&self) -> bool {
        match self {
            Self::Transfer { error: SdoError::Aborted(code), .. } => code.means_absent(),
            _ => false,
        }
    }

    /// Returns `true` if the request was refused before anything was changed.
    pub fn is_refusal(&self) -> bool {
        matches!(
            self,
            Self::OutsideLimits { .. }
                | Self::Missing { .. }
                | Self::Unsupported { .. }
                | Self::NeedsConsent { .. }
                | Self::DoesNotFit { .. }
                | Self::Unsuitable(_)
        )
    }

    /// The remedy.
    pub fn advice(&self) -> Option<&'static str> {
        match self {
            Self::Silent { other_protocol: Some(answered), .. } => Some(answered.cure),
            Self::Silent { .. } => Some(
                "check the node ID (`--node`), the drive's supply, the wiring and the termination of the bus, and \
                 its bit rate",
            ),
            Self::Transfer { error: SdoError::NoReply { .. }, .. } => {
                Some("the drive no longer answers: check its supply, the wiring and the bus load")
            }
            Self::Transfer { error: SdoError::Aborted(AbortCode::PresentDeviceState), .. } => {
                Some("the drive refuses this in its present state: disable it, or clear its fault")
            }
            Self::Transfer { error: SdoError::Aborted(AbortCode::ObjectDoesNotExist), .. } => {
                Some("the drive has no such object")
            }
            Self::Faulted { advice: None, .. } => Some("clear it with `clear-fault`"),
            Self::Request { cure, .. } => *cure,
            Self::OtherDrive { .. } => Some("check the node ID and the family"),
            _ => None,
        }
    }
}
