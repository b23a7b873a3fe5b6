//! Panics of callbacks: caught in the real-time thread, told elsewhere.
//!
//! The usual panic hook writes to standard error, with a backtrace that takes a tenth of a second to resolve. A loop that does nothing
//! else meanwhile misses a hundred slots. So no hook is called for the panic of a callback: where it has panicked is kept beside its
//! message, for whoever waits for the callback.

use std::any::Any;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::sync::Once;
use std::thread;

type Hook = Box<dyn Fn(&PanicHookInfo<'_>) + Send + Sync>;

thread_local! {
    static IS_IN_CALLBACK: Cell<bool> = const { Cell::new(false) };
    static PLACE: Cell<Option<String>> = const { Cell::new(None) };
}

/// What a callback has panicked with, and where.
pub(super) struct CaughtPanic {
    payload: Box<dyn Any + Send>,
    place: Option<String>,
}

impl CaughtPanic {
    /// The text for people.
    pub(super) fn message(&self) -> String {
        let message = panic_message(&*self.payload);
        self.place.as_ref().map_or_else(|| message.clone(), |place| format!("{message}, at {place}"))
    }
}

/// The message of a panic.
pub(crate) fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message").to_owned()
}

/// Puts a hook before the present one that keeps the place of the panics of callbacks, and hands all others on. A hook that is set later
/// is called for callbacks too.
pub(super) fn keep_hooks_away() {
    static ONCE: Once = Once::new();
    // A thread that is panicking cannot set a hook.
    if thread::panicking() {
        return;
    }
    ONCE.call_once(|| {
        let previous = panic::take_hook();
        panic::set_hook(before(previous));
    });
}

/// The hook, before another one.
fn before(previous: Hook) -> Hook {
    Box::new(move |info| {
        if IS_IN_CALLBACK.get() {
            PLACE.set(info.location().map(ToString::to_string));
        } else {
            previous(info);
        }
    })
}

/// Calls a callback.
pub(super) fn catch(body: impl FnOnce()) -> Result<(), CaughtPanic> {
    IS_IN_CALLBACK.set(true);
    // After a panic the function is not called again, so its broken state has no effect.
    let called = catch_unwind(AssertUnwindSafe(body));
    IS_IN_CALLBACK.set(false);
    called.map_err(|payload| CaughtPanic { payload, place: PLACE.take() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};

    #[test]
    fn no_hook_is_called_for_the_panic_of_a_callback_and_its_place_is_kept() {
        let (calls, own) = (Arc::new(AtomicU32::new(0)), thread::current().id());
        let (counting, others) = (Arc::clone(&calls), panic::take_hook());
        panic::set_hook(before(Box::new(move |info| {
            if thread::current().id() == own {
                counting.fetch_add(1, Ordering::Relaxed);
            } else {
                others(info);
            }
        })));
        let caught = catch(|| panic!("no pose {}", 3)).unwrap_err();
        assert!(caught.message().starts_with("no pose 3, at src/channels/callback_panic.rs:"));
        assert_eq!(calls.load(Ordering::Relaxed), 0);
        assert!(catch(|| {}).is_ok());
        assert!(catch_unwind(|| panic!("elsewhere")).is_err());
        assert_eq!(calls.load(Ordering::Relaxed), 1);
    }
}
