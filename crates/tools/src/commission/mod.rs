//! Commissioning of one drive: the tasks of the vendors' host tools, apart from any run.
//!
//! ```text
//! bus_session ── runs a procedure on a bus
//!      │
//! procedure ── takes the time and frames; returns frames, events and an outcome
//!      │
//! family ── one folder a family: objects, alarms, motions
//! ```
//!
//! Devices without a node ID are set up by [`layer_settings`].

mod bus;
pub mod bus_scan;
pub mod bus_session;
pub mod layer_settings;
pub mod line_session;

#[doc(hidden)]
pub use bus::Bus;

#[doc(hidden)]
pub use takt::family::commission::{
    CommandValue, DriveTask, Failure, GainFactors, MotionProfile, MoveKind, ProcedureError, PulseQuantity,
    PulseWidth, Report, ReportItem, RunningTask, TargetDrive, Task, ValueText, command_value, dictionary,
};
#[doc(hidden)]
pub use takt::procedure::{AxisReading, ProcedureEvent};
