//! The buses: what they are connected to, and who commands them.

mod interface;
pub mod ownership;
pub mod port;
mod socketcan;
pub mod trace;

pub use interface::{
    ControllerTiming, InterfaceError, InterfaceSettings, InterfaceStatus, interface_status,
    prepare_interface, transmit_queue_length,
};
pub use port::open_interface;
pub use socketcan::{SocketCanError, SocketCanOptions, open_socketcan};
