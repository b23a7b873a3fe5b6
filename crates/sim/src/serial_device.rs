//! Simulated devices on serial lines.

use takt_rt::Nanoseconds;

/// A device at the end of a serial line. It is passive: bytes and times go in, bytes come out.
pub trait SerialDevice: Send {
    /// Takes a byte that has arrived at this time. What the device answers at once goes to `answer`.
    fn receive(&mut self, now_ns: Nanoseconds, byte: u8, answer: &mut Vec<u8>);

    /// Does what is due at this time. Returns when the next thing is due.
    fn advance(&mut self, now_ns: Nanoseconds, answer: &mut Vec<u8>) -> Nanoseconds;
}

/// A kind of simulated device on a serial line.
#[derive(Clone, Copy, Debug)]
pub struct SerialDeviceKind {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub what: &'static str,
    /// What a person has to know to talk to it.
    pub use_words: fn() -> String,
    /// A device whose supply is switched on.
    pub make: fn() -> Box<dyn SerialDevice>,
}
