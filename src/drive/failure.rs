//! Why a procedure on a drive has failed: which axis, which step, what was expected, what came, what to try.

use std::fmt;

use takt_rt::Nanoseconds;

use super::reported_mapping::MappingProblem;
use super::step::{Access, Check};
use crate::canopen::emcy::Emergency;
use crate::canopen::nmt::NmtState;
use crate::canopen::object::{Object, ObjectAddress};
use crate::canopen::pdo_inquiry::PdoInquiryError;
use crate::canopen::sdo::{AbortCode, SdoError};

/// The drives that could not be brought up (or left), each with its reason.
#[derive(Clone, Debug, PartialEq)]
pub struct BringUpError {
    /// One for each axis that failed, in the order of the configuration. Never empty.
    pub failures: Vec<AxisFailure>,
}

impl fmt::Display for BringUpError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, failure) in self.failures.iter().enumerate() {
            let separator = if place == 0 { "" } else { "\n" };
            write!(f, "{separator}{failure}")?;
        }
        Ok(())
    }
}

impl std::error::Error for BringUpError {}

/// Why one axis has failed.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisFailure {
    /// The axis, an index into the configuration.
    pub axis: usize,
    /// Its name.
    pub name: String,
    /// The name of its bus.
    pub bus: String,
    /// Its node number.
    pub node: u8,
    /// The step.
    pub step: &'static str,
    /// What was expected and what came.
    pub cause: Cause,
    /// The last emergency message of the drive.
    pub emergency: Option<Emergency>,
    /// What the step suggests to try; [`AxisFailure::advice`] knows better where the cause tells more.
    pub step_advice: &'static str,
}

impl AxisFailure {
    /// What to try.
    pub fn advice(&self) -> &'static str {
        self.cause.advice().unwrap_or(self.step_advice)
    }
}

impl fmt::Display for AxisFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, node, bus, step, cause, .. } = self;
        write!(f, "axis `{name}` (node {node} on bus `{bus}`), {step}: {cause}")?;
        if let Some(emergency) = self.emergency {
            write!(f, "; its last emergency: {emergency}")?;
        }
        write!(f, "; try: {}", self.advice())
    }
}

/// What was expected and what came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The node never reported the state that it was commanded to.
    StateNotReached {
        /// The state.
        awaited: NmtState,
        /// The last state that it reported at all.
        reported: Option<NmtState>,
        /// How long was waited.
        waited_ns: Nanoseconds,
        /// Who answered when asked otherwise.
        answered: Answered,
    },
    /// A transfer failed.
    Transfer {
        /// The object.
        object: Object,
        /// What was being done.
        access: Access,
        /// Why it failed.
        error: SdoError,
    },
    /// Reading a text failed.
    TextTransfer {
        /// The object.
        object: ObjectAddress,
        /// Why it failed.
        error: SdoError,
    },
    /// An object holds another number of bytes than its type.
    Length {
        /// The object.
        object: Object,
        /// How many bytes came.
        received: usize,
    },
    /// An object has another value.
    Value {
        /// The object.
        object: Object,
        /// How the value came about.
        access: Access,
        /// What was expected.
        expected: Check,
        /// What came.
        received: i64,
        /// How long was waited for it; 0 when it was read once.
        waited_ns: Nanoseconds,
    },
    /// Writing a configured value, or reading it back, failed.
    ConfigurationTransfer {
        /// The object.
        object: ObjectAddress,
        /// What was to be written.
        written: Content,
        /// Whether it had been written and was being read back.
        is_reading_back: bool,
        /// Why it failed.
        error: SdoError,
        /// Whether this is how the drive says that it has no such object.
        means_absent: bool,
    },
    /// A configured value reads back as another one.
    ConfigurationDiffers {
        /// The object.
        object: ObjectAddress,
        /// What was written.
        written: Content,
        /// What came.
        received: Content,
    },
    /// A value does not fit the object.
    DoesNotFit {
        /// The object.
        object: Object,
        /// The value.
        value: i64,
    },
    /// Reading how the PDOs are configured failed.
    Inquiry(PdoInquiryError),
    /// The PDOs that the drive reports do not suit the axis.
    Mapping(MappingProblem),
    /// The node has restarted, and what it was told is lost.
    Restarted {
        /// How often.
        times: u8,
    },
}

/// The bytes of an object, as far as they are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Content {
    /// How many there are.
    pub length: usize,
    /// The first of them.
    pub first: [u8; 8],
}

impl Content {
    /// Of these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        let mut first = [0; 8];
        for (place, byte) in first.iter_mut().zip(bytes) {
            *place = *byte;
        }
        Self { length: bytes.len(), first }
    }
}

impl fmt::Display for Content {
    /// Numbers as such, low byte first; longer ones byte by byte.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.length {
            0 => f.write_str("nothing"),
            length @ 1..=8 => write!(f, "0x{:0width$X}", u64::from_le_bytes(self.first), width = 2 * length),
            length => write!(f, "{length} bytes {:02X?}…", self.first),
        }
    }
}

