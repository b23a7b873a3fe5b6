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
//! `meaning` describes the frames of a procedure.

pub(crate) mod command_value;
pub(super) mod contact;
pub(crate) mod dictionary;
pub(super) mod failure;
pub(super) mod guarded;
#[cfg(feature = "cli")]
pub(crate) mod meaning;
pub(super) mod motion_profile;
#[cfg(feature = "cli")]
pub(super) mod objects;
pub(super) mod polling;
pub(super) mod profile;
pub(super) mod report;
#[cfg(feature = "cli")]
pub(crate) mod running;
pub(super) mod scan;
pub(super) mod sdo_session;
pub(super) mod target;
pub(super) mod task;

pub use dictionary::{ObjectEntry, ObjectUnit, Permission};
pub use failure::Failure;
pub use motion_profile::{DEFAULT_SHARE, DriveProfile, MotionProfile};
pub use report::{Report, ReportItem};
#[cfg(feature = "cli")]
pub(crate) use running::{Procedure, ProcedureError, procedure};
pub use sdo_session::SdoSession;
pub use target::{CommandValue, TargetDrive};
pub use task::{MoveKind, ReadObject, Task};
