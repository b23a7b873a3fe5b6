//! Which objects travel in which PDO. Bring-up programs it, the cycle compiles it, and the bus arithmetic counts it.

use takt_rt::frame::Id;
use takt_rt::pdo::MappedObject;

use crate::config::{Axis, Control, Feedback};

const CONTROLWORD: MappedObject = MappedObject::new(0x6040, 0, 16);
const TARGET_POSITION: MappedObject = MappedObject::new(0x607A, 0, 32);
const TARGET_VELOCITY: MappedObject = MappedObject::new(0x60FF, 0, 32);
const TARGET_TORQUE: MappedObject = MappedObject::new(0x6071, 0, 16);
const STATUSWORD: MappedObject = MappedObject::new(0x6041, 0, 16);
const POSITION: MappedObject = MappedObject::new(0x6064, 0, 32);

const PDO_BITS: u32 = 64;

/// One PDO of a drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoPlan {
    /// Its number, 1 to 4.
    pub number: u8,
    /// Its identifier.
    pub id: Id,
    /// Its transmission type (CiA 301, 7.5.2.36).
    pub transmission_type: u8,
    /// What it carries, in order.
    pub objects: Vec<MappedObject>,
}

impl PdoPlan {
    /// The payload in bytes.
    pub fn length(&self) -> usize {
        self.objects.iter().map(|object| usize::from(object.bits)).sum::<usize>() / 8
    }
}

/// The PDOs of one axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProcessData {
    /// What we send each cycle (RPDOs of the drive).
    pub commands: Vec<PdoPlan>,
    /// What the drive sends each cycle (its TPDOs).
    pub feedback: Vec<PdoPlan>,
}

impl ProcessData {
    /// The process data of an axis. A command fits one PDO; feedback takes as many as it needs, statusword and
    /// position first.
    pub fn of(axis: &Axis) -> Self {
        let target = match axis.control {
            Control::Position => TARGET_POSITION,
            Control::Velocity { .. } => TARGET_VELOCITY,
            Control::Torque { .. } => TARGET_TORQUE,
        };
        let mut feedback = vec![vec![]];
        for object in [STATUSWORD, POSITION].into_iter().chain(axis.feedback.iter().copied().map(mapped)) {
            let used: u32 =
                feedback.last().into_iter().flatten().map(|o: &MappedObject| u32::from(o.bits)).sum();
            if used + u32::from(object.bits) > PDO_BITS {
                feedback.push(vec![]);
            }
            if let Some(objects) = feedback.last_mut() {
                objects.push(object);
            }
        }
        let plan = |function: u16, number: u8, objects| PdoPlan {
            number,
            id: Id::canopen(function + 0x100 * (u16::from(number) - 1), axis.node),
            transmission_type: axis.transmission_type,
            objects,
        };
        Self {
            commands: vec![plan(0x200, 1, vec![CONTROLWORD, target])],
            feedback: (1..).zip(feedback).map(|(number, objects)| plan(0x180, number, objects)).collect(),
        }
    }
}

fn mapped(feedback: Feedback) -> MappedObject {
    match feedback {
        Feedback::OperationMode => MappedObject::new(0x6061, 0, 8),
        Feedback::Velocity => MappedObject::new(0x606C, 0, 32),
        Feedback::Torque => MappedObject::new(0x6077, 0, 16),
        Feedback::Current => MappedObject::new(0x6078, 0, 16),
        Feedback::ErrorCode => MappedObject::new(0x603F, 0, 16),
    }
}
