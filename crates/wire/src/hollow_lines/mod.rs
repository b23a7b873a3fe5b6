//! The lines of the hollow-shaft motors (HO series) beside CAN, without input or output.
//!
//! ```text
//! motor_data ── the 16 bytes of a command and of a reply, as on CAN FD
//!   transparent (takt_rt) ── these bytes behind the RS-485 module: identifier, bytes, CRC-32
//!     encoder ── the hollow encoder, which is polled in the same form
//!   registers ── these bytes as 16 registers of Modbus
//! console ── the serial console: commands, parameters, the zero point
//! pulse_module ── the stiffness frame of the pulse module
//! ```
//!
//! This is a folder of wire formats, as `erob_can` and `modbus` are: the family and the simulated devices, which know nothing of each other,
//! both need them. What is a fact about the motors stands with their family.
//!
//! From the manual of the vendor. *Not tried on hardware.*

pub mod console;
pub mod encoder;
pub mod motor_data;
pub mod pulse_module;
pub mod registers;

pub use takt_rt::transparent;
