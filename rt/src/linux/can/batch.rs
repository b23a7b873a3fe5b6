//! Many frames a system call: `sendmmsg` and `recvmmsg` on a raw CAN socket.

use super::super::clock::nanoseconds_of;
use super::super::errno;
use super::arrival::{Arrival, MessageSource, Sender};
use super::wire_format::{self, EMPTY};
use crate::frame::Frame;
use crate::port::RECEIVE_BATCH;
use crate::time::Nanoseconds;

/// The most frames handed to the kernel in one call.
pub(super) const SEND_BATCH: usize = 64;

/// Room for a time stamp and the overflow counter, with their headers, in bytes.
const CONTROL_BYTES: usize = 64;

#[derive(Clone, Copy)]
#[repr(C, align(8))]
struct Control([u8; CONTROL_BYTES]);

/// The messages of one socket, with the buffers to receive them. The descriptor belongs to the port.
pub(super) struct SocketSource {
    descriptor: libc::c_int,
    frames: [libc::canfd_frame; RECEIVE_BATCH],
    control: [Control; RECEIVE_BATCH],
}

/// Where a message goes.
#[derive(Clone, Copy)]
pub(super) enum Destination {
    /// The interface that the socket is bound to.
    Bound,
    /// The interface of this index.
    Interface(libc::c_int),
}

impl SocketSource {
    /// The messages of the socket `descriptor`, which must live as long as this is used.
    pub(super) const fn new(descriptor: libc::c_int) -> Self {
        Self {
            descriptor,
            frames: [EMPTY; RECEIVE_BATCH],
            control: [Control([0; CONTROL_BYTES]); RECEIVE_BATCH],
        }
    }
}

impl MessageSource for SocketSource {
    fn receive(&mut self, limit: usize, mut take: impl FnMut(Arrival)) -> Result<usize, i32> {
        let mut vectors = [NO_VECTOR; RECEIVE_BATCH];
        let mut headers = [NO_HEADER; RECEIVE_BATCH];
        let buffers = self.frames.iter_mut().zip(&mut self.control);
        for ((header, vector), (frame, control)) in headers.iter_mut().zip(&mut vectors).zip(buffers) {
            vector.iov_base = (&raw mut *frame).cast();
            vector.iov_len = libc::CANFD_MTU;
            header.msg_hdr.msg_iov = vector;
            header.msg_hdr.msg_iovlen = 1;
            header.msg_hdr.msg_control = control.0.as_mut_ptr().cast();
            header.msg_hdr.msg_controllen = CONTROL_BYTES as _;
        }
        let limit = limit.min(RECEIVE_BATCH);
        // SAFETY: the first `limit` headers point to buffers of the stated lengths. The buffers live until the call has
        // returned, and nothing else touches them meanwhile. There is no time-out.
        let count = unsafe {
            libc::recvmmsg(
                self.descriptor,
                headers.as_mut_ptr(),
                limit as libc::c_uint,
                libc::MSG_DONTWAIT as _,
                core::ptr::null_mut(),
            )
        };
        let Ok(count) = usize::try_from(count) else {
            return match errno() {
                libc::EAGAIN | libc::EINTR => Ok(0),
                number => Err(number),
            };
        };
        for (header, frame) in headers.iter().zip(&self.frames).take(count) {
            let (real_time_ns, lost) = ancillary(&header.msg_hdr);
            take(Arrival {
                message: wire_format::read(frame, header.msg_len as usize),
                sender: Sender::of(header.msg_hdr.msg_flags),
                real_time_ns,
                lost,
            });
        }
        Ok(count)
    }
}

/// Hands frames to the kernel without waiting, the first one first, and returns how many it took. Of more frames than
/// [`SEND_BATCH`], it gets the first ones.
///
/// # Errors
/// The error number of the system. The kernel took no frame then.
pub(super) fn send<'a>(
    descriptor: libc::c_int,
    frames: impl Iterator<Item = (Destination, &'a Frame)>,
) -> Result<usize, i32> {
    let mut buffers = [EMPTY; SEND_BATCH];
    let mut addresses = [NO_ADDRESS; SEND_BATCH];
    let mut vectors = [NO_VECTOR; SEND_BATCH];
    let mut headers = [NO_HEADER; SEND_BATCH];
    let mut count = 0;
    let places = headers.iter_mut().zip(&mut vectors).zip(buffers.iter_mut().zip(&mut addresses));
    for (((header, vector), (buffer, address)), (destination, frame)) in places.zip(frames) {
        vector.iov_len = wire_format::write(frame, buffer);
        vector.iov_base = (&raw mut *buffer).cast();
        header.msg_hdr.msg_iov = vector;
        header.msg_hdr.msg_iovlen = 1;
        if let Destination::Interface(index) = destination {
            address.can_ifindex = index;
            header.msg_hdr.msg_name = (&raw mut *address).cast();
            header.msg_hdr.msg_namelen = size_of::<libc::sockaddr_can>() as libc::socklen_t;
        }
        count += 1;
    }
    // SAFETY: the first `count` headers point to addresses and buffers of the stated lengths, which outlive the call.
    let sent = unsafe { libc::sendmmsg(descriptor, headers.as_mut_ptr(), count, libc::MSG_DONTWAIT as _) };
    usize::try_from(sent).map_err(|_| errno())
}

const NO_ADDRESS: libc::sockaddr_can = {
    // SAFETY: it holds numbers only, for which zero is valid.
    let mut address: libc::sockaddr_can = unsafe { core::mem::zeroed() };
    address.can_family = libc::AF_CAN as libc::sa_family_t;
    address
};

const NO_VECTOR: libc::iovec = libc::iovec { iov_base: core::ptr::null_mut(), iov_len: 0 };

const NO_HEADER: libc::mmsghdr = {
    // SAFETY: it holds numbers and pointers, for which zero and null are valid.
    unsafe { core::mem::zeroed() }
};

/// The time stamp and the overflow counter that came with a message.
fn ancillary(header: &libc::msghdr) -> (Option<Nanoseconds>, Option<u32>) {
    let (mut stamp, mut lost) = (None, None);
    // SAFETY: the kernel has filled the control buffer and set its length. The macros stay within it.
    let mut next = unsafe { libc::CMSG_FIRSTHDR(header) };
    // SAFETY: a header that the macros return is within the control buffer, which is aligned for it.
    while let Some(entry) = unsafe { next.as_ref() } {
        if entry.cmsg_level == libc::SOL_SOCKET && entry.cmsg_type == libc::SCM_TIMESTAMPNS {
            // SAFETY: a message of this type holds a `timespec`, and the buffer has room for it. It need not be aligned.
            let time = unsafe { libc::CMSG_DATA(entry).cast::<libc::timespec>().read_unaligned() };
            stamp = Some(nanoseconds_of(&time));
        } else if entry.cmsg_level == libc::SOL_SOCKET && entry.cmsg_type == libc::SO_RXQ_OVFL {
            // SAFETY: a message of this type holds 32 bits, and the buffer has room for them. They need not be aligned.
            lost = Some(unsafe { libc::CMSG_DATA(entry).cast::<u32>().read_unaligned() });
        }
        // SAFETY: as for the first one.
        next = unsafe { libc::CMSG_NXTHDR(header, entry) };
    }
    (stamp, lost)
}
