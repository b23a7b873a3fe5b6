//! Getting the bottom-half lock out of the way before a frame must leave.

use super::errno;

/// A PREEMPT_RT kernel runs what follows an interrupt (network reception, timers of ordinary threads, RCU callbacks)
/// and every transmission under one lock for each CPU. A thread that holds it can be preempted there; then whoever
/// sends next on that CPU waits for two changes of thread and the rest of the holder's work.
///
/// [`BottomHalfLock::pass`] does that waiting beforehand. A real-time thread that goes on running afterwards, without
/// sleeping, finds the lock free: nobody below its priority comes to run on its CPU and take it.
#[derive(Debug)]
pub(super) struct BottomHalfLock {
    descriptor: libc::c_int,
}

impl BottomHalfLock {
    /// The error is the system's number.
    pub(super) fn new() -> Result<Self, i32> {
        // SAFETY: takes numbers only.
        let descriptor = unsafe { libc::socket(libc::AF_UNIX, libc::SOCK_DGRAM | libc::SOCK_CLOEXEC, 0) };
        if descriptor < 0 { Err(errno()) } else { Ok(Self { descriptor }) }
    }

    /// Returns when nobody else holds the lock of this CPU, having lent its holder the caller's priority.
    ///
    /// Setting an option locks the socket, for which the kernel takes the bottom-half lock (`lock_sock_nested`,
    /// net/core/sock.c). The socket is connected to nothing, and the option is as it was.
    pub(super) fn pass(&self) {
        let off: libc::c_int = 0;
        // SAFETY: the option's value is an `int`, valid for reading. It cannot fail, and only the waiting matters.
        unsafe {
            libc::setsockopt(
                self.descriptor,
                libc::SOL_SOCKET,
                libc::SO_REUSEADDR,
                (&raw const off).cast(),
                size_of::<libc::c_int>() as libc::socklen_t,
            )
        };
    }
}

impl Drop for BottomHalfLock {
    fn drop(&mut self) {
        // SAFETY: the descriptor was made in `new` and belongs to nobody else.
        unsafe { libc::close(self.descriptor) };
    }
}
