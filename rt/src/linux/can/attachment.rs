//! Binds the socket of a port anew when its interface was removed and is there again.

use arrayvec::ArrayVec;

use super::super::errno;
use super::descriptor::{DescriptorError, duplicate};
use super::link::bound_interface;

/// The most filters that a socket takes (`CAN_RAW_FILTER_MAX`).
const FILTERS: usize = 512;

/// The attachment of a [`SocketCanPort`](super::SocketCanPort)'s socket to an interface.
///
/// An interface that is removed (an adapter is unplugged) unbinds the socket, and the kernel forgets its filters. An interface that is
/// there again, even under the same name, is another one with another index. The calls here may wait, so they are made beside the
/// cycle. The port notices the new interface by itself.
pub struct Attachment {
    descriptor: libc::c_int,
    /// Those that the socket had when this was made.
    filters: ArrayVec<libc::can_filter, FILTERS>,
}

impl Attachment {
    /// Returns that of the socket `descriptor`, which is duplicated.
    pub(super) fn of(descriptor: libc::c_int) -> Result<Self, DescriptorError> {
        let descriptor = duplicate(descriptor)?;
        Ok(Self { descriptor, filters: filters_of(descriptor) })
    }

    /// Returns `true` if the socket has lost its interface.
    pub fn is_removed(&self) -> bool {
        bound_interface(self.descriptor) == Some(0)
    }

    /// Binds the socket to the interface with this index, with the filters that it had.
    ///
    /// # Errors
    /// The error number of the system (errno(3)).
    pub fn renew(&self, interface_index: i32) -> Result<(), i32> {
        // SAFETY: it holds numbers only, for which zero is valid.
        let mut address: libc::sockaddr_can = unsafe { core::mem::zeroed() };
        address.can_family = libc::AF_CAN as libc::sa_family_t;
        address.can_ifindex = interface_index;
        let length = size_of::<libc::sockaddr_can>() as libc::socklen_t;
        // SAFETY: the kernel reads `length` bytes of the address.
        if unsafe { libc::bind(self.descriptor, (&raw const address).cast(), length) } != 0 {
            return Err(errno());
        }
        let length = size_of_val(self.filters.as_slice()) as libc::socklen_t;
        // SAFETY: the kernel reads `length` bytes of the filters.
        let set = unsafe {
            libc::setsockopt(
                self.descriptor,
                libc::SOL_CAN_RAW,
                libc::CAN_RAW_FILTER,
                self.filters.as_ptr().cast(),
                length,
            )
        };
        if set == 0 { Ok(()) } else { Err(errno()) }
    }
}

/// Returns the filters of a socket; none for a socket that is not a CAN socket.
fn filters_of(descriptor: libc::c_int) -> ArrayVec<libc::can_filter, FILTERS> {
    let mut filters = [libc::can_filter { can_id: 0, can_mask: 0 }; FILTERS];
    let mut length = size_of_val(&filters) as libc::socklen_t;
    // SAFETY: the kernel writes no more than `length` bytes, and any numbers are valid filters.
    let read = unsafe {
        libc::getsockopt(
            descriptor,
            libc::SOL_CAN_RAW,
            libc::CAN_RAW_FILTER,
            filters.as_mut_ptr().cast(),
            &raw mut length,
        )
    };
    let count = if read == 0 { length as usize / size_of::<libc::can_filter>() } else { 0 };
    filters.into_iter().take(count).collect()
}

impl Drop for Attachment {
    fn drop(&mut self) {
        // SAFETY: the descriptor was made in `of` and nobody else closes it.
        unsafe { libc::close(self.descriptor) };
    }
}

impl core::fmt::Debug for Attachment {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Attachment").field("filters", &self.filters.len()).finish_non_exhaustive()
    }
}
