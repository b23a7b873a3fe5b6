//! A procedure on one drive as a list of steps: plain data that describes a family's procedure. `axis_run` runs it.

use takt_rt::{DriveState, Nanoseconds, OperationMode};

use crate::canopen::dcf::Download;
use crate::canopen::nmt::{NmtCommand, NmtState};
use crate::canopen::object::{Object, ObjectAddress};

/// One step.
#[derive(Clone, Debug, PartialEq)]
pub struct ProcedureStep {
    /// Its name, for progress and failures.
    pub name: &'static str,
    /// The remedy when it fails.
    pub advice: &'static str,
    /// The condition under which it is done.
    pub condition: Condition,
    /// What it does.
    pub action: Action,
}

/// The condition under which a step is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// In any case.
    Always,
    /// Condition the last statusword shows torque on the motor.
    HasTorque,
}

/// What a step does.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Commands an NMT state and waits until the node reports it.
    Nmt {
        command: NmtCommand,
        /// The state to wait for; `None` when the node produces no heartbeat to report it with.
        awaited: Option<NmtState>,
        /// The timeout.
        within_ns: Nanoseconds,
        /// Condition to repeat the command, because a booting node may have missed it.
        repeat_ns: Nanoseconds,
    },
    /// Repeats an NMT command and an SDO upload of object 1000 until the node answers. The node may have been absent,
    /// and a node in NMT stopped has no SDO server before the command.
    WakeUp { command: NmtCommand },
    /// Reads a number.
    Read {
        object: Object,
        check: Check,
        keep: Option<Fact>,
        /// Whether the drive may refuse; the object is then recorded as absent.
        is_optional: bool,
    },
    /// Reads a text. The drive may refuse.
    ReadText { object: ObjectAddress, keep: TextFact },
    /// Writes a number.
    Write {
        object: Object,
        value: ValueSource,
        read_back: ReadBack,
        /// Whether the object may be missing; it is then recorded as absent.
        is_optional: bool,
    },
    /// Writes bytes, and reads them back unless the object is write-only.
    WriteBytes(Download),
    /// Reads the PDO configuration, and takes the process data from it.
    ReadProcessData,
    /// Polls a number until it passes the check.
    Await { object: Object, check: Check, keep: Option<Fact>, within_ns: Nanoseconds },
}

/// The source of a number to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueSource {
    Value(i64),
    /// The last position that was read.
    ActualPosition,
}

/// Whether a written number is read back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadBack {
    No,
    /// It must match in these bits.
    Masked(u32),
}

impl ReadBack {
    /// All bits must match.
    pub const EXACT: Self = Self::Masked(u32::MAX);
}

/// The fact that a number is stored as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fact {
    DeviceType,
    VendorId,
    ProductCode,
    RevisionNumber,
    SupportedModes,
    Statusword,
    ErrorCode,
    Position,
    RatedCurrent,
    RatedTorque,
    MaxTorque,
    QuickStopOptionCode,
}

/// The fact that a text is stored as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextFact {
    DeviceName,
    HardwareVersion,
    SoftwareVersion,
}

/// The condition that a number must meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// Any number.
    Any,
    /// This number.
    Equals(i64),
    /// This number in these bits.
    Masked {
        /// The number.
        value: i64,
        /// The bits.
        mask: u32,
    },
    /// A device type (object 1000) with this profile number in its low 16 bits.
    Profile(u16),
    /// Supported modes (object 6502) with the bit of this mode.
    Supports(OperationMode),
    /// A statusword of a state without torque.
    NoTorque,
    /// A velocity of at most this many drive units in either direction.
    AtMost(i64),
    /// More than zero.
    Positive,
}

impl Check {
    /// Whether `value` meets the condition.
    pub fn passes(self, value: i64) -> bool {
        match self {
            Self::Any => true,
            Self::Equals(wanted) => value == wanted,
            Self::Masked { value: wanted, mask } => (value ^ wanted) & i64::from(mask) == 0,
            Self::Profile(profile) => value & 0xFFFF == i64::from(profile),
            Self::Supports(mode) => value & i64::from(mode.supported_bit()) != 0,
            Self::NoTorque => !DriveState::decode(value as u16).has_torque(),
            Self::AtMost(limit) => value.abs() <= limit,
            Self::Positive => value > 0,
        }
    }

    /// The condition in words, for a value of `object`.
    pub fn words(self, object: &Object) -> String {
        match self {
            Self::Any => "any value".into(),
            Self::Equals(value) => object.show(value),
            Self::Masked { value, mask } => format!("{} in the bits 0x{mask:08X}", object.show(value)),
            Self::Profile(profile) => format!("a device of profile CiA {profile}"),
            Self::Supports(mode) => {
                format!("bit {} ({})", mode.supported_bit().trailing_zeros(), mode.name())
            }
            Self::NoTorque => "a state without torque".into(),
            Self::AtMost(limit) => format!("standstill (at most {limit})"),
            Self::Positive => "more than zero".into(),
        }
    }

    /// The meaning of a value that does not pass, beyond its number.
    pub fn meaning(self, value: i64) -> Option<String> {
        match self {
            Self::NoTorque => Some(format!("{:?}", DriveState::decode(value as u16))),
            Self::Supports(_) => {
                let supported =
                    OperationMode::ALL.into_iter().filter(|mode| Self::Supports(*mode).passes(value));
                let names: Vec<&str> = supported.map(OperationMode::name).collect();
                Some(if names.is_empty() { "no mode at all".into() } else { names.join(", ") })
            }
            _ => None,
        }
    }
}

/// An access to an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reading it.
    Read,
    /// Writing this value to it.
    Write(i64),
    /// Reading it back after this value was written.
    ReadBack(i64),
}

impl Access {
    /// The access in words, for `object`.
    pub fn words(self, object: &Object) -> String {
        match self {
            Self::Read => format!("reading {object}"),
            Self::Write(value) => format!("writing {} to {object}", object.show(value)),
            Self::ReadBack(value) => format!("reading {object} back after writing {}", object.show(value)),
        }
    }
}
