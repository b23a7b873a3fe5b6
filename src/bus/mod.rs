//! bus.

pub mod port;
pub mod trace;
