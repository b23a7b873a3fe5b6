//! NMT state, boot-up, heartbeat producer and consumer, SYNC producer, node guarding (CiA 301, 7.2.8, 7.3.2).

use takt_rt::Nanoseconds;

use super::dictionary::{ErobDictionary, at};
use crate::sim::drive::NodeState;

/// From "reset communication" to the boot-up message (0 to 1 ms in the manual's captures).
const RESET_COMMUNICATION_NS: Nanoseconds = 500_000;
const NEVER: Nanoseconds = Nanoseconds::MAX;
const MILLISECOND_NS: Nanoseconds = 1_000_000;
const MICROSECOND_NS: Nanoseconds = 1000;
/// Object 1005, bit 30: the node produces SYNC.
const SYNC_PRODUCER: u32 = 1 << 30;

/// What the drive resets after an NMT command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErobReset {
    /// Communication parameters only.
    Communication,
    /// The whole node.
    Node,
}

/// NMT slave, error control, and their timers.
#[derive(Clone, Copy, Debug)]
pub struct ErobNetwork {
    node: u8,
    state: NodeState,
    boot_ns: Nanoseconds,
    heartbeat_ns: Nanoseconds,
    /// When the next SYNC is due; [`NEVER`] while the node does not produce it.
    sync_ns: Nanoseconds,
    /// Deadline of the master's next heartbeat; [`NEVER`] until the first one.
    master_deadline_ns: Nanoseconds,
    /// Deadline of the next node guarding request.
    guard_deadline_ns: Nanoseconds,
    guard_toggle: bool,
}

impl ErobNetwork {
    /// A node that boots and is ready at `boot_ns`.
    pub fn starting(node: u8, boot_ns: Nanoseconds) -> Self {
        Self {
            node,
            state: NodeState::Initialising,
            boot_ns,
            heartbeat_ns: NEVER,
            sync_ns: NEVER,
            master_deadline_ns: NEVER,
            guard_deadline_ns: NEVER,
            guard_toggle: false,
        }
    }

    /// The NMT state.
    pub fn state(&self) -> NodeState {
        self.state
    }

    /// Whether SDO and emergency messages work.
    pub fn has_services(&self) -> bool {
        matches!(self.state, NodeState::PreOperational | NodeState::Operational)
    }

    /// The time of the next action.
    pub fn due_ns(&self) -> Nanoseconds {
        let timers = self.boot_ns.min(self.heartbeat_ns).min(self.sync_ns);
        timers.min(self.master_deadline_ns).min(self.guard_deadline_ns)
    }

    /// Boots when it is time. Returns whether the boot-up message is to be sent.
    pub fn boot_if_due(&mut self, now_ns: Nanoseconds, dictionary: &ErobDictionary) -> bool {
        if now_ns < self.boot_ns {
            return false;
        }
        self.boot_ns = NEVER;
        self.state = NodeState::PreOperational;
        self.guard_toggle = false;
        self.schedule_heartbeat(now_ns, dictionary);
        self.schedule_sync(now_ns, dictionary);
        true
    }

    /// The byte of a heartbeat that is due.
    pub fn heartbeat(&mut self, now_ns: Nanoseconds, dictionary: &ErobDictionary) -> Option<u8> {
        if now_ns < self.heartbeat_ns {
            return None;
        }
        self.schedule_heartbeat(now_ns, dictionary);
        Some(self.state.code())
    }

    /// Whether SYNC is due, as the producer of it sends it (object 1005 bit 30, object 1006). A stopped node sends none.
    pub fn produces_sync(&mut self, now_ns: Nanoseconds, dictionary: &ErobDictionary) -> bool {
        if now_ns < self.sync_ns {
            return false;
        }
        // The period counts from the time at which SYNC was due, so that it does not drift.
        let due_ns = self.sync_ns;
        self.schedule_sync(due_ns, dictionary);
        self.sync_ns = self.sync_ns.max(now_ns + 1);
        self.has_services()
    }

