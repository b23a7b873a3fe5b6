//! The client of a procedure: the master's side of one protocol with one drive.

use takt_rt::Nanoseconds;

/// Makes the messages that a procedure sends to its drive, and evaluates those that it receives.
pub trait Client {
    /// A frame of a bus, or the bytes of a serial line.
    type Message;

    /// The next message to send, if one is due. It is called until it returns `None`.
    fn poll(&mut self, now_ns: Nanoseconds) -> Option<Self::Message>;

    /// Takes a received message. Messages of other drives are ignored.
    fn receive(&mut self, message: &Self::Message);
}
