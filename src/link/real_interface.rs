//! An interface that other programs of this machine can open, too: every one but a simulated bus.

use std::fmt;
use std::io;

use takt_rt::linux::Attachment;

use super::converter::open_converter;
use super::interface::{InterfaceSettings, interface_index, prepare_interface};
use super::open_error::OpenError;
use super::port::LinkPort;
use super::serial_line::device_number;
use super::slcan::open_slcan;
use super::socketcan::{SocketCanError, SocketCanOptions, open_socketcan};
use crate::config::{CanLine, Interface, SerialDevice};

/// An interface of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RealInterface {
    /// A SocketCAN network interface, by name.
    SocketCan(String),
    /// An SLCAN adapter on a serial line.
    Slcan(CanLine),
    /// A transparent converter between RS-485 and CAN FD on a serial line.
    Converter(CanLine),
    /// A serial line with drives on it, and no CAN bus.
    Serial(SerialDevice),
}

impl RealInterface {
    /// `None` for a simulated bus.
    pub fn of(interface: &Interface) -> Option<Self> {
        match interface {
            Interface::Simulated => None,
            Interface::SocketCan(name) => Some(Self::SocketCan(name.clone())),
            Interface::Slcan(line) => Some(Self::Slcan(line.clone())),
            Interface::Converter(line) => Some(Self::Converter(line.clone())),
            Interface::Serial(line) => Some(Self::Serial(line.clone())),
        }
    }

    /// The name of its lock: the same for every name and path of the interface, for as long as it is there.
    pub(super) fn lock_name(&self, bus: &str) -> Result<String, OpenError> {
        match self {
            Self::SocketCan(name) => match interface_index(name) {
                Ok(index) => Ok(index.to_string()),
                Err(error) => Err(OpenError::Interface { bus: bus.to_owned(), error }),
            },
            Self::Slcan(line) => match device_number(&line.device) {
                Ok(number) => Ok(format!("line-{number}")),
                Err(error) => Err(OpenError::Slcan { bus: bus.to_owned(), error: error.into() }),
            },
            Self::Converter(line) => match device_number(&line.device) {
                Ok(number) => Ok(format!("line-{number}")),
                Err(error) => Err(OpenError::Converter { bus: bus.to_owned(), error: error.into() }),
            },
            Self::Serial(line) => match device_number(&line.device) {
                Ok(number) => Ok(format!("line-{number}")),
                Err(error) => Err(OpenError::Line { bus: bus.to_owned(), error }),
            },
        }
    }

    /// Brings it up with these settings, or checks that it has them. The channel of an adapter and a
    /// serial line get them when they are opened.
    pub(super) fn prepare(&self, bus: &str, settings: &InterfaceSettings) -> Result<(), OpenError> {
        match self {
            Self::SocketCan(name) => match prepare_interface(name, settings) {
                Ok(_) => Ok(()),
                Err(error) => Err(OpenError::Interface { bus: bus.to_owned(), error }),
            },
            Self::Slcan(_) | Self::Converter(_) | Self::Serial(_) => Ok(()),
        }
    }

    /// Opens it. A network interface must be up.
    pub(super) fn open_prepared(
        &self,
        bus: &str,
        settings: &InterfaceSettings,
        options: &SocketCanOptions,
    ) -> Result<LinkPort, OpenError> {
        match self {
            Self::SocketCan(name) => match open_socketcan(name, options) {
                Ok(port) => Ok(LinkPort::SocketCan(Box::new(port))),
                Err(error) => Err(OpenError::Socket { bus: bus.to_owned(), error }),
            },
            Self::Slcan(line) => match open_slcan(line, settings) {
                Ok(port) => Ok(LinkPort::Slcan(Box::new(port))),
                Err(error) => Err(OpenError::Slcan { bus: bus.to_owned(), error }),
            },
            Self::Converter(line) => match open_converter(line, settings.bit_rate) {
                Ok(port) => Ok(LinkPort::Converter(Box::new(port))),
                Err(error) => Err(OpenError::Converter { bus: bus.to_owned(), error }),
            },
            Self::Serial(_) => Err(OpenError::NotCan { bus: bus.to_owned(), interface: self.to_string() }),
        }
    }

    /// Binds the port of a removed interface to the one that has its name now, which is prepared.
    pub(crate) fn attach(&self, bus: &str, attachment: &Attachment) -> Result<(), OpenError> {
        let Self::SocketCan(name) = self else { return Ok(()) };
        let index =
            interface_index(name).map_err(|error| OpenError::Interface { bus: bus.to_owned(), error })?;
        let bound = i32::try_from(index).map_err(|_| libc::ENODEV).and_then(|index| attachment.renew(index));
        bound.map_err(|errno| {
            let error = io::Error::from_raw_os_error(errno);
            let error = SocketCanError { interface: name.clone(), action: "binding the socket anew", error };
            OpenError::Socket { bus: bus.to_owned(), error }
        })
    }

    /// Returns `true` if it carries CAN frames, by which another master can be recognised.
    pub(super) const fn is_can(&self) -> bool {
        !matches!(self, Self::Serial(_))
    }
}

impl fmt::Display for RealInterface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SocketCan(name) => f.write_str(name),
            Self::Slcan(line) => write!(f, "slcan:{line}"),
            Self::Converter(line) => write!(f, "rs485-canfd:{line}"),
            Self::Serial(line) => write!(f, "serial:{line}"),
        }
    }
}
