//! The caller's function that is notified of events and failures. The logger goes on even if this function panics.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, OnceLock};

use takt_rt::Event;

use super::black_box::Incident;
use crate::channels::panic_message;

/// Notification of an event, or of a file that cannot be written.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Notice {
    /// An event; [`event_words`](super::event_words) gives its text.
    Event(Event),
    /// A file can no longer be written: which one, and why. Each failure is reported once. The motion goes on.
    NotWritten(String),
}

/// A function that is notified of events and failures.
pub type Notify = Box<dyn FnMut(&Notice) + Send>;

/// The caller's function, until it panics.
pub struct Listener {
    notify: Option<Notify>,
    /// The message of its panic.
    pub panic: Arc<OnceLock<String>>,
}

/// The function has just panicked.
pub struct Panicked;

impl Listener {
    pub fn new(notify: Notify) -> Self {
        Self { notify: Some(notify), panic: Arc::default() }
    }

    /// Calls the function. After a panic its state is unknown, so it is not called again.
    pub fn notify(&mut self, notice: &Notice) -> Result<(), Panicked> {
        let Some(notify) = &mut self.notify else { return Ok(()) };
        let Err(payload) = catch_unwind(AssertUnwindSafe(|| notify(notice))) else { return Ok(()) };
        self.notify = None;
        // A panic is set only once, since the function is not called again.
        let _ = self.panic.set(panic_message(&*payload));
        Err(Panicked)
    }

    /// The panic as an incident.
    pub fn incident(&self) -> Option<Incident> {
        self.panic.get().cloned().map(Incident::CallbackPanicked)
    }
}
