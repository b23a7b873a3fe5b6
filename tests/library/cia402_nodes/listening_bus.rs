//! A simulated bus that keeps what passes, and loses error control frames when told to.

use takt::sim::SimulatedBus;
use takt_rt::{BusHealth, BusPort, Frame, FrameKind, Id, ReceiveBatch};

pub struct ListeningBus {
    pub bus: SimulatedBus,
    /// What the controller has sent, and when.
    pub sent: Vec<(u64, Frame)>,
    /// What the drives have sent.
    pub received: Vec<Frame>,
    /// The node whose heartbeats and replies to guarding are lost.
    pub loses_error_control_of: Option<u8>,
}

impl ListeningBus {
    pub fn new(bus: SimulatedBus) -> Self {
        Self { bus, sent: vec![], received: vec![], loses_error_control_of: None }
    }

    /// When the controller has asked a node for its state.
    pub fn guard_requests_ns(&self, node: u8) -> Vec<u64> {
        let is_request = |frame: &Frame| {
            frame.kind() == FrameKind::Remote && frame.id() == Id::canopen(0x700, node) && frame.length() == 1
        };
        self.sent.iter().filter(|(_, frame)| is_request(frame)).map(|(at_ns, _)| *at_ns).collect()
    }
}

impl BusPort for ListeningBus {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        for (index, frame) in frames.iter().enumerate() {
            if self.bus.send(now_ns, &[*frame]) == 0 {
                return index;
            }
            self.sent.push((now_ns, *frame));
        }
        frames.len()
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        let mut all = ReceiveBatch::new();
        self.bus.receive(now_ns, &mut all);
        for received in all {
            self.received.push(received.frame);
            let lost = self.loses_error_control_of.map(|node| Id::canopen(0x700, node));
            if lost != Some(received.frame.id()) {
                batch.push(received);
            }
        }
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.bus.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.bus.health()
    }
}
