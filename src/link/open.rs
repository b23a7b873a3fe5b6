//! Opens an interface for a bus: brings it up as far as that is permitted, and opens a socket on it.

use takt_rt::linux::SocketCanPort;

use super::interface::{InterfaceError, InterfaceSettings, prepare_interface};
use super::socketcan::{SocketCanError, SocketCanOptions, open_socketcan};

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
}

/// Prepares an interface and opens a socket on it, for the bus of this name.
///
/// # Errors
/// See [`OpenError`].
pub fn open_interface(
    bus: &str,
    interface: &str,
    settings: &InterfaceSettings,
    options: &SocketCanOptions,
) -> Result<SocketCanPort, OpenError> {
    prepare(bus, interface, settings)?;
    open_socket(bus, interface, options)
}

/// Brings an interface up with these settings, or checks that it has them.
pub(super) fn prepare(bus: &str, interface: &str, settings: &InterfaceSettings) -> Result<(), OpenError> {
    match prepare_interface(interface, settings) {
        Ok(_) => Ok(()),
        Err(error) => Err(OpenError::Interface { bus: bus.to_owned(), error }),
    }
}

pub(super) fn open_socket(
    bus: &str,
    interface: &str,
    options: &SocketCanOptions,
) -> Result<SocketCanPort, OpenError> {
    open_socketcan(interface, options).map_err(|error| OpenError::Socket { bus: bus.to_owned(), error })
}
