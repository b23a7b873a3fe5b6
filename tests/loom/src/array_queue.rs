//! What a ring asks of crossbeam's `ArrayQueue`, and no more. The real queue orders what its two ends do to a slot, and
//! for that it waits when it meets an end half-way through. This one orders nothing: loom fails a test in which both
//! ends touch a slot without an order between them, and a slot that is not as expected is a failure, too. Where this
//! queue passes, the other end has always finished with the slot before, so the real one has nothing to wait for.
//! What the real one does within a slot is left to crossbeam's own tests.

use std::sync::atomic::{AtomicUsize, Ordering};

use loom::cell::UnsafeCell;

pub struct ArrayQueue<T> {
    slots: Box<[UnsafeCell<Option<T>>]>,
    // The standard library's atomics are unseen by loom: only one end uses each, and they order nothing for loom.
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
        // SAFETY: loom has checked that nobody else has the slot when it calls this, and the reference ends with it.
        slot.with_mut(|slot| access(unsafe { &mut *slot }))
    }
}
