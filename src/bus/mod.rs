//! bus.

pub mod trace;
