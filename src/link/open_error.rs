//! A bus that cannot be opened.

use super::converter::ConverterError;
use super::interface::InterfaceError;
use super::serial_line::SerialLineError;
use super::slcan::SlcanError;
use super::socketcan::SocketCanError;

/// A bus that cannot be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The interface is missing, down or set up differently.
    #[error("bus `{bus}`: {error}")]
    Interface {
        /// The name of the bus.
        bus: String,
        /// The reason.
        #[source]
        error: InterfaceError,
    },
    /// No socket could be opened on the interface.
    #[error("bus `{bus}`: {error}")]
    Socket {
        /// The name of the bus.
        bus: String,
        /// The reason.
        #[source]
        error: SocketCanError,
    },
    /// The converter on the serial line cannot be used.
    #[error("bus `{bus}`: {error}")]
    Converter {
        /// The name of the bus.
        bus: String,
        /// The reason.
        #[source]
        error: ConverterError,
    },
    /// The serial line cannot be used.
    #[error("bus `{bus}`: {error}")]
    Line {
        /// The name of the bus.
        bus: String,
        /// The reason.
        #[source]
        error: SerialLineError,
    },
    /// A serial line where a CAN bus is needed.
    #[error("bus `{bus}`: {interface} is a serial line, and no CAN bus")]
    NotCan {
        /// The name of the bus.
        bus: String,
        /// The interface.
        interface: String,
    },
    /// The adapter on the serial line cannot be used.
    #[error("bus `{bus}`: {error}")]
    Slcan {
        /// The name of the bus.
        bus: String,
        /// The reason.
        #[source]
        error: SlcanError,
    },
}

impl OpenError {
    /// Returns `true` if another program has the serial line.
    pub const fn is_line_taken(&self) -> bool {
        matches!(
            self,
            Self::Slcan { error: SlcanError::Line(SerialLineError::Busy { .. }), .. }
                | Self::Converter { error: ConverterError::Line(SerialLineError::Busy { .. }), .. }
                | Self::Line { error: SerialLineError::Busy { .. }, .. }
        )
    }
}
