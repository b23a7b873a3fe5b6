//! What is wrong with what an interface is called.

use std::ops::RangeInclusive;

use thiserror::Error;

/// The baud rate that the manuals of SLCAN adapters name, and that of a converter.
pub const USUAL_BAUD_RATE: u32 = 1_000_000;
/// What chips for serial lines can do, from the slowest to the fastest.
pub const BAUD_RATES: RangeInclusive<u32> = 9_600..=12_000_000;

/// What is wrong with what an interface is called.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum InterfaceError {
    /// Not the path of a device.
    #[error("{given:?} cannot be the path of a serial line")]
    Device {
        /// What was given.
        given: String,
    },
    /// Not a baud rate.
    #[error("{given:?} cannot be the baud rate of a serial line")]
    BaudRate {
        /// What was given.
        given: String,
    },
    /// Not a name that a network interface of Linux can have.
    #[error("{name:?} cannot be the name of a network interface")]
    Name {
        /// The name.
        name: String,
    },
}

impl InterfaceError {
    /// What to do about it.
    pub fn help(&self) -> String {
        match self {
            Self::Device { .. } => {
                "name the device by its whole path: \"slcan:/dev/ttyACM0\", \"serial:/dev/ttyUSB0\", or \
                 \"serial:/dev/serial/by-id/…\", which stays the same when adapters are plugged in another order"
                    .to_owned()
            }
            Self::BaudRate { .. } => format!(
                "a whole number of {} to {} behind the path: \"slcan:/dev/ttyUSB0@2000000\", \"serial:/dev/ttyUSB0@19200\"; \
                 without it the line of an SLCAN adapter has {USUAL_BAUD_RATE} baud, and one with drives the `bit_rate` of its bus",
                BAUD_RATES.start(),
                BAUD_RATES.end()
            ),
            Self::Name { .. } => {
                "\"sim\", a name of at most 15 letters, digits and -_. as `ip link` shows it (\"can0\", \"vcan0\"), or \
                 \"slcan:\" and the path of an adapter on a serial line; \"rs485-canfd:\" and that of a converter between RS-485 and CAN FD; \
                 \"serial:\" and that of a line with drives on it"
                    .to_owned()
            }
        }
    }
}
