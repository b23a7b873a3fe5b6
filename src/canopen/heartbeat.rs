//! Heartbeat consumers for several nodes (CiA 301, 7.2.8.3.2 and object 1016).

use takt_rt::{Frame, Nanoseconds};

use super::nmt::{HeartbeatConsumer, HeartbeatEvent, NmtState};

const MILLISECOND_NS: Nanoseconds = 1_000_000;

/// An entry of object 1016: a node ID and its heartbeat timeout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConsumerHeartbeatTime {
    /// The producer's node ID, 1 to 127.
    pub node: u8,
    /// The timeout in ms, more than 0.
    pub time_ms: u16,
}

impl ConsumerHeartbeatTime {
    /// Decodes an entry; `None` without a timeout or a valid node ID.
    pub const fn from_parameter(value: u32) -> Option<Self> {
        let (node, time_ms) = ((value >> 16) as u8, value as u16);
        if time_ms == 0 || node == 0 || node > 0x7F { None } else { Some(Self { node, time_ms }) }
    }

    /// Encodes the entry.
    pub const fn parameter(self) -> u32 {
        (self.node as u32) << 16 | self.time_ms as u32
    }
}

/// The node already has a consumer; CiA 301, 7.5.2.19 refuses such an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the heartbeat of node {node} is already monitored")]
pub struct AlreadyMonitored {
    /// The node ID.
    pub node: u8,
}

/// Monitors the heartbeats of several nodes on one bus.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HeartbeatTable {
    /// In the order of their addition.
    consumers: Vec<(u8, HeartbeatConsumer)>,
}

impl HeartbeatTable {
    /// Monitors these nodes, each from its first message on.
    pub fn new(entries: impl IntoIterator<Item = ConsumerHeartbeatTime>) -> Result<Self, AlreadyMonitored> {
        let mut table = Self::default();
        for entry in entries {
            table.monitor(entry)?;
        }
        Ok(table)
    }

    /// Adds a node.
    pub fn monitor(&mut self, entry: ConsumerHeartbeatTime) -> Result<(), AlreadyMonitored> {
        let ConsumerHeartbeatTime { node, time_ms } = entry;
        if self.is_monitored(node) {
            return Err(AlreadyMonitored { node });
        }
        let timeout_ns = Nanoseconds::from(time_ms) * MILLISECOND_NS;
        self.consumers.push((node, HeartbeatConsumer::new(node, timeout_ns)));
        Ok(())
    }

    /// Removes a node.
    pub fn remove(&mut self, node: u8) {
        self.consumers.retain(|(monitored, _)| *monitored != node);
    }

    /// Whether a node is monitored.
    pub fn is_monitored(&self, node: u8) -> bool {
        self.consumers.iter().any(|(monitored, _)| *monitored == node)
    }

    /// The last reported state of a node; `None` if it is not monitored, not known yet, or lost.
    pub fn state(&self, node: u8) -> Option<NmtState> {
        self.consumers.iter().find(|(monitored, _)| *monitored == node)?.1.state()
    }

    /// Every monitored node with its state.
    pub fn states(&self) -> impl Iterator<Item = (u8, Option<NmtState>)> + '_ {
        self.consumers.iter().map(|(node, consumer)| (*node, consumer.state()))
    }

    /// Receives a frame at `now_ns`; returns the node that has booted or changed its state.
    pub fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame) -> Option<(u8, HeartbeatEvent)> {
        self.consumers.iter_mut().find_map(|(node, consumer)| Some((*node, consumer.receive(now_ns, frame)?)))
    }

    /// Returns a lost node, each once. Call it until it returns `None`.
    pub fn poll(&mut self, now_ns: Nanoseconds) -> Option<(u8, HeartbeatEvent)> {
        self.consumers.iter_mut().find_map(|(node, consumer)| Some((*node, consumer.poll(now_ns)?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::nmt::ErrorControl;

    fn entry(node: u8, time_ms: u16) -> ConsumerHeartbeatTime {
        ConsumerHeartbeatTime { node, time_ms }
    }

    fn heartbeat(node: u8, state: NmtState) -> Frame {
        ErrorControl { node, state }.frame()
    }

    #[test]
    fn every_node_has_its_own_timeout() {
        let mut table = HeartbeatTable::new([entry(2, 100), entry(3, 200)]).unwrap();
        for node in [2, 3, 4] {
            let event = table.receive(0, &heartbeat(node, NmtState::Operational));
            assert_eq!(event.is_some(), node != 4, "node {node}");
        }
        assert_eq!(table.poll(100_000_000), None);
        let lost = |silence_ns| HeartbeatEvent::Lost { last: NmtState::Operational, silence_ns };
        assert_eq!(table.poll(150_000_000), Some((2, lost(150_000_000))));
        assert_eq!(table.poll(150_000_000), None);
        assert_eq!(table.poll(250_000_000), Some((3, lost(250_000_000))));
        let back = table.receive(260_000_000, &heartbeat(2, NmtState::BootUp));
        assert_eq!(back, Some((2, HeartbeatEvent::BootUp)));
        assert_eq!(table.states().collect::<Vec<_>>(), [(2, Some(NmtState::BootUp)), (3, None)]);
    }

    #[test]
    fn several_nodes_lost_at_once_are_returned_one_by_one() {
        let mut table = HeartbeatTable::new([entry(2, 100), entry(3, 100)]).unwrap();
        for node in [2, 3] {
            table.receive(0, &heartbeat(node, NmtState::PreOperational));
        }
        let mut lost = vec![];
        while let Some((node, _)) = table.poll(1_000_000_000) {
            lost.push(node);
        }
        assert_eq!(lost, [2, 3]);
    }

    #[test]
    fn a_node_is_added_once_and_can_be_removed() {
        let mut table = HeartbeatTable::new([entry(2, 100)]).unwrap();
        assert_eq!(table.monitor(entry(2, 500)), Err(AlreadyMonitored { node: 2 }));
        table.remove(2);
        assert!(!table.is_monitored(2));
        assert_eq!(table.monitor(entry(2, 500)), Ok(()));
    }

    #[test]
    fn entries_of_object_1016_are_decoded_and_encoded() {
        assert_eq!(ConsumerHeartbeatTime::from_parameter(0x007F_07D0), Some(entry(127, 2000)));
        assert_eq!(entry(127, 2000).parameter(), 0x007F_07D0);
        assert_eq!(ConsumerHeartbeatTime::from_parameter(0x007F_0000), None);
        assert_eq!(ConsumerHeartbeatTime::from_parameter(0x0080_07D0), None);
        assert_eq!(ConsumerHeartbeatTime::from_parameter(0), None);
    }
}
