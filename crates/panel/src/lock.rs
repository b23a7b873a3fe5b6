//! A lock that a panic does not close.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// A panic of another holder of a lock leaves what it guards consistent.
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
