//! The end of a loop that does not come back.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Whether the loop has been given up: the run is over, and nothing is sent any more. Clones are the same.
#[derive(Clone, Debug, Default)]
pub struct Abandonment(Arc<AtomicBool>);

impl Abandonment {
    /// Gives the loop up.
    pub fn begin(&self) {
        self.0.store(true, Ordering::Release);
    }

    /// Returns `true` if the loop has been given up.
    pub fn has_begun(&self) -> bool {
        self.0.load(Ordering::Acquire)
    }

    /// Returns, unless the loop has been given up: then this thread waits for the end of the process, so that it commands nothing.
    pub(super) fn wait_if_begun(&self) {
        while self.has_begun() {
            thread::park();
        }
    }
}
