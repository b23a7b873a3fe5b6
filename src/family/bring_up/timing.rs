//! Timeouts and intervals of bring-up and shutdown.

use takt_rt::Nanoseconds;
use takt_wire::canopen::sdo;

/// The timeouts of bring-up and shutdown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BringUpTiming {
    /// Timeout of a node's boot-up after a reset. It includes the boot time after power-up (8 s for some drives).
    pub boot_up_timeout_ns: Nanoseconds,
    /// Interval between two resets of a node that does not boot.
    pub reset_repeat_ns: Nanoseconds,
    /// Timeout of a mode change, a state change or standstill.
    pub confirm_timeout_ns: Nanoseconds,
    /// SDO reply timeout and retries.
    pub sdo: sdo::SdoTiming,
}

impl Default for BringUpTiming {
    fn default() -> Self {
        Self {
            boot_up_timeout_ns: 12_000_000_000,
            // Not a divisor of 8 s: a drive with that boot time would be reset again just after it has booted.
            reset_repeat_ns: 700_000_000,
            confirm_timeout_ns: 2_000_000_000,
            sdo: sdo::SdoTiming::default(),
        }
    }
}
