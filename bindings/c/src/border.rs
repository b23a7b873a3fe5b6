//! The border between C and Rust: no panic crosses it, no cancellation of the thread takes effect behind it, and no pointer is used before it
//! was looked at.

use std::cell::Cell;
use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use crate::errors::{self, Failure, takt_result};
use crate::posix::NotCancelled;

thread_local! {
    static IS_IN_CALLBACK: Cell<bool> = const { Cell::new(false) };
}

/// Calls the body of a function of the header. What goes wrong becomes the last error of the thread.
pub(crate) fn enter(body: impl FnOnce() -> Result<takt_result, Failure>) -> takt_result {
    if IS_IN_CALLBACK.get() {
        // The text of an error would be allocated.
        return takt_result::TAKT_ERROR_IN_CALLBACK;
    }
    let _whole = NotCancelled::new();
    let result = catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|_| Err(Failure::defect()));
    result.unwrap_or_else(errors::keep)
}

/// The same for a function that has nothing to say but that it has been carried out.
pub(crate) fn carry_out(body: impl FnOnce() -> Result<(), Failure>) -> takt_result {
    enter(|| body().map(|()| takt_result::TAKT_OK))
}

/// The same for what may be called in a callback and in a signal handler: it keeps no error, since its text would be allocated.
pub(crate) fn enter_without_words(body: impl FnOnce() -> takt_result) -> takt_result {
    let _whole = NotCancelled::new();
    catch_unwind(AssertUnwindSafe(body)).unwrap_or(takt_result::TAKT_ERROR_DEFECT)
}

/// Calls a callback of the program. Until it returns, no function of the header that may wait does anything in this thread.
pub(crate) fn in_callback<T>(call: impl FnOnce() -> T) -> T {
    IS_IN_CALLBACK.set(true);
    let returned = call();
    IS_IN_CALLBACK.set(false);
    returned
}

/// An array of the caller.
///
/// # Safety
/// `pointer` is null, or points to `length` values that nobody writes to during `'a`.
pub(crate) unsafe fn array<'a, T>(pointer: *const T, length: usize, name: &str) -> Result<&'a [T], Failure> {
    if length == 0 {
        return Ok(&[]);
    }
    check_pointer(pointer, name)?;
    if length > isize::MAX as usize / size_of::<T>().max(1) {
        return Err(Failure::argument(format!("{name} cannot have {length} entries")));
    }
    // SAFETY: it is aligned, not null, and not too long; the rest the caller promises.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// A text of the caller.
///
/// # Safety
/// `pointer` is null, or points to a text that ends with a zero and that nobody writes to during `'a`.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, Failure> {
    check_pointer(pointer, name)?;
    // SAFETY: it is not null; the rest the caller promises.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| Failure::argument(format!("{name} is not UTF-8")))
}

/// A text of the caller, which may be null.
///
/// # Safety
/// As [`text`].
pub(crate) unsafe fn optional_text<'a>(
    pointer: *const c_char,
    name: &str,
) -> Result<Option<&'a str>, Failure> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller promises what `text` needs.
    unsafe { text(pointer, name) }.map(Some)
}

/// Puts a value where the caller wants it.
///
/// # Safety
/// `place` is null, or may be written to.
pub(crate) unsafe fn put<T>(place: *mut T, value: T, name: &str) -> Result<(), Failure> {
    check_pointer(place, name)?;
    // SAFETY: it is aligned and not null; the rest the caller promises.
    unsafe { place.write(value) };
    Ok(())
}

/// Refuses a place that nothing can be put into, before anything is begun whose name would be lost.
pub(crate) fn check_pointer<T>(pointer: *const T, name: &str) -> Result<(), Failure> {
    if pointer.is_null() {
        return Err(Failure::argument(format!("{name} is null")));
    }
    if !pointer.is_aligned() {
        return Err(Failure::argument(format!("{name} is not aligned")));
    }
    Ok(())
}

/// A structure of the header that may grow at its end. It begins with its size, as the caller was compiled with it.
///
/// # Safety
/// `repr(C)`, its first field is a `u32`, and every pattern of bits is a value.
pub(crate) unsafe trait Growing: Copy {
    /// Its size in the first release that had it.
    const FIRST_SIZE: usize;
}

