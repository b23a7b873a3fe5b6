//! Opens an interface for a bus: brings it up as far as that is permitted, and opens a port on it.

use super::converter::ConverterError;
use super::interface::{InterfaceError, InterfaceSettings, interface_status};
use super::port::LinkPort;
use super::real_interface::RealInterface;
use super::serial_line::SerialLineError;
use super::slcan::SlcanError;
use super::socketcan::{SocketCanError, SocketCanOptions};

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

/// Prepares an interface and opens a port on it, for the bus of this name.
///
/// # Errors
/// See [`OpenError`].
pub fn open_interface(
    bus: &str,
    interface: &RealInterface,
    settings: &InterfaceSettings,
    options: &SocketCanOptions,
) -> Result<LinkPort, OpenError> {
    interface.prepare(bus, settings)?;
    interface.open_prepared(bus, settings, options)
}

/// Opens a port for listening alone, for the bus of this name. A network interface stays as it is: it must be up. The channel of an
/// adapter, which one program has at a time, is opened.
///
/// # Errors
/// See [`OpenError`].
pub fn open_to_listen(
    bus: &str,
    interface: &RealInterface,
    settings: &InterfaceSettings,
    options: &SocketCanOptions,
) -> Result<LinkPort, OpenError> {
    if let RealInterface::SocketCan(name) = interface {
        let failed = |error| OpenError::Interface { bus: bus.to_owned(), error };
        if !interface_status(name).map_err(failed)?.is_up {
            return Err(failed(InterfaceError::Down { name: name.clone() }));
        }
    }
    interface.open_prepared(bus, settings, options)
}
