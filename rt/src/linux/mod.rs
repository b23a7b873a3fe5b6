//! Linux: the only part of this crate that touches the operating system.
//!
//! - [`MonotonicClock`] sleeps until an absolute time. [`PacedClock`] does the same and spins for the rest; the loop uses it.
//!   [`SpinGuard`] computes how long the spin must be.
//! - [`RealtimeThread`] makes the calling thread a real-time thread, step by step, and keeps the outcome of each step.
//! - [`SocketCanPort`] is a raw CAN socket as a bus port. [`SlcanPort`] is an adapter on a serial line as one.
//!
//! The real-time path formats nothing and allocates nothing. Failures are plain data; their texts are made elsewhere.
#![allow(unsafe_code)] // System calls need it. Every unsafe block says why it is sound.

mod can;
mod can_line;
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
mod wire_time;

pub use can::{Attachment, DescriptorError, SocketCanPort};
pub use can_line::{Arrival, LineCodec, LinePort, SlcanCodec, SlcanPort, TransparentCodec, TransparentPort};
pub use clock::MonotonicClock;
pub use kernel::{is_preempt_rt, is_preempt_rt_version};
pub use memory::{PREFAULT_LIMIT_BYTES, PageFaults};
pub use paced_clock::PacedClock;
pub use scheduling::{Policy, Scheduling, set_fifo, set_nice, set_ordinary};
pub use spin_guard::SpinGuard;
pub use step::{Outcome, STEP_COUNT, Step, StepResult};
pub use thread::{RealtimeThread, ThreadConfig, ThreadReport};

/// The error number of the system call that has just failed (errno(3)).
fn errno() -> i32 {
    // SAFETY: the location belongs to this thread and is always valid.
    unsafe { *libc::__errno_location() }
}
