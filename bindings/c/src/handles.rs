//! The table of handles. A handle is a number: the place of an entry in the table, and how often that place has been used before. So a
//! handle that is null, closed, made up or of another kind is an error, and never a pointer to nothing.
//!
//! To use a handle is a few atomic operations, without a lock: a stop may do so in a signal handler, even in the middle of another call.
//! An entry is freed by whoever closes its handle, once the last call that uses it has returned.
//!
//! A fork has a copy of the table, and none of the threads of the controllers in it. It may use only the handles that it opens itself.

use std::ops::Deref;
use std::ptr;
use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use takt::{AnyHandle, CallbackHandle, Events};

use crate::errors::{Failure, takt_result};
use crate::posix;
use crate::scope::Scope;

/// A controller, or one group of its axes: whatever is asked by it concerns its axes alone, in their order. `{0}` is the null handle.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_handle {
    /// Not for you.
    pub number: u64,
}

/// A place among the events of a controller. `{0}` is the null handle.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_events {
    /// Not for you.
    pub number: u64,
}

/// A callback that leads axes, or has led them. `{0}` is the null handle.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_callback {
    /// Not for you.
    pub number: u64,
}

/// What a handle stands for.
pub(crate) enum Entry {
    Scope(Scope),
    Events(Mutex<Events>, AnyHandle),
    Callback(CallbackHandle, Vec<usize>),
}

/// The most handles that are open at a time.
const PLACES: usize = 256;
/// In the state of a place: it is open. Below are the calls that use it, above is how often it has been used.
const OPEN: u64 = 1 << 31;
const CALLS: u64 = OPEN - 1;
const USES_SHIFT: u32 = 32;
/// How long a close waits before it looks again whether the last call has returned.
const LOOK: Duration = Duration::from_micros(100);

struct Place {
    state: AtomicU64,
    /// [`posix::process_mark`] when it was opened.
    process: AtomicU64,
    entry: AtomicPtr<Entry>,
}

/// What is put into the table is used from every thread.
const _: fn() = || {
    fn is_for_every_thread<T: Send + Sync>() {}
    is_for_every_thread::<Entry>();
};

static TABLE: [Place; PLACES] = [const {
    Place { state: AtomicU64::new(0), process: AtomicU64::new(0), entry: AtomicPtr::new(ptr::null_mut()) }
}; PLACES];
/// Whoever opens a handle holds it. Nobody else needs it.
static OPENING: Mutex<()> = Mutex::new(());

/// Why a handle cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unusable {
    /// It is null, closed, or of another kind.
    Wrong,
    /// It was opened in the process of which this one is a fork.
    Forked,
}

impl Unusable {
    /// Without words, for a signal handler.
    pub(crate) const fn result(self) -> takt_result {
        match self {
            Self::Wrong => takt_result::TAKT_ERROR_HANDLE,
            Self::Forked => takt_result::TAKT_ERROR_ENDED,
        }
    }
}

impl From<Unusable> for Failure {
    fn from(why: Unusable) -> Self {
        let words = match why {
            Unusable::Wrong => "the handle is null, closed, or of another kind",
            Unusable::Forked => {
                "the handle was opened in another process, and this is a fork of it: command the controller from there"
            }
        };
        Self::new(why.result(), words)
    }
}

/// An entry in use. It is not freed before this is dropped.
pub(crate) struct Used {
    place: &'static Place,
    entry: *const Entry,
}

impl Deref for Used {
    type Target = Entry;

    fn deref(&self) -> &Entry {
        // SAFETY: the entry was put there before the place was opened, and is freed only when no call is counted in its state. This
        // one is, until it is dropped.
        unsafe { &*self.entry }
    }
}

impl Drop for Used {
    fn drop(&mut self) {
        self.place.state.fetch_sub(1, Ordering::Release);
    }
}

/// Makes a handle.
pub(crate) fn open(entry: Entry) -> Result<u64, Failure> {
    let _opening = OPENING.lock().unwrap_or_else(PoisonError::into_inner);
    posix::mark_process();
    let is_free = |place: &&Place| place.entry.load(Ordering::Acquire).is_null();
    let Some((number, place)) = (1..).zip(&TABLE).find(|(_, place)| is_free(place)) else {
        let words = format!("{PLACES} handles are open, and there is no room for another one; close some");
        return Err(Failure::new(takt_result::TAKT_ERROR_FULL, words));
    };
    place.entry.store(Box::into_raw(Box::new(entry)), Ordering::Release);
    place.process.store(posix::process_mark(), Ordering::Relaxed);
    // Calls with old handles of this place may be counted for a moment.
    let state = place.state.fetch_or(OPEN, Ordering::AcqRel);
    Ok((state >> USES_SHIFT) << USES_SHIFT | number)
}

