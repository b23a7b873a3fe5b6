//! What the cycle needs from the world: a clock and a bus. Everything else in this crate is computation.
//!
//! The same cycle runs over a real kernel (`linux`, and the SocketCAN port), over simulated buses in wall-clock
//! time, and over both in virtual time: only the implementations of these two traits differ.

use crate::frame::Frame;
use crate::time::Nanoseconds;

/// The most frames taken from a bus in one go.
pub const RECEIVE_BATCH: usize = 64;

/// A monotonic clock that can be waited on.
pub trait Clock {
    /// The present.
    fn now_ns(&mut self) -> Nanoseconds;

    /// Returns at `deadline_ns` or as soon after it as the system allows; at once when it has passed.
    fn wait_until(&mut self, deadline_ns: Nanoseconds) -> Wake;

    /// As [`Clock::wait_until`], where a frame must leave at `deadline_ns`: whatever can be done beforehand to be on
    /// time is done.
    fn wait_to_send(&mut self, deadline_ns: Nanoseconds) -> Wake {
        self.wait_until(deadline_ns)
    }
}

/// How a wait ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Wake {
    /// The present, at or after the deadline.
    pub now_ns: Nanoseconds,
    /// How late the operating system's timer was against the instant it was set to (which lies the guard
    /// time before the deadline when the wait ends in a spin); 0 when there was no sleep.
    pub timer_latency_ns: Nanoseconds,
    /// How long the computer was suspended since the last wait that tells of it: the clock stood still then. 0 where the clock cannot tell.
    pub suspended_ns: Nanoseconds,
}

/// A frame from a bus with the time of its arrival.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received {
    /// The frame.
    pub frame: Frame,
    /// When it had completely arrived.
    pub at_ns: Nanoseconds,
}

/// Frames taken from a bus in one go.
pub type ReceiveBatch = arrayvec::ArrayVec<Received, RECEIVE_BATCH>;

/// What one of several ports is to send.
pub struct Outgoing<'a, P> {
    /// The port.
    pub port: &'a mut P,
    /// The frames, the first one first.
    pub frames: &'a [Frame],
    /// Where it is written how many of them the port took.
    pub taken: &'a mut usize,
}

/// One CAN interface as the real-time thread sees it. No call blocks.
pub trait BusPort {
    /// Hands frames to the interface, the first one first, and returns how many it took; the rest is not sent
    /// and not kept.
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize;

    /// As [`BusPort::send`] on each of these ports (at most [`MAX_BUSES`](crate::capacity::MAX_BUSES)), in as few calls of
    /// the system as they can share: then the frames of several buses leave closer together.
    fn send_together(now_ns: Nanoseconds, outgoing: &mut [Outgoing<'_, Self>])
    where
        Self: Sized,
    {
        for entry in outgoing {
            *entry.taken = entry.port.send(now_ns, entry.frames);
        }
    }

    /// Appends what has arrived up to `now_ns`, oldest first, as far as `batch` has room. Own frames are not
    /// among it. Fewer than the room left means that nothing more is waiting, or that the port has done as much as it
    /// does in one call; the rest stays for the next one.
    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch);

    /// Own frames that were taken by [`BusPort::send`] and have not yet been seen on the wire. While there are
    /// any at a command phase, no set-points are queued behind them: stale ones would be sent late. A frame whose confirmation was lost
    /// counts until a later one has been seen.
    fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize;

    /// The state of the interface, with its counters since it was opened.
    fn health(&mut self) -> BusHealth;
}

/// The fault confinement state of a CAN controller (ISO 11898-1), and whether there is an interface at all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum BusState {
    /// Works normally.
    #[default]
    ErrorActive,
    /// An error counter is above 127.
    ErrorPassive,
    /// The controller has switched itself off the bus.
    BusOff,
    /// The interface is down or gone.
    Down,
}

/// State and counters of an interface since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct BusHealth {
    /// The fault confinement state.
    pub state: BusState,
    /// Frames sent and seen on the wire.
    pub tx_frames: u64,
    /// Frames received from others.
    pub rx_frames: u64,
    /// Frames that the interface had no room for.
    pub tx_overruns: u64,
    /// Received frames that were lost before they could be read.
    pub rx_overruns: u64,
    /// Error frames, bus errors, and own frames whose confirmation was lost.
    pub errors: u64,
    /// How long the wire was occupied, in nanoseconds, by the frames that this port saw; for the bus load. A SocketCAN port
    /// leaves out the stuff bits: the wire is then occupied for up to 22 % longer. A simulated bus counts every bit.
    pub busy_ns: u64,
}
