//! The descriptor of a socket.

use super::super::errno;

/// A socket descriptor that cannot be duplicated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DescriptorError {
    /// The descriptor that was handed in.
    pub descriptor: i32,
    /// The error number of the system (errno(3)).
    pub errno: i32,
}

impl core::fmt::Display for DescriptorError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "file descriptor {} cannot be duplicated: system error {}", self.descriptor, self.errno)
    }
}

impl core::error::Error for DescriptorError {}

/// Duplicates a descriptor.
pub(super) fn duplicate(descriptor: libc::c_int) -> Result<libc::c_int, DescriptorError> {
    // SAFETY: the call takes numbers only, and refuses a number that is no descriptor.
    let own = unsafe { libc::fcntl(descriptor, libc::F_DUPFD_CLOEXEC, 0) };
    if own < 0 { Err(DescriptorError { descriptor, errno: errno() }) } else { Ok(own) }
}
