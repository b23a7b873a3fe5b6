//! A running controller: the engine of a configuration, the real-time thread that runs it, and the life cycle of a run.

mod arrival;
pub mod assemble;
#[cfg(target_os = "linux")]
mod buses;
mod handle;
mod lines;
mod off_cycle;
#[cfg(target_os = "linux")]
pub mod opening;
mod outcome;
pub mod port;
mod program;
#[cfg(target_os = "linux")]
pub mod realtime_thread;
#[cfg(target_os = "linux")]
pub mod session;
mod supervisor;
mod time_of_day;
mod virtual_time;

pub use crate::channels::{CallbackCommand, CallbackState, CallbackTimes};
#[cfg(target_os = "linux")]
pub use handle::Controller;
pub use handle::{
    CallbackHandle, CallbackOptions, Events, GroupHandle, Handle, StartFailure, StreamHandle,
    VirtualController,
};
pub use lines::{LinePort, Lines, SharedLine};
pub use outcome::{Interrupt, Outcome, Progress};
pub use program::{ProgramRunner, ProgramStep};
pub use supervisor::{AfterBringUp, Supervisor};
pub use virtual_time::{VirtualClock, VirtualRun};