/// Who answered a node's silence when asked otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answered {
    /// Nobody was asked.
    NotAsked,
    /// Nothing answered.
    Nothing,
    /// Its SDO server.
    Sdo,
    /// It speaks this other protocol.
    OtherProtocol(&'static str),
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |ns: Nanoseconds| ns / 1_000_000;
        match self {
            Self::StateNotReached { awaited, reported, waited_ns, answered } => {
                write!(f, "expected the state {awaited}, waited {} ms, ", ms(*waited_ns))?;
                match reported {
                    Some(state) => write!(f, "it last reported {state}")?,
                    None => f.write_str("it reported nothing")?,
                }
                match answered {
                    Answered::NotAsked => Ok(()),
                    Answered::Nothing => f.write_str(" and answered neither SDO nor any other protocol"),
                    Answered::Sdo => f.write_str(", but its SDO server did answer"),
                    Answered::OtherProtocol(name) => write!(f, ", but it did answer the {name}"),
                }
            }
            Self::Transfer { object, access: access @ Access::Write(_), error } => {
                write!(f, "{}: expected it to be accepted, got {error}", access.words(object))
            }
            Self::Transfer { object, access, error } => {
                write!(f, "{}: expected a value, got {error}", access.words(object))
            }
            Self::TextTransfer { object, error } => {
                write!(f, "reading {object}: expected a text, got {error}")
            }
            Self::Length { object, received } => {
                let expected = object.data_type.length();
                write!(f, "reading {object}: expected {expected} bytes, got {received}")
            }
            Self::Value { object, access, expected, received, waited_ns } => {
                let (wanted, came) = (expected.words(object), object.show(*received));
                write!(f, "{}: expected {wanted}, got {came}", access.words(object))?;
                if let Some(meaning) = expected.meaning(*received) {
                    write!(f, " ({meaning})")?;
                }
                if *waited_ns > 0 {
                    write!(f, " for {} ms", ms(*waited_ns))?;
                }
                Ok(())
            }
            Self::ConfigurationTransfer { object, written, is_reading_back: false, error, .. } => {
                write!(f, "writing {written} to {object}: expected it to be accepted, got {error}")
            }
            Self::ConfigurationTransfer { object, written, is_reading_back: true, error, .. } => {
                write!(f, "reading {object} back after writing {written}: expected a value, got {error}")
            }
            Self::ConfigurationDiffers { object, written, received } => {
                write!(f, "reading {object} back after writing {written}: got {received}")
            }
            Self::DoesNotFit { object, value } => {
                let bits = 8 * object.data_type.length();
                write!(f, "writing {value} to {object}: it does not fit {bits} bits")
            }
            Self::Inquiry(error) => write!(f, "{error}"),
            Self::Mapping(problem) => write!(f, "{problem}"),
            Self::Restarted { times } => {
                write!(f, "expected it to keep running, it has restarted {times} times")
            }
        }
    }
}

impl Cause {
    /// Whether the drive gave no answer.
    pub fn is_silence(&self) -> bool {
        matches!(
            self,
            Self::Transfer { error: SdoError::NoReply { .. }, .. }
                | Self::Inquiry(_)
                | Self::StateNotReached { answered: Answered::Nothing, .. }
        )
    }

    /// What to try, where the cause itself tells more than the step.
    fn advice(&self) -> Option<&'static str> {
        match self {
            Self::StateNotReached { answered: Answered::OtherProtocol(_), .. } => {
                Some("load CANopen firmware into the drive, or configure the protocol that it speaks")
            }
            Self::StateNotReached { answered: Answered::Sdo, .. } => Some(
                "the drive runs but does not obey NMT: look for a second master on the bus, and power-cycle the drive",
            ),
            Self::ConfigurationTransfer { error: SdoError::NoReply { .. }, means_absent: true, .. } => Some(
                "this drive gives no answer at all for an object that it does not have: leave the object out of the file \
                 named by `dcf`; if it has the object, check its supply and the wiring",
            ),
            Self::Transfer { error: SdoError::NoReply { .. }, .. }
            | Self::ConfigurationTransfer { error: SdoError::NoReply { .. }, .. }
            | Self::Inquiry(PdoInquiryError { error: SdoError::NoReply { .. }, .. })
            | Self::TextTransfer { error: SdoError::NoReply { .. }, .. } => Some(
                "the drive has fallen silent: check its supply, the wiring and the bus load, and that no other master \
                 stops it",
            ),
            Self::Transfer { error: SdoError::Aborted(AbortCode::PresentDeviceState), .. } => Some(
                "the drive refuses this in its present state: clear its fault and disable it, then run again",
            ),
            Self::Mapping(problem) => Some(problem.advice()),
            Self::Restarted { .. } => {
                Some("check the drive's supply for dips, and that no other master resets it")
            }
            _ => None,
        }
    }
}
