//! The socket of a bus.

use super::super::clock::timespec_of;
use super::accounting::TxRxAccounting;
use super::attachment::Attachment;
use super::batch::{self, Destination, SEND_BATCH, SocketSource};
use super::descriptor::{DescriptorError, duplicate};
use super::link::Link;
use crate::frame::Frame;
use crate::port::BusState;
use crate::time::Nanoseconds;

/// A raw CAN socket as a bus port.
///
/// The caller opens and configures the socket. The port needs these settings:
///
/// - own frames are received back (`CAN_RAW_RECV_OWN_MSGS`), and the filters let them pass. Otherwise
///   [`BusPort::unconfirmed`](crate::port::BusPort::unconfirmed) never returns to zero. A frame that does not come back is lost when a later
///   one has.
///
/// The port uses these settings where they are on: error frames, kernel time stamps (`SO_TIMESTAMPNS`), the overflow
/// counter (`SO_RXQ_OVFL`), CAN FD frames. Its calls never wait, even on a blocking socket.
///
/// # State of the interface
/// An interface that goes down is [`BusState::Down`] from the first frame that it has dropped. It comes back by itself. An interface
/// that is removed (an adapter is unplugged) unbinds the socket; an [`Attachment`] binds it to the interface that takes its place.
///
/// An error-passive controller is error-active when its driver says so. Some drivers do not: then it is, after 10,000 own frames and a
/// received one without an error.
///
/// # Time of arrival
/// The kernel stamps a frame on `CLOCK_REALTIME` when the driver hands it over. The stamp is moved to the monotonic clock
/// by the difference of both clocks at the time of reading. A stamp more than 1 s in the future is replaced by the present.
pub struct SocketCanPort {
    pub(super) descriptor: libc::c_int,
    pub(super) link: Link,
    pub(super) source: SocketSource,
    pub(super) accounting: TxRxAccounting,
    /// True if the bus is set up for CAN FD frames.
    takes_fd: bool,
}

impl SocketCanPort {
    /// Makes a port on the socket `descriptor`. The descriptor is duplicated: the caller keeps and closes its own.
    ///
    /// The bit rates in bit/s say how long a frame occupies the wire, for the bus load; `data_bit_rate` is for the data phase
    /// of CAN FD frames. Without it the bus is a classic one, on which every node would answer a CAN FD frame with an
    /// error: the port refuses such frames.
    ///
    /// # Errors
    /// [`DescriptorError`] where the descriptor is not an open one, or the process has no more descriptors.
    pub fn new(descriptor: i32, bit_rate: u32, data_bit_rate: Option<u32>) -> Result<Self, DescriptorError> {
        let own = duplicate(descriptor)?;
        Ok(Self {
            descriptor: own,
            link: Link::of(own),
            source: SocketSource::new(own),
            accounting: TxRxAccounting::new(bit_rate, data_bit_rate),
            takes_fd: data_bit_rate.is_some(),
        })
    }

    /// This port, of a controller that is in this state now. A driver reports changes alone; without this, a port begins as
    /// error-active.
    #[must_use]
    pub fn begun_in(mut self, state: BusState) -> Self {
        self.accounting.begin_in(state);
        self
    }

    /// Returns the attachment of the socket, by which another thread binds it to an interface anew.
    ///
    /// # Errors
    /// [`DescriptorError`] where the process has no more descriptors.
    pub fn attachment(&self) -> Result<Attachment, DescriptorError> {
        Attachment::of(self.descriptor)
    }

    /// Waits until a message has arrived, but not longer than `timeout_ns`.
    ///
    /// This is for programs that react to frames, such as a simulated drive. The cycle waits for the clock instead.
    pub fn wait(&self, timeout_ns: Nanoseconds) {
        let mut entry = libc::pollfd { fd: self.descriptor, events: libc::POLLIN, revents: 0 };
        let timeout = timespec_of(timeout_ns);
        // SAFETY: the entry and the time are valid for the call, and there is no signal mask. The result does not matter: the
        // caller reads the socket in any case.
        unsafe { libc::ppoll(&mut entry, 1, &timeout, core::ptr::null()) };
    }

    /// The first frames, as far as the bus may carry them: no CAN FD frame on a classic bus, and none behind it.
    pub(super) fn permitted<'f>(&self, frames: &'f [Frame]) -> &'f [Frame] {
        let is_refused = |frame: &Frame| frame.is_fd() && !self.takes_fd;
        frames.split(is_refused).next().unwrap_or_default()
    }

    /// Sends on this socket alone; see [`BusPort::send`](crate::port::BusPort::send).
    pub(super) fn send_alone(&mut self, frames: &[Frame]) -> usize {
        let permitted = self.permitted(frames);
        let taken = self.send_permitted(permitted);
        if taken == permitted.len() && taken < frames.len() {
            self.accounting.refused(frames.len() - taken, libc::EINVAL);
        }
        taken
    }

    fn send_permitted(&mut self, frames: &[Frame]) -> usize {
        let mut taken = 0;
        for chunk in frames.chunks(SEND_BATCH) {
            let refusal =
                match batch::send(self.descriptor, chunk.iter().map(|frame| (Destination::Bound, frame))) {
                    Ok(count) => {
                        self.accounting.taken(chunk.get(..count).unwrap_or(chunk));
                        taken += count;
                        // The kernel does not say why it stopped in the middle. A full queue is the usual reason; with any
                        // other one, the next call says it.
                        (count < chunk.len()).then_some(libc::ENOBUFS)
                    }
                    Err(errno) => Some(errno),
                };
            if let Some(errno) = refusal {
                self.accounting.refused(frames.len().saturating_sub(taken), errno);
                break;
            }
        }
        taken
    }
}

impl Drop for SocketCanPort {
    fn drop(&mut self) {
        // SAFETY: the descriptor was made in `new` and nobody else closes it.
        unsafe { libc::close(self.descriptor) };
    }
}

impl core::fmt::Debug for SocketCanPort {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("SocketCanPort").field("accounting", &self.accounting).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn a_number_that_is_no_descriptor_is_refused_by_name() {
        let error = SocketCanPort::new(-1, 1_000_000, None).unwrap_err();
        assert_eq!(error, DescriptorError { descriptor: -1, errno: libc::EBADF });
        assert_eq!(error.to_string(), "file descriptor -1 cannot be duplicated: system error 9");
    }
}
