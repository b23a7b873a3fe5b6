//! What the buses can carry: how long frames take, and whether the traffic of a configuration fits.

pub mod frame_time;
pub mod schedule;
