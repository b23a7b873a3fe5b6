//! Commissioning of one drive, as far as its families need it: tasks, targets, sessions.
//!
//! ```text
//! task ── procedure ── takes the time and frames; returns frames, events and an outcome
//!            │
//!       sdo_session ── transfers, pauses and conditions to await, each of which may be interrupted
//!            │
//!        profile ── the tasks of every drive that keeps to CiA 402
//!         family ── one folder a family: objects, alarms, motions of its own
//!            │
//!     target, motion_profile ── units and limits of the axis
//! ```
//!
//! [`meaning`] describes the frames of a procedure.

pub mod command_value;
pub(super) mod contact;
pub mod dictionary;
pub(super) mod failure;
pub(super) mod guarded;
pub mod meaning;
pub(super) mod motion_profile;
pub(super) mod objects;
pub(super) mod polling;
pub(super) mod profile;
pub(super) mod report;
pub(super) mod scan;
pub(super) mod sdo_session;
pub(super) mod target;
pub(super) mod task;

use crate::family;
use crate::procedure::{self, CanopenClient, CanopenSession};

pub use failure::Failure;
pub use motion_profile::{DEFAULT_SHARE, DriveProfile, MotionProfile};
pub use report::{Report, ReportItem};
pub use sdo_session::SdoSession;
pub use target::{CommandValue, TargetDrive};
pub use task::{MoveKind, ReadObject, Task};

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
