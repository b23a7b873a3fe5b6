//! CAN interfaces of this machine: what state they are in, bringing them up, and opening them as bus ports.

mod interface;
mod socketcan;

pub use interface::{InterfaceSettings, InterfaceError, InterfaceStatus, interface_status, prepare_interface};
pub use socketcan::{OpenError, SocketCanOptions, open_socketcan};
