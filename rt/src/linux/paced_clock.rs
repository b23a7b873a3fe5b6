//! The clock of the loop. Where a frame must leave on time, it wakes early and spins for the rest.

use super::clock::{MonotonicClock, monotonic_ns, suspended_since_boot_ns};
use super::kernel::is_preempt_rt;
use super::send_path::SendPath;
use super::spin_guard::SpinGuard;
use crate::port::{Clock, Wake};
use crate::time::Nanoseconds;

/// A computer takes longer than this to be suspended and to resume.
const SHORTEST_SUSPENSION_NS: Nanoseconds = 1_000_000;

/// `CLOCK_MONOTONIC` with absolute sleeps. Where a frame must leave on time ([`Clock::wait_to_send`]), the sleep ends earlier by
/// the guard time, and the thread spins for the rest.
///
/// The kernel wakes a thread late, by its latency. On a PREEMPT_RT kernel, sending may then have to wait for locks. The clock takes
/// and releases these locks before the spin, so the guard time absorbs both delays. The remaining error is the granularity
/// of the spin, some ten nanoseconds.
///
/// The latency occurs at every wake-up, so it can be measured. A lock that is held for long occurs about once in ten thousand
/// sends. No measurement announces the first one, so only a guard time that is reserved for it keeps that frame punctual.
#[derive(Debug)]
pub struct PacedClock {
    clock: MonotonicClock,
    guard: Guard,
    send_path: Option<SendPath>,
    /// See [`suspended_since_boot_ns`], at the last wait.
    suspended_since_boot_ns: Nanoseconds,
}

#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one, and no allocator to put it elsewhere")]
enum Guard {
    Fixed { guard_ns: Nanoseconds },
    Measured { latencies: SpinGuard },
}

impl PacedClock {
    /// A clock with a guard time of `guard_ns`, in ns. With 0 it only sleeps.
    pub fn fixed(guard_ns: Nanoseconds) -> Self {
        Self::new(Guard::Fixed { guard_ns }, guard_ns > 0)
    }

    /// A clock that finds its own guard time, at most `cap_ns`, in ns.
    ///
    /// Where sending takes no locks, the guard time follows the measured latencies. The first waits only sleep, so make some
    /// waits before punctuality matters. On a PREEMPT_RT kernel, where sending takes locks, the guard time is `cap_ns`.
    pub fn measured(cap_ns: Nanoseconds) -> Self {
        let clock = Self::new(Guard::Measured { latencies: SpinGuard::new(cap_ns) }, cap_ns > 0);
        if clock.send_path.is_some() {
            Self { guard: Guard::Fixed { guard_ns: cap_ns }, ..clock }
        } else {
            clock
        }
    }

    /// Takes the locks of sending only on a PREEMPT_RT kernel that has CAN sockets. Other kernels have no such locks.
    fn new(guard: Guard, has_spin: bool) -> Self {
        let has_locks = has_spin && is_preempt_rt();
        let send_path = has_locks.then(SendPath::new).and_then(Result::ok);
        let suspended_since_boot_ns = suspended_since_boot_ns();
        Self { clock: MonotonicClock::default(), guard, send_path, suspended_since_boot_ns }
    }

    /// How long before the time of sending the sleep ends, in ns.
    pub fn guard_ns(&self) -> Nanoseconds {
        match &self.guard {
            Guard::Fixed { guard_ns } => *guard_ns,
            Guard::Measured { latencies } => latencies.guard_ns(),
        }
    }
}

impl Clock for PacedClock {
    fn now_ns(&mut self) -> Nanoseconds {
        monotonic_ns()
    }

    fn wait_until(&mut self, deadline_ns: Nanoseconds) -> Wake {
        self.clock.wait_until(deadline_ns)
    }

    fn wait_to_send(&mut self, deadline_ns: Nanoseconds) -> Wake {
        let timer_ns = deadline_ns.saturating_sub(self.guard_ns());
        let has_time_to_sleep = monotonic_ns() < timer_ns;
        let mut wake = self.clock.wait_until(timer_ns);
        if let Some(path) = &self.send_path {
            path.walk();
            wake.now_ns = monotonic_ns();
        }
        if let Guard::Measured { latencies } = &mut self.guard
            && has_time_to_sleep
        {
            latencies.record(wake.now_ns.saturating_sub(timer_ns));
        }
        while wake.now_ns < deadline_ns {
            core::hint::spin_loop();
            wake.now_ns = monotonic_ns();
        }
        let suspended_ns = suspended_since_boot_ns();
        // Two clocks that are read one after the other differ by what lies between.
        if suspended_ns > self.suspended_since_boot_ns.saturating_add(SHORTEST_SUSPENSION_NS) {
            wake.suspended_ns = suspended_ns - self.suspended_since_boot_ns;
            self.suspended_since_boot_ns = suspended_ns;
        }
        wake
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::time::NANOSECONDS_PER_SECOND;

    #[test]
    fn no_wait_ends_early_with_any_guard() {
        let fixed = [0, 1, 20_000, 200_000, 5_000_000, u64::MAX].map(PacedClock::fixed);
        let measured = [0, 1, 100_000].map(PacedClock::measured);
        for mut clock in fixed.into_iter().chain(measured) {
            for step_ns in [0, 1, 999, 50_000, 300_000, 1_000_000] {
                let deadline_ns = clock.now_ns() + step_ns;
                assert!(clock.wait_to_send(deadline_ns).now_ns >= deadline_ns, "{clock:?}, step {step_ns}");
                let deadline_ns = clock.now_ns() + step_ns;
                assert!(clock.wait_until(deadline_ns).now_ns >= deadline_ns, "{clock:?}, step {step_ns}");
            }
        }
    }

    #[test]
    fn with_a_guard_longer_than_the_wait_there_is_only_a_spin() {
        let mut clock = PacedClock::fixed(60 * NANOSECONDS_PER_SECOND);
        let deadline_ns = clock.now_ns() + 100_000;
        let wake = clock.wait_to_send(deadline_ns);
        assert_eq!(wake.timer_latency_ns, 0);
        assert!(wake.now_ns >= deadline_ns);
    }

    #[test]
    fn without_a_guard_the_timer_latency_is_the_whole_lateness() {
        let mut clock = PacedClock::fixed(0);
        let deadline_ns = clock.now_ns() + 2_000_000;
        let wake = clock.wait_to_send(deadline_ns);
        assert_eq!(wake.now_ns - deadline_ns, wake.timer_latency_ns);
    }

    #[test]
    fn where_sending_takes_locks_the_guard_is_all_that_it_may_be_from_the_first_wait_on() {
        let clock = PacedClock::measured(200_000);
        assert_eq!(clock.guard_ns(), if clock.send_path.is_some() { 200_000 } else { 0 });
    }

    #[test]
    fn a_measured_guard_comes_from_the_waits_to_send_alone() {
        let cap_ns = 200_000;
        let mut clock = PacedClock::new(Guard::Measured { latencies: SpinGuard::new(cap_ns) }, true);
        let deadline_ns = clock.now_ns() + 1_000_000;
        clock.wait_until(deadline_ns);
        assert_eq!(clock.guard_ns(), 0);
        let deadline_ns = clock.now_ns() + 1_000_000;
        clock.wait_to_send(deadline_ns);
        assert!(clock.guard_ns() > 0 && clock.guard_ns() <= cap_ns);
    }
}
