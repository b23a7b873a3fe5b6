//! Settings that delay wake-ups on purpose, switched off: the timer slack of the thread and the deep idle states of the CPUs.

use super::errno;
use super::step::Outcome;

/// Sets the timer slack of the calling thread to 1 ns, the smallest value. 0 would mean the default of 50 µs (prctl(2)).
pub(super) fn remove_timer_slack() -> Outcome {
    // SAFETY: the call takes numbers only, and changes only the calling thread.
    Outcome::of(unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1 as libc::c_ulong) })
}

/// The timer slack of the calling thread in nanoseconds.
pub(super) fn timer_slack_ns() -> u64 {
    // SAFETY: the call takes and returns numbers only. The answer is an `int`: a slack beyond 2 s reads as negative.
    u64::try_from(unsafe { libc::prctl(libc::PR_GET_TIMERSLACK) }).unwrap_or(u64::MAX)
}

/// The request that no CPU enters an idle state that takes time to leave. It holds as long as this value exists: the kernel takes
/// it back when the file is closed (Documentation/power/pm_qos_interface).
#[derive(Debug)]
pub(super) struct DmaLatencyHold {
    descriptor: libc::c_int,
}

impl DmaLatencyHold {
    /// Requests a latency of zero.
    ///
    /// # Errors
    /// The refusal of the system.
    pub(super) fn acquire() -> Result<Self, Outcome> {
        // SAFETY: the path is a terminated string.
        let descriptor =
            unsafe { libc::open(c"/dev/cpu_dma_latency".as_ptr(), libc::O_WRONLY | libc::O_CLOEXEC) };
        if descriptor < 0 {
            return Err(Outcome::Refused { errno: errno() });
        }
        let hold = Self { descriptor };
        let latency_us = 0i32;
        // SAFETY: the four bytes are readable. The kernel takes a binary 32-bit number of microseconds.
        let written = unsafe { libc::write(descriptor, (&raw const latency_us).cast(), size_of::<i32>()) };
        match Outcome::of(written as i64) {
            Outcome::Granted => Ok(hold),
            refused => Err(refused),
        }
    }
}

impl Drop for DmaLatencyHold {
    fn drop(&mut self) {
        // SAFETY: `acquire` opened the descriptor, and nobody else closes it.
        unsafe { libc::close(self.descriptor) };
    }
}
