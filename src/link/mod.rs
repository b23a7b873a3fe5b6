//! The buses: what they are connected to, and who commands them.

mod adapter_latency;
#[cfg(target_os = "linux")]
mod converter;
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub mod interface;
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub mod modbus_line;
#[cfg(target_os = "linux")]
mod open;
#[cfg(target_os = "linux")]
mod open_error;
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub mod ownership;
#[cfg_attr(not(target_os = "linux"), path = "no_port.rs")]
mod port;
mod process;
#[cfg(target_os = "linux")]
pub(crate) mod real_interface;
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub mod serial_line;
#[cfg(target_os = "linux")]
mod slcan;
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub mod socketcan;
#[doc(hidden)]
pub mod trace;

#[doc(hidden)]
pub use adapter_latency::{adapter_latency_ns, shortest_latency_command};
#[cfg(target_os = "linux")]
pub use converter::ConverterError;
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub use interface::{
    ControllerTiming, InterfaceSettings, InterfaceStatus, QUEUE_FRAMES, interface_status, restart_command,
    transmit_queue_length,
};
#[cfg(target_os = "linux")]
pub use interface::{InterfaceError, UnfitMode};
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub use open::{open_interface, open_to_listen};
#[cfg(target_os = "linux")]
pub use open_error::OpenError;
#[cfg(target_os = "linux")]
pub use ownership::{
    ClaimError, HeardMaster, IfOwned, LockError, MasterActivity, ReleaseError, Role, TakeOverError,
};
#[doc(hidden)]
pub use port::LinkPort;
pub use process::Process;
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub use real_interface::RealInterface;
#[cfg(target_os = "linux")]
pub use serial_line::SerialLineError;
#[cfg(target_os = "linux")]
pub use slcan::SlcanError;
#[cfg(target_os = "linux")]
pub use socketcan::SocketCanError;
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub use socketcan::SocketCanOptions;
pub use trace::{PortAnswer, PortMark, Trace, Traced, TracedFrame, TracedHealth, TracedPort};
