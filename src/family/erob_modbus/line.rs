//! The drives of a serial line, each with its follower: they share the line by turns, one request at a time.

use takt_rt::{Nanoseconds, OffCycleReport};
use takt_wire::modbus::frame::SlaveAddress;
use takt_wire::modbus::master::{Master, MasterTiming, Repeat};

use super::follower::{Follower, FollowerParameters};
use crate::family::{LineCounts, OffCycleLine, OffCycleTarget};

/// A line whose drives follow.
#[derive(Debug)]
pub struct FollowedLine {
    timing: MasterTiming,
    master: Master,
    slaves: Vec<(SlaveAddress, Follower)>,
    /// Whose turn is next, and who was asked.
    turn: usize,
    asked: Option<usize>,
    counts: LineCounts,
}

impl FollowedLine {
    /// A line with these drives, of which nothing is known. A request is not repeated: the next one brings what is new.
    pub fn new(
        timing: MasterTiming,
        slaves: impl IntoIterator<Item = (SlaveAddress, FollowerParameters)>,
    ) -> Self {
        let slaves = slaves.into_iter().map(|(slave, parameters)| (slave, Follower::new(parameters)));
        Self {
            timing,
            master: Master::new(timing),
            slaves: slaves.collect(),
            turn: 0,
            asked: None,
            counts: LineCounts::default(),
        }
    }

    /// Begins the request of the next drive that has one. Returns whether there was any.
    fn begin_next(&mut self, now_ns: Nanoseconds, targets: &[OffCycleTarget]) -> bool {
        let count = self.slaves.len();
        for place in (0..count).map(|at| (self.turn + at) % count) {
            let (Some((slave, follower)), Some(target)) = (self.slaves.get_mut(place), targets.get(place))
            else {
                continue;
            };
            let Some(request) = follower.next(now_ns, target) else { continue };
            // The master is free: its last outcome has been taken.
            if self.master.start(*slave, request, Repeat::Never).is_ok() {
                (self.asked, self.turn) = (Some(place), place + 1);
                return true;
            }
        }
        false
    }

    fn sent(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        self.counts.requests = self.counts.requests.saturating_add(1);
        let busy_ns = self.timing.line.duration_ns(bytes.len());
        self.counts.busy_ns = self.counts.busy_ns.saturating_add(busy_ns);
        bytes
    }
}

impl OffCycleLine for FollowedLine {
    fn receive(&mut self, bytes: &[u8]) {
        let busy_ns = self.timing.line.duration_ns(bytes.len());
        self.counts.busy_ns = self.counts.busy_ns.saturating_add(busy_ns);
        self.master.receive(bytes);
    }

    fn poll(
        &mut self,
        now_ns: Nanoseconds,
        targets: &[OffCycleTarget],
        report: &mut dyn FnMut(usize, OffCycleReport),
    ) -> Option<Vec<u8>> {
        loop {
            if let Some(bytes) = self.master.poll(now_ns) {
                return Some(self.sent(bytes));
            }
            if let Some(outcome) = self.master.take_outcome() {
                let counted =
                    if outcome.is_ok() { &mut self.counts.replies } else { &mut self.counts.failures };
                *counted = counted.saturating_add(1);
                let place = self.asked.take()?;
                if let Some(news) =
                    self.slaves.get_mut(place).and_then(|(_, follower)| follower.take(now_ns, outcome))
                {
                    report(place, news);
                }
            }
            if self.asked.is_some() || !self.begin_next(now_ns, targets) {
                return None;
            }
            if let Some(bytes) = self.master.poll(now_ns) {
                return Some(self.sent(bytes));
            }
        }
    }

    fn is_settled(&self, place: usize) -> bool {
        self.slaves.get(place).is_none_or(|(_, follower)| follower.is_settled())
    }

    fn counts(&self) -> LineCounts {
        self.counts
    }
}
