//! The state of a serial line.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use takt_rt::{BusHealth, BusState};

use crate::family::LineCounts;

/// The state of a line, which its master writes and the cycle reads.
#[derive(Debug, Default)]
pub struct LineStatus {
    is_down: AtomicBool,
    /// True if an injected fault has taken the line away.
    is_taken_away: AtomicBool,
    requests: AtomicU64,
    replies: AtomicU64,
    failures: AtomicU64,
    busy_ns: AtomicU64,
}

impl LineStatus {
    /// Shows these counters.
    pub fn show(&self, counts: LineCounts) {
        // Each is of use alone, so that they need no order.
        self.requests.store(counts.requests, Ordering::Relaxed);
        self.replies.store(counts.replies, Ordering::Relaxed);
        self.failures.store(counts.failures, Ordering::Relaxed);
        self.busy_ns.store(counts.busy_ns, Ordering::Relaxed);
    }

    /// Shows whether the line is there.
    pub fn set_down(&self, is_down: bool) {
        self.is_down.store(is_down, Ordering::Relaxed);
    }

    /// Shows whether an injected fault has taken the line away.
    pub fn set_taken_away(&self, is_taken_away: bool) {
        self.is_taken_away.store(is_taken_away, Ordering::Relaxed);
    }

    pub fn health(&self) -> BusHealth {
        let is_down = self.is_down.load(Ordering::Relaxed) || self.is_taken_away.load(Ordering::Relaxed);
        BusHealth {
            state: if is_down { BusState::Down } else { BusState::ErrorActive },
            tx_frames: self.requests.load(Ordering::Relaxed),
            rx_frames: self.replies.load(Ordering::Relaxed),
            errors: self.failures.load(Ordering::Relaxed),
            busy_ns: self.busy_ns.load(Ordering::Relaxed),
            ..BusHealth::default()
        }
    }
}
