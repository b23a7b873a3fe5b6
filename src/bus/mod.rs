//! The buses: what they are connected to, how long frames take, and whether everything fits.

pub mod frame_time;
pub mod port;
pub mod schedule;
pub mod trace;
