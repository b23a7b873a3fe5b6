//! Modbus-RTU ("MODBUS Application Protocol" 1.1b3, "MODBUS over Serial Line" 1.02), without input and output: the caller passes
//! time and bytes in, and sends the bytes that come out. The crate `rmodbus` makes the frames, and checks their CRC.
//!
//! - [`frame`]: requests and replies on the wire, seen from both sides.
//! - [`exception`]: why a slave refuses a request.
//! - [`line_timing`]: how long bytes take, and the silence between frames.
//! - [`master`]: asks the slaves of a line, one request at a time.
//! - [`request_gathering`]: the slave's side: from bytes to requests.

pub mod exception;
pub mod frame;
pub mod line_timing;
pub mod master;
pub mod request_gathering;
