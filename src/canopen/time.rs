//! Converts the time of day of the TIME message (CiA 301, 7.2.6) from and to the system clock. The message and its
//! producer are in [`takt_rt::time_of_day`].

use std::time::{Duration, SystemTime, UNIX_EPOCH};

pub use takt_rt::TimeOfDay;
use takt_rt::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// From 1970-01-01 to 1984-01-01.
const EPOCH: Duration = Duration::from_secs(5_113 * 86_400);

/// The time of day of a system time; `None` before 1984 and after 2163.
pub fn from_system_time(time: SystemTime) -> Option<TimeOfDay> {
    let since_epoch = time.duration_since(UNIX_EPOCH + EPOCH).ok()?;
    TimeOfDay::after_epoch(u64::try_from(since_epoch.as_millis()).ok()?)
}

/// The system time of a time of day.
pub fn system_time(time: TimeOfDay) -> SystemTime {
    UNIX_EPOCH + EPOCH + Duration::from_millis(time.since_epoch_ms())
}

/// Nanoseconds since 1984-01-01 from nanoseconds since 1970-01-01; 0 before that day.
pub const fn since_epoch_ns(unix_ns: Nanoseconds) -> Nanoseconds {
    unix_ns.saturating_sub(EPOCH.as_secs() * NANOSECONDS_PER_SECOND)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_epoch_is_the_first_of_january_1984() {
        let epoch = UNIX_EPOCH + Duration::from_secs(441_763_200);
        let first = TimeOfDay { days: 0, milliseconds: 0 };
        assert_eq!(from_system_time(epoch), Some(first));
        assert_eq!(system_time(first), epoch);
        assert_eq!(from_system_time(epoch - Duration::from_millis(1)), None);
        // 2026-11-21 12:00:00.5 UTC
        let later = UNIX_EPOCH + Duration::from_millis(1_795_262_400_500);
        let expected = TimeOfDay { days: 15_665, milliseconds: 43_200_500 };
        assert_eq!(from_system_time(later), Some(expected));
        assert_eq!(system_time(expected), later);
        assert_eq!(since_epoch_ns(1_795_262_400_500_000_000), expected.since_epoch_ms() * 1_000_000);
    }
}
