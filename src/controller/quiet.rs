//! Keeping the other threads of this process out of the way of a slot's beginning.
//!
//! On a PREEMPT_RT kernel the timers of ordinary threads expire in a kernel thread that holds a lock which sending a
//! frame needs too. A sleep of the logger that ends just before a slot delays its SYNC by some ten microseconds. So slots
//! begin a quarter of a period after the multiples of the period on the monotonic clock, where the kernel's own tick
//! falls, and ordinary threads sleep until such multiples: three quarters of the way through a slot, when its set-points
//! are out. Nobody has to tell anybody anything.

use std::thread;
use std::time::Duration;

use takt_rt::linux::MonotonicClock;
use takt_rt::{Clock, Nanoseconds};

/// The start of the first slot at or after `earliest_ns`.
pub(super) fn first_slot_after(earliest_ns: Nanoseconds, period_ns: Nanoseconds) -> Nanoseconds {
    let phase_ns = period_ns / 4;
    earliest_ns.saturating_sub(phase_ns).div_ceil(period_ns) * period_ns + phase_ns
}

/// How long an ordinary thread sleeps so that it wakes after at least `pause_ns`, and away from the beginning of a slot.
const fn pause_from(now_ns: Nanoseconds, pause_ns: Nanoseconds, period_ns: Nanoseconds) -> Nanoseconds {
    (now_ns + pause_ns).div_ceil(period_ns) * period_ns - now_ns
}

/// The pause that an ordinary thread makes now: at least `pause`, and no more than a period longer.
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
