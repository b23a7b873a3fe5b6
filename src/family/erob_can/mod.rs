//! ZeroErr eRob whose firmware speaks the vendor's own CAN protocol (eRunner manual 1.7, chapters 4 and 7).
//!
//! The protocol is too slow and too loose for the cycle: procedures move such a drive, one request at a time.
//!
//! - [`motion`]: the motions of the manual, with their steps and waits.
//! - [`module`]: what a module tells of itself, saving, the brake, and the encoder.

pub mod module;
pub mod motion;
