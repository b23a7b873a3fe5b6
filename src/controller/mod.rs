//! controller.

pub mod channels;
