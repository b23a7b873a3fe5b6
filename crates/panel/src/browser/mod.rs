//! takt in a page without a machine: for `extras/wasm` alone. It may change in any release.
//!
//! - [`replay()`]: the engine again on a recording.
//! - [`SimulatedArm`]: a controller of simulated drives in virtual time, with the words of the panel.
//!
//! Everything is text: JSON in, JSON out. Nothing here is of a browser, so that the tests of this machine try it as well.

mod breakage;
mod replay;
mod simulated_arm;

pub use replay::replay;
pub use simulated_arm::SimulatedArm;
