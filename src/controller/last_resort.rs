//! What stops drives when the real-time thread does not: NMT stop by a socket of its own, and where the system does not take that, the
//! interface is set down.
//!
//! What it tells is what was sent. Nobody is left to see what the drives make of it.

use std::collections::BTreeSet;
use std::io;

use socketcan::{CanFrame, CanInterface, CanSocket, Frame, Socket, SocketOptions};
use takt_wire::canopen::nmt::{NmtCommand, NmtTarget};

use super::assemble::is_canopen;
use crate::config::{Config, Interface};

/// The sockets, opened in advance.
pub(super) struct LastResort {
    buses: Vec<Bus>,
}

struct Bus {
    name: String,
    nodes: BTreeSet<u8>,
    way: Way,
}

/// How the drives of a bus can be reached beside the loop.
enum Way {
    Interface {
        name: String,
        socket: io::Result<CanSocket>,
    },
    /// They are simulated inside the loop.
    Simulated,
    /// The loop alone has the line, or the drives know no NMT.
    None,
}

impl LastResort {
    /// For the buses of a configuration, which are open.
    pub(super) fn prepare(config: &Config) -> Self {
        let buses = config.buses.iter().enumerate().map(|(index, bus)| {
            let of_bus = config.axes.iter().filter(|axis| axis.bus == index);
            let nodes: BTreeSet<u8> = of_bus.map(|axis| axis.node).collect();
            let way = match &bus.interface {
                Interface::Simulated => Way::Simulated,
                Interface::SocketCan(name) if is_canopen(config, index) => {
                    Way::Interface { name: name.clone(), socket: sending_socket(name) }
                }
                _ => Way::None,
            };
            Bus { name: bus.name.clone(), nodes, way }
        });
        Self { buses: buses.collect() }
    }

    /// Stops the drives as far as that is possible. Returns a sentence for each bus.
    pub fn stop_drives(&self) -> Vec<String> {
        self.buses.iter().map(Bus::stop_drives).collect()
    }
}

impl Bus {
    fn stop_drives(&self) -> String {
        let name = &self.name;
        let (interface, socket) = match &self.way {
            Way::Interface { name, socket } => (name, socket),
            Way::Simulated => return format!("the drives of {name} are simulated"),
            Way::None => return format!("the drives of {name} cannot be reached beside the loop"),
        };
        // An interface that was removed and is there again is not that of the socket.
        let sent = self.send_stops(socket).or_else(|_| self.send_stops(&sending_socket(interface)));
        let not_sent = match sent {
            Ok(()) => return format!("NMT stop was sent to the drives of {name}"),
            Err(error) => error,
        };
        match CanInterface::open(interface).and_then(|interface| interface.bring_down()) {
            Ok(()) => {
                format!("NMT stop could not be sent on {name} ({not_sent}), and {interface} was set down")
            }
            Err(error) => format!(
                "NMT stop could not be sent on {name} ({not_sent}), nor {interface} be set down ({error})"
            ),
        }
    }

    fn send_stops(&self, socket: &io::Result<CanSocket>) -> io::Result<()> {
        let socket = socket.as_ref().map_err(|error| io::Error::new(error.kind(), error.to_string()))?;
        for node in &self.nodes {
            let stop = NmtCommand::Stop.frame(NmtTarget::Node(*node));
            let frame = CanFrame::from_raw_id(stop.id().value(), stop.payload());
            socket.write_frame(&frame.ok_or(io::ErrorKind::InvalidInput)?)?;
        }
        Ok(())
    }
}

/// Stops the drives of a configuration at once.
pub fn stop_drives(config: &Config) -> Vec<String> {
    LastResort::prepare(config).stop_drives()
}

/// A socket that receives nothing, and never waits.
fn sending_socket(interface: &str) -> io::Result<CanSocket> {
    let socket = CanSocket::open(interface)?;
    socket.set_filter_drop_all()?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}
