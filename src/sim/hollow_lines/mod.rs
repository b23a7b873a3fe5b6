//! Simulated hollow-shaft motors and their encoder on serial lines: what the manual says of them, no more.

mod bridge;
mod console;
mod encoder;
mod motor;

pub use bridge::Bridge;
pub use console::Console;
pub use encoder::Encoder;
