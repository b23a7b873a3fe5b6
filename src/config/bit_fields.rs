//! Drives that are spoken to by frames of fixed bit fields: reads their descriptions, and compiles them for the cycle.

mod compile;
mod read;
mod read_registers;
mod read_scan;
mod shipped;
mod values;

pub use compile::{check_command, check_reply, compile, most, position_range, step};
pub use read::{load, parse};
pub use shipped::{DESCRIPTIONS, other_modes, shipped};
