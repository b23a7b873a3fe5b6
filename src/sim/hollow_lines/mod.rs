//! Simulated hollow-shaft motors and their encoder on serial lines: what the manual says of them, no more.

mod bridge;
mod console;
mod encoder;
mod motor;
mod pulse_module;
mod registers;

pub use bridge::Bridge;
pub use console::Console;
pub use encoder::Encoder;
pub use pulse_module::PulseModule;
pub use registers::RegisterBridge;
