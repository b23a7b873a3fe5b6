//! The CANopen services (CiA 301) of a master, as far as a family of drives or a data sheet needs them, without input and output:
//! the caller passes time and frames in, and sends the frames that come out.
//!
//! - [`nmt`]: network management: commands, states, boot-up and heartbeat.
//! - [`sdo`]: service data objects: what one transfers, and how it fails.
//! - [`emcy`]: emergency messages and the names of their codes.
//! - [`dcf`]: the values that a configuration file writes to a device, and their order.
//! - [`eds`]: electronic data sheets and device configuration files.
//! - [`pdo_configuration`]: the configuration of a PDO, from a device or a file.
//! - [`object`]: an object's address, type and name; [`objects`]: the standard objects used here.

pub(crate) mod communication_names;
pub mod dcf;
pub mod eds;
pub mod emcy;
#[cfg(any(feature = "cli", feature = "internals"))]
pub(crate) mod lss;
pub mod nmt;
pub mod object;
pub mod objects;
pub mod pdo_configuration;
pub(crate) mod pdo_reader;
pub mod sdo;
pub(crate) mod time;

/// Function codes of the pre-defined connection set (CiA 301, 7.3.3), to which the node ID is added.
pub(crate) mod function_code {
    /// Network management, without a node ID.
    pub const NMT: u16 = 0x000;
    /// SYNC, without a node ID.
    pub const SYNC: u16 = 0x080;
    /// TIME, without a node ID.
    pub const TIME: u16 = 0x100;
    /// EMCY of a device.
    pub const EMERGENCY: u16 = 0x080;
    /// TPDO 1 to 4.
    pub const TPDO: [u16; 4] = [0x180, 0x280, 0x380, 0x480];
    /// RPDO 1 to 4.
    pub const RPDO: [u16; 4] = [0x200, 0x300, 0x400, 0x500];
    /// SDO server to client.
    pub const SDO_RESPONSE: u16 = 0x580;
    /// SDO client to server.
    pub const SDO_REQUEST: u16 = 0x600;
    /// Boot-up and heartbeat.
    pub const ERROR_CONTROL: u16 = 0x700;
}

/// The node ID of a frame with `function`'s 11-bit identifier; `None` for other frames.
pub(crate) fn node_of(frame: &takt_rt::Frame, function: u16) -> Option<u8> {
    let id = frame.id();
    let node = id.value().checked_sub(function.into())?;
    (!id.is_extended() && (1..=0x7F).contains(&node)).then_some(node as u8)
}
