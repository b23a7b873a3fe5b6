//! What is known of the calls of a callback, in every thread.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use takt_rt::{CallbackCycle, Nanoseconds};

/// The calls of a callback: the real-time thread counts and measures them.
#[derive(Debug, Default)]
pub struct CallbackRecord {
    calls: AtomicU64,
    missed_slots: AtomicU64,
    overruns: AtomicU64,
    last_ns: AtomicU64,
    longest_ns: AtomicU64,
    /// The message of its panic.
    panic: OnceLock<String>,
    /// True if the function has been freed, or is about to be.
    is_over: AtomicBool,
}

/// How the calls of a callback have gone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CallbackTimes {
    /// How often it was called.
    pub calls: u64,
    /// Slots between its calls in which it was not called.
    pub missed_slots: u64,
    /// Calls that took longer than their budget.
    pub overruns: u64,
    /// How long the last call took.
    pub last: Duration,
    /// How long the longest one took.
    pub longest: Duration,
}

impl CallbackRecord {
    /// Counts a call. Only the real-time thread does.
    pub(super) fn count(&self, cycle: &CallbackCycle, spent_ns: Nanoseconds) {
        let add = |count: &AtomicU64, more: u64| {
            count.store(count.load(Ordering::Relaxed) + more, Ordering::Relaxed);
        };
        add(&self.missed_slots, cycle.missed_slots);
        add(&self.overruns, u64::from(spent_ns > cycle.budget_ns));
        self.last_ns.store(spent_ns, Ordering::Relaxed);
        self.longest_ns.store(self.longest_ns.load(Ordering::Relaxed).max(spent_ns), Ordering::Relaxed);
        add(&self.calls, 1);
    }

    /// The function is freed, after this panic.
    pub(super) fn end(&self, panic: Option<String>) {
        if let Some(message) = panic {
            // It has panicked only once.
            let _ = self.panic.set(message);
        }
        self.is_over.store(true, Ordering::Release);
    }

    /// How the calls have gone.
    pub fn times(&self) -> CallbackTimes {
        let read = |count: &AtomicU64| count.load(Ordering::Relaxed);
        CallbackTimes {
            calls: read(&self.calls),
            missed_slots: read(&self.missed_slots),
            overruns: read(&self.overruns),
            last: Duration::from_nanos(read(&self.last_ns)),
            longest: Duration::from_nanos(read(&self.longest_ns)),
        }
    }

    /// Returns `true` if the function has been freed, or is about to be.
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Acquire)
    }

    /// The message of its panic, once it is over.
    pub fn panic(&self) -> Option<&str> {
        self.panic.get().map(String::as_str)
    }
}
