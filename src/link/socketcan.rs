//! Opens a SocketCAN interface as a bus port for the real-time thread.

use std::io;
use std::os::fd::AsRawFd;

use socketcan::{CanFdSocket, CanFilter, Socket, SocketOptions};
use takt_rt::Id;
use takt_rt::linux::SocketCanPort;
use thiserror::Error;

use super::interface::interface_status;

/// Bytes that the kernel reserves for one frame that waits in the buffer of a socket. The frame with its bookkeeping takes 768 bytes
/// on Linux 6.1, and up to 960 since 6.3.
const BYTES_PER_FRAME: usize = 1_024;

/// The most filters that a socket takes (`CAN_RAW_FILTER_MAX`).
const FILTER_LIMIT: usize = 512;

/// How a socket is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SocketCanOptions {
    /// The identifiers of all data frames that are received **and sent**; empty for no filter. Own frames come back through the same
    /// filters. A frame that does not come back never counts as sent.
    pub identifiers: Vec<Id>,
    /// The bit rate of classic frames and of the arbitration phase, in bit/s. Only the bus load depends on it.
    pub bit_rate: u32,
    /// The bit rate of the data phase of CAN FD frames, in bit/s.
    pub data_bit_rate: Option<u32>,
    /// How many frames of this socket may wait in the queues of the interfaces; the kernel does not take more. Choose not much more
    /// than a cycle sends: set-points that wait longer are stale.
    pub transmit_frames: usize,
    /// How many received frames the kernel keeps until they are read. A process without CAP_NET_ADMIN may get fewer
    /// (`net.core.rmem_max`).
    pub receive_frames: usize,
}

/// Enough for a reader that stalls for 30 ms on a fully loaded bus.
const RECEIVE_FRAMES: usize = 1_024;

impl Default for SocketCanOptions {
    /// No filter, 1 Mbit/s. 32 frames may wait to be sent, and 1,024 to be read.
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
    /// The action that failed.
    pub action: &'static str,
    /// The error of the system.
    #[source]
    pub error: io::Error,
}

/// Opens an interface, which must exist, as a port. It receives CAN FD frames, error frames and, as confirmations, its own frames.
/// Kernel time stamps and the overflow counter are on.
///
/// # Errors
/// [`SocketCanError`]: the action that the system refused.
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
    let port = SocketCanPort::new(socket.as_raw_fd(), options.bit_rate, options.data_bit_rate)
        .map_err(|error| io::Error::from_raw_os_error(error.errno))
        .map_err(failed("duplicating the socket"))?;
    // Changes from here on are reported to the socket.
    Ok(match interface_status(interface) {
        Ok(status) => port.begun_in(status.state),
        Err(_) => port,
    })
}

/// Sets one filter for each identifier. The kernel keeps filters for exactly one identifier and only data frames in a table of
/// their own. There, the number of filters costs no time.
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

/// Sets the sizes of the buffers. The kernel doubles the requested size for its bookkeeping, which [`BYTES_PER_FRAME`] includes
/// already.
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
    fn an_interface_that_does_not_exist_is_named() {
        let options =
            SocketCanOptions { transmit_frames: 8, receive_frames: 8, ..SocketCanOptions::default() };
        let error = open_socketcan("takt-none", &options).unwrap_err();
        assert_eq!(error.interface, "takt-none");
    }
}
