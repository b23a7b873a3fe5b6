//! Linux: the only part of this crate that touches the operating system.
//!
//! - [`MonotonicClock`]: absolute sleep; [`PacedClock`]: the same and a spin, for the loop; [`SpinGuard`] computes how
//!   long the spin must be.
//! - [`RealtimeThread`]: elevates the calling thread step by step and keeps what came of each step.
//! - [`SocketCanPort`]: a raw CAN socket as a bus port.
//!
//! Nothing here formats, allocates or decides: refusals are plain data, and the user's side puts them in words.
#![allow(unsafe_code)] // System calls cannot be made without it; every one says why it is sound.

mod can;
mod clock;
mod kernel;
mod latency;
mod memory;
mod paced_clock;
mod scheduling;
mod send_path;
mod spin_guard;
mod step;
mod thread;

pub use can::{DescriptorError, SocketCanPort};
pub use clock::MonotonicClock;
pub use kernel::{is_preempt_rt, is_preempt_rt_version};
pub use memory::{PREFAULT_LIMIT_BYTES, PageFaults};
pub use paced_clock::PacedClock;
pub use scheduling::{Policy, Scheduling, set_nice};
pub use spin_guard::SpinGuard;
pub use step::{Outcome, STEP_COUNT, Step, StepResult};
pub use thread::{RealtimeThread, ThreadConfig, ThreadReport};

/// The error number of the system call that has just failed.
fn errno() -> i32 {
    // SAFETY: the location is this thread's own and always valid.
    unsafe { *libc::__errno_location() }
}
