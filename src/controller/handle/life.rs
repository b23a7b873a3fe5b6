//! Whether a run goes on.

use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

const RUNNING: u8 = 0;
const ENDING: u8 = 1;
const OVER: u8 = 2;

/// How far a run is on its way to the end. It never goes back.
#[derive(Debug, Default)]
pub(super) struct Life(AtomicU8);

impl Life {
    /// The owner ends the run: the axes come to rest, and nothing new begins.
    pub(super) fn begin_end(&self) {
        self.0.fetch_max(ENDING, Ordering::Relaxed);
    }

    /// Returns `true` if the owner ends the run, or the run is over.
    pub(super) fn is_ending(&self) -> bool {
        self.0.load(Ordering::Relaxed) != RUNNING
    }

    /// Returns `true` if the run is over. What was published before its end can be seen then.
    pub(super) fn is_over(&self) -> bool {
        self.0.load(Ordering::Acquire) == OVER
    }

    /// The run is over.
    pub(super) fn end(&self) {
        self.0.store(OVER, Ordering::Release);
    }

    /// For the thread of the run: the run is over when this is dropped, even by a panic.
    pub(super) fn over_when_dropped(self: Arc<Self>) -> OverWhenDropped {
        OverWhenDropped(self)
    }
}

/// See [`Life::over_when_dropped`].
pub(super) struct OverWhenDropped(Arc<Life>);

impl Deref for OverWhenDropped {
    type Target = Life;

    fn deref(&self) -> &Life {
        &self.0
    }
}

impl Drop for OverWhenDropped {
    fn drop(&mut self) {
        self.0.end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    #[test]
    fn a_run_is_over_even_if_its_thread_panics_and_does_not_come_back() {
        let life = Arc::<Life>::default();
        assert!(!life.is_ending() && !life.is_over());
        life.begin_end();
        assert!(life.is_ending() && !life.is_over());
        let running = Arc::clone(&life).over_when_dropped();
        let panicked = thread::spawn(move || {
            let _running = running;
            std::panic::resume_unwind(Box::new("a panic that prints nothing"));
        });
        assert!(panicked.join().is_err());
        life.begin_end();
        assert!(life.is_ending() && life.is_over());
    }
}
