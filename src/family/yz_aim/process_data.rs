//! The fixed PDOs of a YZ-AIM (manual, 5.08): it answers RPDO n with TPDO n at once, and SYNC with TPDO 2.

use takt_rt::TransmissionType;
use takt_wire::canopen::objects::PdoDirection;

use crate::config::{Axis, Control};
use crate::family::bring_up::mapped_objects::{
    CONTROLWORD, OPERATION_MODE, POSITION, STATUSWORD, TARGET_POSITION, TARGET_VELOCITY, VELOCITY,
};
use crate::family::bring_up::{PdoPlan, ProcessData, Reply};

/// The process data of an axis.
pub fn fixed(axis: &Axis) -> ProcessData {
    let receive = |number, objects, transmission| PdoPlan {
        transmission_type: if number == 4 { 1 } else { 255 },
        ..PdoPlan::new(PdoDirection::Receive, number, axis.node, objects, transmission)
    };
    let transmit = |number: u8| {
        let objects = vec![POSITION, if number == 3 { VELOCITY } else { STATUSWORD }];
        let is_at_sync = number == 2 && answers_sync(axis);
        PdoPlan {
            transmission_type: if is_at_sync { 1 } else { 255 },
            // TPDO 1, the reply in profile position, may also be sent by its event timer (manual, 5.08.3).
            reply: match number {
                _ if is_at_sync => Reply::No,
                4 => Reply::ToCommandsOnly,
                _ => Reply::ToCommands,
            },
            ..PdoPlan::new(PdoDirection::Transmit, number, axis.node, objects, TransmissionType::EveryCycle)
        }
    };
    let position = vec![CONTROLWORD, OPERATION_MODE, TARGET_POSITION];
    let (commands, answer) = match axis.control {
        Control::ProfileVelocity => {
            let velocity = vec![CONTROLWORD, OPERATION_MODE, TARGET_VELOCITY];
            (vec![receive(3, velocity, TransmissionType::EveryCycle)], 3)
        }
        Control::ProfilePosition => (vec![receive(1, position, TransmissionType::EveryCycle)], 1),
        _ => {
            let interpolated = receive(4, vec![TARGET_POSITION], TransmissionType::EveryCycle);
            (vec![receive(1, position, TransmissionType::OnControlword), interpolated], 4)
        }
    };
    let feedback = if answers_sync(axis) { 2 } else { answer };
    let unused = (1..=4).filter(|number| *number != feedback).map(transmit).collect();
    ProcessData { commands, feedback: vec![transmit(feedback)], unused }
}

/// Returns `true` if the drive sends its feedback at SYNC. In profile velocity it must: its reply to a command has no statusword.
pub fn answers_sync(axis: &Axis) -> bool {
    axis.answers_sync || axis.control == Control::ProfileVelocity
}
