//! A port that remembers what the controller has handed over in the present cycle.

use std::collections::VecDeque;

use takt::Port;
use takt::sim::Observation;
use takt_rt::{BusHealth, BusPort, Frame, ReceiveBatch};

/// Frames that an interface holds.
const QUEUE: usize = 64;

/// The outermost port of a bus: what happens to a frame behind it is no longer the controller's doing.
pub struct Tap {
    port: Port,
    /// What has been taken since the last look.
    pub sent: Vec<Frame>,
    /// True if the interface's queue takes frames and sends none.
    pub is_clogged: bool,
    queue: VecDeque<Frame>,
}

impl Tap {
    pub fn new(port: Port) -> Self {
        Self { port, sent: vec![], is_clogged: false, queue: VecDeque::new() }
    }

    /// What was held back leaves, all at once.
    fn drain(&mut self, now_ns: u64) {
        if !self.is_clogged && !self.queue.is_empty() {
            let taken = self.port.send(now_ns, self.queue.make_contiguous());
            self.queue.drain(..taken);
        }
    }

    /// The truth about a drive at this time. A bus on which nothing was sent has not got that far yet.
    pub fn observe(&mut self, now_ns: u64, node: u8) -> Observation {
        self.port.unconfirmed(now_ns);
        self.port.simulated_mut().unwrap().observe(node).unwrap()
    }
}

impl BusPort for Tap {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        self.drain(now_ns);
        let taken = if self.is_clogged || !self.queue.is_empty() {
            let taken = frames.len().min(QUEUE - self.queue.len());
            self.queue.extend(&frames[..taken]);
            taken
        } else {
            self.port.send(now_ns, frames)
        };
        self.sent.extend(&frames[..taken]);
        taken
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        self.drain(now_ns);
        self.port.receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.port.unconfirmed(now_ns) + self.queue.len()
    }

    fn health(&mut self) -> BusHealth {
        self.port.health()
    }
}
