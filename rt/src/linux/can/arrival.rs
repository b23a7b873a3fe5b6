//! A message as the kernel hands it over, and where messages come from.

use super::wire_format::Message;
use crate::time::Nanoseconds;

/// One message as the kernel handed it over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arrival {
    /// What it holds.
    pub(super) message: Message,
    /// Who sent it.
    pub(super) sender: Sender,
    /// When the kernel saw it, on `CLOCK_REALTIME`; `None` without a time stamp.
    pub(super) real_time_ns: Option<Nanoseconds>,
    /// How many messages this socket has lost so far because its buffer was full (`SO_RXQ_OVFL`), modulo 2³².
    pub(super) lost: Option<u32>,
}

/// Who sent a message, as far as the kernel tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sender {
    /// This socket: the message is back from the wire (`MSG_CONFIRM`).
    ThisSocket,
    /// Another socket of this machine (`MSG_DONTROUTE`).
    ThisMachine,
    /// Another device on the bus.
    Wire,
}

impl Sender {
    /// The sender by the flags of the received message (recvmsg(2)).
    pub(super) const fn of(flags: libc::c_int) -> Self {
        if flags & libc::MSG_CONFIRM != 0 {
            Self::ThisSocket
        } else if flags & libc::MSG_DONTROUTE != 0 {
            Self::ThisMachine
        } else {
            Self::Wire
        }
    }
}

/// Where messages come from: the kernel's socket, or a script in a test.
pub(super) trait MessageSource {
    /// Takes up to `limit` messages without waiting, hands each to `take`, and returns how many there were.
    ///
    /// # Errors
    /// The error number of the system. An empty queue is not an error.
    fn receive(&mut self, limit: usize, take: impl FnMut(Arrival)) -> Result<usize, i32>;
}
