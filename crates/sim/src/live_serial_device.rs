//! The loop that puts a simulated device behind a pseudo-terminal.

use std::io::{ErrorKind, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use takt_rt::linux::MonotonicClock;
use takt_rt::{Clock, Nanoseconds};

use super::pseudo_terminal::PseudoTerminal;
use super::serial_device::{SerialDevice, SerialDeviceKind};

/// Every kind.
pub fn kinds() -> &'static [SerialDeviceKind] {
    &super::hollow_lines::DEVICES
}

/// The longest wait, so that a request to stop is noticed.
const LONGEST_WAIT_NS: Nanoseconds = 20_000_000;
/// Bytes that wait for a host that does not read. A device has no memory for more: they are lost.
const UNREAD_BYTES: usize = 4_096;

/// A device behind a pseudo-terminal.
pub struct LiveSerialDevice {
    line: PseudoTerminal,
    device: Box<dyn SerialDevice>,
    answer: Vec<u8>,
    epoch_ns: Nanoseconds,
}

impl LiveSerialDevice {
    /// This device at the end of this line. It is switched on now.
    pub fn new(line: PseudoTerminal, device: Box<dyn SerialDevice>) -> Self {
        Self { line, device, answer: vec![], epoch_ns: MonotonicClock::default().now_ns() }
    }

    /// The path of the line for a host.
    pub fn path(&self) -> String {
        self.line.linked_path().unwrap_or(self.line.path()).display().to_string()
    }

    /// Runs until `is_stopped`.
    ///
    /// # Errors
    /// What the system said when the line could not be used any more.
    pub fn run(&mut self, is_stopped: &AtomicBool) -> std::io::Result<()> {
        while !is_stopped.load(Ordering::Relaxed) {
            let next_ns = self.poll()?;
            self.line.wait(next_ns.saturating_sub(self.now_ns()).min(LONGEST_WAIT_NS));
        }
        Ok(())
    }

    fn now_ns(&self) -> Nanoseconds {
        MonotonicClock::default().now_ns().saturating_sub(self.epoch_ns)
    }

    /// Does what is due, and returns when the next thing is due unless a byte arrives before.
    fn poll(&mut self) -> std::io::Result<Nanoseconds> {
        let mut bytes = [0; 256];
        let count = match self.line.read(&mut bytes) {
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::WouldBlock => 0,
            Err(error) => return Err(error),
        };
        let now_ns = self.now_ns();
        for byte in bytes.iter().take(count) {
            self.device.receive(now_ns, *byte, &mut self.answer);
        }
        let next_ns = self.device.advance(now_ns, &mut self.answer);
        match self.line.write(&self.answer) {
            Ok(written) => drop(self.answer.drain(..written)),
            Err(error) if error.kind() == ErrorKind::WouldBlock => self.answer.truncate(UNREAD_BYTES),
            Err(error) => return Err(error),
        }
        Ok(next_ns)
    }
}
