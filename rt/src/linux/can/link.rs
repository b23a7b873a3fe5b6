//! Asks the kernel whether the interface of a socket can send at all.
//!
//! While an interface is taken down, the kernel takes frames and silently drops them for some milliseconds. Only then the socket
//! gets an error (`ENETDOWN`). The flags of the interface show it earlier: `IFF_RUNNING` is gone as soon as the queue is
//! closed. An interface that is removed unbinds the socket; an [`Attachment`](super::Attachment) binds it anew.

/// The interface that a socket is bound to.
#[derive(Clone, Copy)]
pub(super) struct Link {
    descriptor: libc::c_int,
    /// `None` if the socket is not a CAN socket that is bound to one interface.
    interface: Option<Interface>,
}

#[derive(Clone, Copy)]
struct Interface {
    index: libc::c_int,
    name: [libc::c_char; libc::IFNAMSIZ],
}

impl Link {
    /// The interface of the socket `descriptor`, which must live as long as this is used.
    pub(super) fn of(descriptor: libc::c_int) -> Self {
        let interface = bound_interface(descriptor).filter(|index| *index > 0).and_then(|index| {
            let mut request = NO_REQUEST;
            request.ifr_ifru.ifru_ifindex = index;
            // SAFETY: the call reads the index from the request and writes the name into it.
            let named = unsafe { libc::ioctl(descriptor, libc::SIOCGIFNAME as _, &raw mut request) };
            (named == 0).then_some(Interface { index, name: request.ifr_name })
        });
        Self { descriptor, interface }
    }

    /// The index of the interface in the kernel.
    pub(super) fn index(&self) -> Option<libc::c_int> {
        self.interface.map(|interface| interface.index)
    }

    /// Returns `true` if the interface is down, going down or removed. An unknown interface counts as present.
    ///
    /// The socket may have been bound to another interface since the last call.
    pub(super) fn is_lost(&mut self) -> bool {
        let Some(known) = self.interface else { return false };
        let interface = match bound_interface(self.descriptor) {
            // This check comes first: for the name of a removed interface, the kernel would look for a module of that name.
            Some(0) => return true,
            Some(index) if index != known.index => {
                *self = Self::of(self.descriptor);
                self.interface.unwrap_or(known)
            }
            _ => known,
        };
        let mut request = libc::ifreq { ifr_name: interface.name, ..NO_REQUEST };
        // SAFETY: the call reads the name from the request and writes the flags into it.
        let answered = unsafe { libc::ioctl(self.descriptor, libc::SIOCGIFFLAGS as _, &raw mut request) };
        // SAFETY: the kernel has written the flags if the call succeeded, and any bits are valid flags.
        answered != 0 || !is_running(unsafe { request.ifr_ifru.ifru_flags })
    }
}

/// Returns `true` if an interface with these flags sends the frames that it takes.
const fn is_running(flags: libc::c_short) -> bool {
    let needed = libc::IFF_UP | libc::IFF_RUNNING;
    flags as libc::c_int & needed == needed
}

/// The index of the interface that a CAN socket is bound to; 0 for none, `None` for a socket that is not a CAN socket.
pub(super) fn bound_interface(descriptor: libc::c_int) -> Option<libc::c_int> {
    // SAFETY: it holds numbers only, for which zero is valid.
    let mut address: libc::sockaddr_can = unsafe { core::mem::zeroed() };
    let mut length = size_of::<libc::sockaddr_can>() as libc::socklen_t;
    // SAFETY: the kernel writes no more than `length` bytes.
    let asked = unsafe { libc::getsockname(descriptor, (&raw mut address).cast(), &raw mut length) };
    (asked == 0 && libc::c_int::from(address.can_family) == libc::AF_CAN).then_some(address.can_ifindex)
}

const NO_REQUEST: libc::ifreq = {
    // SAFETY: it holds bytes and numbers only, for which zero is valid.
    unsafe { core::mem::zeroed() }
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_is_lost_from_the_moment_at_which_its_queue_is_closed() {
        assert!(is_running((libc::IFF_UP | libc::IFF_RUNNING | libc::IFF_NOARP) as libc::c_short));
        assert!(!is_running((libc::IFF_UP | libc::IFF_NOARP) as libc::c_short));
        assert!(!is_running(libc::IFF_RUNNING as libc::c_short));
        assert!(!is_running(0));
    }

    #[test]
    fn a_socket_of_another_family_or_none_has_no_interface_to_lose() {
        let mut ends = [0; 2];
        // SAFETY: `ends` has room for both descriptors.
        assert_eq!(unsafe { libc::socketpair(libc::AF_UNIX, libc::SOCK_DGRAM, 0, ends.as_mut_ptr()) }, 0);
        assert!(!Link::of(ends[0]).is_lost());
        // SAFETY: both are ours.
        unsafe { (libc::close(ends[0]), libc::close(ends[1])) };
        assert!(!Link::of(-1).is_lost());
    }

    #[test]
    fn the_kernel_tells_the_name_and_the_flags_of_an_interface() {
        // The loopback is everywhere, and any socket may ask for it.
        // SAFETY: makes a descriptor.
        let socket = unsafe { libc::socket(libc::AF_UNIX, libc::SOCK_DGRAM, 0) };
        let mut request = NO_REQUEST;
        request.ifr_name[0] = b'l' as libc::c_char;
        request.ifr_name[1] = b'o' as libc::c_char;
        // SAFETY: as in `is_lost`.
        assert_eq!(unsafe { libc::ioctl(socket, libc::SIOCGIFFLAGS as _, &raw mut request) }, 0);
        // SAFETY: as in `is_lost`.
        let flags = unsafe { request.ifr_ifru.ifru_flags };
        assert!(i32::from(flags) & libc::IFF_LOOPBACK != 0, "{flags:#x}");
        // SAFETY: it is ours.
        unsafe { libc::close(socket) };
    }
}
