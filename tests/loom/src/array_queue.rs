//! The part of crossbeam's `ArrayQueue` that a ring uses. The real queue orders the accesses of its two ends to a slot, and
//! so it waits for an end in the middle of an access. This queue orders nothing. Loom fails a test in which both ends
//! access a slot without an order between them. A slot with an unexpected content is a failure, too. If the tests pass with
//! this queue, the other end has always completed its access before, so the real queue never waits. The real queue's
//! accesses within a slot are covered by crossbeam's own tests.

use std::sync::atomic::{AtomicUsize, Ordering};

use loom::cell::UnsafeCell;

pub struct ArrayQueue<T> {
    slots: Box<[UnsafeCell<Option<T>>]>,
    // Loom does not see the standard library's atomics. Each is used by one end only, and they order nothing for loom.
    pushed: AtomicUsize,
    popped: AtomicUsize,
}

// SAFETY: loom runs one thread at a time, and fails a test in which the accesses to a slot are not ordered.
unsafe impl<T: Send> Sync for ArrayQueue<T> {}

impl<T> ArrayQueue<T> {
    pub fn new(capacity: usize) -> Self {
        Self {
            slots: (0..capacity).map(|_| UnsafeCell::new(None)).collect(),
            pushed: AtomicUsize::new(0),
            popped: AtomicUsize::new(0),
        }
    }

    pub fn capacity(&self) -> usize {
        self.slots.len()
    }

    pub fn push(&self, item: T) -> Result<(), T> {
        let before = self.with_next(&self.pushed, |slot| slot.replace(item));
        assert!(before.is_none(), "the ring has pushed into a slot that was still full");
        Ok(())
    }

    pub fn pop(&self) -> Option<T> {
        let item = self.with_next(&self.popped, Option::take);
        assert!(item.is_some(), "the ring has popped from a slot that was empty");
        item
    }

    fn with_next<R>(&self, count: &AtomicUsize, access: impl FnOnce(&mut Option<T>) -> R) -> R {
        let slot = &self.slots[count.fetch_add(1, Ordering::Relaxed) % self.slots.len()];
        // SAFETY: loom has checked that the other end does not access the slot during this call, and the reference ends with it.
        slot.with_mut(|slot| access(unsafe { &mut *slot }))
    }
}
