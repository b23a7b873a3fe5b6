//! A CAN bus behind a serial line as a [`BusPort`](crate::port::BusPort): an SLCAN adapter, or a transparent converter between RS-485 and
//! CAN FD.
//!
//! - `port`: the descriptor with its channel, as the owner makes it and the cycle calls it;
//! - `codec`: what the line carries;
//! - `channel`: frames to lines and back, with bounded work and no input or output of its own;
//! - `byte_line`: the system calls on the descriptor;
//! - `accounting`: the counters and the state of the bus.
//!
//! No call here waits or allocates, except [`LinePort::wait`], which waits on request.

mod accounting;
mod byte_line;
mod channel;
mod codec;
mod port;

pub use codec::{Arrival, LineCodec, SlcanCodec, TransparentCodec};
pub use port::{LinePort, SlcanPort, TransparentPort};
