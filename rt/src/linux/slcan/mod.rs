//! An SLCAN adapter on a serial line as a [`BusPort`](crate::port::BusPort).
//!
//! - `port`: the descriptor with its channel, as the owner makes it and the cycle calls it;
//! - `channel`: frames to lines and back, with bounded work and no input or output of its own;
//! - `byte_line`: the system calls on the descriptor;
//! - `accounting`: the counters and the state of the bus.
//!
//! No call here waits or allocates, except [`SlcanPort::wait`], which waits on request.

mod accounting;
mod byte_line;
mod channel;
mod port;

pub use port::SlcanPort;
