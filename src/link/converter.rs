//! Opens a transparent converter between RS-485 and CAN FD on a serial line as a bus port for the real-time thread.

use std::os::fd::AsRawFd;
use std::time::{Duration, Instant};

use takt_rt::linux::{DescriptorError, TransparentPort};
use thiserror::Error;

use super::serial_line::{SerialLine, SerialLineError, SerialSettings};
use crate::config::CanLine;

/// The line is silent when nothing has come for this time.
const SILENCE: Duration = Duration::from_millis(5);
/// How long to wait for silence: what a program before this one had asked for is answered by then.
const QUIETENING_TIME: Duration = Duration::from_millis(100);

/// Why a converter cannot be used. The message ends with the cure.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ConverterError {
    /// The serial line cannot be used.
    #[error(transparent)]
    Line(#[from] SerialLineError),
    /// The line cannot be handed to the real-time thread.
    #[error("{device}: {error}")]
    Descriptor {
        /// The path.
        device: String,
        /// What the system said.
        #[source]
        error: DescriptorError,
    },
}

/// Opens the line of a converter. A converter has no commands of its own: whether one is there shows in the first reply.
///
/// This waits for the line, so it is not for the real-time thread. The port that it returns never waits.
///
/// # Errors
/// See [`ConverterError`].
pub fn open_converter(line: &CanLine, bit_rate: u32) -> Result<TransparentPort, ConverterError> {
    let CanLine { device, baud_rate } = line;
    let mut open = SerialLine::open(device, &SerialSettings::new(*baud_rate))?;
    let end = Instant::now() + QUIETENING_TIME;
    let mut bytes = [0; 256];
    while Instant::now() < end && open.read(&mut bytes, SILENCE)? > 0 {}
    TransparentPort::transparent(open.descriptor().as_raw_fd(), bit_rate)
        .map_err(|error| ConverterError::Descriptor { device: device.clone(), error })
}
