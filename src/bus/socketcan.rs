//! Opening a SocketCAN interface as a bus port for the real-time thread.

use std::io;
use std::os::fd::AsRawFd;

use socketcan::{CanFdSocket, CanFilter, Socket, SocketOptions};
use takt_rt::Id;
use takt_rt::linux::SocketCanPort;
use thiserror::Error;

use crate::config::Config;

/// What the kernel reserves for one frame that waits in a socket's buffer: the frame with its bookkeeping, 768
/// bytes on Linux 6.1, up to 960 since 6.3.
const BYTES_PER_FRAME: usize = 1_024;

/// The most filters that a socket takes (`CAN_RAW_FILTER_MAX`).
const FILTER_LIMIT: usize = 512;

/// How a socket is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SocketCanOptions {
    /// The identifiers of all data frames that are received **and sent**: own frames come back through the same
    /// filters, and one that does not would never count as sent. Empty: no filter.
    pub identifiers: Vec<Id>,
    /// Bit/s of classic frames and of the arbitration phase; only the report of the bus load depends on it.
    pub bit_rate: u32,
    /// Bit/s of the data phase of CAN FD frames.
    pub data_bit_rate: Option<u32>,
    /// How many frames of this socket may wait in the interfaces' queues; more are not taken. Not much above what is
    /// sent in a cycle: set-points that wait longer are stale.
    pub transmit_frames: usize,
    /// How many received frames the kernel keeps while nobody reads. The kernel may grant less
    /// (`net.core.rmem_max`) to a process without the right to go beyond.
    pub receive_frames: usize,
}

impl SocketCanOptions {
    /// For bus number `bus` of a configuration, as its master: every identifier that CANopen gives to the nodes on
    /// it (CiA 301, 7.3.3), in both directions.
    pub fn of_master(config: &Config, bus: usize) -> Self {
        let nodes = config.axes.iter().filter(|axis| axis.bus == bus).map(|axis| axis.node);
        let functions = (1..=0xE).map(|function| function << 7);
        let of_node = |node: u8| functions.clone().map(move |function| Id::canopen(function, node));
        let broadcast = [NMT, SYNC, TIME].map(|function| Id::canopen(function, 0));
        let own = Id::canopen(HEARTBEAT, config.master.node);
        let settings = config.buses.get(bus);
        Self {
            identifiers: nodes.flat_map(of_node).chain(broadcast).chain([own]).collect(),
            bit_rate: settings.map_or(1_000_000, |bus| bus.bit_rate),
            data_bit_rate: settings.and_then(|bus| bus.data_bit_rate),
            // Of all buses: one socket can carry what the others send in the same call, and on a bus that is stuck it lies.
            transmit_frames: config.axes.len() * COMMANDS_PER_AXIS + config.buses.len() * SERVICE_FRAMES,
            receive_frames: RECEIVE_FRAMES,
        }
    }
}

const NMT: u16 = 0x000;
const SYNC: u16 = 0x080;
const TIME: u16 = 0x100;
const HEARTBEAT: u16 = 0x700;

/// Set-points of an axis in a cycle, at most: as many as a drive has PDOs for them.
const COMMANDS_PER_AXIS: usize = 4;
/// SYNC and services in a cycle, at most.
const SERVICE_FRAMES: usize = 8;
/// A reader that is stalled for 30 ms on a full bus misses nothing.
const RECEIVE_FRAMES: usize = 1_024;

impl Default for SocketCanOptions {
    /// Everything is received, 1 Mbit/s, 32 frames may wait to be sent and 1024 to be read.
    fn default() -> Self {
        Self {
            identifiers: vec![],
            bit_rate: 1_000_000,
            data_bit_rate: None,
            transmit_frames: 32,
            receive_frames: RECEIVE_FRAMES,
        }
    }
}

/// Why an interface could not be opened.
#[derive(Debug, Error)]
#[error("{interface}: {action}: {error}")]
pub struct SocketCanError {
    /// The interface.
    pub interface: String,
    /// What was tried.
    pub action: &'static str,
    /// What the system said.
    #[source]
    pub error: io::Error,
}

