//! The lines of the hollow-shaft motors (HO series) beside CAN, without input or output.
//!
//! ```text
//! motor_data ── the 16 bytes of a command and of a reply, as on CAN FD
//!   transparent ── these bytes behind the RS-485 module: identifier, bytes, CRC-32
//!     encoder ── the hollow encoder, which is polled in the same form
//!   registers ── these bytes as 16 registers of Modbus
//! console ── the serial console: commands, parameters, the zero point
//! pulse_module, pwm, encoder_output ── what the module and the pins for pulses are set to
//! ```
//!
//! From the manual of the vendor. *Not tried on hardware.*

pub mod console;
pub mod encoder;
pub mod encoder_output;
pub mod motor_data;
pub mod pulse_module;
pub mod pwm;
pub mod registers;
pub mod transparent;
