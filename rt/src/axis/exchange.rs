//! What is exchanged with the drive of an axis in each cycle of its bus: PDOs, or frames of bit fields.

use arrayvec::ArrayVec;

use super::off_cycle::OffCycleReport;
use crate::bit_fields::{CommandValue, FieldDriveParameters, ReplyError, ReplyValue};
use crate::frame::{Frame, FrameFormat, Id};
use crate::pdo::{
    CommandSlot, FeedbackSlot, FeedbackSlots, MAX_PDOS, Mapping, ProcessImage, TooShort, TransmissionType,
};
use crate::sender_byte::SenderByte;

/// What is exchanged with a drive in each cycle of its bus.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is no allocator, and a drive of either kind needs all of it"
)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum Exchange {
    /// The PDOs of a CANopen drive.
    Pdos(Pdos),
    /// A command and a reply of bit fields.
    BitFields(FieldDriveParameters),
    /// Nothing in the cycle. Somebody else speaks to the drive, as often as it can answer: it takes what is wanted of the drive from
    /// [`AxisSnapshot`](crate::AxisSnapshot), and brings [`OffCycleReport`](crate::OffCycleReport)s.
    OffCycle {
        /// Cycles of the bus within which a report is expected; 0 counts as 1. What is counted in cycles of feedback elsewhere is counted in
        /// such times.
        report_cycles: u16,
        /// The frame that takes its torque. It is sent in its bus' place for frames that stop drives, when the frames of whoever speaks to
        /// the drive do not get out. `None`: there is none on this bus.
        stop_frame: Option<Frame>,
    },
}

/// The PDOs of a drive.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Pdos {
    /// What is sent, in order.
    pub commands: ArrayVec<CommandPdo, MAX_PDOS>,
    /// What is expected.
    pub feedback: ArrayVec<Pdo, MAX_PDOS>,
    /// Identifiers of process data that the drive sends beside that, which carries nothing new.
    pub unused: ArrayVec<Id, MAX_PDOS>,
}

impl Exchange {
    /// The PDOs that are sent: none to a drive that has no PDOs.
    pub fn commands(&self) -> &[CommandPdo] {
        match self {
            Self::Pdos(pdos) => &pdos.commands,
            Self::BitFields(_) | Self::OffCycle { .. } => &[],
        }
    }

    /// Cycles of the bus within which a report is expected, where that is not each of them.
    pub(super) const fn report_cycles(&self) -> u16 {
        match self {
            Self::Pdos(_) | Self::BitFields(_) => 1,
            Self::OffCycle { report_cycles, .. } => *report_cycles,
        }
    }

    /// The PDOs; `None` for a drive that has none.
    pub const fn pdos_mut(&mut self) -> Option<&mut Pdos> {
        match self {
            Self::Pdos(pdos) => Some(pdos),
            Self::BitFields(_) | Self::OffCycle { .. } => None,
        }
    }

    /// Returns `true` if the drive is sent a number.
    pub fn sends(&self, slot: CommandSlot) -> bool {
        let fields = match self {
            Self::Pdos(pdos) => return pdos.commands.iter().any(|command| command.pdo.mapping.sends(slot)),
            Self::BitFields(fields) => fields,
            Self::OffCycle { .. } => return false,
        };
        match slot {
            CommandSlot::Controlword => true,
            CommandSlot::OperationMode => fields.life_cycle.has_modes(),
            CommandSlot::TargetPosition => fields.command.carries(CommandValue::Position),
            CommandSlot::TargetVelocity => fields.command.carries(CommandValue::Velocity),
            CommandSlot::TargetTorque => fields.command.carries(CommandValue::Torque),
            CommandSlot::VelocityOffset | CommandSlot::TorqueOffset | CommandSlot::Zero => false,
        }
    }

    /// Which numbers the drive reports.
    pub(super) fn reported_slots(&self) -> FeedbackSlots {
        let fields = match self {
            Self::Pdos(pdos) => return FeedbackSlots::of(pdos.feedback.iter().map(|pdo| &pdo.mapping)),
            Self::BitFields(fields) => fields,
            Self::OffCycle { .. } => return FeedbackSlots::with(OffCycleReport::SLOTS),
        };
        let of_reply = [
            (ReplyValue::Velocity, FeedbackSlot::Velocity),
            (ReplyValue::Torque, FeedbackSlot::Torque),
            (ReplyValue::Error, FeedbackSlot::ErrorCode),
        ];
        let carried = of_reply.into_iter().filter(|(value, _)| fields.reply.carries(*value));
        let always = [FeedbackSlot::Statusword, FeedbackSlot::OperationModeDisplay, FeedbackSlot::Position];
        FeedbackSlots::with(carried.map(|(_, slot)| slot).chain(always))
    }

    /// The most frames that are sent in a cycle.
    pub fn frames(&self) -> usize {
        match self {
            Self::Pdos(pdos) => pdos.commands.len(),
            Self::BitFields(_) => 1,
            Self::OffCycle { .. } => 0,
        }
    }

    /// How many parts a complete feedback has.
    pub fn reports(&self) -> usize {
        match self {
            Self::Pdos(pdos) => pdos.feedback.len(),
            Self::BitFields(_) | Self::OffCycle { .. } => 1,
        }
    }
}

/// A frame whose payload is no feedback of the drive that it comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoFeedback {
    /// It is shorter than the mapping of its PDO.
    Pdo(TooShort),
    /// It is no reply of bit fields.
    Reply(ReplyError),
    /// The drive sends nothing in the cycle.
    OffCycle,
}

impl core::error::Error for NoFeedback {}

impl core::fmt::Display for NoFeedback {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Pdo(error) => error.fmt(f),
            Self::Reply(error) => error.fmt(f),
            Self::OffCycle => f.write_str("the drive is spoken to outside of the cycle"),
        }
    }
}

/// A PDO: its frames and its compiled mapping.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Pdo {
    /// The identifier.
    pub id: Id,
    /// The kind of its frames. CAN FD frames are received with and without bit-rate switch, whichever of the two this says.
    pub format: FrameFormat,
    /// The byte by which its frames are known where several drives may send by this identifier. Nothing in a PDO that is sent.
    pub sender: Option<SenderByte>,
    /// What it carries.
    pub mapping: Mapping,
}

impl Pdo {
    /// A PDO of classic frames whose identifier is its own.
    pub const fn classic(id: Id, mapping: Mapping) -> Self {
        Self { id, format: FrameFormat::Classic, sender: None, mapping }
    }

    /// The frame that carries these numbers.
    #[inline]
    pub(crate) fn frame(&self, image: &ProcessImage) -> Frame {
        Frame::packed(self.id, self.format, self.mapping.pack(image), self.mapping.length())
    }
}

/// A PDO that is sent to the drive.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct CommandPdo {
    /// What.
    pub pdo: Pdo,
    /// When.
    pub transmission: TransmissionType,
    /// For how many axes its frame is: 1 as a rule. Where it is for several, the drive of each takes its own part and passes over that
    /// of the others (dummy mapping, CiA 301, 7.4.7.1), and the frame leaves when each of them has its part in it.
    pub axes: u8,
}

impl CommandPdo {
    /// One that is sent in every cycle of its bus.
    pub const fn every_cycle(pdo: Pdo) -> Self {
        Self { pdo, transmission: TransmissionType::EveryCycle, axes: 1 }
    }
}
