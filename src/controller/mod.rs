//! A running controller: the engine of a configuration, the real-time thread that runs it, and the life cycle of a run.

mod arrival;
pub mod assemble;
mod buses;
mod handle;
mod lines;
mod off_cycle;
mod outcome;
pub mod port;
mod program;
pub mod realtime_thread;
pub mod session;
mod supervisor;
mod time_of_day;
mod virtual_time;

pub use crate::channels::{CallbackCommand, CallbackState, CallbackTimes};
pub use handle::{
    CallbackHandle, CallbackOptions, Controller, Events, GroupHandle, Handle, StartFailure, StreamHandle,
    VirtualController,
};
pub use lines::{LinePort, Lines, SharedLine};
pub use outcome::{Interrupt, Outcome, Progress};
pub use program::{ProgramRunner, ProgramStep};
pub use supervisor::{AfterBringUp, Supervisor};
pub use virtual_time::{VirtualClock, VirtualRun};
