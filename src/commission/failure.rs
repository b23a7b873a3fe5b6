//! Why a procedure could not be done.

use takt_rt::Nanoseconds;

use crate::canopen::nmt::NmtState;
use crate::canopen::object::{Object, ObjectAddress};
use crate::canopen::sdo::{AbortCode, SdoError};
use crate::config::Quantity;
use crate::drive::Access;

/// Why a procedure has ended before its end.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// It was asked to end; the axis was stopped in control and disabled.
    #[error("interrupted")]
    Interrupted,
    /// Nothing answers under this node number.
    #[error("node {node} does not answer{}{}", nmt_words(*.reported), other_words(*.other_protocol))]
    Silent {
        /// The node.
        node: u8,
        /// The last state that it has reported.
        reported: Option<NmtState>,
        /// Another protocol in which it did answer.
        other_protocol: Option<&'static str>,
    },
    /// A transfer failed.
    #[error("{}: {error}", access.words(object))]
    Transfer {
        /// The object.
        object: Object,
        /// What was being done.
        access: Access,
        /// Why it failed.
        error: SdoError,
    },
    /// Reading a text or bytes failed.
    #[error("reading {object}: {error}")]
    TextTransfer {
        /// The object.
        object: ObjectAddress,
        /// Why it failed.
        error: SdoError,
    },
    /// An object holds no number of this length.
    #[error("reading {object}: expected {} bytes, got {received}", object.data_type.length())]
    Length {
        /// The object.
        object: Object,
        /// How many bytes came.
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
    /// The drive accepted a value and has another one.
    #[error("{object}: {} was written and accepted, {} is read back", object.show(*.written), object.show(*.received))]
    NotKept {
        /// The object.
        object: Object,
        /// What was written.
        written: i64,
        /// What is there.
        received: i64,
    },
    /// Something did not become as wanted in time.
    #[error("{what} did not come within {} ms; {object} is {}", waited_ns / 1_000_000, object.show(*.last))]
    NotInTime {
        /// The object.
        object: Object,
        /// What was waited for.
        what: &'static str,
        /// Its last value.
        last: i64,
        /// How long was waited.
        waited_ns: Nanoseconds,
    },
    /// Another drive than expected.
    #[error(
        "another drive answers: its vendor id (1018:01) is 0x{received:08X}, a {family} has 0x{expected:08X}"
    )]
    OtherDrive {
        /// What was expected.
        family: &'static str,
        /// Its vendor id.
        expected: u32,
        /// The one that was read.
        received: u32,
    },
    /// The drive is in a fault, and nothing moves before that is cleared.
    #[error("the drive is in a fault: {what}{}", advice_words(.advice))]
    Faulted {
        /// The fault.
        what: String,
        /// What to do about it.
        advice: Option<&'static str>,
    },
    /// The fault is still there after it was cleared.
    #[error("the fault persists: {what}{}", advice_words(.advice))]
    FaultPersists {
        /// The fault.
        what: String,
        /// What to do about it.
        advice: Option<&'static str>,
    },
    /// The drive has torque where it must have none.
    #[error("the drive is enabled: disable it first")]
    Enabled,
    /// The drive has lost torque on its own.
    #[error("the drive is no longer enabled (statusword 0x{statusword:04X})")]
    Disabled {
        /// Its statusword.
        statusword: u16,
    },
    /// A value lies outside the limits of the axis.
    #[error("{} lies outside the limits of the axis, {} to {}", quantity.show(*.value), quantity.show(*.low), quantity.show(*.high))]
    OutsideLimits {
        /// What it is.
        quantity: Quantity,
        /// The value in SI units.
        value: f64,
        /// The lowest permitted.
        low: f64,
        /// The highest permitted.
        high: f64,
    },
    /// The axis has come to its limit while it moved, and was stopped.
    #[error("stopped at the limit of the axis: {} of {} to {}", quantity.show(*.value), quantity.show(*.low), quantity.show(*.high))]
    AtLimit {
        /// What it is.
        quantity: Quantity,
        /// Where it was stopped, in SI units.
        value: f64,
        /// The lowest permitted.
        low: f64,
        /// The highest permitted.
        high: f64,
    },
    /// A joint value is meant, but the axis' units are not known.
    #[error("{what} must be given: {why}")]
    Missing {
        /// What is missing.
        what: &'static str,
        /// Why it is needed.
        why: &'static str,
    },
    /// The axis moves although it should not.
    #[error("the axis has moved by {counts} counts while it was being enabled")]
    Jumped {
        /// How far.
        counts: i64,
    },
    /// This drive cannot do that.
    #[error("{what}; {instead}")]
    Unsupported {
        /// What it cannot.
        what: String,
        /// What can be done.
        instead: String,
    },
    /// Nothing was done because it was not agreed to.
    #[error("{consequence}; add {option} to do it")]
    NeedsConsent {
        /// What would happen.
        consequence: &'static str,
        /// The option that agrees.
        option: &'static str,
    },
    /// A homing run failed.
    #[error("homing failed: {0}")]
    Homing(&'static str),
    /// Not what must be written.
    #[error("{0}")]
    Unsuitable(String),
    /// The drive has confirmed one thing and does another.
    #[error("{0}")]
    Contradicted(String),
}

fn nmt_words(reported: Option<NmtState>) -> String {
    reported.map_or_else(String::new, |state| format!("; the last state that it has reported is {state}"))
}

fn other_words(name: Option<&'static str>) -> String {
    name.map_or_else(String::new, |name| {
        format!(", but it did answer the {name}: it has no CANopen firmware")
    })
}

fn advice_words(advice: &Option<&'static str>) -> String {
    advice.map_or_else(String::new, |advice| format!("; {advice}"))
}

impl Failure {
    /// Whether the drive says that it does not have the object.
    pub fn means_absent(&self) -> bool {
        match self {
            Self::Transfer { error: SdoError::Aborted(code), .. } => code.means_absent(),
            _ => false,
        }
    }

    /// Whether nothing was done, because what was asked for cannot be or may not be.
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

    /// What to try.
    pub fn advice(&self) -> Option<&'static str> {
        match self {
            Self::Silent { other_protocol: Some(_), .. } => Some("load CANopen firmware into the drive"),
            Self::Silent { .. } => Some(
                "check the node number (`--node`), the drive's supply, the wiring and the termination of the bus, and \
                 its bit rate",
            ),
            Self::Transfer { error: SdoError::NoReply { .. }, .. } => {
                Some("the drive has fallen silent: check its supply, the wiring and the bus load")
            }
            Self::Transfer { error: SdoError::Aborted(AbortCode::PresentDeviceState), .. } => {
                Some("the drive refuses this in its present state: disable it, or clear its fault")
            }
            Self::Transfer { error: SdoError::Aborted(AbortCode::ObjectDoesNotExist), .. } => {
                Some("the drive has no such object")
            }
            Self::Faulted { advice: None, .. } => Some("clear it with `clear-fault`"),
            Self::OtherDrive { .. } => Some("check the node number and the family"),
            _ => None,
        }
    }
}
