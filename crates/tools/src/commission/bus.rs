//! The bus of a drive that is commissioned, and how it is opened.

use crate::monitor::BusDecoder;
use takt::config::Config;
use takt::controller::opening::open_configured;
use takt::controller::port::Port;
use takt::link::ownership::{BusClaim, MasterTraffic};
use takt::link::{InterfaceSettings, OpenError, RealInterface, SocketCanOptions, open_interface};

/// The time in milliseconds after which the kernel restarts a controller that is bus-off.
const RESTART_MS: u32 = 100;

/// The bus of a drive.
pub enum Bus {
    /// A bus of a configuration.
    Configured {
        /// The configuration.
        config: Box<Config>,
        /// The index of the bus.
        bus: usize,
    },
    /// An interface of this machine.
    Interface {
        /// The interface.
        interface: RealInterface,
        /// bit/s
        bit_rate: u32,
        /// bit/s of the data phase of CAN FD
        data_bit_rate: Option<u32>,
    },
}

impl Bus {
    /// What is to be owned for it; `None` for a simulated bus. Without a node, the drives may be any.
    pub fn claim(&self, node: Option<u8>) -> Option<BusClaim> {
        match self {
            Self::Configured { config, bus } => BusClaim::of(config, *bus),
            Self::Interface { interface, bit_rate, data_bit_rate } => Some(BusClaim {
                bus: interface.to_string(),
                interface: interface.clone(),
                settings: settings(*bit_rate, *data_bit_rate),
                traffic: match node {
                    Some(node) => MasterTraffic::without_configuration(Some(node)),
                    None => MasterTraffic::of_any_node(),
                },
            }),
        }
    }

    /// Opens the port without filters: a scan has to see all nodes.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub fn open(&self) -> Result<Port, OpenError> {
        let usual = SocketCanOptions::default();
        match self {
            Self::Configured { config, bus } => {
                let settings = config.buses.get(*bus);
                let options = SocketCanOptions {
                    bit_rate: settings.map_or(usual.bit_rate, |bus| bus.bit_rate),
                    data_bit_rate: settings.and_then(|bus| bus.data_bit_rate),
                    ..usual
                };
                Ok(match open_configured(config, *bus, &options)? {
                    Some(port) => port.into(),
                    None => Port::Simulated(Box::new(takt::family::simulated_bus(config, *bus))),
                })
            }
            Self::Interface { interface, bit_rate, data_bit_rate } => {
                let options =
                    SocketCanOptions { bit_rate: *bit_rate, data_bit_rate: *data_bit_rate, ..usual };
                let settings = settings(*bit_rate, *data_bit_rate);
                open_interface(&interface.to_string(), interface, &settings, &options).map(Port::from)
            }
        }
    }

    /// What its frames mean.
    pub fn decoder(&self) -> BusDecoder {
        match self {
            Self::Configured { config, bus } => BusDecoder::of(config, *bus),
            Self::Interface { .. } => BusDecoder::with_drives(&[]),
        }
    }

    /// Returns `true` if it carries CAN FD frames.
    pub fn has_fd(&self) -> bool {
        match self {
            Self::Configured { config, bus } => {
                config.buses.get(*bus).is_some_and(|bus| bus.data_bit_rate.is_some())
            }
            Self::Interface { data_bit_rate, .. } => data_bit_rate.is_some(),
        }
    }
}

const fn settings(bit_rate: u32, data_bit_rate: Option<u32>) -> InterfaceSettings {
    InterfaceSettings { bit_rate, data_bit_rate, restart_ms: RESTART_MS }
}