fn check_size<T: Growing>(size: u32, name: &str) -> Result<usize, Failure> {
    let size = size as usize;
    if size < T::FIRST_SIZE {
        let needed = T::FIRST_SIZE;
        return Err(Failure::argument(format!(
            "{name}->size is {size}; set it to sizeof *{name}, at least {needed}"
        )));
    }
    Ok(size.min(size_of::<T>()))
}

/// Puts as much of a value as the caller knows of it, and of its size.
///
/// # Safety
/// `place` is null, or points to as many bytes that may be written to as its first field says.
pub(crate) unsafe fn put_growing<T: Growing>(place: *mut T, value: &T, name: &str) -> Result<(), Failure> {
    check_pointer(place, name)?;
    // SAFETY: it begins with its size, and the caller promises that this can be read.
    let size = check_size::<T>(unsafe { place.cast::<u32>().read() }, name)?;
    // SAFETY: so many bytes of both may be used, of one by `check_size`, of the other as the caller promises. They are apart, since
    // `value` is ours.
    unsafe {
        std::ptr::copy_nonoverlapping(std::ptr::from_ref(value).cast::<u8>(), place.cast::<u8>(), size);
        place.cast::<u32>().write(size as u32);
    }
    Ok(())
}

/// What the caller has set of a value that it may leave out, and the rest as it is by default.
///
/// # Safety
/// `place` is null, or points to as many bytes that can be read as its first field says.
pub(crate) unsafe fn take_growing<T: Growing + Default>(place: *const T, name: &str) -> Result<T, Failure> {
    let mut value = T::default();
    if place.is_null() {
        return Ok(value);
    }
    check_pointer(place, name)?;
    // SAFETY: it begins with its size, and the caller promises that this can be read.
    let size = check_size::<T>(unsafe { place.cast::<u32>().read() }, name)?;
    // SAFETY: as in `put_growing`; every pattern of bits is a value of a growing structure.
    unsafe {
        std::ptr::copy_nonoverlapping(place.cast::<u8>(), std::ptr::from_mut(&mut value).cast::<u8>(), size)
    };
    Ok(value)
}

/// Seconds of the caller as a time to wait.
pub(crate) fn duration(seconds: f64, name: &str) -> Result<Duration, Failure> {
    if seconds == f64::INFINITY {
        return Ok(Duration::MAX);
    }
    Duration::try_from_secs_f64(seconds)
        .map_err(|_| Failure::argument(format!("{name} is {seconds} s; it is a time from 0 on, or INFINITY")))
}

/// Puts a text into an array of the caller, cut off between two letters where it is too long, with a zero at its end.
pub(crate) fn put_text<const LENGTH: usize>(text: &str) -> [c_char; LENGTH] {
    let mut array = [0; LENGTH];
    let ends = text.char_indices().map(|(start, letter)| start + letter.len_utf8());
    let cut = ends.take_while(|end| *end < LENGTH).last().unwrap_or(0);
    for (to, from) in array.iter_mut().zip(text.bytes().take(cut)) {
        *to = from.cast_signed();
    }
    array
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    fn text() -> String {
        // SAFETY: it is a text until the next failure of this thread.
        unsafe { CStr::from_ptr(errors::last_words()) }.to_string_lossy().into_owned()
    }

    #[test]
    fn no_panic_crosses_the_border_and_the_next_call_goes_on() {
        let lock = Mutex::new(());
        let panics = || {
            let _held = lock.lock();
            panic!("a defect")
        };
        assert_eq!(enter(panics), takt_result::TAKT_ERROR_DEFECT);
        assert!(text().contains("please report it"), "{}", text());
        assert_eq!(enter_without_words(|| panic!("a defect")), takt_result::TAKT_ERROR_DEFECT);
        assert_eq!(carry_out(|| Ok(())), takt_result::TAKT_OK);
        let refused = carry_out(|| Err(Failure::argument("a count is wrong")));
        assert_eq!((refused, text()), (takt_result::TAKT_ERROR_ARGUMENT, "a count is wrong".to_owned()));
    }

    #[test]
    fn in_a_callback_nothing_is_done_that_may_wait() {
        let is_done = Cell::new(false);
        let called = in_callback(|| {
            enter(|| {
                is_done.set(true);
                Ok(takt_result::TAKT_OK)
            })
        });
        assert_eq!((called, is_done.get()), (takt_result::TAKT_ERROR_IN_CALLBACK, false));
        assert_eq!(carry_out(|| Ok(())), takt_result::TAKT_OK);
    }
}