    /// Restarts the SYNC period, as after a write of object 1005 or 1006.
    pub fn schedule_sync(&mut self, now_ns: Nanoseconds, dictionary: &ErobDictionary) {
        let period_us = Nanoseconds::from(dictionary.get(at::CYCLE_PERIOD));
        let is_producer = dictionary.get(at::SYNC_ID) & SYNC_PRODUCER != 0 && period_us > 0;
        self.sync_ns = if is_producer { now_ns + period_us * MICROSECOND_NS } else { NEVER };
    }

    /// Restarts the heartbeat period, as after a write of object 1017.
    pub fn schedule_heartbeat(&mut self, now_ns: Nanoseconds, dictionary: &ErobDictionary) {
        let period_ms = Nanoseconds::from(dictionary.get(at::PRODUCER_HEARTBEAT));
        self.heartbeat_ns = if period_ms == 0 { NEVER } else { now_ns + period_ms * MILLISECOND_NS };
    }

    /// Takes an NMT command of two bytes.
    pub fn command(&mut self, now_ns: Nanoseconds, command: u8) -> Option<ErobReset> {
        match command {
            0x01 => self.state = NodeState::Operational,
            0x02 => self.state = NodeState::Stopped,
            0x80 => self.state = NodeState::PreOperational,
            0x81 => return Some(ErobReset::Node),
            0x82 => {
                *self = Self::starting(self.node, now_ns + RESET_COMMUNICATION_NS);
                return Some(ErobReset::Communication);
            }
            _ => {}
        }
        None
    }

    /// Receives the heartbeat of another node.
    pub fn receive_heartbeat(&mut self, now_ns: Nanoseconds, node: u8, dictionary: &ErobDictionary) {
        let [low, high, watched, _] = dictionary.get(at::CONSUMER_HEARTBEAT).to_le_bytes();
        let timeout_ms = u16::from_le_bytes([low, high]);
        if watched == node && timeout_ms > 0 {
            self.master_deadline_ns = now_ns + Nanoseconds::from(timeout_ms) * MILLISECOND_NS;
        }
    }

    /// Stops monitoring the master until its next heartbeat, as after a write of object 1016.
    pub fn stop_master_monitor(&mut self) {
        self.master_deadline_ns = NEVER;
    }

    /// Answers a node guarding request. There is no node guarding while a heartbeat is produced.
    pub fn guarded(&mut self, now_ns: Nanoseconds, dictionary: &ErobDictionary) -> Option<u8> {
        if self.heartbeat_ns != NEVER || self.state == NodeState::Initialising {
            return None;
        }
        let guard_time_ms = Nanoseconds::from(dictionary.get(at::GUARD_TIME));
        let life_time_ms = guard_time_ms * Nanoseconds::from(dictionary.get(at::LIFE_TIME_FACTOR));
        self.guard_deadline_ns =
            if life_time_ms == 0 { NEVER } else { now_ns + life_time_ms * MILLISECOND_NS };
        let byte = self.state.code() | u8::from(self.guard_toggle) << 7;
        self.guard_toggle = !self.guard_toggle;
        Some(byte)
    }

    /// Whether the master has just been lost; the NMT state has then changed by object 1029.
    pub fn check_master(&mut self, now_ns: Nanoseconds, dictionary: &ErobDictionary) -> bool {
        if now_ns < self.master_deadline_ns && now_ns < self.guard_deadline_ns {
            return false;
        }
        if now_ns >= self.master_deadline_ns {
            self.master_deadline_ns = NEVER;
        } else {
            self.guard_deadline_ns = NEVER;
        }
        match dictionary.get(at::ERROR_BEHAVIOUR) {
            0 if self.state == NodeState::Operational => self.state = NodeState::PreOperational,
            2 => self.state = NodeState::Stopped,
            _ => {}
        }
        true
    }
}
