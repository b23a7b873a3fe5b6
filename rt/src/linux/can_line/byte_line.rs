//! The system calls on the descriptor of a serial line.

use super::super::can::DescriptorError;
use super::super::clock::timespec_of;
use super::super::errno;
use crate::time::Nanoseconds;

/// A serial line that never waits.
pub(super) trait ByteLine {
    /// Takes bytes that have arrived. `Ok(0)`: the other end has hung up for good.
    ///
    /// # Errors
    /// The error number of the system; `EAGAIN` where nothing has arrived.
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, i32>;

    /// Hands bytes to the line, and returns how many of them it took, the first ones.
    ///
    /// # Errors
    /// The error number of the system; `EAGAIN` where there is no room.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, i32>;

    /// How many of the bytes that the line took have not left it, as far as it knows. Some drivers count in whole buffers.
    fn queued(&self) -> usize;
}

/// The descriptor of a serial line.
pub(super) struct Descriptor(libc::c_int);

impl Descriptor {
    /// Duplicates a descriptor and makes it non-blocking.
    pub(super) fn duplicate(descriptor: i32) -> Result<Self, DescriptorError> {
        // SAFETY: the call takes numbers only, and refuses a number that is no descriptor.
        let own = unsafe { libc::fcntl(descriptor, libc::F_DUPFD_CLOEXEC, 0) };
        if own < 0 {
            return Err(DescriptorError { descriptor, errno: errno() });
        }
        let own = Self(own);
        // SAFETY: the calls take numbers only.
        let is_set = unsafe {
            let flags = libc::fcntl(own.0, libc::F_GETFL);
            flags >= 0 && libc::fcntl(own.0, libc::F_SETFL, flags | libc::O_NONBLOCK) >= 0
        };
        if is_set { Ok(own) } else { Err(DescriptorError { descriptor, errno: errno() }) }
    }

    /// Waits until bytes have arrived, but not longer than `timeout_ns`.
    pub(super) fn wait(&self, timeout_ns: Nanoseconds) {
        let mut entry = libc::pollfd { fd: self.0, events: libc::POLLIN, revents: 0 };
        let timeout = timespec_of(timeout_ns);
        // SAFETY: the entry and the time are valid for the call, and there is no signal mask. The result does not matter: the
        // caller reads the line in any case.
        unsafe { libc::ppoll(&mut entry, 1, &timeout, core::ptr::null()) };
    }
}

impl ByteLine for Descriptor {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, i32> {
        // SAFETY: the buffer is valid for writing for its length.
        let count = unsafe { libc::read(self.0, bytes.as_mut_ptr().cast(), bytes.len()) };
        usize::try_from(count).map_err(|_| errno())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, i32> {
        // SAFETY: the buffer is valid for reading for its length.
        let count = unsafe { libc::write(self.0, bytes.as_ptr().cast(), bytes.len()) };
        usize::try_from(count).map_err(|_| errno())
    }

    fn queued(&self) -> usize {
        let mut bytes: libc::c_int = 0;
        // SAFETY: the request writes one `int`, which is valid for writing.
        let outcome = unsafe { libc::ioctl(self.0, libc::TIOCOUTQ, &mut bytes) };
        if outcome < 0 { 0 } else { usize::try_from(bytes).unwrap_or(0) }
    }
}

impl Drop for Descriptor {
    fn drop(&mut self) {
        // SAFETY: the descriptor was made in `duplicate` and nobody else closes it.
        unsafe { libc::close(self.0) };
    }
}
