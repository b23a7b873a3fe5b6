//! Takes and releases the locks of sending shortly before a frame must leave.

use super::errno;

/// The path that a frame takes through the kernel. It can be walked in advance, without a frame.
///
/// On a PREEMPT_RT kernel, every transmission takes locks of its CPU: the locks of the allocator for its buffer, and the
/// bottom-half lock. Under that lock runs all work that follows interrupts (network reception, timers of ordinary threads,
/// RCU callbacks). A thread can be preempted while it holds such a lock. Then the next sender on that CPU waits for two
/// thread switches and for the rest of the holder's work.
///
/// [`SendPath::walk`] does that waiting in advance. A real-time thread that goes on running afterwards, without sleeping, finds
/// the locks free: no thread of lower priority runs on its CPU and takes them.
#[derive(Debug)]
pub(super) struct SendPath {
    /// A raw CAN socket. It is bound to no interface, so it receives nothing.
    descriptor: libc::c_int,
}

/// The index of the loopback interface in every network namespace (include/net/net_namespace.h).
const LOOPBACK_INDEX: libc::c_int = 1;

impl SendPath {
    /// Opens the socket.
    ///
    /// # Errors
    /// The error number of the system, for example where the kernel has no CAN.
    pub(super) fn new() -> Result<Self, i32> {
        // SAFETY: the call takes numbers only.
        let descriptor =
            unsafe { libc::socket(libc::AF_CAN, libc::SOCK_RAW | libc::SOCK_CLOEXEC, libc::CAN_RAW) };
        if descriptor < 0 { Err(errno()) } else { Ok(Self { descriptor }) }
    }

    /// Returns when nobody else holds a lock of this CPU that sending takes. Meanwhile the holder inherits the caller's priority.
    ///
    /// It makes two system calls without an effect:
    ///
    /// - It sends a frame to the loopback interface, which is not a CAN interface. The kernel allocates the buffer of the frame,
    ///   then notices the interface and frees the buffer (`can_send`, net/can/af_can.c).
    /// - It sets an option to the value that it has. The kernel locks the socket, for which it takes the bottom-half lock
    ///   (`lock_sock_nested`, net/core/sock.c).
    ///
    /// Both calls are needed. Of 8,000 frames on a loaded CPU, the latest was 22 µs late without them, 27 µs with the second
    /// call alone, 22 µs with the first call alone, and 7 µs with both.
    pub(super) fn walk(&self) {
        // SAFETY: all-zero bytes are a valid address and a valid frame.
        let (mut address, frame): (libc::sockaddr_can, libc::can_frame) = unsafe { core::mem::zeroed() };
        address.can_family = libc::AF_CAN as libc::sa_family_t;
        address.can_ifindex = LOOPBACK_INDEX;
        let off: libc::c_int = 0;
        // SAFETY: frame, address and option are valid for reading and have the stated sizes. The first call is meant to be
        // refused, and the second one cannot fail.
        unsafe {
            libc::sendto(
                self.descriptor,
                (&raw const frame).cast(),
                size_of_val(&frame),
                libc::MSG_DONTWAIT,
                (&raw const address).cast(),
                size_of_val(&address) as libc::socklen_t,
            );
            libc::setsockopt(
                self.descriptor,
                libc::SOL_SOCKET,
                libc::SO_REUSEADDR,
                (&raw const off).cast(),
                size_of_val(&off) as libc::socklen_t,
            );
        }
    }
}

impl Drop for SendPath {
    fn drop(&mut self) {
        // SAFETY: `new` made the descriptor, and nobody else closes it.
        unsafe { libc::close(self.descriptor) };
    }
}
