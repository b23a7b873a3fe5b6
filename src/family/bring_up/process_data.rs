//! Which objects each PDO carries. Bring-up writes it to the drive, the cycle compiles it, and the bus load counts it.

use takt_rt::{
    AxisProcessData, CommandSlot, Id, MAX_PDOS, MappedObject, MappedPdo, Request, TransmissionType,
};
use takt_wire::canopen::objects::PdoDirection;

use super::mapped_objects::{
    CONTROLWORD, CURRENT, ERROR_CODE, OPERATION_MODE, OPERATION_MODE_DISPLAY, POSITION, STATUSWORD,
    TARGET_POSITION, TARGET_TORQUE, TARGET_VELOCITY, TORQUE, TORQUE_OFFSET, VELOCITY, VELOCITY_OFFSET,
};
use crate::config::{Axis, Control, Feedback};

const PDO_BITS: u32 = 64;
/// A placeholder for one byte of a PDO with unknown content.
const ANY_BYTE: MappedObject = MappedObject::new(0x0005, 0, 8);

/// One PDO of a drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoPlan {
    /// Its number, 1 to 4 for those of the first axis of a node.
    pub number: u16,
    /// Its identifier.
    pub id: Id,
    /// Its transmission type (CiA 301, 7.5.2.36).
    pub transmission_type: u8,
    /// The mapped objects, in order.
    pub objects: Vec<MappedObject>,
    /// For how many axes its frame is, for an RPDO: 1 unless they share it.
    pub axes: u8,
    /// Condition the controller sends it, for an RPDO.
    pub transmission: TransmissionType,
    /// Whether it is sent in reply to a command, for a TPDO.
    pub reply: Reply,
}

/// Whether a drive sends a TPDO in reply to a command of the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reply {
    /// It does not: the transmission type alone says when.
    #[default]
    No,
    /// It does, and on other events as well.
    ToCommands,
    /// It does, and at no other time.
    ToCommandsOnly,
}

impl PdoPlan {
    /// PDO 1 to 4 of a node, with its identifier of the pre-defined connection set and transmission type 0.
    pub fn new(
        direction: PdoDirection,
        number: u8,
        node: u8,
        objects: Vec<MappedObject>,
        transmission: TransmissionType,
    ) -> Self {
        let id = pdo_id(direction, number, node);
        Self {
            number: number.into(),
            id,
            transmission_type: 0,
            objects,
            axes: 1,
            transmission,
            reply: Reply::No,
        }
    }

    /// The payload in bytes.
    pub fn length(&self) -> usize {
        self.objects.iter().map(|object| usize::from(object.bits)).sum::<usize>() / 8
    }
}

/// The PDOs of one axis.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProcessData {
    /// The PDOs that the controller sends (RPDOs of the drive).
    pub commands: Vec<PdoPlan>,
    /// The PDOs that the controller evaluates (TPDOs of the drive).
    pub feedback: Vec<PdoPlan>,
    /// The other TPDOs that the drive sends.
    pub unused: Vec<PdoPlan>,
}

impl ProcessData {
    /// All of its PDOs.
    pub fn all(&self) -> impl Iterator<Item = &PdoPlan> {
        self.commands.iter().chain(&self.feedback).chain(&self.unused)
    }

    /// The same PDOs at full length.
    pub(crate) fn padded(mut self) -> Self {
        for pdo in self.commands.iter_mut().chain(&mut self.feedback) {
            let free_bytes = (PDO_BITS as usize / 8).saturating_sub(pdo.length());
            pdo.objects.extend(std::iter::repeat_n(ANY_BYTE, free_bytes));
        }
        self
    }

    /// The objects that a drive with free mapping must receive in every cycle.
    pub(super) fn needed_commands(axis: &Axis) -> Vec<MappedObject> {
        let target_of = |control: &Control| match control.target_slot() {
            CommandSlot::TargetVelocity => TARGET_VELOCITY,
            CommandSlot::TargetTorque => TARGET_TORQUE,
            _ if *control == Control::Interpolated => axis.drive.interpolation_target,
            _ => TARGET_POSITION,
        };
        let mut objects = vec![CONTROLWORD, target_of(&axis.control)];
        if axis.control.is_profile() {
            return of_node_axis(objects, axis);
        }
        if changes_mode(axis) {
            objects.push(OPERATION_MODE);
        }
        objects.extend(axis.other_modes.iter().map(target_of));
        let follows = |target| axis.controls().any(|control| control.target_slot() == target);
        // It fits beside the target, where there is one.
        if axis.feed_forward.has_torque()
            && (follows(CommandSlot::TargetPosition) || follows(CommandSlot::TargetVelocity))
        {
            objects.push(TORQUE_OFFSET);
        }
        if axis.feed_forward.has_velocity() && follows(CommandSlot::TargetPosition) {
            objects.push(VELOCITY_OFFSET);
        }
        of_node_axis(objects, axis)
    }

