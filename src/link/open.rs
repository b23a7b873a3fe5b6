//! Opens an interface for a bus: brings it up as far as that is permitted, and opens a port on it.

use super::interface::{InterfaceError, InterfaceSettings, interface_status};
use super::open_error::OpenError;
use super::port::LinkPort;
use super::real_interface::RealInterface;
use super::socketcan::SocketCanOptions;

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
