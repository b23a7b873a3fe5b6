//! The node's life on the network: NMT state, boot-up, heartbeat in both directions, node guarding (CiA 301, 7.2.8,
//! 7.3.2).

use takt_rt::Nanoseconds;

use super::dictionary::{Dictionary, at};
use crate::sim::drive::NmtState;

/// From "reset communication" to the boot-up message (0 to 1 ms in the manual's captures).
const RESET_COMMUNICATION_NS: Nanoseconds = 500_000;
const NEVER: Nanoseconds = Nanoseconds::MAX;
const MILLISECOND_NS: Nanoseconds = 1_000_000;

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
    node: u8,
    state: NmtState,
    boot_ns: Nanoseconds,
    heartbeat_ns: Nanoseconds,
    /// By when the next heartbeat of the master must come; [`NEVER`] until it was heard once.
    master_deadline_ns: Nanoseconds,
    /// The same for guarding requests.
    guard_deadline_ns: Nanoseconds,
    guard_toggle: bool,
}

impl Network {
    /// A node that is starting and will be there at `boot_ns`.
    pub fn starting(node: u8, boot_ns: Nanoseconds) -> Self {
        Self {
            node,
            state: NmtState::Initialising,
            boot_ns,
            heartbeat_ns: NEVER,
            master_deadline_ns: NEVER,
            guard_deadline_ns: NEVER,
            guard_toggle: false,
        }
    }

    /// The NMT state.
    pub fn state(&self) -> NmtState {
        self.state
    }

    /// Whether SDO and emergency messages are alive.
    pub fn has_services(&self) -> bool {
        matches!(self.state, NmtState::PreOperational | NmtState::Operational)
    }

    /// When something is due.
    pub fn due_ns(&self) -> Nanoseconds {
        self.boot_ns.min(self.heartbeat_ns).min(self.master_deadline_ns).min(self.guard_deadline_ns)
    }

    /// Whether the node comes up now; then its boot-up message is to be sent.
    pub fn boots(&mut self, now_ns: Nanoseconds, dictionary: &Dictionary) -> bool {
        if now_ns < self.boot_ns {
            return false;
        }
        self.boot_ns = NEVER;
        self.state = NmtState::PreOperational;
        self.guard_toggle = false;
        self.schedule_heartbeat(now_ns, dictionary);
        true
    }

    /// The byte of a heartbeat that is to be sent now.
    pub fn heartbeat(&mut self, now_ns: Nanoseconds, dictionary: &Dictionary) -> Option<u8> {
        if now_ns < self.heartbeat_ns {
            return None;
        }
        self.schedule_heartbeat(now_ns, dictionary);
        Some(self.state.code())
    }

    /// Starts the heartbeat's period anew, as after a change of object 1017.
    pub fn schedule_heartbeat(&mut self, now_ns: Nanoseconds, dictionary: &Dictionary) {
        let period_ms = Nanoseconds::from(dictionary.get(at::PRODUCER_HEARTBEAT));
        self.heartbeat_ns = if period_ms == 0 { NEVER } else { now_ns + period_ms * MILLISECOND_NS };
    }

    /// Takes an NMT command of two bytes.
    pub fn command(&mut self, now_ns: Nanoseconds, command: u8) -> Option<Reset> {
        match command {
            0x01 => self.state = NmtState::Operational,
            0x02 => self.state = NmtState::Stopped,
            0x80 => self.state = NmtState::PreOperational,
            0x81 => return Some(Reset::Node),
            0x82 => {
                *self = Self::starting(self.node, now_ns + RESET_COMMUNICATION_NS);
                return Some(Reset::Communication);
            }
            _ => {}
        }
        None
    }

    /// Takes the heartbeat of another node.
    pub fn heard(&mut self, now_ns: Nanoseconds, node: u8, dictionary: &Dictionary) {
        let [low, high, watched, _] = dictionary.get(at::CONSUMER_HEARTBEAT).to_le_bytes();
        let timeout_ms = u16::from_le_bytes([low, high]);
        if watched == node && timeout_ms > 0 {
            self.master_deadline_ns = now_ns + Nanoseconds::from(timeout_ms) * MILLISECOND_NS;
        }
    }

    /// Ceases to watch the master until it is heard again, as after a change of object 1016.
    pub fn forget_master(&mut self) {
        self.master_deadline_ns = NEVER;
    }

    /// Takes a guarding request and returns the byte of its answer. With a heartbeat there is no guarding.
    pub fn guarded(&mut self, now_ns: Nanoseconds, dictionary: &Dictionary) -> Option<u8> {
        if self.heartbeat_ns != NEVER || self.state == NmtState::Initialising {
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

    /// Whether the master has just been lost; then the NMT state has changed as object 1029 says.
    pub fn loses_master(&mut self, now_ns: Nanoseconds, dictionary: &Dictionary) -> bool {
        if now_ns < self.master_deadline_ns && now_ns < self.guard_deadline_ns {
            return false;
        }
        if now_ns >= self.master_deadline_ns {
            self.master_deadline_ns = NEVER;
        } else {
            self.guard_deadline_ns = NEVER;
        }
        match dictionary.get(at::ERROR_BEHAVIOUR) {
            0 if self.state == NmtState::Operational => self.state = NmtState::PreOperational,
            2 => self.state = NmtState::Stopped,
            _ => {}
        }
        true
    }
}