/// Uses a handle.
pub(crate) fn using(handle: u64) -> Result<Used, Unusable> {
    let place = place_of(handle).ok_or(Unusable::Wrong)?;
    let state = place.state.fetch_add(1, Ordering::Acquire);
    let used = Used { place, entry: place.entry.load(Ordering::Acquire) };
    // Dropping it takes the count back.
    match is_open(state, handle) {
        false => Err(Unusable::Wrong),
        true if place.process.load(Ordering::Relaxed) != posix::process_mark() => Err(Unusable::Forked),
        true => Ok(used),
    }
}

/// Closes a handle: from now on nobody can use it. `end` lets the calls return that use it, before they are waited for.
pub(crate) fn close<T>(
    handle: u64,
    is_kind: fn(&Entry) -> bool,
    end: impl FnOnce(&Entry) -> T,
) -> Result<T, Failure> {
    let used = using(handle)?;
    if !is_kind(&used) {
        return Err(Unusable::Wrong.into());
    }
    let place = used.place;
    let clear = |state: u64| is_open(state, handle).then_some(state & !OPEN);
    // Of several that close it at once, one does.
    place.state.fetch_update(Ordering::AcqRel, Ordering::Acquire, clear).map_err(|_| Unusable::Wrong)?;
    let ended = end(&used);
    let entry = place.entry.load(Ordering::Acquire);
    drop(used);
    let uses = handle >> USES_SHIFT;
    let unused = uses << USES_SHIFT;
    let next = (uses + 1) << USES_SHIFT;
    while place.state.compare_exchange(unused, next, Ordering::AcqRel, Ordering::Acquire).is_err() {
        thread::sleep(LOOK);
    }
    // SAFETY: it comes from `Box::into_raw` in `open`. The place was closed by this call alone, and no call uses it any more. It is not
    // opened again before its entry is null.
    let entry = unsafe { Box::from_raw(entry) };
    place.entry.store(ptr::null_mut(), Ordering::Release);
    drop(entry);
    Ok(ended)
}

fn place_of(handle: u64) -> Option<&'static Place> {
    let number = usize::try_from(handle & CALLS).ok()?;
    TABLE.get(number.checked_sub(1)?)
}

fn is_open(state: u64, handle: u64) -> bool {
    state & OPEN != 0 && state >> USES_SHIFT == handle >> USES_SHIFT && handle & OPEN == 0
}

/// The axes of a handle, in use.
pub(crate) struct UsedScope(Used);

impl Deref for UsedScope {
    type Target = Scope;

    fn deref(&self) -> &Scope {
        match &*self.0 {
            Entry::Scope(scope) => scope,
            _ => unreachable!("it was looked at"),
        }
    }
}

impl takt_handle {
    /// The axes, if the handle is one of axes.
    pub(crate) fn scope(self) -> Result<UsedScope, Unusable> {
        let used = using(self.number)?;
        if matches!(*used, Entry::Scope(_)) { Ok(UsedScope(used)) } else { Err(Unusable::Wrong) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt::{Config, VirtualController};

    fn entry() -> Entry {
        let config = Config::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/first.toml").as_ref());
        let controller = VirtualController::start(&config.unwrap(), None).unwrap();
        Entry::Events(Mutex::new(controller.events()), controller.handle().into())
    }

    #[test]
    fn a_handle_that_is_closed_stays_closed_when_its_place_is_used_again() {
        let is_any = |_: &Entry| true;
        let first = open(entry()).unwrap();
        assert!(using(first).is_ok());
        assert!(close(first, is_any, |_| ()).is_ok());
        let second = open(entry()).unwrap();
        assert_ne!(first, second);
        assert!(using(first).is_err());
        assert!(close(first, is_any, |_| ()).is_err());
        assert!(using(second).is_ok());
        assert!(close(second, |entry| matches!(entry, Entry::Scope(_)), |_| ()).is_err());
        assert!(close(second, is_any, |_| ()).is_ok());
    }

    #[test]
    fn a_handle_that_is_made_up_is_none() {
        for made_up in [0, 1, 256, 257, OPEN, OPEN | 1, CALLS, u64::MAX, 77 << USES_SHIFT | 3] {
            assert!(using(made_up).is_err(), "{made_up:#x}");
        }
    }

    #[test]
    fn a_close_waits_for_the_call_that_uses_the_handle() {
        let handle = open(entry()).unwrap();
        let used = using(handle).unwrap();
        let closing = thread::spawn(move || close(handle, |_| true, |_| ()).is_ok());
        while using(handle).is_ok() {
            thread::yield_now();
        }
        assert!(!closing.is_finished());
        assert!(matches!(*used, Entry::Events(..)));
        drop(used);
        assert!(closing.join().unwrap());
    }
}
