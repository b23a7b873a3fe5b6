//! Getting the locks that sending takes out of the way before a frame must leave.

use super::errno;

/// The kernel's way of sending a frame, to be walked beforehand without one.
///
/// On a PREEMPT_RT kernel every transmission takes locks of its CPU: those of the allocator that its buffer comes from,
/// and the bottom-half lock, under which everything that follows an interrupt runs as well (network reception, timers of
/// ordinary threads, RCU callbacks). A thread can be preempted while it holds one. Whoever sends next on that CPU then
/// waits for two changes of thread and the rest of the holder's work.
///
/// [`SendPath::walk`] does that waiting. A real-time thread that goes on running afterwards, without sleeping, finds the
/// locks free: nobody below its priority comes to run on its CPU and take them.
#[derive(Debug)]
pub(super) struct SendPath {
    /// A raw CAN socket that is bound to no interface, and so receives nothing.
    descriptor: libc::c_int,
}

/// The kernel's number of the loopback interface in every network namespace (include/net/net_namespace.h).
const LOOPBACK_INDEX: libc::c_int = 1;

impl SendPath {
    /// The error is the system's number.
    pub(super) fn new() -> Result<Self, i32> {
        // SAFETY: takes numbers only.
        let descriptor =
            unsafe { libc::socket(libc::AF_CAN, libc::SOCK_RAW | libc::SOCK_CLOEXEC, libc::CAN_RAW) };
        if descriptor < 0 { Err(errno()) } else { Ok(Self { descriptor }) }
    }

    /// Returns when nobody else holds a lock of this CPU that sending takes, having lent the holder the caller's
    /// priority. Two system calls, neither of which has an effect:
    ///
    /// - a frame to the loopback interface, which is none of CAN's: the kernel allocates the frame's buffer, and then
    ///   finds that out and gives it back (`can_send`, net/can/af_can.c);
    /// - an option set to what it is: the kernel locks the socket, for which it takes the bottom-half lock
    ///   (`lock_sock_nested`, net/core/sock.c).
    ///
    /// Both are needed: of 8000 frames on a loaded CPU the latest was 22 µs late without them, 27 µs with the second call
    /// alone, 22 µs with the first alone, and 7 µs with both.
    pub(super) fn walk(&self) {
        // SAFETY: all-zero bytes are a valid address and a valid frame.
        let (mut address, frame): (libc::sockaddr_can, libc::can_frame) = unsafe { core::mem::zeroed() };
        address.can_family = libc::AF_CAN as libc::sa_family_t;
        address.can_ifindex = LOOPBACK_INDEX;
        let off: libc::c_int = 0;
        // SAFETY: frame, address and option are valid for reading and as long as is said. That the first call is
        // refused is its purpose, and the second one cannot fail.
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
        // SAFETY: the descriptor was made in `new` and belongs to nobody else.
        unsafe { libc::close(self.descriptor) };
    }
}
