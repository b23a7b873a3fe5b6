//! The function of the caller that hears of events and failures. Whatever it does, the logger goes on.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, OnceLock};

use super::black_box::Fault;
use super::logger::Notice;

/// A function that hears of events and failures.
pub type Notify = Box<dyn FnMut(&Notice) + Send>;

/// The caller's function, until it panics.
pub struct Listener {
    notify: Option<Notify>,
    /// What it said when it panicked.
    pub panic: Arc<OnceLock<String>>,
}

/// The function has just panicked.
pub struct Panicked;

impl Listener {
    pub fn new(notify: Notify) -> Self {
        Self { notify: Some(notify), panic: Arc::default() }
    }

    /// Tells it something. A function that has panicked is in no known state and is not called again.
    pub fn tell(&mut self, notice: &Notice) -> Result<(), Panicked> {
        let Some(notify) = &mut self.notify else { return Ok(()) };
        let Err(payload) = catch_unwind(AssertUnwindSafe(|| notify(notice))) else { return Ok(()) };
        self.notify = None;
        // There is only one first time.
        let _ = self.panic.set(panic_message(&*payload));
        Err(Panicked)
    }

    /// The panic as a fault.
    pub fn fault(&self) -> Option<Fault> {
        self.panic.get().cloned().map(Fault::CallbackPanicked)
    }
}

/// What a panic said.
pub fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message").to_owned()
}
