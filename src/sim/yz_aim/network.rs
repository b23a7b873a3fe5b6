//! The node's life on the network: NMT state, boot-up, heartbeat in both directions (manual 5.11, 5.12).

use takt_rt::Nanoseconds;

use super::dictionary::Dictionary;
use super::objects::at;
use crate::sim::drive::NmtState;

/// From "reset communication" to the boot-up message.
const RESET_COMMUNICATION_NS: Nanoseconds = 500_000;
const NEVER: Nanoseconds = Nanoseconds::MAX;
const MILLISECOND_NS: Nanoseconds = 1_000_000;
/// What a heartbeat says while there is an alarm.
const ALARM: u8 = 0x04;

/// What an NMT command makes the rest of the drive do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Communication parameters only.
    Communication,
    /// The whole node.
    Node,
}

/// NMT slave, error control, and their timers.
#[derive(Clone, Copy, Debug)]
pub struct Network {
    state: NmtState,
    /// The state that the start leads to.
    next: NmtState,
    is_announced: bool,
    boot_ns: Nanoseconds,
    heartbeat_ns: Nanoseconds,
    /// By when the next heartbeat of the master must come; [`NEVER`] until it was heard once.
    master_deadline_ns: Nanoseconds,
    is_master_lost: bool,
}

/// What a start ends with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BootUp {
    /// Whether the boot-up message is to be sent.
    pub is_announced: bool,
}

impl Network {
    /// A node that is starting and will be in the state `next` at `boot_ns`.
    pub fn starting(boot_ns: Nanoseconds, next: NmtState, is_announced: bool) -> Self {
        Self {
            state: NmtState::Initialising,
            next,
            is_announced,
            boot_ns,
            heartbeat_ns: NEVER,
            master_deadline_ns: NEVER,
            is_master_lost: false,
        }
    }

    /// The NMT state.
    pub fn state(&self) -> NmtState {
        self.state
    }

    /// Whether SDO is alive.
    pub fn has_services(&self) -> bool {
        matches!(self.state, NmtState::PreOperational | NmtState::Operational)
    }

    /// Whether the master's heartbeat has stayed away.
    pub fn is_master_lost(&self) -> bool {
        self.is_master_lost
    }

    /// When something is due.
    pub fn due_ns(&self) -> Nanoseconds {
        self.boot_ns.min(self.heartbeat_ns).min(self.master_deadline_ns)
    }

    /// Whether the node comes up now.
    pub fn boots(&mut self, now_ns: Nanoseconds, dictionary: &Dictionary) -> Option<BootUp> {
        if now_ns < self.boot_ns {
            return None;
        }
        self.boot_ns = NEVER;
        self.state = self.next;
        self.schedule_heartbeat(now_ns, dictionary);
        Some(BootUp { is_announced: self.is_announced })
    }

    /// The byte of a heartbeat that is to be sent now. A stopped node sends none.
    pub fn heartbeat(&mut self, now_ns: Nanoseconds, dictionary: &Dictionary, has_alarm: bool) -> Option<u8> {
        if now_ns < self.heartbeat_ns {
            return None;
        }
        self.schedule_heartbeat(now_ns, dictionary);
        self.has_services().then_some(if has_alarm { ALARM } else { self.state.code() })
    }

    /// Starts the heartbeat's period anew, as after a change of object 1017.
    pub fn schedule_heartbeat(&mut self, now_ns: Nanoseconds, dictionary: &Dictionary) {
        let period_ms = dictionary.get(at::PRODUCER_HEARTBEAT) as Nanoseconds;
        self.heartbeat_ns = if period_ms == 0 { NEVER } else { now_ns + period_ms * MILLISECOND_NS };
    }

    /// Takes an NMT command that is meant for this node.
    pub fn command(&mut self, now_ns: Nanoseconds, command: u8) -> Option<Reset> {
        match command {
            0x01 => self.state = NmtState::Operational,
            0x02 => self.state = NmtState::Stopped,
            0x80 => self.state = NmtState::PreOperational,
            0x81 => return Some(Reset::Node),
            0x82 => {
                let boot_ns = now_ns + RESET_COMMUNICATION_NS;
                *self = Self::starting(boot_ns, NmtState::PreOperational, true);
                return Some(Reset::Communication);
            }
            _ => {}
        }
        None
    }

    /// Takes the heartbeat of another node. Watching begins with the first one; after a loss the next one is enough.
    pub fn heard(&mut self, now_ns: Nanoseconds, node: u8, dictionary: &Dictionary) {
        let consumer = dictionary.get(at::CONSUMER_HEARTBEAT) as u32;
        let timeout_ms = Nanoseconds::from(consumer as u16);
        if consumer >> 16 == u32::from(node) {
            self.is_master_lost = false;
            self.master_deadline_ns =
                if timeout_ms == 0 { NEVER } else { now_ns + timeout_ms * MILLISECOND_NS };
        }
    }

    /// Ceases to watch the master until it is heard again, as after a change of object 1016.
    pub fn forget_master(&mut self) {
        self.master_deadline_ns = NEVER;
        self.is_master_lost = false;
    }

    /// Notices that the master's heartbeat has stayed away.
    pub fn watch_master(&mut self, now_ns: Nanoseconds) {
        if now_ns >= self.master_deadline_ns {
            self.lose_master();
        }
    }

    /// Takes the master for lost until it is heard again.
    pub fn lose_master(&mut self) {
        self.master_deadline_ns = NEVER;
        self.is_master_lost = true;
    }
}
