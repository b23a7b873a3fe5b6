//! Why a procedure failed.

use takt_rt::Nanoseconds;
use takt_wire::canopen::nmt::NmtState;
use takt_wire::canopen::object::{Object, ObjectAddress};
use takt_wire::canopen::sdo::{AbortCode, SdoError};

use crate::config::Quantity;
#[doc(hidden)]
pub use crate::procedure::Access;
use crate::words;
use crate::words::Words;

/// Why a procedure failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", self.words())]
#[non_exhaustive]
pub enum Failure {
    /// It was interrupted; the axis was stopped and disabled.
    Interrupted,
    /// No drive answers under this node ID.
    Silent {
        /// The node ID.
        node: u8,
        /// The last NMT state that it has reported.
        reported: Option<NmtState>,
        /// Another protocol that did get an answer.
        other_protocol: Option<AnsweredProtocol>,
    },
    /// A transfer failed.
    Transfer {
        /// The object.
        object: Object,
        /// The attempted access.
        access: Access,
        /// Why it failed.
        error: SdoError,
    },
    /// A request in a protocol without an object dictionary failed.
    Request {
        /// The request, and why it failed.
        what: String,
        /// What to do about it.
        cure: Option<&'static str>,
    },
    /// Reading a text or bytes failed.
    TextTransfer {
        /// The object.
        object: ObjectAddress,
        /// Why it failed.
        error: SdoError,
    },
    /// An object's data has the wrong length for a number.
    Length {
        /// The object.
        object: Object,
        /// Number of received bytes.
        received: usize,
    },
    /// A value does not fit its object.
    DoesNotFit {
        /// The object.
        object: Object,
        /// The value.
        value: i64,
    },
    /// The drive accepted a value but holds another one.
    NotKept {
        /// The object.
        object: Object,
        /// The value that was written.
        written: i64,
        /// The value that was read back.
        received: i64,
    },
    /// A condition was not met in time.
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
    OtherDrive {
        /// The expected family.
        family: &'static str,
        /// The family's vendor ID.
        expected: u32,
        /// The vendor ID that was read.
        received: u32,
    },
    /// The drive is in a fault, which must be cleared first.
    Faulted {
        /// The fault.
        what: Words,
        /// What to do about it.
        advice: Option<&'static str>,
    },
    /// The fault did not go away.
    FaultPersists {
        /// The fault.
        what: Words,
        /// What to do about it.
        advice: Option<&'static str>,
    },
    /// The drive is enabled but must not be.
    Enabled,
    /// The drive left the enabled state by itself.
    Disabled {
        /// Its statusword.
        statusword: u16,
    },
    /// A value lies outside the limits of the axis.
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
    Missing {
        /// What is missing.
        what: &'static str,
        /// Why it is needed.
        why: &'static str,
    },
    /// The axis moved while it was being enabled.
    Jumped {
        /// How far, in counts.
        counts: i64,
    },
    /// This drive does not support the task.
    Unsupported {
        /// What it does not support.
        what: String,
        /// What to do instead.
        instead: String,
    },
    /// The task was not done, because the user did not confirm it.
    NeedsConsent {
        /// What the task would cause.
        consequence: &'static str,
        /// The option that confirms it.
        option: &'static str,
    },
    /// Homing failed.
    Homing(&'static str),
    /// The request itself is not valid.
    Unsuitable(String),
    /// The drive confirmed a value but behaves otherwise.
    Contradicted(String),
}

/// A protocol in which a drive did answer, other than the expected one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnsweredProtocol {
    /// Its name.
    pub name: &'static str,
    /// What to do then.
    pub cure: &'static str,
}

fn advice_words(advice: Option<&'static str>) -> Words {
    advice.map_or("".into(), |advice| words!("; {advice}", advice = Words::from(advice)))
}

fn sdo_words(error: SdoError) -> Words {
    match error {
        SdoError::Aborted(code) => words!(
            "abort {code} ({meaning})",
            code = format!("0x{:08X}", code.number()),
            meaning = Words::bilingual(code.bilingual())
        ),
        SdoError::NoReply { attempts, reply_timeout_ns, unusable: 0 } => words!(
            "no reply within {wait} ms in {attempts} attempts",
            wait = reply_timeout_ns / 1_000_000,
            attempts
        ),
        error => error.to_string().into(),
    }
}

