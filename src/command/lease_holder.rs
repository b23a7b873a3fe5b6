//! Who commands a controller that several processes may command.

use std::time::Duration;

/// Who commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeaseHolder {
    /// The process.
    pub process: u32,
    /// When its lease expires, unless it gives another command.
    pub expires_in: Duration,
}
