//! The port of a configured bus, whatever it is connected to.

use takt_rt::frame::Frame;
use takt_rt::port::{BusHealth, BusPort, ReceiveBatch};
use takt_rt::time::Nanoseconds;

use super::trace::{Trace, TracedPort, traced};
use crate::config::{Config, Interface};
use crate::sim::SimulatedBus;

/// Frames on their way to the candump log: a second of a full bus.
const TRACE_FRAMES: usize = 1 << 14;

/// A bus port of any kind.
pub enum Port {
    /// Simulated drives inside this process.
    Simulated(Box<SimulatedBus>),
    /// Any port whose frames are also logged.
    Traced(Box<TracedPort<Port>>),
}

/// A bus that cannot be opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OpenError {
    /// The interface is of a kind that this build cannot open.
    #[error("bus `{bus}`: cannot open `{interface}`")]
    NotSupported {
        /// The bus.
        bus: String,
        /// What it was to be connected to.
        interface: String,
    },
}

impl Port {
    /// Opens bus number `bus` of a configuration.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub fn open(config: &Config, bus: usize) -> Result<Self, OpenError> {
        match config.buses.get(bus).map(|bus| (&bus.name, &bus.interface)) {
            Some((name, Interface::SocketCan(interface))) => {
                Err(OpenError::NotSupported { bus: name.clone(), interface: interface.clone() })
            }
            _ => Ok(Self::Simulated(Box::new(SimulatedBus::new(config, bus)))),
        }
    }

    /// The same port, and a trace of its frames.
    pub fn traced(self, name: &str) -> (Self, Trace) {
        let (port, trace) = traced(self, name, TRACE_FRAMES);
        (Self::Traced(Box::new(port)), trace)
    }
}

impl BusPort for Port {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        match self {
            Self::Simulated(port) => port.send(now_ns, frames),
            Self::Traced(port) => port.send(now_ns, frames),
        }
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        match self {
            Self::Simulated(port) => port.receive(now_ns, batch),
            Self::Traced(port) => port.receive(now_ns, batch),
        }
    }

    fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
        match self {
            Self::Simulated(port) => port.unconfirmed(now_ns),
            Self::Traced(port) => port.unconfirmed(now_ns),
        }
    }

    fn health(&mut self) -> BusHealth {
        match self {
            Self::Simulated(port) => port.health(),
            Self::Traced(port) => port.health(),
        }
    }
}
