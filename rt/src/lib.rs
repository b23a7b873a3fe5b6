//! The real-time half of takt: everything that runs inside the real-time thread, and nothing else.
//!
//! This crate is `no_std` and does not link an allocator, so the loop cannot allocate. It formats nothing, takes
//! no lock, and never panics on data from outside. It is sans-I/O: time and frames are handed in, frames are
//! handed out; the only place that touches an operating system is `linux`, behind a feature.
//!
//! From the wire inwards:
//!
//! - [`time`], [`time_of_day`], [`frame`]: integer nanoseconds and the grid; what the drives are told the time is; CAN
//!   frames that can only be valid.
//! - [`port`], [`door`]: what the cycle needs from the world, and what it shares with the rest of the program, as
//!   small traits.
//! - [`pdo`], [`units`], [`cia402`], [`dialect`], [`profile`]: process data compiled to shifts and masks; SI to drive
//!   units; the state machine of drives, those that speak otherwise, and those that make their own way to a target.
//! - [`plan`], [`guard`], [`control`], [`stop`]: trajectories, the last look at every set-point, the loops closed here,
//!   and the reasons to stop.
//! - [`axis`], [`engine`]: one joint, and the group that moves together; [`engine::Engine::compute`] is a cycle's thinking.
//! - [`watch`]: what is watched over time: missed slots, nodes that fall silent, two nodes with one number.
//! - [`cycle`]: the paced loop around it: SYNC, feedback, set-points, skip and never burst.
//! - [`record`], [`refusal`]: what each cycle leaves behind; why a request was refused.
#![no_std]
#![deny(unsafe_code)]

pub mod axis;
pub mod cia402;
pub mod control;
pub mod cycle;
pub mod dialect;
pub mod dispatch;
pub mod door;
pub mod engine;
pub mod frame;
pub mod guard;
#[cfg(feature = "linux")]
pub mod linux;
mod motion;
pub mod pdo;
pub mod plan;
pub mod port;
pub mod profile;
pub mod record;
pub mod refusal;
pub mod stop;
pub mod time;
pub mod time_of_day;
pub mod units;
pub mod watch;
pub mod wire;
