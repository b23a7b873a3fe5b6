//! A running controller: the engine of a configuration, the real-time thread that runs it, and the life cycle of a run.

mod arrival;
pub mod assemble;
#[cfg(target_os = "linux")]
mod buses;
mod handle;
#[cfg(target_os = "linux")]
mod interfaces;
#[cfg(target_os = "linux")]
mod last_resort;
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
#[cfg(target_os = "linux")]
mod watchdog;

pub use crate::channels::{CallbackCommand, CallbackState, CallbackTimes};
#[cfg(target_os = "linux")]
pub use handle::Controller;
pub use handle::{CallbackHandle, CallbackOptions, Handle, OwnProcess, StartFailure, VirtualController};
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub use last_resort::stop_drives;
pub use lines::{LinePort, Lines, SharedLine};
pub use outcome::{Interrupt, Outcome, Progress};
pub use program::{ProgramRunner, ProgramStep};
#[doc(hidden)]
pub use supervisor::unreleased_stop;
pub use supervisor::{AfterBringUp, Supervisor};
pub use virtual_time::{VirtualClock, VirtualRun};
