//! What a library must know of the threads and processes of a program in C: cancellation, and forks.

use std::alloc::{self, Layout};
use std::ffi::{c_int, c_void};
use std::ptr;
use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering};

unsafe extern "C" {
    fn pthread_setcancelstate(state: c_int, before: *mut c_int) -> c_int;
    fn madvise(at: *mut c_void, length: usize, advice: c_int) -> c_int;
}

unsafe extern "C-unwind" {
    fn pthread_testcancel();
}

/// Ends this thread if it has been cancelled, as the functions of POSIX do that wait. The last thing that a function of the header does: the
/// frames that are unwound, up to that of the program, have nothing left to drop.
pub(crate) fn cancellation_point() {
    // SAFETY: it takes nothing. It unwinds through functions that may be unwound, and have nothing to drop.
    unsafe { pthread_testcancel() };
}

/// Value of glibc and of musl.
const PTHREAD_CANCEL_DISABLE: c_int = 1;

/// While it lives, pthread_cancel() does not end this thread: its unwinding would end the process at the first function in Rust.
pub(crate) struct NotCancelled {
    state_before: c_int,
}

impl NotCancelled {
    pub(crate) fn new() -> Self {
        let mut state_before = PTHREAD_CANCEL_DISABLE;
        // SAFETY: it writes to the place that it is given, and may be called in a signal handler.
        unsafe { pthread_setcancelstate(PTHREAD_CANCEL_DISABLE, &raw mut state_before) };
        Self { state_before }
    }
}

impl Drop for NotCancelled {
    fn drop(&mut self) {
        // SAFETY: as in `new`. It is no cancellation point.
        unsafe { pthread_setcancelstate(self.state_before, ptr::null_mut()) };
    }
}

/// Mark of the process that has written it, in memory that a fork finds empty: also one by _Fork() or clone(), which run no handler of
/// pthread_atfork() (madvise(2), Linux 4.14). To ask for the number of the process in every call would be a system call in each.
static MARK: AtomicPtr<AtomicU64> = AtomicPtr::new(ptr::null_mut());

/// Marks of this process and those before it.
static MARKS: AtomicU64 = AtomicU64::new(0);

/// Marks this process, if it is not marked yet. Without memory this fails, and forks are not noticed.
pub(crate) fn mark_process() {
    if MARK.load(Ordering::Relaxed).is_null() {
        MARK.store(wiped_on_fork().unwrap_or(ptr::null_mut()), Ordering::Relaxed);
    }
    if let Some(mark) = mark().filter(|mark| mark.load(Ordering::Relaxed) == 0) {
        mark.store(MARKS.fetch_add(1, Ordering::Relaxed) + 1, Ordering::Relaxed);
    }
}

/// Returns the mark of this process: 0 before it is marked.
pub(crate) fn process_mark() -> u64 {
    mark().map_or(0, |mark| mark.load(Ordering::Relaxed))
}

fn mark() -> Option<&'static AtomicU64> {
    // SAFETY: it is null, or points to a page that is never unmapped.
    unsafe { MARK.load(Ordering::Relaxed).as_ref() }
}

/// Returns zero in memory that the kernel wipes in every child.
fn wiped_on_fork() -> Option<*mut AtomicU64> {
    /// `MADV_WIPEONFORK` of Linux.
    const WIPE_ON_FORK: c_int = 18;
    /// Pages are no larger on any machine that Linux runs on.
    const LARGEST_PAGE: usize = 1 << 16;
    let pages = Layout::from_size_align(LARGEST_PAGE, LARGEST_PAGE).ok()?;
    // SAFETY: the memory is whole pages of its own, and is never freed. The word is written before anybody reads it.
    unsafe {
        let page = alloc::alloc(pages);
        if page.is_null() || madvise(page.cast(), pages.size(), WIPE_ON_FORK) != 0 {
            return None;
        }
        page.cast::<u64>().write(0);
        Some(page.cast())
    }
}
