//! The simulated wire with frames that are queued at chosen moments, in virtual time.

use std::collections::{BTreeMap, HashMap, VecDeque};

use takt::sim::medium::Medium;
use takt::sim::{Mailbox, QueueOrder, WireBitRates};
use takt_rt::{Frame, Id};

/// A frame that has been received, times in ns.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    pub id: Id,
    pub queued_ns: u64,
    /// When its last bit was there, before the intermission.
    pub heard_ns: u64,
    /// When the wire was free again.
    pub done_ns: u64,
}

impl Arrival {
    pub fn response_ns(self) -> u64 {
        self.done_ns - self.queued_ns
    }
}

/// The wire, its stations and what they are going to send.
pub struct Traffic {
    medium: Medium,
    now_ns: u64,
    /// By moment, in the order in which they were asked for.
    releases: BTreeMap<(u64, usize), (usize, Frame)>,
    asked: usize,
    queued_ns: HashMap<Id, VecDeque<u64>>,
}

impl Traffic {
    /// Station 0 is the controller with its queue; the others send by priority.
    pub fn new(rates: WireBitRates, drives: usize) -> Self {
        Self::on(Medium::with_master(rates, 256, drives, 64))
    }

    /// Every station sends by priority.
    pub fn by_priority(rates: WireBitRates, stations: usize) -> Self {
        Self::on(Medium::new(
            rates,
            (0..stations).map(|_| Mailbox::new(QueueOrder::Priority, 1024)).collect(),
        ))
    }

    fn on(medium: Medium) -> Self {
        Self { medium, now_ns: 0, releases: BTreeMap::new(), asked: 0, queued_ns: HashMap::new() }
    }

    /// Has a station queue a frame at this moment.
    pub fn release(&mut self, at_ns: u64, station: usize, frame: Frame) {
        assert!(at_ns >= self.now_ns, "the past cannot be changed");
        self.releases.insert((at_ns, self.asked), (station, frame));
        self.asked += 1;
    }

    /// The next frame that arrives; `None` when all have.
    pub fn next(&mut self) -> Option<Arrival> {
        loop {
            let release_ns = self.releases.first_key_value().map(|((at_ns, _), _)| *at_ns);
            let wire_ns = self.medium.next_ns(self.now_ns);
            self.now_ns = release_ns.into_iter().chain(wire_ns).min()?;
            while let Some(entry) = self.releases.first_entry().filter(|entry| entry.key().0 <= self.now_ns) {
                let (station, frame) = entry.remove();
                self.queued_ns.entry(frame.id()).or_default().push_back(self.now_ns);
                assert!(self.medium.mailbox_mut(station).push(frame), "a mailbox is full");
            }
            if let Some(sent) = self.medium.step(self.now_ns) {
                let id = sent.frame.id();
                let queued_ns = self.queued_ns.get_mut(&id).and_then(VecDeque::pop_front).unwrap();
                return Some(Arrival { id, queued_ns, heard_ns: sent.arrives_ns, done_ns: sent.free_ns });
            }
        }
    }

    /// Everything that arrives.
    pub fn all(mut self) -> Vec<Arrival> {
        std::iter::from_fn(|| self.next()).collect()
    }
}

/// The longest response of the frames with this identifier.
pub fn longest_response_ns(arrivals: &[Arrival], id: Id) -> u64 {
    arrivals.iter().filter(|arrival| arrival.id == id).map(|arrival| arrival.response_ns()).max().unwrap_or(0)
}
