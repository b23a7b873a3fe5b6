//! A simulated ZeroErr eRob whose firmware speaks the vendor's own CAN protocol (eRunner manual 1.7, chapters 4 and 7, and field
//! experience). It has no cyclic process data: a master asks, and it replies.
//!
//! - `drive`: the complete module: frames, time, power.
//! - `settings`: what can be written, and what is kept without power.

mod drive;
mod settings;

pub use drive::{ErobCanDrive, ErobCanParameters, ErrorForm};
