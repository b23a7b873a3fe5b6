//! The end of a scan before its time.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::interruption;
use crate::usage_error::UsageError;

/// Ctrl-C, or the wish of another takt to take the bus over.
pub struct Interruption {
    arrived: Arc<AtomicBool>,
    /// True if it has been seen once.
    is_over: Cell<bool>,
}

impl Interruption {
    pub fn watch() -> Result<Self, UsageError> {
        let arrived = interruption::watch().map_err(|error| format!("cannot watch for Ctrl-C: {error}"))?;
        Ok(Self { arrived, is_over: Cell::new(false) })
    }

    /// Ends the scan as Ctrl-C does.
    pub fn end(&self) {
        self.is_over.set(true);
    }

    /// Returns `true` if it has come.
    pub fn has_come(&self) -> bool {
        if self.arrived.load(Ordering::Relaxed) {
            self.is_over.set(true);
        }
        self.is_over.get()
    }
}
