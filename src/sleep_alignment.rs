//! Aligns the sleeps of ordinary threads so that they do not end at the beginning of a slot.
//!
//! On a PREEMPT_RT kernel the timers of ordinary threads expire in a kernel thread. It holds a lock that sending a frame
//! needs too. A sleep of the logger that ends just before a slot delays its SYNC by some ten microseconds.
//!
//! Therefore slots begin a quarter of a period after the multiples of the period on the monotonic clock. The kernel's own
//! tick falls on these multiples. Ordinary threads sleep until such a multiple: three quarters through a slot, when its
//! set-points have been sent. The threads need no communication for this.

use std::thread;
use std::time::Duration;

use takt_rt::linux::MonotonicClock;
use takt_rt::{Clock, Nanoseconds};

/// The start of the first slot at or after `earliest_ns`.
pub(crate) fn first_slot_after(earliest_ns: Nanoseconds, period_ns: Nanoseconds) -> Nanoseconds {
    let phase_ns = period_ns / 4;
    earliest_ns.saturating_sub(phase_ns).div_ceil(period_ns) * period_ns + phase_ns
}

/// The time from `now_ns` to the first multiple of the period that is at least `pause_ns` later.
const fn pause_from(now_ns: Nanoseconds, pause_ns: Nanoseconds, period_ns: Nanoseconds) -> Nanoseconds {
    (now_ns + pause_ns).div_ceil(period_ns) * period_ns - now_ns
}

/// The aligned pause of an ordinary thread from now on: at least `pause`, and at most one period longer.
pub fn pause(pause: Duration, period_ns: Nanoseconds) -> Duration {
    let now_ns = MonotonicClock::default().now_ns();
    Duration::from_nanos(pause_from(now_ns, pause.as_nanos() as u64, period_ns.max(1)))
}

/// Sleeps for [`pause`].
pub fn sleep(at_least: Duration, period_ns: Nanoseconds) {
    thread::sleep(pause(at_least, period_ns));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slots_begin_a_quarter_of_a_period_after_the_multiples_of_it(earliest in 0u64..1 << 50, period in 4u64..1 << 30) {
            let first = first_slot_after(earliest, period);
            prop_assert!(first >= earliest);
            prop_assert!(first < earliest + period + period / 4);
            prop_assert_eq!(first % period, period / 4);
        }

        #[test]
        fn pauses_are_long_enough_and_end_three_quarters_through_a_slot(now in 0u64..1 << 50, pause in 0u64..1 << 30, period in 4u64..1 << 30) {
            let slept = pause_from(now, pause, period);
            prop_assert!(slept >= pause && slept < pause + period);
            let into_slot = (now + slept + period - period / 4) % period;
            prop_assert_eq!(into_slot, period - period / 4);
        }
    }
}
