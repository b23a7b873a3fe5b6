//! ZeroErr eRob's own CAN protocol (eRunner manual 1.7, chapter 7), without input and output: the caller passes time and frames in,
//! and sends the frames that come out.
//!
//! - [`frame`]: requests and replies on the wire.
//! - [`entries`]: the table of parameters, variables and commands.
//! - [`error_code`]: why a drive refuses a request, and the cure.
//! - [`client`]: the master of one node, with one request at a time.
//! - [`parameter`]: what the tables of the manuals say of a parameter, in this protocol and in Modbus-RTU.
//! - [`module_information`]: serial number, model and versions, decoded.

pub mod client;
pub mod entries;
pub mod error_code;
pub mod frame;
pub mod module_information;
pub mod parameter;
