//! A raw CAN socket of Linux (SocketCAN) as a [`BusPort`](crate::port::BusPort): many frames a system call, no
//! blocking, no allocation.

mod account;
mod batch;
mod error_frame;
mod link;
mod port;
mod together;
mod wire_format;

pub use port::SocketCanPort;
