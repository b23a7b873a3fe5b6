//! What keeps wake-ups from being delayed on purpose: the thread's timer slack and the CPU's idle states.

use super::errno;
use super::step::Outcome;

/// Sets the timer slack of the calling thread to one nanosecond, the smallest there is (0 means the default of
/// 50 µs, prctl(2)).
pub(super) fn remove_timer_slack() -> Outcome {
    // SAFETY: takes numbers only, and concerns the calling thread alone.
    Outcome::of(unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1 as libc::c_ulong) })
}

/// The timer slack of the calling thread in nanoseconds.
pub(super) fn timer_slack_ns() -> u64 {
    // SAFETY: takes and returns numbers only. The answer is an `int`, so that beyond 2 s it reads as negative.
    u64::try_from(unsafe { libc::prctl(libc::PR_GET_TIMERSLACK) }).unwrap_or(u64::MAX)
}

/// The request that no CPU enters an idle state that takes time to leave. In force as long as this exists: the
/// kernel takes it back when the file is closed (Documentation/power/pm_qos_interface).
#[derive(Debug)]
pub(super) struct DmaLatencyHold {
    descriptor: libc::c_int,
}

impl DmaLatencyHold {
    /// Asks for a latency of zero.
    pub(super) fn acquire() -> Result<Self, Outcome> {
        // SAFETY: the path is a terminated string.
        let descriptor =
            unsafe { libc::open(c"/dev/cpu_dma_latency".as_ptr(), libc::O_WRONLY | libc::O_CLOEXEC) };
        if descriptor < 0 {
            return Err(Outcome::Refused { errno: errno() });
        }
        let hold = Self { descriptor };
        let latency_us = 0i32;
        // SAFETY: four readable bytes; the kernel takes a binary 32-bit number of microseconds.
        let written = unsafe { libc::write(descriptor, (&raw const latency_us).cast(), size_of::<i32>()) };
        match Outcome::of(written as i64) {
            Outcome::Granted => Ok(hold),
            refused => Err(refused),
        }
    }
}

impl Drop for DmaLatencyHold {
    fn drop(&mut self) {
        // SAFETY: the descriptor was opened by `acquire` and belongs to nobody else.
        unsafe { libc::close(self.descriptor) };
    }
}
