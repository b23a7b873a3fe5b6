//! The port of a configured bus, of any kind.

use arrayvec::ArrayVec;
use takt_rt::Frame;
use takt_rt::{BusHealth, BusPort, MAX_BUSES, Nanoseconds, Outgoing, ReceiveBatch};

use super::lines::LinePort;
use crate::faults::{Delivery, DriveEffect, FaultyPort, InjectError, Injectable};
use crate::link::LinkPort;
use crate::link::trace::{Trace, TracedPort, traced};
use takt_sim::SimulatedBus;

/// Frames that the trace to the logger holds: almost one second of a fully loaded bus at 1 Mbit/s.
const TRACE_FRAMES: usize = 1 << 13;

/// A bus port of any kind.
#[non_exhaustive]
pub enum Port {
    /// A bus with simulated drives inside this process.
    Simulated(Box<SimulatedBus>),
    /// A CAN interface of this machine, or an adapter on a serial line of it.
    Link(LinkPort),
    /// A serial line, whose drives are spoken to outside of the cycle.
    Line(Box<LinePort>),
    /// Any port whose frames are copied to the logger.
    Traced(Box<TracedPort<Port>>),
    /// Any port with injected faults.
    Faulty(Box<FaultyPort<Port>>),
}

impl Port {
    /// The simulated bus behind this port, if it is a simulated one.
    pub fn simulated_mut(&mut self) -> Option<&mut SimulatedBus> {
        match self {
            Self::Simulated(bus) => Some(bus),
            Self::Link(_) | Self::Line(_) => None,
            Self::Traced(port) => port.inner_mut().simulated_mut(),
            Self::Faulty(port) => port.inner_mut().simulated_mut(),
        }
    }

    /// This port with a trace, which receives a copy of every frame, and the trace.
    pub fn traced(self, name: &str) -> (Self, Trace) {
        let (port, trace) = traced(self, name, TRACE_FRAMES);
        (Self::Traced(Box::new(port)), trace)
    }
}

impl From<LinkPort> for Port {
    fn from(port: LinkPort) -> Self {
        Self::Link(port)
    }
}

impl From<FaultyPort<Port>> for Port {
    fn from(port: FaultyPort<Self>) -> Self {
        Self::Faulty(Box::new(port))
    }
}

impl Port {
    /// The port of its kind.
    fn kind(&mut self) -> &mut dyn Injectable {
        match self {
            Self::Simulated(port) => port.as_mut(),
            Self::Link(port) => port,
            Self::Line(port) => port.as_mut(),
            Self::Traced(port) => port.as_mut(),
            Self::Faulty(port) => port.as_mut(),
        }
    }
}

impl BusPort for Port {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        self.kind().send(now_ns, frames)
    }

    fn send_together(now_ns: Nanoseconds, outgoing: &mut [Outgoing<'_, Self>]) {
        let mut links = ArrayVec::<_, MAX_BUSES>::new();
        let mut traced = ArrayVec::<_, MAX_BUSES>::new();
        for Outgoing { port, frames, taken } in outgoing.iter_mut().take(MAX_BUSES) {
            match port {
                Self::Link(port) => links.push(Outgoing { port, frames, taken }),
                Self::Traced(port) => traced.push(Outgoing { port: port.as_mut(), frames, taken }),
                port => **taken = port.send(now_ns, frames),
            }
        }
        if !links.is_empty() {
            LinkPort::send_together(now_ns, &mut links);
        }
        if !traced.is_empty() {
            TracedPort::send_together(now_ns, &mut traced);
        }
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        self.kind().receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
        self.kind().unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.kind().health()
    }
}

impl Injectable for LinkPort {}

impl Injectable for Port {
    fn send_foreign(&mut self, now_ns: Nanoseconds, frame: &Frame) -> Delivery {
        self.kind().send_foreign(now_ns, frame)
    }

    fn inject(&mut self, node: u8, effect: DriveEffect, is_present: bool) -> Result<(), InjectError> {
        self.kind().inject(node, effect, is_present)
    }
}
