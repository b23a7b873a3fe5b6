//! The buses: what they are connected to, and who commands them.

pub(crate) mod interface;
mod open;
pub(crate) mod ownership;
pub(crate) mod socketcan;
pub(crate) mod trace;

pub use interface::InterfaceError;
pub(crate) use interface::{
    ControllerTiming, InterfaceSettings, InterfaceStatus, interface_status, transmit_queue_length,
};
pub use open::OpenError;
pub(crate) use open::open_interface;
pub use ownership::{
    ClaimError, HeardMaster, IfOwned, LockError, MasterActivity, Process, ReleaseError, Role, TakeOverError,
};
pub use socketcan::SocketCanError;
pub(crate) use socketcan::{SocketCanOptions, open_socketcan};
pub use trace::{Trace, TracedFrame, TracedHealth, TracedPort};
