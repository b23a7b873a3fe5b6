//! A simulated ZeroErr eRob on an RS-485 line with Modbus-RTU (eRob Modbus-RTU manual 1.5, and field experience).
//!
//! - `drive`: the complete module: requests, time, power.
//! - `registers`: what can be read and written, and what is kept without power.
//! - `line`: a line with a master and such modules: the time that bytes take, noise, a cut wire.

mod drive;
mod line;
mod registers;

pub use drive::{ErobModbusDrive, ErobModbusParameters};
pub use line::SimulatedLine;
