//! The buses: what they are connected to, and who commands them.

mod interface;
mod open;
pub mod ownership;
mod socketcan;
pub mod trace;

pub use interface::{
    ControllerTiming, InterfaceError, InterfaceSettings, InterfaceStatus, interface_status,
    prepare_interface, transmit_queue_length,
};
pub use open::{OpenError, open_interface};
pub use socketcan::{SocketCanError, SocketCanOptions, open_socketcan};
