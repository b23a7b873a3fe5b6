//! Node guarding (CiA 301, 7.2.8.3.2.1): the controller asks a node without a heartbeat for its state by a remote frame, and the node
//! notices by the same frames that the controller is there.
//!
//! A request leaves at the guard time, at most one on a bus in a cycle. The reply carries the NMT state, and a bit that toggles from
//! one reply to the next. A reply whose bit has not changed counts as not received. Silence counts from the first request that has
//! had no reply: a node that was not asked, because the thread was late, has not missed anything.

use arrayvec::ArrayVec;

use super::parameters::EngineParameters;
use crate::axis::Supervision;
use crate::frame::{Frame, Id};
use crate::function_code;
use crate::watch::node_state;

/// The bit of a reply that changes from one to the next.
const TOGGLE: u8 = 0x80;

/// What a node has said to the requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
enum Exchange {
    /// It has not been asked since it started, or since guarding began.
    #[default]
    NotAsked,
    /// It has been asked and has not replied yet. Its reply before that, if there was one, had this toggle bit.
    Asked { before: Option<bool> },
    /// It has replied, with this toggle bit.
    Answered { toggle: bool },
}

/// One node that is asked.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct NodeGuard {
    pub(super) bus: u8,
    pub(super) node: u8,
    guard_cycles: u32,
    /// Cycles until the next request.
    due: u32,
    /// Cycles for which one has been due.
    overdue: u32,
    exchange: Exchange,
}

impl NodeGuard {
    /// Returns `true` if it has been asked and has not replied yet.
    #[inline]
    pub(super) const fn is_asked(&self) -> bool {
        matches!(self.exchange, Exchange::Asked { .. })
    }
}

/// The nodes that are asked, each once, however many axes it has.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct NodeGuards<const AXES: usize> {
    pub(super) nodes: ArrayVec<NodeGuard, AXES>,
    is_begun: bool,
}

impl<const AXES: usize> NodeGuards<AXES> {
    pub(super) fn new<const BUSES: usize>(parameters: &EngineParameters<AXES, BUSES>) -> Self {
        let mut nodes: ArrayVec<NodeGuard, AXES> = ArrayVec::new();
        for axis in &parameters.axes {
            let Supervision::Guarding { guard_cycles, .. } = axis.supervision else { continue };
            let (bus, node) = (axis.bus, axis.node);
            if !nodes.iter().any(|guard| (guard.bus, guard.node) == (bus, node)) {
                let exchange = Exchange::default();
                nodes.push(NodeGuard { bus, node, guard_cycles, due: 0, overdue: 0, exchange });
            }
        }
        Self { nodes, is_begun: false }
    }

    /// Begins to ask: the nodes are operational. It never ends, since the nodes watch for the requests from the first one on.
    pub(super) const fn begin(&mut self) {
        self.is_begun = true;
    }

    /// Lets slots pass.
    pub(super) fn pass(&mut self, elapsed: u64) {
        let elapsed = u32::try_from(elapsed).unwrap_or(u32::MAX);
        for NodeGuard { due, overdue, .. } in &mut self.nodes {
            *overdue = if *due == 0 { overdue.saturating_add(elapsed) } else { 0 };
            *due = due.saturating_sub(elapsed);
        }
    }

    /// The request that is due on a bus, to the node that has waited for it longest. It counts as sent.
    pub(super) fn take_request(&mut self, bus: usize) -> Option<Frame> {
        if !self.is_begun {
            return None;
        }
        let waiting = self.nodes.iter_mut().filter(|guard| usize::from(guard.bus) == bus && guard.due == 0);
        // The first of several that have waited equally long.
        let guard =
            waiting.reduce(|longest, other| if other.overdue > longest.overdue { other } else { longest })?;
        guard.due = guard.guard_cycles;
        guard.overdue = 0;
        guard.exchange = match guard.exchange {
            Exchange::NotAsked => Exchange::Asked { before: None },
            Exchange::Asked { before } => Exchange::Asked { before },
            Exchange::Answered { toggle } => Exchange::Asked { before: Some(toggle) },
        };
        // The reply has one byte.
        Frame::remote(Id::canopen(function_code::ERROR_CONTROL, guard.node), 1).ok()
    }

    /// Returns `true` if an error control message of a node counts: the reply of a node that is asked must have toggled its bit.
    pub(super) fn accepts(&mut self, bus: u8, node: u8, message: u8) -> bool {
        let Some(guard) = self.of(bus, node) else { return true };
        if message == node_state::BOOT_UP {
            guard.exchange = Exchange::NotAsked;
            return true;
        }
        let toggle = message & TOGGLE != 0;
        let before = match guard.exchange {
            Exchange::NotAsked => return true,
            Exchange::Asked { before } => before,
            Exchange::Answered { toggle } => Some(toggle),
        };
        let is_new = before != Some(toggle);
        if is_new {
            guard.exchange = Exchange::Answered { toggle };
        }
        is_new
    }

    fn of(&mut self, bus: u8, node: u8) -> Option<&mut NodeGuard> {
        self.nodes.iter_mut().find(|guard| (guard.bus, guard.node) == (bus, node))
    }

    /// Returns `true` if a node is not asked at all, or has replied: then it watches the controller.
    pub(super) fn allows_enabling(&self, bus: u8, node: u8) -> bool {
        let guard = self.nodes.iter().find(|guard| (guard.bus, guard.node) == (bus, node));
        let has_replied = |guard: &NodeGuard| {
            matches!(guard.exchange, Exchange::Answered { .. } | Exchange::Asked { before: Some(_) })
        };
        guard.is_none_or(has_replied)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guards(nodes: &[u8], guard_cycles: u32) -> NodeGuards<8> {
        let guard = |node: &u8| NodeGuard {
            bus: 0,
            node: *node,
            guard_cycles,
            due: 0,
            overdue: 0,
            exchange: Exchange::default(),
        };
        NodeGuards { nodes: nodes.iter().map(guard).collect(), is_begun: true }
    }

    #[test]
    fn each_node_has_its_turn_at_the_guard_time_and_no_two_in_one_cycle() {
        let mut guards = guards(&[3, 1, 2], 10);
        let asked: [Option<u32>; 24] = core::array::from_fn(|_| {
            let request = guards.take_request(0);
            assert_eq!(guards.take_request(1), None, "another bus");
            guards.pass(1);
            request.map(|frame| frame.id().value())
        });
        for (cycle, id) in asked.into_iter().enumerate() {
            let expected = [0x703, 0x701, 0x702].get(cycle % 10).copied();
            assert_eq!(id, expected, "{cycle}");
        }
    }

    #[test]
    fn a_reply_counts_once_it_has_toggled_and_a_boot_up_begins_anew() {
        let mut guards = guards(&[5], 1);
        guards.take_request(0);
        assert!(guards.accepts(0, 5, 0x85), "the first reply may have either bit");
        assert!(!guards.accepts(0, 5, 0x85));
        guards.take_request(0);
        assert!(!guards.accepts(0, 5, 0x85));
        assert!(guards.accepts(0, 5, 0x05));
        assert!(guards.accepts(0, 5, node_state::BOOT_UP));
        guards.take_request(0);
        assert!(guards.accepts(0, 5, 0x05), "the bit of a node that has started anew is 0");
        assert!(guards.accepts(0, 6, 0x05) && guards.accepts(0, 6, 0x05), "another node is not guarded");
    }
}
