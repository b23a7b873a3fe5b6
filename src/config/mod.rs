//! The configuration of a controller: what the TOML file says, checked, in SI units.

mod model;

pub use model::*;
