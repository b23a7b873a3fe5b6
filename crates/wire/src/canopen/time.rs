//! Converts the system clock to the time of day of the TIME message (CiA 301, 7.2.6). The message and its producer are in
//! [`takt_rt::TimeOfDay`].

use takt_rt::{NANOSECONDS_PER_SECOND, Nanoseconds};

pub use takt_rt::TimeOfDay;

/// From 1970-01-01 to 1984-01-01.
const EPOCH_NS: Nanoseconds = 5_113 * 86_400 * NANOSECONDS_PER_SECOND;

/// Nanoseconds since 1984-01-01 from nanoseconds since 1970-01-01; 0 before that day.
pub const fn since_epoch_ns(unix_ns: Nanoseconds) -> Nanoseconds {
    unix_ns.saturating_sub(EPOCH_NS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_epoch_is_the_first_of_january_1984() {
        let epoch_ns = 441_763_200 * NANOSECONDS_PER_SECOND;
        assert_eq!((since_epoch_ns(epoch_ns - 1), since_epoch_ns(epoch_ns)), (0, 0));
        // 2026-11-21 12:00:00.5 UTC
        let later = TimeOfDay { days: 15_665, milliseconds: 43_200_500 };
        assert_eq!(since_epoch_ns(1_795_262_400_500_000_000), later.since_epoch_ms() * 1_000_000);
    }
}
