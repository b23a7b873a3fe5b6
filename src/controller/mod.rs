//! A running controller: the engine of a configuration, the real-time thread that paces it, and the life cycle
//! around it.

pub mod assemble;
pub mod channels;
pub mod program;
pub mod realtime_thread;
