//! Commissioning of one drive: the tasks of the vendors' host tools, as procedures without input and output.
//!
//! ```text
//! task ── procedure ── takes the time and frames; returns frames, events and an outcome
//!            │
//!       sdo_session ── transfers, pauses and conditions to await, each of which may be interrupted
//!            │
//!         family ── one folder a family: objects, alarms, motions
//!            │
//!     target, motion_profile ── units and limits of the axis
//! ```
//!
//! [`bus_session::run`] runs a procedure on a bus, and [`meaning`] describes its frames. Devices without a node ID are
//! set up by [`layer_settings`].

pub mod bus_session;
pub mod command_value;
mod contact;
pub mod dictionary;
pub mod erob_canopen;
mod failure;
mod guarded;
pub mod layer_settings;
pub mod meaning;
mod motion_profile;
mod objects;
mod polling;
mod report;
mod scan;
mod sdo_session;
mod target;
mod task;
pub mod yz_aim;

use crate::procedure::{self, CanopenClient, CanopenSession};

pub use crate::procedure::{AxisReading, ProcedureEvent, SdoQuirks};
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
    let session = CanopenSession::new(CanopenClient::new(target.node, target.family().sdo_quirks()));
    let c = SdoSession::new(session.clone());
    Procedure::new(session, async move {
        match task {
            Task::Read { objects } => objects::read(&c, &target, &objects).await,
            Task::Write { object, value, entry } => objects::write(&c, &target, object, value, entry).await,
            task => target.family().carry_out(&c, &target, task).await,
        }
    })
}
