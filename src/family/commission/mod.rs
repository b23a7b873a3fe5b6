//! Commissioning of one drive, as far as its families need it: tasks, targets, sessions.
//!
//! ```text
//! task ── procedure ── takes the time and frames; returns frames, events and an outcome
//!            │
//!         family ── one folder a family: entries, errors, motions of its own, and the client of its protocol
//!            │
//!        profile ── the tasks of every drive that keeps to CiA 402
//!       sdo_task ── a task of a drive with an object dictionary
//!    sdo_session ── transfers, pauses and conditions to await, each of which may be interrupted
//!            │
//!     target, motion_profile ── units and limits of the axis
//! ```
//!
//! `meaning` describes the frames of a CANopen node.

#[doc(hidden)]
pub mod command_value;
pub(super) mod contact;
#[doc(hidden)]
pub mod dictionary;
pub(super) mod failure;
pub(super) mod guarded;
#[doc(hidden)]
pub mod meaning;
pub(super) mod motion_profile;
mod objects;
pub(super) mod polling;
pub(super) mod profile;
pub(super) mod report;
mod running;
pub(super) mod scan;
pub(super) mod sdo_session;
mod sdo_task;
pub(super) mod target;
pub(super) mod task;

pub use dictionary::{NamedEntry, ObjectEntry, ObjectUnit, Permission};
pub use failure::{AnsweredProtocol, Failure};
pub use motion_profile::{DEFAULT_SHARE, DriveProfile, MotionProfile};
pub use report::{Report, ReportItem};
pub use running::{DriveTask, ProcedureError, RunningTask};
pub use sdo_session::SdoSession;
pub use sdo_task::over_sdo;
pub use target::{CommandValue, TargetDrive};
pub use task::{GainFactors, MoveKind, PulseQuantity, PulseWidth, Task, ValueText};
