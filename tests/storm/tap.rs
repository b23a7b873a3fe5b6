//! A port that remembers what the controller has handed over in the present cycle.

use takt::bus::port::Port;
use takt::sim::Observation;
use takt_rt::{BusHealth, BusPort, Frame, ReceiveBatch};

/// The outermost port of a bus: what happens to a frame behind it is no longer the controller's doing.
pub struct Tap {
    port: Port,
    /// What has been taken since the last look.
    pub sent: Vec<Frame>,
}

impl Tap {
    pub fn new(port: Port) -> Self {
        Self { port, sent: vec![] }
    }

    /// The truth about a drive.
    pub fn observe(&mut self, node: u8) -> Observation {
        self.port.simulated_mut().unwrap().observe(node).unwrap()
    }
}

impl BusPort for Tap {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        let taken = self.port.send(now_ns, frames);
        self.sent.extend(&frames[..taken]);
        taken
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        self.port.receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.port.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.port.health()
    }
}
