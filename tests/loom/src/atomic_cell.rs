//! The part of crossbeam's `AtomicCell` that the requests of clients use. The real cell orders the accesses to it. This cell
//! orders nothing. Loom fails a test in which two threads access a cell without an order between them. If the tests pass with
//! this cell, each slot is used by one thread at a time.

use loom::cell::UnsafeCell;

pub struct AtomicCell<T>(UnsafeCell<T>);

// SAFETY: loom runs one thread at a time, and fails a test in which the accesses to a cell are not ordered.
unsafe impl<T: Send> Sync for AtomicCell<T> {}

impl<T: Default> AtomicCell<T> {
    pub fn new(value: T) -> Self {
        Self(UnsafeCell::new(value))
    }

    /// As the real cell is for a value of the size of a pointer.
    pub const fn is_lock_free() -> bool {
        true
    }

    pub fn take(&self) -> T {
        // SAFETY: as above.
        self.0.with_mut(|value| unsafe { std::mem::take(&mut *value) })
    }

    pub fn store(&self, new: T) {
        // SAFETY: as above.
        self.0.with_mut(|value| unsafe { *value = new });
    }
}