/// Opens an interface, which must exist, as a port: CAN FD frames and error frames on, own frames received back as
/// confirmations, kernel time stamps and overflow counter on.
pub fn open_socketcan(interface: &str, options: &SocketCanOptions) -> Result<SocketCanPort, SocketCanError> {
    let failed = |action| move |error| SocketCanError { interface: interface.into(), action, error };
    let socket = CanFdSocket::open(interface).map_err(failed("opening a socket"))?;
    set_filters(&socket, &options.identifiers).map_err(failed("setting the filters"))?;
    socket.set_error_filter_accept_all().map_err(failed("asking for error frames"))?;
    socket.set_recv_own_msgs(true).map_err(failed("asking for own frames"))?;
    socket.set_recv_timestamp(true).map_err(failed("asking for time stamps"))?;
    set_buffers(&socket, options).map_err(failed("setting the size of the buffers"))?;
    socket
        .set_socket_option_int(libc::SOL_SOCKET, libc::SO_RXQ_OVFL, 1)
        .map_err(failed("asking for the overflow counter"))?;
    SocketCanPort::new(socket.as_raw_fd(), options.bit_rate, options.data_bit_rate)
        .map_err(io::Error::from_raw_os_error)
        .map_err(failed("duplicating the socket"))
}

/// One filter for each identifier: the kernel keeps those that name an identifier exactly, and data frames alone,
/// in a table of its own, in which the number of filters costs nothing.
fn set_filters(socket: &CanFdSocket, identifiers: &[Id]) -> io::Result<()> {
    if identifiers.is_empty() || identifiers.len() > FILTER_LIMIT {
        return socket.set_filter_accept_all();
    }
    let filters: Vec<CanFilter> = identifiers.iter().map(|id| filter(*id)).collect();
    socket.set_filters(&filters)
}

fn filter(id: Id) -> CanFilter {
    let flags = libc::CAN_EFF_FLAG | libc::CAN_RTR_FLAG;
    if id.is_extended() {
        CanFilter::new(id.value() | libc::CAN_EFF_FLAG, libc::CAN_EFF_MASK | flags)
    } else {
        CanFilter::new(id.value(), libc::CAN_SFF_MASK | flags)
    }
}

/// The kernel doubles what is asked for, to have its bookkeeping in it; here that is part of a frame's bytes.
fn set_buffers(socket: &CanFdSocket, options: &SocketCanOptions) -> io::Result<()> {
    let bytes = |frames: usize| i32::try_from(frames.saturating_mul(BYTES_PER_FRAME) / 2).unwrap_or(i32::MAX);
    socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_SNDBUF, bytes(options.transmit_frames))?;
    let receive = bytes(options.receive_frames);
    socket
        .set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUFFORCE, receive)
        .or_else(|_| socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUF, receive))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn a_filter_names_the_identifier_exactly_and_data_frames_alone() {
        let base = filter(Id::base(0x181).unwrap());
        assert_eq!(base.as_ref().can_id, 0x181);
        assert_eq!(base.as_ref().can_mask, 0xC000_07FF);
        let extended = filter(Id::extended(0x181).unwrap());
        assert_eq!(extended.as_ref().can_id, 0x8000_0181);
        assert_eq!(extended.as_ref().can_mask, 0xDFFF_FFFF);
    }

    #[test]
    fn a_master_hears_every_identifier_of_its_nodes_and_its_own() {
        let config = Config::load(Path::new("configs/arm6-erob.toml")).unwrap();
        let options = SocketCanOptions::of_master(&config, 0);
        let node = config.axes.iter().find(|axis| axis.bus == 0).map(|axis| axis.node).unwrap();
        for function in [0x080, 0x180, 0x200, 0x480, 0x500, 0x580, 0x600, 0x700] {
            assert!(options.identifiers.contains(&Id::canopen(function, node)), "{function:X}");
        }
        for id in [Id::canopen(NMT, 0), Id::canopen(SYNC, 0), Id::canopen(HEARTBEAT, config.master.node)] {
            assert!(options.identifiers.contains(&id), "{id:?}");
        }
        let elsewhere = config.axes.iter().find(|axis| axis.bus == 1).map(|axis| axis.node).unwrap();
        assert!(!options.identifiers.contains(&Id::canopen(0x180, elsewhere)));
        assert!(options.identifiers.len() <= FILTER_LIMIT);
    }

    #[test]
    fn an_interface_that_does_not_exist_is_named() {
        let options =
            SocketCanOptions { transmit_frames: 8, receive_frames: 8, ..SocketCanOptions::default() };
        let error = open_socketcan("takt-none", &options).unwrap_err();
        assert_eq!(error.interface, "takt-none");
    }
}
