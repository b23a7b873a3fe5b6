//! Everything about an axis that does not change while it runs.

use arrayvec::ArrayVec;

use crate::control::ControlLaw;
use crate::dialect::Dialect;
use crate::frame::Id;
use crate::guard::{AxisLimits, OnViolation};
use crate::pdo::Mapping;
use crate::units::Scale;

/// The PDOs that a CANopen drive has in each direction here.
pub const MAX_PDOS: usize = 4;

/// A PDO: its identifier and its compiled mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct Pdo {
    /// The identifier.
    pub id: Id,
    /// What it carries.
    pub mapping: Mapping,
}

/// When a command is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransmissionType {
    /// In every cycle of its bus.
    EveryCycle,
    /// When the controlword changes, and again while the drive is not enabled or is not to be.
    OnControlword,
}

/// A PDO that is sent to the drive.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandPdo {
    /// What.
    pub pdo: Pdo,
    /// When.
    pub transmission: TransmissionType,
}

impl CommandPdo {
    /// One that is sent in every cycle of its bus.
    pub const fn every_cycle(pdo: Pdo) -> Self {
        Self { pdo, transmission: TransmissionType::EveryCycle }
    }
}

/// Since when feedback must have arrived to be that of the present cycle. PDOs carry no number: the time of their arrival
/// is what tells an answer of this cycle from one that is late.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeedbackSince {
    /// The cycle's SYNC, which the drive answers.
    #[default]
    Sync,
    /// The command phase of the cycle before, in which the drive was sent the set-point that it answers: the command that
    /// is sent in every cycle.
    SetPoint,
    /// The same, for a drive that reports when it likes.
    CommandPhase,
}

/// Everything about an axis that does not change while it runs.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisParameters {
    /// The bus, an index into the engine's buses.
    pub bus: u8,
    /// The node number.
    pub node: u8,
    /// What is sent, in order.
    pub commands: ArrayVec<CommandPdo, MAX_PDOS>,
    /// What is expected each cycle of the bus.
    pub feedback: ArrayVec<Pdo, MAX_PDOS>,
    /// Since when it must have arrived.
    pub feedback_since: FeedbackSince,
    /// Identifiers of process data that the drive sends beside that, which carries nothing new.
    pub unused: ArrayVec<Id, MAX_PDOS>,
    /// How it speaks.
    pub dialect: Dialect,
    /// Cycles of the bus from one controlword to the next on the way to operation enabled; 0 where the drive shows how
    /// far it has come.
    pub controlword_spacing_cycles: u32,
    /// How it is commanded.
    pub law: ControlLaw,
    /// SI to drive units.
    pub scale: Scale,
    /// What it may never be asked to do.
    pub limits: AxisLimits,
    /// How far from the joint a stream may begin (rad or m).
    pub start_tolerance: f64,
    /// What is done with set-points of a stream that break a limit.
    pub on_violation: OnViolation,
    /// Slots without a heartbeat of the node that are allowed; `None` where it sends none.
    pub heartbeat_timeout_cycles: Option<u32>,
    /// Following error that is allowed at any time (rad or m).
    pub following_error_limit: f64,
    /// Cycles in a row that the following error may be larger.
    pub following_error_cycles: u32,
    /// Cycles of the bus in a row without feedback that are bridged.
    pub missed_feedback_cycles: u16,
}
