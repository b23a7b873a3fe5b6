//! The time of arrival of a message, on the monotonic clock.

use super::super::clock::{monotonic_ns, real_time_ns};
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// The same instant on both clocks.
///
/// The kernel stamps a message on `CLOCK_REALTIME` when the driver hands it over. The difference between the two clocks at
/// the time of reading moves the stamp to the monotonic clock.
#[derive(Clone, Copy)]
pub(super) struct ClockPair {
    pub(super) monotonic_ns: Nanoseconds,
    pub(super) real_time_ns: Nanoseconds,
}

/// A stamp can be this far in the future before it is replaced by the present.
const FUTURE_LIMIT_NS: Nanoseconds = NANOSECONDS_PER_SECOND;

impl ClockPair {
    pub(super) fn read() -> Self {
        // The thread can be interrupted between two readings. The middle of two readings halves that error.
        let before_ns = monotonic_ns();
        let real_time_ns = real_time_ns();
        Self { monotonic_ns: before_ns.midpoint(monotonic_ns()), real_time_ns }
    }

    /// The stamp on the monotonic clock; the present where there is no stamp.
    ///
    /// An old stamp is taken as it is. The message may have waited for seconds in the socket while the process was stopped, and
    /// old feedback must not look fresh. If the real-time clock was set forwards instead, the messages of one reading look old.
    /// A stamp that is far in the future means that the real-time clock was set back: it is replaced by the present.
    pub(super) fn monotonic_at(&self, stamp_ns: Option<Nanoseconds>) -> Nanoseconds {
        let Some(stamp_ns) = stamp_ns else { return self.monotonic_ns };
        match stamp_ns.checked_sub(self.real_time_ns) {
            None => self.monotonic_ns.saturating_sub(self.real_time_ns - stamp_ns),
            Some(ahead_ns) if ahead_ns <= FUTURE_LIMIT_NS => self.monotonic_ns.saturating_add(ahead_ns),
            Some(_) => self.monotonic_ns,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: ClockPair = ClockPair { monotonic_ns: 5_000_000_000, real_time_ns: 1_700_000_000_000_000_000 };

    #[test]
    fn a_stamp_is_moved_to_the_monotonic_clock() {
        assert_eq!(NOW.monotonic_at(Some(NOW.real_time_ns - 40_000)), NOW.monotonic_ns - 40_000);
        assert_eq!(NOW.monotonic_at(Some(NOW.real_time_ns + 300)), NOW.monotonic_ns + 300);
        assert_eq!(NOW.monotonic_at(None), NOW.monotonic_ns);
    }

    #[test]
    fn a_message_that_waited_for_seconds_is_as_old_as_its_stamp() {
        let stamp_ns = NOW.real_time_ns - 3 * NANOSECONDS_PER_SECOND;
        assert_eq!(NOW.monotonic_at(Some(stamp_ns)), NOW.monotonic_ns - 3 * NANOSECONDS_PER_SECOND);
        assert_eq!(NOW.monotonic_at(Some(0)), 0);
    }

    #[test]
    fn a_real_time_clock_that_was_set_back_moves_no_arrival_into_the_future() {
        let stamp_ns = NOW.real_time_ns + 3_600 * NANOSECONDS_PER_SECOND;
        assert_eq!(NOW.monotonic_at(Some(stamp_ns)), NOW.monotonic_ns);
    }
}
