//! The time of day.

use std::time::{SystemTime, UNIX_EPOCH};

use takt::rt::Clock;
use takt::rt::linux::MonotonicClock;

/// The time of day in ns since 1970.
pub fn time_of_day_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// The time of day of a moment on the clock of the controller, which is that of this computer.
pub fn day_ns_of(monotonic_ns: u64) -> u64 {
    let age_ns = MonotonicClock::default().now_ns().saturating_sub(monotonic_ns);
    u64::try_from(time_of_day_ns()).unwrap_or_default().saturating_sub(age_ns)
}
