//! The CANopen services (CiA 301) of a master, as far as a family of drives or a data sheet needs them, without I/O:
//! the caller passes time and frames in, and sends the frames that come out.
//!
//! - [`nmt`]: network management: commands, states, boot-up and heartbeat.
//! - [`sdo`]: service data objects: what one transfers, and how it fails.
//! - [`emcy`]: emergency messages and the names of their codes.
//! - [`time`]: the TIME message.
//! - [`lss`]: the layer settings of a device: bit rate and node ID.
//! - [`dcf`]: the values that a configuration file writes to a device, and their order.
//! - [`eds`]: electronic data sheets and device configuration files.
//! - [`pdo_configuration`]: the configuration of a PDO, from a device or a file; [`pdo_reader`]: reads it from a device.
//! - [`object`]: an object's address, type and name; [`objects`]: the standard objects used here;
//!   [`communication_names`]: the names of those of CiA 301.

pub mod communication_names;
pub mod dcf;
pub mod eds;
pub mod emcy;
pub mod lss;
pub mod nmt;
pub mod object;
pub mod objects;
pub mod pdo_configuration;
pub mod pdo_reader;
pub mod sdo;
pub mod time;

pub use takt_rt::function_code;

/// The node ID of a frame with `function`'s 11-bit identifier; `None` for other frames.
pub fn node_of(frame: &takt_rt::Frame, function: u16) -> Option<u8> {
    let id = frame.id();
    let node = id.value().checked_sub(function.into())?;
    (!id.is_extended() && (1..=0x7F).contains(&node)).then_some(node as u8)
}