    /// The objects that a drive with free mapping must send in every cycle.
    pub(super) fn needed_feedback(axis: &Axis) -> Vec<MappedObject> {
        let asked = axis.feedback.iter().copied();
        // Nothing else shows that the drive has taken another mode.
        let is_mode_missing = changes_mode(axis) && !axis.feedback.contains(&Feedback::OperationMode);
        let mode = is_mode_missing.then_some(Feedback::OperationMode);
        let objects = [STATUSWORD, POSITION].into_iter().chain(mode.into_iter().chain(asked).map(mapped));
        of_node_axis(objects.collect(), axis)
    }

    /// Maps a drive with free mapping: command and feedback in as many PDOs as they need, controlword and target, statusword and
    /// position first.
    pub(crate) fn mapped_freely(axis: &Axis) -> Self {
        let (commands, feedback) = (packed(Self::needed_commands(axis)), packed(Self::needed_feedback(axis)));
        let plan = |direction, (place, objects): (u8, Vec<MappedObject>)| PdoPlan {
            number: first_pdo(axis.drive.node_axis) + u16::from(place) - 1,
            transmission_type: axis.transmission_type,
            ..PdoPlan::new(direction, place, axis.node, objects, TransmissionType::EveryCycle)
        };
        let plans = |direction, pdos: Vec<Vec<MappedObject>>| -> Vec<PdoPlan> {
            (1..).zip(pdos).map(|pdo| plan(direction, pdo)).collect()
        };
        Self {
            commands: plans(PdoDirection::Receive, commands),
            feedback: plans(PdoDirection::Transmit, feedback),
            unused: vec![],
        }
    }

    /// The request that makes the cycle exchange this process data with the drive of an axis.
    pub fn request(&self, axis: u8) -> Request {
        fn each<T>(plans: &[PdoPlan], part: impl Fn(&PdoPlan) -> T) -> [Option<T>; MAX_PDOS] {
            std::array::from_fn(|at| plans.get(at).map(&part))
        }
        let mapped = |plan: &PdoPlan| MappedPdo {
            id: plan.id,
            transmission: plan.transmission,
            objects: std::array::from_fn(|at| plan.objects.get(at).copied()),
        };
        Request::ProcessData(AxisProcessData {
            axis,
            commands: each(&self.commands, mapped),
            feedback: each(&self.feedback, mapped),
            unused: each(&self.unused, |plan| plan.id),
        })
    }

    /// The unused TPDO that the drive sends in reply to each command.
    pub fn answer(&self) -> Option<&PdoPlan> {
        let command =
            self.commands.iter().find(|command| command.transmission == TransmissionType::EveryCycle)?;
        self.unused.iter().find(|pdo| pdo.number == command.number)
    }
}

/// The number of the first PDO of an axis of a node, counted from 1: each axis has 64 in each direction (CiA 402-2, multi-axis
/// devices).
pub const fn first_pdo(node_axis: u8) -> u16 {
    64 * (node_axis.saturating_sub(1) as u16) + 1
}

/// Objects of the first axis of a node, as those of this axis.
fn of_node_axis(objects: Vec<MappedObject>, axis: &Axis) -> Vec<MappedObject> {
    objects.into_iter().map(|object| object.of_node_axis(axis.drive.node_axis)).collect()
}

/// Returns `true` if the mode of an axis may be changed at run time.
fn changes_mode(axis: &Axis) -> bool {
    !axis.other_modes.is_empty()
}

/// Objects in their order in as few PDOs as that takes.
fn packed(objects: Vec<MappedObject>) -> Vec<Vec<MappedObject>> {
    let mut pdos: Vec<Vec<MappedObject>> = vec![vec![]];
    for object in objects {
        let used: u32 = pdos.last().into_iter().flatten().map(|object| u32::from(object.bits)).sum();
        if used + u32::from(object.bits) > PDO_BITS {
            pdos.push(vec![]);
        }
        if let Some(last) = pdos.last_mut() {
            last.push(object);
        }
    }
    pdos
}

/// The identifier of PDO 1 to 4 in the pre-defined connection set.
pub(super) fn pdo_id(direction: PdoDirection, number: u8, node: u8) -> Id {
    let first = match direction {
        PdoDirection::Receive => 0x200,
        PdoDirection::Transmit => 0x180,
    };
    Id::canopen(first + 0x100 * (u16::from(number.clamp(1, 4)) - 1), node)
}

fn mapped(feedback: Feedback) -> MappedObject {
    match feedback {
        Feedback::OperationMode => OPERATION_MODE_DISPLAY,
        Feedback::Velocity => VELOCITY,
        Feedback::Torque => TORQUE,
        Feedback::Current => CURRENT,
        Feedback::ErrorCode => ERROR_CODE,
    }
}
