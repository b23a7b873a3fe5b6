//! Opens the bus of a configuration.

use super::buses::socket_options;
use super::port::Port;
use crate::config::Config;
use crate::link::{InterfaceSettings, LinkPort, OpenError, RealInterface, SocketCanOptions, open_interface};

impl Port {
    /// Opens bus number `bus` of a configuration.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub fn open(config: &Config, bus: usize) -> Result<Self, OpenError> {
        let options = socket_options(config, bus);
        match open_configured(config, bus, &options)? {
            Some(port) => Ok(port.into()),
            None => Ok(Self::Simulated(Box::new(crate::family::simulated_bus(config, bus)))),
        }
    }
}

/// Brings the interface of bus number `bus` up, as far as needed and permitted, and opens it. Returns `None` for a simulated
/// bus.
///
/// # Errors
/// See [`OpenError`].
pub fn open_configured(
    config: &Config,
    bus: usize,
    options: &SocketCanOptions,
) -> Result<Option<LinkPort>, OpenError> {
    let Some(bus) = config.buses.get(bus) else { return Ok(None) };
    let Some(interface) = RealInterface::of(&bus.interface) else { return Ok(None) };
    open_interface(&bus.name, &interface, &InterfaceSettings::of(bus), options).map(Some)
}
