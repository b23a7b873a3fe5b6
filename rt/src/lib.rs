//! The real-time half of takt: everything that runs inside the real-time thread, and nothing else.
//!
//! This crate is `no_std` and does not link an allocator, so the loop cannot allocate. It formats nothing, takes
//! no lock, and never panics on data from outside. It is sans-I/O: time and frames are handed in, frames are
//! handed out; the only place that touches an operating system is `linux`, behind a feature.
#![no_std]
#![deny(unsafe_code)]

pub mod axis;
pub mod cia402;
pub mod control;
pub mod cycle;
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
pub mod record;
pub mod stop;
pub mod time;
pub mod units;
pub mod wire;
