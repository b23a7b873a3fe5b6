//! Commissioning of one drive: the tasks of the vendors' host tools, as procedures without input and output.
//!
//! ```text
//! task ── procedure ── takes the time and frames; returns frames, events and an outcome
//!            │
//!       sdo_session ── transfers, pauses and conditions to await
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
mod event;
mod failure;
mod guarded;
pub mod layer_settings;
pub mod meaning;
mod motion_profile;
mod objects;
mod polling;
mod procedure;
mod report;
mod scan;
mod sdo_session;
mod session_state;
mod target;
mod task;
pub mod yz_aim;

pub use event::{AxisReading, ProcedureEvent};
pub use failure::Failure;
pub use motion_profile::{DEFAULT_SHARE, DriveProfile, MotionProfile};
pub use procedure::{Procedure, ProcedureError};
pub use report::{Report, ReportItem};
pub use sdo_session::SdoSession;
pub use session_state::SdoQuirks;
pub use target::{CommandValue, TargetDrive};
pub use task::{MoveKind, ReadObject, Task};

/// The procedure that carries out a task with this drive.
pub fn procedure(target: TargetDrive, task: Task) -> Procedure {
    let (node, sdo_quirks) = (target.node, target.family().sdo_quirks());
    Procedure::new(node, sdo_quirks, move |session| async move {
        match task {
            Task::Read { objects } => objects::read(&session, &target, &objects).await,
            Task::Write { object, value, entry } => {
                objects::write(&session, &target, object, value, entry).await
            }
            task => target.family().carry_out(&session, &target, task).await,
        }
    })
}