impl Failure {
    /// The sentence, for a page in another language.
    pub fn words(&self) -> Words {
        match self {
            Self::Interrupted => "interrupted".into(),
            Self::Silent { node, reported, other_protocol } => words!(
                "node {node} does not answer{reported}{other}",
                node,
                reported = reported.map_or("".into(), |state| words!(
                    "; the last state that it has reported is {state}",
                    state = Words::from(state.to_string())
                )),
                other = other_protocol.map_or("".into(), |other| words!(
                    ", but it did answer the {protocol}",
                    protocol = Words::from(other.name)
                ))
            ),
            Self::Transfer { object, access, error } => {
                words!("{access}: {error}", access = access.words(object), error = sdo_words(*error))
            }
            Self::Request { what, .. } => what.clone().into(),
            Self::TextTransfer { object, error } => {
                words!("reading {object}: {error}", object = object.to_string(), error = sdo_words(*error))
            }
            Self::Length { object, received } => words!(
                "reading {object}: expected {bytes} bytes, got {received}",
                object = object.to_string(),
                bytes = object.data_type.length(),
                received
            ),
            Self::DoesNotFit { object, value } => words!(
                "{value} does not fit the {bits} bits of {object}",
                value,
                bits = 8 * object.data_type.length(),
                object = object.to_string()
            ),
            Self::NotKept { object, written, received } => words!(
                "{object}: {written} was written and accepted, {received} is read back",
                object = object.to_string(),
                written = object.show(*written),
                received = object.show(*received)
            ),
            Self::NotInTime { object, what, last, waited_ns } => words!(
                "timeout waiting for {what} after {waited} ms; {object} is {last}",
                what = Words::from(*what),
                waited = waited_ns / 1_000_000,
                object = object.to_string(),
                last = object.show(*last)
            ),
            Self::OtherDrive { family, expected, received } => words!(
                "another drive answers: its vendor ID (1018:01) is {received}, a {family} has {expected}",
                received = format!("0x{received:08X}"),
                family = *family,
                expected = format!("0x{expected:08X}")
            ),
            Self::Faulted { what, advice } => words!(
                "the drive is in a fault: {what}{advice}",
                what = what.clone(),
                advice = advice_words(*advice)
            ),
            Self::FaultPersists { what, advice } => words!(
                "the fault persists: {what}{advice}",
                what = what.clone(),
                advice = advice_words(*advice)
            ),
            Self::Enabled => "the drive is enabled: disable it first".into(),
            Self::Disabled { statusword } => words!(
                "the drive is no longer enabled (statusword {statusword})",
                statusword = format!("0x{statusword:04X}")
            ),
            Self::OutsideLimits { quantity, value, low, high } => words!(
                "{value} lies outside the limits of the axis, {low} to {high}",
                value = quantity.show(*value),
                low = quantity.show(*low),
                high = quantity.show(*high)
            ),
            Self::AtLimit { quantity, value, low, high } => words!(
                "stopped at the limit of the axis: {value} of {low} to {high}",
                value = quantity.show(*value),
                low = quantity.show(*low),
                high = quantity.show(*high)
            ),
            Self::Missing { what, why } => {
                words!("{what} must be given: {why}", what = Words::from(*what), why = Words::from(*why))
            }
            Self::Jumped { counts } => {
                words!("the axis has moved by {counts} counts while it was being enabled", counts)
            }
            Self::Unsupported { what, instead } => words!(
                "{what}; {instead}",
                what = Words::from(what.clone()),
                instead = Words::from(instead.clone())
            ),
            Self::NeedsConsent { consequence, option } => words!(
                "{consequence}; add {option} to do it",
                consequence = Words::from(*consequence),
                option = *option
            ),
            Self::Homing(why) => words!("homing failed: {why}", why = Words::from(*why)),
            Self::Unsuitable(text) | Self::Contradicted(text) => text.clone().into(),
        }
    }

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
