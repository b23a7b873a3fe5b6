//! A bus port that lets another thread see every frame that passes.

use takt_rt::frame::Frame;
use takt_rt::port::{BusHealth, BusPort, ReceiveBatch};
use takt_rt::time::Nanoseconds;

use crate::controller::channels::{Consumer, Producer, ring};

/// A frame that passed a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TracedFrame {
    /// When it was handed to the interface, or had completely arrived.
    pub at_ns: Nanoseconds,
    /// The frame.
    pub frame: Frame,
}

/// Wraps a port: everything it sends and receives is also copied to a [`Trace`]. A full trace drops and counts.
pub struct TracedPort<P> {
    port: P,
    frames: Producer<TracedFrame>,
}

/// The other end: the frames of one bus, in the order in which they passed the port.
pub struct Trace {
    name: String,
    frames: Consumer<TracedFrame>,
}

/// Wraps `port` and makes a trace for `capacity` frames, which candump logs show under `name` (an interface's name:
/// white space in it becomes `_`).
pub fn traced<P: BusPort>(port: P, name: &str, capacity: usize) -> (TracedPort<P>, Trace) {
    let (producer, consumer) = ring(capacity);
    let name = name.split_whitespace().collect::<Vec<_>>().join("_");
    (TracedPort { port, frames: producer }, Trace { name, frames: consumer })
}

impl Trace {
    /// The name of the bus.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Takes the oldest frame.
    pub fn take(&mut self) -> Option<TracedFrame> {
        self.frames.pop()
    }

    /// Frames that found no room.
    pub fn dropped(&self) -> u64 {
        self.frames.dropped()
    }
}

impl<P> TracedPort<P> {
    /// The port within.
    pub fn inner_mut(&mut self) -> &mut P {
        &mut self.port
    }
}

impl<P: BusPort> BusPort for TracedPort<P> {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        let taken = self.port.send(now_ns, frames);
        for frame in frames.iter().take(taken) {
            self.frames.push(TracedFrame { at_ns: now_ns, frame: *frame });
        }
        taken
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        let before = batch.len();
        self.port.receive(now_ns, batch);
        for received in batch.iter().skip(before) {
            self.frames.push(TracedFrame { at_ns: received.at_ns, frame: received.frame });
        }
    }

    fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
        self.port.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.port.health()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::frame::Id;
    use takt_rt::port::{BusState, Received};

    /// Takes two frames at a time, and has received one frame at each instant.
    struct Narrow;

    impl BusPort for Narrow {
        fn send(&mut self, _now_ns: Nanoseconds, frames: &[Frame]) -> usize {
            frames.len().min(2)
        }

        fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
            batch.push(Received { frame: frame(0xFF), at_ns: now_ns - 1 });
        }

        fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
            now_ns as usize
        }

        fn health(&mut self) -> BusHealth {
            BusHealth { state: BusState::ErrorPassive, errors: 3, ..BusHealth::default() }
        }
    }

    fn frame(byte: u8) -> Frame {
        Frame::of(Id::canopen(0x200, 1), [byte])
    }

    #[test]
    fn what_the_port_took_and_brought_is_traced_in_order_and_nothing_else() {
        let (mut port, mut trace) = traced(Narrow, "arm left", 8);
        assert_eq!(port.send(100, &[frame(1), frame(2), frame(3)]), 2);
        let mut batch = ReceiveBatch::new();
        batch.push(Received { frame: frame(0xEE), at_ns: 0 });
        port.receive(200, &mut batch);
        assert_eq!(batch.len(), 2);
        let seen: Vec<_> = std::iter::from_fn(|| trace.take()).collect();
        let expected = [(100, frame(1)), (100, frame(2)), (199, frame(0xFF))];
        assert_eq!(seen, expected.map(|(at_ns, frame)| TracedFrame { at_ns, frame }));
        assert_eq!((trace.name(), trace.dropped()), ("arm_left", 0));
    }

    #[test]
    fn a_full_trace_drops_and_counts_and_the_port_works_on() {
        let (mut port, trace) = traced(Narrow, "can0", 3);
        assert_eq!(port.send(1, &[frame(1), frame(2)]), 2);
        assert_eq!(port.send(2, &[frame(3), frame(4)]), 2);
        assert_eq!(trace.dropped(), 1);
        assert_eq!((port.unconfirmed(7), port.health()), (7, Narrow.health()));
    }
}
