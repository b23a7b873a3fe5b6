//! What the threads share.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use takt::command::AnyHandle;
use takt_rt::{Nanoseconds, RequestTarget};

use super::lease::Lease;
use crate::layout::STOP_WORDS;

/// A controller and who commands it.
pub struct Served {
    pub controller: AnyHandle,
    pub stops: Stops,
    lease: Mutex<Lease>,
    has_ended: AtomicBool,
}

impl Served {
    pub fn new(controller: AnyHandle, lease: Duration) -> Self {
        Self {
            controller,
            stops: Stops::default(),
            lease: Mutex::new(Lease::new(lease)),
            has_ended: AtomicBool::new(false),
        }
    }

    pub fn lease(&self) -> MutexGuard<'_, Lease> {
        // A panic of another holder of the lock leaves the lease consistent.
        self.lease.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn has_ended(&self) -> bool {
        self.has_ended.load(Ordering::Acquire)
    }

    /// Ends the threads.
    pub fn end(&self) {
        self.has_ended.store(true, Ordering::Release);
    }
}

/// When the newest stop came, of a client or of this process, by `CLOCK_MONOTONIC`: of all axes, and of each group.
#[derive(Default)]
pub struct Stops([AtomicU64; STOP_WORDS]);

impl Stops {
    pub fn note(&self, target: RequestTarget, at_ns: Nanoseconds) {
        let place = match target {
            RequestTarget::All => 0,
            RequestTarget::Group(group) => 1 + usize::from(group),
        };
        if let Some(newest_ns) = self.0.get(place) {
            newest_ns.fetch_max(at_ns, Ordering::AcqRel);
        }
    }

    /// True if a stop that concerns a target has come after a time.
    pub fn came_after(&self, target: RequestTarget, at_ns: Nanoseconds) -> bool {
        self.0.iter().enumerate().any(|(place, newest_ns)| {
            let is_concerned = match target {
                RequestTarget::All => true,
                RequestTarget::Group(group) => place == 0 || place == 1 + usize::from(group),
            };
            is_concerned && newest_ns.load(Ordering::Acquire) > at_ns
        })
    }
}
