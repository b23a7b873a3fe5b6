//! The last failure of a call in each thread.

use std::ffi::c_char;

use crate::border::{self, Growing};
use crate::errors::{self, takt_error, takt_result};

// SAFETY: it begins with its size; it is only written for the caller, so no pattern of bits is ever taken for a value.
unsafe impl Growing for takt_error {
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// The last failure of a call in this thread, as a sentence that names what and where, and the cure where one is known; empty before the
/// first failure. UTF-8. It stays valid until the next failure of a call in this thread. Any thread; does not block.
#[unsafe(no_mangle)]
pub extern "C" fn takt_last_error_text() -> *const c_char {
    errors::last_words()
}

/// The last failure of a call in this thread, as numbers: which point, axis and limit. Any thread; does not block.
///
/// Errors: TAKT_ERROR_ARGUMENT.
///
/// # Safety
/// `error` is null, or points to a structure of the size that it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_last_error(error: *mut takt_error) -> takt_result {
    border::carry_out(|| {
        // SAFETY: the caller promises it.
        unsafe { border::put_growing(error, &errors::last(), "error") }
    })
}
