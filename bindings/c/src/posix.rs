//! What a library must know of the threads and processes of a program in C: cancellation, and forks.

use std::ffi::c_int;
use std::ptr;
use std::sync::Once;
use std::sync::atomic::{AtomicU64, Ordering};

/// A handler of pthread_atfork().
type ForkHandler = Option<unsafe extern "C" fn()>;

unsafe extern "C" {
    fn pthread_setcancelstate(state: c_int, before: *mut c_int) -> c_int;
    fn pthread_atfork(prepare: ForkHandler, parent: ForkHandler, child: ForkHandler) -> c_int;
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

/// Number of forks between the process that has called [`count_forks`] first and this one.
static FORKS: AtomicU64 = AtomicU64::new(0);

unsafe extern "C" fn after_fork() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

/// Counts forks from now on. To ask for the number of the process in every call would be a system call in each.
pub(crate) fn count_forks() {
    static ONCE: Once = Once::new();
    // SAFETY: the handler is one atomic operation. Without memory this fails, and forks are not counted.
    ONCE.call_once(|| unsafe {
        pthread_atfork(None, None, Some(after_fork));
    });
}

/// Number of forks before this process.
pub(crate) fn forks() -> u64 {
    FORKS.load(Ordering::Relaxed)
}
