//! The CANopen services (CiA 301) as a master needs them, without input and output: time and frames are handed in,
//! frames are handed out.
//!
//! - [`nmt`]: network management: commands, states, boot-up and heartbeat.
//! - [`sdo`]: service data objects: what is on the wire, and a client that moves one object at a time,
//!   expedited, segmented or in blocks.
//! - [`emcy`]: emergency messages and what their codes mean.
//! - [`sync`]: the SYNC message; [`time`]: the TIME message.
//! - [`heartbeat`]: the nodes whose heartbeat is watched.
//! - [`lss`]: layer setting services: node numbers and bit rates for devices that have none.
//! - [`dcf`]: what a configuration file has written to a device, and in which order.
//! - [`eds`]: electronic data sheets and device configuration files.
//! - [`pdo_configuration`]: how a PDO is configured, as a device or a file tells it; [`pdo_inquiry`] asks a device.
//! - [`object`]: an object's address, type and name; [`objects`]: the standard ones used here.

pub mod dcf;
pub mod eds;
pub mod emcy;
pub mod heartbeat;
pub mod lss;
pub mod nmt;
pub mod object;
pub mod objects;
pub mod pdo_configuration;
pub mod pdo_inquiry;
pub mod sdo;
pub mod sync;
pub mod time;

/// Function codes of the pre-defined connection set (CiA 301, 7.3.3), to which the node number is added.
pub mod function_code {
    /// SYNC, without a node number.
    pub const SYNC: u16 = 0x080;
    /// TIME, without a node number.
    pub const TIME: u16 = 0x100;
    /// EMCY of a device.
    pub const EMERGENCY: u16 = 0x080;
    /// SDO server to client.
    pub const SDO_RESPONSE: u16 = 0x580;
    /// SDO client to server.
    pub const SDO_REQUEST: u16 = 0x600;
    /// Boot-up and heartbeat.
    pub const ERROR_CONTROL: u16 = 0x700;
}

/// The node of a frame that carries `function`'s 11-bit identifier; `None` for every other frame.
fn node_of(frame: &takt_rt::Frame, function: u16) -> Option<u8> {
    let id = frame.id();
    let node = id.value().checked_sub(function.into())?;
    (!id.is_extended() && (1..=0x7F).contains(&node)).then_some(node as u8)
}
