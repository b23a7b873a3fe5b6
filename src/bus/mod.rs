//! The buses: what they are connected to, who commands them, how long frames take, and whether everything fits.

pub mod frame_time;
mod interface;
pub mod ownership;
pub mod port;
pub mod schedule;
mod socketcan;
pub mod trace;

pub use interface::{
    ControllerTiming, InterfaceError, InterfaceSettings, InterfaceStatus, interface_status,
    prepare_interface, transmit_queue_length,
};
pub use port::open_interface;
pub use socketcan::{SocketCanError, SocketCanOptions, open_socketcan};
