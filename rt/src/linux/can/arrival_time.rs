//! The time of arrival of a message, on the monotonic clock.

use super::super::clock::{monotonic_ns, real_time_ns};
use crate::time::Nanoseconds;

/// The same instant on both clocks.
///
/// The kernel stamps a message on `CLOCK_REALTIME` when the driver hands it over. The difference between the two clocks at
/// the time of reading moves the stamp to the monotonic clock.
#[derive(Clone, Copy)]
pub(super) struct ClockPair {
    pub(super) monotonic_ns: Nanoseconds,
    pub(super) real_time_ns: Nanoseconds,
}

impl ClockPair {
    pub(super) fn read() -> Self {
        // The thread can be interrupted between two readings. The middle of two readings halves that error.
        let before_ns = monotonic_ns();
        let real_time_ns = real_time_ns();
        Self { monotonic_ns: before_ns.midpoint(monotonic_ns()), real_time_ns }
    }

    /// Returns the stamp on the monotonic clock; the present where there is no stamp, and `None` where it lies in the future.
    ///
    /// An old stamp is taken as it is. The message may have waited for seconds in the socket while the process was stopped, and
    /// old feedback must not look fresh. If the real-time clock was set forwards instead, the messages of one reading look old.
    pub(super) fn monotonic_at(&self, stamp_ns: Option<Nanoseconds>) -> Option<Nanoseconds> {
        let age_ns = stamp_ns.map_or(Some(0), |stamp_ns| self.real_time_ns.checked_sub(stamp_ns))?;
        Some(self.monotonic_ns.saturating_sub(age_ns))
    }

    /// Returns when a message that was read after this pair has arrived.
    ///
    /// A stamp after the present means that the real-time clock was set back while the message waited, for how long is not known: it
    /// has arrived at 0, as long ago as can be.
    pub(super) fn arrival_ns(&self, stamp_ns: Option<Nanoseconds>) -> Nanoseconds {
        self.monotonic_at(stamp_ns).or_else(|| Self::read().monotonic_at(stamp_ns)).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::NANOSECONDS_PER_SECOND;

    const NOW: ClockPair = ClockPair { monotonic_ns: 5_000_000_000, real_time_ns: 1_700_000_000_000_000_000 };

    #[test]
    fn a_stamp_is_moved_to_the_monotonic_clock() {
        assert_eq!(NOW.monotonic_at(Some(NOW.real_time_ns - 40_000)), Some(NOW.monotonic_ns - 40_000));
        assert_eq!(NOW.monotonic_at(None), Some(NOW.monotonic_ns));
    }

    #[test]
    fn a_message_that_waited_for_seconds_is_as_old_as_its_stamp() {
        let stamp_ns = NOW.real_time_ns - 3 * NANOSECONDS_PER_SECOND;
        assert_eq!(NOW.arrival_ns(Some(stamp_ns)), NOW.monotonic_ns - 3 * NANOSECONDS_PER_SECOND);
        assert_eq!(NOW.arrival_ns(Some(0)), 0);
    }

    #[test]
    fn a_message_that_arrives_after_the_clocks_were_read_has_its_own_time() {
        let before = ClockPair::read();
        let stamp_ns = before.real_time_ns + 1;
        while real_time_ns() <= stamp_ns {}
        let arrival_ns = before.arrival_ns(Some(stamp_ns));
        assert!(
            arrival_ns >= before.monotonic_ns - 1_000_000 && arrival_ns <= monotonic_ns(),
            "{arrival_ns}"
        );
    }

    #[test]
    fn a_message_that_waited_while_the_real_time_clock_was_set_back_is_old() {
        let now = ClockPair::read();
        for seconds in [1, 3_600] {
            let stamp_ns = now.real_time_ns + seconds * NANOSECONDS_PER_SECOND;
            assert_eq!(now.arrival_ns(Some(stamp_ns)), 0);
        }
    }
}
