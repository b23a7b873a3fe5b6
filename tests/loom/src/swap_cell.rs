//! The part of crossbeam's `AtomicCell` that lending uses: several threads may exchange the value at any time. The real cell does so
//! by an exchange of the pointer that the value is. This one exchanges a pointer to the value, with the ordering that it is given,
//! and loom fails a test in which two threads access a value without an order between them.

use std::marker::PhantomData;

use loom::cell::UnsafeCell;
use loom::sync::atomic::{AtomicPtr, Ordering};

/// How the exchanges are ordered.
pub trait Order {
    const ORDER: Ordering;
}

/// As those of the real cell.
pub struct AcquireRelease;

impl Order for AcquireRelease {
    const ORDER: Ordering = Ordering::AcqRel;
}

/// Not at all.
pub struct Relaxed;

impl Order for Relaxed {
    const ORDER: Ordering = Ordering::Relaxed;
}

pub struct SwapCell<T, O>(AtomicPtr<UnsafeCell<T>>, PhantomData<(T, O)>);

// SAFETY: each value is with one thread at a time: with whoever has exchanged it last. Loom fails a test in which that is not ordered.
unsafe impl<T: Send, O> Send for SwapCell<T, O> {}
// SAFETY: as above.
unsafe impl<T: Send, O> Sync for SwapCell<T, O> {}

impl<T: Default, O: Order> SwapCell<T, O> {
    pub fn new(value: T) -> Self {
        Self(AtomicPtr::new(boxed(value)), PhantomData)
    }

    /// As the real cell is for a value of the size of a pointer.
    pub const fn is_lock_free() -> bool {
        true
    }

    pub fn take(&self) -> T {
        self.swap(T::default())
    }

    pub fn store(&self, new: T) {
        drop(self.swap(new));
    }

    fn swap(&self, new: T) -> T {
        let old = self.0.swap(boxed(new), O::ORDER);
        // SAFETY: it comes from `boxed`, and nobody else has it any more.
        let old = unsafe { Box::from_raw(old) };
        // SAFETY: as above.
        old.with_mut(|value| unsafe { std::mem::take(&mut *value) })
    }
}

impl<T, O> Drop for SwapCell<T, O> {
    fn drop(&mut self) {
        // A failed test has no order any more that could be checked.
        if std::thread::panicking() {
            return;
        }
        // SAFETY: it comes from `boxed`, and the cell has been the only one to have it.
        drop(unsafe { Box::from_raw(self.0.with_mut(|pointer| *pointer)) });
    }
}

fn boxed<T>(value: T) -> *mut UnsafeCell<T> {
    Box::into_raw(Box::new(UnsafeCell::new(value)))
}
