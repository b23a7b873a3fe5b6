//! A raw CAN socket of Linux (SocketCAN) as a [`BusPort`](crate::port::BusPort).
//!
//! - `port`: the socket, as the owner makes it and sends on it; `bus_port`: what the cycle calls; `together`: one system
//!   call for the frames of several buses.
//! - `batch`: many frames in one system call; `wire_format`: the kernel's layout of a frame.
//! - `reading`: takes what has arrived, with bounded work; `arrival`: one message as the kernel hands it over;
//!   `arrival_time`: its time of arrival on the monotonic clock.
//! - `accounting`: the counters and the state of the bus; `in_flight`: the own frames that have not come back;
//!   `error_frame`: what the driver reports; `link`: whether the interface can send at all.
//! - `attachment`: binds the socket anew when its interface was removed and is there again.
//!
//! No call of the cycle waits or allocates. [`SocketCanPort::wait`] waits on request; [`Attachment`] is for another thread.

mod accounting;
mod arrival;
mod arrival_time;
mod attachment;
mod batch;
mod bus_port;
mod descriptor;
mod error_frame;
mod in_flight;
mod link;
mod port;
mod reading;
mod together;
mod wire_format;

pub use attachment::Attachment;
pub use descriptor::DescriptorError;
pub use port::SocketCanPort;
