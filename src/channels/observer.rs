//! Any thread's view of the state after the newest cycle.

use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

use takt_rt::Snapshot;

use super::latest::{Attempt, Reader};
use super::words::{self, take_snapshot_into};

/// The last state that a thread has looked at, of any controller. What a later one does not count stays in it.
#[derive(Default)]
struct LookedAt {
    /// The number of the observers of that controller; 0 for none.
    observers: u64,
    /// The number of the state in its mailbox.
    number: u64,
    snapshot: Snapshot,
}

/// The controllers that this process has had.
static CONTROLLERS: AtomicU64 = AtomicU64::new(0);

thread_local! {
    static LOOKED_AT: Cell<Option<Box<LookedAt>>> = const { Cell::new(None) };
}

/// Reads the state of the controller at any time, without disturbing it. Clone it for every thread.
#[derive(Clone)]
pub struct Observer {
    snapshot: Reader,
    /// Another one for the observers of each controller of this process.
    number: u64,
}

impl Observer {
    /// Of one more controller of this process.
    pub(super) fn new(snapshot: Reader) -> Self {
        Self { snapshot, number: CONTROLLERS.fetch_add(1, Ordering::Relaxed) + 1 }
    }

    /// The state after the newest complete cycle. Before the first one, it is a passive controller whose drives have reported nothing.
    pub fn snapshot(&self) -> Snapshot {
        let mut snapshot = words::NO_SNAPSHOT;
        self.read(&mut snapshot);
        snapshot
    }

    /// Shows that state to `look`, without a copy: a snapshot has twelve kilobytes, most of which do not count.
    pub fn look<T>(&self, look: impl FnOnce(&Snapshot) -> T) -> T {
        let mut looked_at = LOOKED_AT.take().unwrap_or_default();
        self.update(&mut looked_at);
        let seen = look(&looked_at.snapshot);
        LOOKED_AT.set(Some(looked_at));
        seen
    }

    /// Reads the state, unless it is the one that is there.
    fn update(&self, looked_at: &mut LookedAt) {
        let newest = if looked_at.observers == self.number { looked_at.number } else { 0 };
        loop {
            match self.snapshot.attempt(newest, |words| take_snapshot_into(words, &mut looked_at.snapshot)) {
                Attempt::Whole((), number) => {
                    (looked_at.observers, looked_at.number) = (self.number, number);
                    return;
                }
                Attempt::Nothing if newest > 0 => return,
                Attempt::Torn | Attempt::Nothing => std::hint::spin_loop(),
            }
        }
    }

    /// The same, written over an earlier one of this controller, or over [`Snapshot::default`].
    pub fn read(&self, snapshot: &mut Snapshot) {
        loop {
            match self.snapshot.attempt(0, |words| take_snapshot_into(words, snapshot)) {
                Attempt::Whole((), _) => return,
                // Three cycles have passed during the read, because this thread was preempted. There is one from the beginning.
                Attempt::Torn | Attempt::Nothing => std::hint::spin_loop(),
            }
        }
    }
}
