//! The monotonic clock of the kernel.

use crate::port::{Clock, Wake};
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// `CLOCK_MONOTONIC` with absolute sleeps (`clock_nanosleep` with `TIMER_ABSTIME`). The thread can be interrupted between reading
/// the clock and going to sleep: an absolute sleep still ends on time.
#[derive(Clone, Copy, Debug, Default)]
pub struct MonotonicClock {}

impl Clock for MonotonicClock {
    fn now_ns(&mut self) -> Nanoseconds {
        monotonic_ns()
    }

    fn wait_until(&mut self, deadline_ns: Nanoseconds) -> Wake {
        let now_ns = monotonic_ns();
        if now_ns >= deadline_ns {
            return Wake { now_ns, timer_latency_ns: 0, suspended_ns: 0 };
        }
        sleep_until(deadline_ns);
        // If the kernel refuses to sleep, the wait goes on as a spin.
        let mut now_ns = monotonic_ns();
        while now_ns < deadline_ns {
            core::hint::spin_loop();
            now_ns = monotonic_ns();
        }
        Wake { now_ns, timer_latency_ns: now_ns - deadline_ns, suspended_ns: 0 }
    }
}

/// Reads the clock. The vDSO does it without a system call.
pub(super) fn monotonic_ns() -> Nanoseconds {
    read_clock(libc::CLOCK_MONOTONIC)
}

/// How far `CLOCK_BOOTTIME` is ahead of `CLOCK_MONOTONIC`: the time for which the computer has been suspended since it was booted.
pub(super) fn suspended_since_boot_ns() -> Nanoseconds {
    // In this order the difference is never larger than it was.
    let boot_ns = read_clock(libc::CLOCK_BOOTTIME);
    boot_ns.saturating_sub(monotonic_ns())
}

/// The time of day. Somebody can set it while the program runs.
pub(super) fn real_time_ns() -> Nanoseconds {
    read_clock(libc::CLOCK_REALTIME)
}

/// Reads a clock of the kernel.
fn read_clock(clock: libc::clockid_t) -> Nanoseconds {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for writing. The call fails only for a clock that does not exist.
    unsafe { libc::clock_gettime(clock, &mut time) };
    nanoseconds_of(&time)
}

/// A time of the kernel in nanoseconds. A negative time becomes zero.
pub(super) fn nanoseconds_of(time: &libc::timespec) -> Nanoseconds {
    let seconds = u64::try_from(time.tv_sec).unwrap_or(0);
    let nanoseconds = u64::try_from(time.tv_nsec).unwrap_or(0);
    seconds.saturating_mul(NANOSECONDS_PER_SECOND).saturating_add(nanoseconds)
}

/// Nanoseconds as a time of the kernel.
pub(super) fn timespec_of(time_ns: Nanoseconds) -> libc::timespec {
    libc::timespec {
        tv_sec: libc::time_t::try_from(time_ns / NANOSECONDS_PER_SECOND).unwrap_or(libc::time_t::MAX),
        tv_nsec: (time_ns % NANOSECONDS_PER_SECOND) as libc::c_long,
    }
}

/// Sleeps until the clock reads `deadline_ns`. A signal that is handled meanwhile does not end the sleep.
fn sleep_until(deadline_ns: Nanoseconds) {
    let time = timespec_of(deadline_ns);
    // SAFETY: `time` is valid for reading. An absolute sleep writes no remainder, so null is allowed.
    // The loop ends with the time, which is absolute. Any other error ends it at once, and the caller spins.
    while unsafe {
        libc::clock_nanosleep(libc::CLOCK_MONOTONIC, libc::TIMER_ABSTIME, &time, core::ptr::null_mut())
    } == libc::EINTR
    {}
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    #[test]
    fn time_never_runs_backwards() {
        let mut clock = MonotonicClock::default();
        let mut before_ns = clock.now_ns();
        for _ in 0..10_000 {
            let now_ns = clock.now_ns();
            assert!(now_ns >= before_ns);
            before_ns = now_ns;
        }
    }

    #[test]
    fn a_wait_never_ends_early() {
        let mut clock = MonotonicClock::default();
        for step_ns in [0, 1, 999, 50_000, 300_000, 1_000_000] {
            let deadline_ns = clock.now_ns() + step_ns;
            let wake = clock.wait_until(deadline_ns);
            assert!(wake.now_ns >= deadline_ns, "step {step_ns}");
            assert!(clock.now_ns() >= wake.now_ns);
        }
    }

    #[test]
    fn a_deadline_that_has_passed_costs_no_sleep() {
        let mut clock = MonotonicClock::default();
        let now_ns = clock.now_ns();
        assert_eq!(clock.wait_until(now_ns).timer_latency_ns, 0);
        assert_eq!(clock.wait_until(0).timer_latency_ns, 0);
    }

    #[test]
    fn after_a_sleep_the_timer_latency_is_the_whole_lateness() {
        let mut clock = MonotonicClock::default();
        let deadline_ns = clock.now_ns() + 2_000_000;
        let wake = clock.wait_until(deadline_ns);
        assert_eq!(wake.now_ns - deadline_ns, wake.timer_latency_ns);
    }

    #[test]
    fn a_signal_handled_during_the_sleep_does_not_end_it() {
        extern "C" fn ignore(_: libc::c_int) {}
        // SAFETY: an all-zero sigaction is valid, and the handler does nothing. No SA_RESTART: the sleep is
        // interrupted, and must be taken up again.
        unsafe {
            let mut action: libc::sigaction = core::mem::zeroed();
            action.sa_sigaction = ignore as *const () as libc::sighandler_t;
            assert_eq!(libc::sigaction(libc::SIGUSR1, &action, core::ptr::null_mut()), 0);
        }
        // SAFETY: pthread_self always succeeds.
        let sleeper = unsafe { libc::pthread_self() };
        let (done, stop) = std::sync::mpsc::channel::<()>();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                while stop.try_recv().is_err() {
                    // SAFETY: the sleeping thread outlives this scope.
                    unsafe { libc::pthread_kill(sleeper, libc::SIGUSR1) };
                    std::thread::sleep(std::time::Duration::from_millis(1));
                }
            });
            let mut clock = MonotonicClock::default();
            let deadline_ns = clock.now_ns() + 30_000_000;
            assert!(clock.wait_until(deadline_ns).now_ns >= deadline_ns);
            done.send(()).unwrap();
        });
    }
}
