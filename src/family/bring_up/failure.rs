//! Why a procedure on a drive failed: axis, step, expected and received value, remedy.

use std::fmt;

use takt_rt::Nanoseconds;
use takt_wire::canopen::emcy::Emergency;
use takt_wire::canopen::nmt::NmtState;
use takt_wire::canopen::object::{Object, ObjectAddress};
use takt_wire::canopen::pdo_reader::PdoReadError;
use takt_wire::canopen::sdo::{AbortCode, SdoError};

use super::axis_units::SiUnit;
use super::check::Check;
use super::reported_mapping::MappingProblem;
use crate::procedure::Access;

/// The drives that failed during bring-up or shutdown.
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

/// Why one axis failed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct AxisFailure {
    /// The axis, an index into the configuration.
    pub axis: usize,
    /// Its name.
    pub name: String,
    /// The name of its bus.
    pub bus: String,
    /// Its node ID.
    pub node: u8,
    /// The failed step.
    pub step: &'static str,
    /// The cause.
    pub cause: FailureCause,
    /// The last emergency message of the drive.
    pub emergency: Option<Emergency>,
    /// The remedy of the step. [`AxisFailure::advice`] may know a better one from the cause.
    pub step_advice: &'static str,
}

impl AxisFailure {
    /// The remedy.
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

/// The cause of a failure: what was expected and what was received.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum FailureCause {
    /// The node did not report the commanded NMT state.
    StateNotReached {
        /// The state.
        awaited: NmtState,
        /// The last state that it reported.
        reported: Option<NmtState>,
        /// How long the procedure waited.
        waited_ns: Nanoseconds,
        /// The answer to a probe with other services.
        probe_result: ProbeResult,
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
    /// Reading a text failed.
    TextTransfer {
        /// The object.
        object: ObjectAddress,
        /// Why it failed.
        error: SdoError,
    },
    /// An object's data has another length than its type.
    Length {
        /// The object.
        object: Object,
        /// Number of received bytes.
        received: usize,
    },
    /// An object has another value.
    Value {
        /// The object.
        object: Object,
        /// The access that brought the value.
        access: Access,
        /// What was expected.
        expected: Check,
        /// The received value.
        received: i64,
        /// Its unit, where it is known.
        unit: Option<SiUnit>,
        /// How long the procedure waited for it; 0 when it was read once.
        waited_ns: Nanoseconds,
    },
    /// Writing a configured value, or reading it back, failed.
    ConfigurationTransfer {
        /// The object.
        object: ObjectAddress,
        /// The bytes to write.
        written: Content,
        /// True if it was being read back after the write.
        is_reading_back: bool,
        /// Why it failed.
        error: SdoError,
        /// True if this error means that the drive does not have the object.
        means_absent: bool,
    },
    /// A configured value reads back differently.
    ConfigurationDiffers {
        /// The object.
        object: ObjectAddress,
        /// The written bytes.
        written: Content,
        /// The received bytes.
        received: Content,
    },
    /// A value does not fit the object.
    DoesNotFit {
        /// The object.
        object: Object,
        /// The value.
        value: i64,
    },
    /// Reading the PDO configuration failed.
    PdoRead(PdoReadError),
    /// The PDOs that the drive reports do not suit the axis.
    Mapping(MappingProblem),
    /// The node has restarted and lost its configuration.
    Restarted {
        /// Number of times.
        times: u8,
    },
}

/// The bytes of an object, shortened for display.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Content {
    /// Their number.
    pub length: usize,
    /// The first of them.
    pub first: [u8; 8],
}

impl Content {
    /// The content of these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        let mut first = [0; 8];
        for (place, byte) in first.iter_mut().zip(bytes) {
            *place = *byte;
        }
        Self { length: bytes.len(), first }
    }
}

impl fmt::Display for Content {
    /// Up to eight bytes are shown as a little-endian number, longer content byte by byte.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.length {
            0 => f.write_str("nothing"),
            length @ 1..=8 => write!(f, "0x{:0width$X}", u64::from_le_bytes(self.first), width = 2 * length),
            length => write!(f, "{length} bytes {:02X?}…", self.first),
        }
    }
}

/// The answer of a node that did not report the awaited state to a probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProbeResult {
    /// Nothing answered.
    Nothing,
    /// Its SDO server.
    Sdo,
    /// The drive, in this other protocol.
    OtherProtocol(&'static str),
}

impl fmt::Display for FailureCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |ns: Nanoseconds| ns / 1_000_000;
        match self {
            Self::StateNotReached { awaited, reported, waited_ns, probe_result } => {
                write!(f, "expected the state {awaited}, waited {} ms, ", ms(*waited_ns))?;
                match reported {
                    Some(state) => write!(f, "it last reported {state}")?,
                    None => f.write_str("it reported nothing")?,
                }
                match probe_result {
                    ProbeResult::Nothing => f.write_str(" and answered neither SDO nor any other protocol"),
                    ProbeResult::Sdo => f.write_str(", but its SDO server answers"),
                    ProbeResult::OtherProtocol(name) => write!(f, ", but it answers the {name}"),
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
            Self::Value { object, access, expected, received, unit, waited_ns } => {
                let came = unit.map_or_else(|| object.show(*received), |unit| unit.show(*received));
                let wanted = expected.words(object, *unit);
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
            Self::PdoRead(error) => write!(f, "{error}"),
            Self::Mapping(problem) => write!(f, "{problem}"),
            Self::Restarted { times } => {
                write!(f, "expected it to keep running, but it has restarted {times} times")
            }
        }
    }
}

impl FailureCause {
    /// Returns `true` if the drive did not answer.
    pub(crate) fn is_silence(&self) -> bool {
        matches!(
            self,
            Self::Transfer { error: SdoError::NoReply { .. }, .. }
                | Self::PdoRead(_)
                | Self::StateNotReached { probe_result: ProbeResult::Nothing, .. }
        )
    }

    /// The remedy, if the cause is more specific than the step.
    fn advice(&self) -> Option<&'static str> {
        match self {
            Self::StateNotReached { probe_result: ProbeResult::OtherProtocol(_), .. } => {
                Some("load CANopen firmware into the drive, or configure the protocol that it speaks")
            }
            Self::StateNotReached { probe_result: ProbeResult::Sdo, .. } => Some(
                "the drive runs but ignores NMT: look for a second master on the bus, and power-cycle the drive",
            ),
            Self::ConfigurationTransfer { error: SdoError::NoReply { .. }, means_absent: true, .. } => Some(
                "this drive does not answer at all for an object that it does not have: leave the object out of the file \
                 named by `dcf`; if it has the object, check its supply and the wiring",
            ),
            Self::Transfer { error: SdoError::NoReply { .. }, .. }
            | Self::ConfigurationTransfer { error: SdoError::NoReply { .. }, .. }
            | Self::PdoRead(PdoReadError { error: SdoError::NoReply { .. }, .. })
            | Self::TextTransfer { error: SdoError::NoReply { .. }, .. } => Some(
                "the drive no longer answers: check its supply, the wiring and the bus load, and that no other master \
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
