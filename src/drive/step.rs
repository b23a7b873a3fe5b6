//! A procedure on one drive as a list of steps: plain data that a family of drives writes down and
//! [`AxisRun`](super::axis_run::AxisRun) carries out.

use takt_rt::{DriveState, Nanoseconds, OperationMode};

use crate::canopen::dcf::Download;
use crate::canopen::nmt::{NmtCommand, NmtState};
use crate::canopen::object::{Object, ObjectAddress};

/// One step.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Step {
    /// What it is about, for progress and failures.
    pub name: &'static str,
    /// What to try when it fails.
    pub advice: &'static str,
    /// Whether it is done at all.
    pub when: When,
    /// What is done.
    pub action: Action,
}

/// Whether a step is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum When {
    /// In any case.
    Always,
    /// Only when the last statusword shows torque on the motor.
    HasTorque,
}

/// What a step does.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Action {
    /// Commands a state and waits until the node reports it.
    Nmt {
        command: NmtCommand,
        /// The state to wait for; `None` when the node produces no heartbeat to report it with.
        awaited: Option<NmtState>,
        /// For how long to wait.
        within_ns: Nanoseconds,
        /// When to command again: the first frame may have come before the node could hear.
        repeat_ns: Nanoseconds,
    },
    /// Commands a state and asks for the device type, both again and again, until the node answers. It may have been away, and
    /// a stopped one has no SDO server before it is commanded.
    Reach { command: NmtCommand },
    /// Reads a number.
    Read {
        object: Object,
        check: Check,
        keep: Option<Fact>,
        /// Whether the drive may refuse: then the object is noted as absent.
        is_optional: bool,
    },
    /// Reads a text, which the drive may refuse.
    ReadText { object: ObjectAddress, keep: TextFact },
    /// Writes a number.
    Write {
        object: Object,
        value: Source,
        read_back: ReadBack,
        /// Whether the drive may say that it has no such object: then it is noted as absent.
        is_optional: bool,
    },
    /// Writes bytes, and reads them back where they can be read.
    WriteBytes(Download),
    /// Reads how the PDOs are configured, and settles the process data by it.
    ReadProcessData,
    /// Reads a number again and again until it is as wanted.
    Await { object: Object, check: Check, keep: Option<Fact>, within_ns: Nanoseconds },
}

/// The number to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    Value(i64),
    /// The position that was read last.
    ActualPosition,
}

/// Whether a written number is read again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReadBack {
    No,
    /// It must be the same in these bits.
    Masked(u32),
}

impl ReadBack {
    /// It must be the same.
    pub const EXACT: Self = Self::Masked(u32::MAX);
}

/// Where a number is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fact {
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

/// Where a text is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TextFact {
    DeviceName,
    HardwareVersion,
    SoftwareVersion,
}

/// What a number must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// Anything.
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
    /// A number whose low 16 bits are those of the profile in object 1000.
    Profile(u16),
    /// A number with the bit of this mode in object 6502.
    Supports(OperationMode),
    /// A statusword of a state without torque.
    NoTorque,
    /// A velocity of at most this many drive units either way.
    AtMost(i64),
    /// More than zero.
    Positive,
}

impl Check {
    /// Whether `value` passes.
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

    /// In words, for a value of `object`.
    pub fn words(self, object: &Object) -> String {
        match self {
            Self::Any => "any value".into(),
            Self::Equals(value) => object.show(value),
            Self::Masked { value, mask } => format!("{} in the bits 0x{mask:08X}", object.show(value)),
            Self::Profile(profile) => format!("a device of profile CiA {profile}"),
            Self::Supports(mode) => {
                format!("bit {} ({})", mode.supported_bit().trailing_zeros(), mode_words(mode))
            }
            Self::NoTorque => "a state without torque".into(),
            Self::AtMost(limit) => format!("standstill (at most {limit})"),
            Self::Positive => "more than zero".into(),
        }
    }

    /// What a value means, beside the number itself.
    pub fn meaning(self, value: i64) -> Option<String> {
        match self {
            Self::NoTorque => Some(format!("{:?}", DriveState::decode(value as u16))),
            Self::Supports(_) => {
                let supported =
                    OperationMode::ALL.into_iter().filter(|mode| Self::Supports(*mode).passes(value));
                let names: Vec<&str> = supported.map(mode_words).collect();
                Some(if names.is_empty() { "no mode at all".into() } else { names.join(", ") })
            }
            _ => None,
        }
    }
}

/// A mode of operation as CiA 402 calls it.
pub fn mode_words(mode: OperationMode) -> &'static str {
    match mode {
        OperationMode::ProfilePosition => "profile position",
        OperationMode::Velocity => "velocity",
        OperationMode::ProfileVelocity => "profile velocity",
        OperationMode::ProfileTorque => "profile torque",
        OperationMode::Homing => "homing",
        OperationMode::InterpolatedPosition => "interpolated position",
        OperationMode::CyclicSynchronousPosition => "cyclic synchronous position",
        OperationMode::CyclicSynchronousVelocity => "cyclic synchronous velocity",
        OperationMode::CyclicSynchronousTorque => "cyclic synchronous torque",
    }
}

/// What was being done to an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It was being read.
    Read,
    /// This was being written to it.
    Write(i64),
    /// It was being read after this had been written to it.
    ReadBack(i64),
}

impl Access {
    /// In words, for `object`.
    pub fn words(self, object: &Object) -> String {
        match self {
            Self::Read => format!("reading {object}"),
            Self::Write(value) => format!("writing {} to {object}", object.show(value)),
            Self::ReadBack(value) => format!("reading {object} back after writing {}", object.show(value)),
        }
    }
}
