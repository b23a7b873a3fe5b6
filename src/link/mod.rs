//! The buses: what they are connected to, and who commands them.

mod adapter_latency;
mod converter;
pub(crate) mod interface;
#[cfg(feature = "cli")]
pub(crate) mod modbus_line;
mod open;
pub(crate) mod ownership;
#[cfg_attr(
    not(feature = "internals"),
    allow(unnameable_types, reason = "it becomes the port of a controller")
)]
mod port;
pub(crate) mod real_interface;
pub(crate) mod serial_line;
mod slcan;
pub(crate) mod socketcan;
pub(crate) mod trace;

pub(crate) use adapter_latency::{adapter_latency_ns, shortest_latency_command};
pub use converter::ConverterError;
pub use interface::InterfaceError;
pub(crate) use interface::{
    ControllerTiming, InterfaceSettings, InterfaceStatus, interface_status, transmit_queue_length,
};
pub use open::OpenError;
pub(crate) use open::{open_interface, open_to_listen};
pub use ownership::{
    ClaimError, HeardMaster, IfOwned, LockError, MasterActivity, Process, ReleaseError, Role, TakeOverError,
};
pub(crate) use port::LinkPort;
pub(crate) use real_interface::RealInterface;
pub use serial_line::SerialLineError;
pub use slcan::SlcanError;
pub use socketcan::SocketCanError;
pub(crate) use socketcan::SocketCanOptions;
pub use trace::{PortAnswer, PortMark, Trace, Traced, TracedFrame, TracedHealth, TracedPort};
