//! A Modbus line of this machine with its clock: what a procedure needs.

use std::time::{Duration, Instant};

use takt_rt::Nanoseconds;

use super::serial_line::{SerialLine, SerialLineError, SerialSettings};

/// How long a read waits: the time of procedures goes on in such steps.
const TICK: Duration = Duration::from_millis(1);

/// An open line with its clock.
#[derive(Debug)]
pub struct ModbusLine {
    line: SerialLine,
    began: Instant,
}

impl ModbusLine {
    /// Opens a line.
    ///
    /// # Errors
    /// See [`SerialLineError`].
    pub fn open(device: &str, settings: &SerialSettings) -> Result<Self, SerialLineError> {
        Ok(Self { line: SerialLine::open(device, settings)?, began: Instant::now() })
    }

    /// The time since the line was opened.
    pub fn now_ns(&self) -> Nanoseconds {
        u64::try_from(self.began.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    /// Waits a moment for bytes. None have come if it returns none.
    ///
    /// # Errors
    /// The line does not work any more.
    pub fn read(&mut self) -> Result<Vec<u8>, SerialLineError> {
        let mut bytes = [0; 512];
        let count = self.line.read(&mut bytes, TICK)?;
        Ok(bytes.get(..count).unwrap_or_default().to_vec())
    }

    /// Sends bytes.
    ///
    /// # Errors
    /// The line does not work any more.
    pub fn write(&self, bytes: &[u8]) -> Result<(), SerialLineError> {
        self.line.write(bytes)
    }
}
