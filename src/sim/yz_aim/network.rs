//! NMT state, boot-up, heartbeat producer and consumer (manual 5.11, 5.12).

use takt_rt::Nanoseconds;

use super::dictionary::YzAimDictionary;
use super::objects::at;
use crate::sim::drive::NodeState;

/// From "reset communication" to the boot-up message.
const RESET_COMMUNICATION_NS: Nanoseconds = 500_000;
const NEVER: Nanoseconds = Nanoseconds::MAX;
const MILLISECOND_NS: Nanoseconds = 1_000_000;
/// The code of a heartbeat during an alarm.
const ALARM: u8 = 0x04;

/// What the drive resets after an NMT command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum YzAimReset {
    /// Communication parameters only.
    Communication,
    /// The whole node.
    Node,
}

/// NMT slave, error control, and their timers.
#[derive(Clone, Copy, Debug)]
pub struct YzAimNetwork {
    state: NodeState,
    /// The NMT state after the boot.
    next: NodeState,
    is_announced: bool,
    boot_ns: Nanoseconds,
    heartbeat_ns: Nanoseconds,
    /// Deadline of the master's next heartbeat; [`NEVER`] until the first one.
    master_deadline_ns: Nanoseconds,
    is_master_lost: bool,
}

/// The end of a boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BootUp {
    /// Whether the boot-up message is to be sent.
    pub is_announced: bool,
}

impl YzAimNetwork {
    /// A node that boots and enters the state `next` at `boot_ns`.
    pub fn starting(boot_ns: Nanoseconds, next: NodeState, is_announced: bool) -> Self {
        Self {
            state: NodeState::Initialising,
            next,
            is_announced,
            boot_ns,
            heartbeat_ns: NEVER,
            master_deadline_ns: NEVER,
            is_master_lost: false,
        }
    }

    /// The NMT state.
    pub fn state(&self) -> NodeState {
        self.state
    }

    /// Whether SDO works.
    pub fn has_services(&self) -> bool {
        matches!(self.state, NodeState::PreOperational | NodeState::Operational)
    }

    /// Whether the master's heartbeat has timed out.
    pub fn is_master_lost(&self) -> bool {
        self.is_master_lost
    }

    /// The time of the next action.
    pub fn due_ns(&self) -> Nanoseconds {
        self.boot_ns.min(self.heartbeat_ns).min(self.master_deadline_ns)
    }

    /// Boots when it is time.
    pub fn boot_if_due(&mut self, now_ns: Nanoseconds, dictionary: &YzAimDictionary) -> Option<BootUp> {
        if now_ns < self.boot_ns {
            return None;
        }
        self.boot_ns = NEVER;
        self.state = self.next;
        self.schedule_heartbeat(now_ns, dictionary);
        Some(BootUp { is_announced: self.is_announced })
    }

    /// The byte of a heartbeat that is due. A stopped node sends none.
    pub fn heartbeat(
        &mut self,
        now_ns: Nanoseconds,
        dictionary: &YzAimDictionary,
        has_alarm: bool,
    ) -> Option<u8> {
        if now_ns < self.heartbeat_ns {
            return None;
        }
        self.schedule_heartbeat(now_ns, dictionary);
        self.has_services().then_some(if has_alarm { ALARM } else { self.state.code() })
    }

    /// Restarts the heartbeat period, as after a write of object 1017.
    pub fn schedule_heartbeat(&mut self, now_ns: Nanoseconds, dictionary: &YzAimDictionary) {
        let period_ms = dictionary.get(at::PRODUCER_HEARTBEAT) as Nanoseconds;
        self.heartbeat_ns = if period_ms == 0 { NEVER } else { now_ns + period_ms * MILLISECOND_NS };
    }

    /// Takes an NMT command for this node.
    pub fn command(&mut self, now_ns: Nanoseconds, command: u8) -> Option<YzAimReset> {
        match command {
            0x01 => self.state = NodeState::Operational,
            0x02 => self.state = NodeState::Stopped,
            0x80 => self.state = NodeState::PreOperational,
            0x81 => return Some(YzAimReset::Node),
            0x82 => {
                let boot_ns = now_ns + RESET_COMMUNICATION_NS;
                *self = Self::starting(boot_ns, NodeState::PreOperational, true);
                return Some(YzAimReset::Communication);
            }
            _ => {}
        }
        None
    }

    /// Receives the heartbeat of another node. The first one starts monitoring; after a loss, the next one ends the
    /// alarm.
    pub fn receive_heartbeat(&mut self, now_ns: Nanoseconds, node: u8, dictionary: &YzAimDictionary) {
        let consumer = dictionary.get(at::CONSUMER_HEARTBEAT) as u32;
        let timeout_ms = Nanoseconds::from(consumer as u16);
        if consumer >> 16 == u32::from(node) {
            self.is_master_lost = false;
            self.master_deadline_ns =
                if timeout_ms == 0 { NEVER } else { now_ns + timeout_ms * MILLISECOND_NS };
        }
    }

    /// Stops monitoring the master until its next heartbeat, as after a write of object 1016.
    pub fn stop_master_monitor(&mut self) {
        self.master_deadline_ns = NEVER;
        self.is_master_lost = false;
    }

    /// Checks the deadline of the master's heartbeat.
    pub fn check_master(&mut self, now_ns: Nanoseconds) {
        if now_ns >= self.master_deadline_ns {
            self.lose_master();
        }
    }

    /// Marks the master as lost until its next heartbeat.
    pub fn lose_master(&mut self) {
        self.master_deadline_ns = NEVER;
        self.is_master_lost = true;
    }
}
