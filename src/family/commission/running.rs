//! The procedure that carries out a task.

use super::{Failure, Report, SdoSession, TargetDrive, Task, objects};
use crate::family;
use crate::procedure::{self, CanopenClient, CanopenSession};

/// A running procedure of commissioning.
pub type Procedure = procedure::Procedure<CanopenClient, Report, Failure>;

/// Why a procedure failed, and in which step.
pub type ProcedureError = procedure::ProcedureError<Failure>;

/// The procedure that carries out a task with this drive.
pub fn procedure(target: TargetDrive, task: Task) -> Procedure {
    let quirks = family::sdo_quirks(&target.drive, target.family().sdo_quirks().timing);
    let session = CanopenSession::new(CanopenClient::new(target.node, quirks));
    let c = SdoSession::new(session.clone(), target.drive.node_axis);
    Procedure::new(session, async move {
        match task {
            Task::Read { objects } => objects::read(&c, &target, &objects).await,
            Task::Write { object, value, entry } => objects::write(&c, &target, object, value, entry).await,
            task => target.family().carry_out(&c, &target, task).await,
        }
    })
}
