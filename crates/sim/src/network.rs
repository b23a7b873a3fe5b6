//! NMT state, boot-up, heartbeat producer and consumer, SYNC producer and node guarding of a simulated device (CiA 301,
//! 7.2.8, 7.3.2), each as far as its dictionary has the object.

use takt_rt::{Id, Nanoseconds};
use takt_wire::quirks::PowerUpState;

use crate::drive::NodeState;
use crate::object_dictionary::SimulatedDictionary;

/// From "reset communication" to the boot-up message.
const RESET_COMMUNICATION_NS: Nanoseconds = 500_000;
const NEVER: Nanoseconds = Nanoseconds::MAX;
const MILLISECOND_NS: Nanoseconds = 1_000_000;
const MICROSECOND_NS: Nanoseconds = 1000;
/// Object 1005, bit 30: the node produces SYNC.
const SYNC_PRODUCER: i64 = 1 << 30;
/// COB-IDs: the identifier, and bit 31 of 1014, which switches emergency messages off.
const ID: i64 = 0x7FF;
const EMERGENCY_INVALID: i64 = 1 << 31;
/// SYNC and emergency identifiers of the pre-defined connection set.
const DEFAULT_SYNC: u32 = 0x080;
const DEFAULT_EMERGENCY: u16 = 0x080;

/// Where the communication objects stand in the dictionary.
#[derive(Clone, Debug)]
struct Places {
    sync_id: Option<usize>,
    cycle_period: Option<usize>,
    sync_overflow: Option<usize>,
    guard_time: Option<usize>,
    life_time_factor: Option<usize>,
    emergency_id: Option<usize>,
    heartbeat: Option<usize>,
    error_behaviour: Option<usize>,
}

/// A heartbeat that the node watches, by one entry of object 1016.
#[derive(Clone, Copy, Debug)]
struct Watched {
    place: usize,
    /// Deadline of the next heartbeat; [`NEVER`] until the first one.
    deadline_ns: Nanoseconds,
}

/// What a device resets after an NMT command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtReset {
    /// Communication parameters only.
    Communication,
    /// The whole node.
    Node,
}

/// NMT slave, error control, and their timers.
#[derive(Clone, Debug)]
pub struct Network {
    places: Places,
    power_up: PowerUpState,
    state: NodeState,
    boot_ns: Nanoseconds,
    heartbeat_ns: Nanoseconds,
    /// When the next SYNC is due; [`NEVER`] while the node does not produce it.
    sync_ns: Nanoseconds,
    sync_counter: u8,
    watched: Vec<Watched>,
    /// Deadline of the next node guarding request.
    guard_deadline_ns: Nanoseconds,
    guard_toggle: bool,
}

impl Network {
    /// A node that boots and is ready at `boot_ns`.
    pub fn starting(dictionary: &SimulatedDictionary, boot_ns: Nanoseconds, power_up: PowerUpState) -> Self {
        let at = |index| dictionary.place(index, 0);
        let places = Places {
            sync_id: at(0x1005),
            cycle_period: at(0x1006),
            sync_overflow: at(0x1019),
            guard_time: at(0x100C),
            life_time_factor: at(0x100D),
            emergency_id: at(0x1014),
            heartbeat: at(0x1017),
            error_behaviour: dictionary.place(0x1029, 1),
        };
        let watched = (1..=127).filter_map(|subindex| dictionary.place(0x1016, subindex));
        let watched = watched.map(|place| Watched { place, deadline_ns: NEVER }).collect();
        let mut network = Self {
            places,
            power_up,
            state: NodeState::Initialising,
            boot_ns,
            heartbeat_ns: NEVER,
            sync_ns: NEVER,
            sync_counter: 0,
            watched,
            guard_deadline_ns: NEVER,
            guard_toggle: false,
        };
        network.restart(boot_ns);
        network
    }

    /// The state that the next boot leads to.
    pub fn set_power_up(&mut self, power_up: PowerUpState) {
        self.power_up = power_up;
    }

    /// The same node when it boots again.
    pub fn restart(&mut self, boot_ns: Nanoseconds) {
        self.state = NodeState::Initialising;
        self.boot_ns = boot_ns;
        (self.heartbeat_ns, self.sync_ns, self.guard_deadline_ns) = (NEVER, NEVER, NEVER);
        self.sync_counter = 0;
        self.stop_master_monitor();
    }

    /// The NMT state.
    pub fn state(&self) -> NodeState {
        self.state
    }

    /// Returns `true` if SDO and emergency messages work.
    pub fn has_services(&self) -> bool {
        matches!(self.state, NodeState::PreOperational | NodeState::Operational)
    }

    /// The identifier of SYNC.
    pub fn sync_id(&self, dictionary: &SimulatedDictionary) -> u32 {
        dictionary.number_at(self.places.sync_id).map_or(DEFAULT_SYNC, |id| (id & ID) as u32)
    }

    /// The identifier of emergency messages; `None` while object 1014 switches them off.
    pub fn emergency_id(&self, node: u8, dictionary: &SimulatedDictionary) -> Option<Id> {
        match dictionary.number_at(self.places.emergency_id) {
            None => Some(Id::canopen(DEFAULT_EMERGENCY, node)),
            Some(id) if id & EMERGENCY_INVALID != 0 || id & ID == 0 => None,
            Some(id) => Id::base((id & ID) as u32).ok(),
        }
    }

    /// The length of SYNC in bytes: 1 with a counter (object 1019), otherwise 0.
    pub fn sync_length(&self, dictionary: &SimulatedDictionary) -> usize {
        usize::from(dictionary.number_at(self.places.sync_overflow).unwrap_or(0) > 0)
    }

    /// The time of the next action.
    pub fn due_ns(&self) -> Nanoseconds {
        let timers = self.boot_ns.min(self.heartbeat_ns).min(self.sync_ns).min(self.guard_deadline_ns);
        self.watched.iter().fold(timers, |due_ns, watched| due_ns.min(watched.deadline_ns))
    }

    /// Boots when it is time. Returns whether the boot-up message is to be sent.
    pub fn boot_if_due(&mut self, now_ns: Nanoseconds, dictionary: &SimulatedDictionary) -> bool {
        if now_ns < self.boot_ns {
            return false;
        }
        self.boot_ns = NEVER;
        self.state = match self.power_up {
            PowerUpState::PreOperational => NodeState::PreOperational,
            PowerUpState::Operational => NodeState::Operational,
        };
        self.guard_toggle = false;
        self.schedule_heartbeat(now_ns, dictionary);
        self.schedule_sync(now_ns, dictionary);
        true
    }

    /// The byte of a heartbeat that is due.
    pub fn heartbeat(&mut self, now_ns: Nanoseconds, dictionary: &SimulatedDictionary) -> Option<u8> {
        if now_ns < self.heartbeat_ns {
            return None;
        }
        self.schedule_heartbeat(now_ns, dictionary);
        Some(self.state.code())
    }

    /// The SYNC that is due, as its producer sends it (object 1005 bit 30, object 1006): the counter, if it has one. A stopped
    /// node sends none.
    pub fn produced_sync(
        &mut self,
        now_ns: Nanoseconds,
        dictionary: &SimulatedDictionary,
    ) -> Option<Option<u8>> {
        if now_ns < self.sync_ns {
            return None;
        }
        // The period counts from the time at which SYNC was due, so that it does not drift.
        let due_ns = self.sync_ns;
        self.schedule_sync(due_ns, dictionary);
        self.sync_ns = self.sync_ns.max(now_ns + 1);
        let overflow = dictionary.number_at(self.places.sync_overflow).unwrap_or(0);
        let counter = (overflow > 0).then(|| {
            self.sync_counter = (i64::from(self.sync_counter) % overflow + 1) as u8;
            self.sync_counter
        });
        self.has_services().then_some(counter)
    }

    /// Restarts the SYNC period, as after a write of object 1005 or 1006.
    pub fn schedule_sync(&mut self, now_ns: Nanoseconds, dictionary: &SimulatedDictionary) {
        let period_us = dictionary.number_at(self.places.cycle_period).unwrap_or(0) as Nanoseconds;
        let produces = dictionary.number_at(self.places.sync_id).is_some_and(|id| id & SYNC_PRODUCER != 0);
        self.sync_ns = if produces && period_us > 0 { now_ns + period_us * MICROSECOND_NS } else { NEVER };
    }

    /// Restarts the heartbeat period, as after a write of object 1017.
    pub fn schedule_heartbeat(&mut self, now_ns: Nanoseconds, dictionary: &SimulatedDictionary) {
        let period_ms = dictionary.number_at(self.places.heartbeat).unwrap_or(0) as Nanoseconds;
        self.heartbeat_ns = if period_ms == 0 { NEVER } else { now_ns + period_ms * MILLISECOND_NS };
    }

    /// Takes an NMT command.
    pub fn command(&mut self, now_ns: Nanoseconds, command: u8) -> Option<NmtReset> {
        match command {
            0x01 => self.state = NodeState::Operational,
            0x02 => self.state = NodeState::Stopped,
            0x80 => self.state = NodeState::PreOperational,
            0x81 => return Some(NmtReset::Node),
            0x82 => {
                self.restart(now_ns + RESET_COMMUNICATION_NS);
                return Some(NmtReset::Communication);
            }
            _ => {}
        }
        None
    }

    /// Receives the heartbeat of another node. Returns whether this node watches it.
    pub fn receive_heartbeat(
        &mut self,
        now_ns: Nanoseconds,
        node: u8,
        dictionary: &SimulatedDictionary,
    ) -> bool {
        let mut is_watched = false;
        for watched in &mut self.watched {
            let [low, high, of, _] = (dictionary.number(watched.place) as u32).to_le_bytes();
            let timeout_ms = u16::from_le_bytes([low, high]);
            if of == node && timeout_ms > 0 {
                watched.deadline_ns = now_ns + Nanoseconds::from(timeout_ms) * MILLISECOND_NS;
            }
            is_watched |= of == node;
        }
        is_watched
    }

    /// Stops monitoring the master until its next heartbeat, as after a write of object 1016.
    pub fn stop_master_monitor(&mut self) {
        self.watched.iter_mut().for_each(|watched| watched.deadline_ns = NEVER);
    }

    /// Stops to wait for node guarding requests until the next one, as after a write of object 100C or 100D.
    pub fn stop_life_guarding(&mut self) {
        self.guard_deadline_ns = NEVER;
    }

    /// Answers a node guarding request, if the node has objects 100C and 100D, and produces no heartbeat.
    pub fn guarded(&mut self, now_ns: Nanoseconds, dictionary: &SimulatedDictionary) -> Option<u8> {
        let guard_time_ms = dictionary.number_at(self.places.guard_time)? as Nanoseconds;
        let factor = dictionary.number_at(self.places.life_time_factor)? as Nanoseconds;
        if self.heartbeat_ns != NEVER || self.state == NodeState::Initialising {
            return None;
        }
        let life_time_ms = guard_time_ms * factor;
        self.guard_deadline_ns =
            if life_time_ms == 0 { NEVER } else { now_ns + life_time_ms * MILLISECOND_NS };
        let byte = self.state.code() | u8::from(self.guard_toggle) << 7;
        self.guard_toggle = !self.guard_toggle;
        Some(byte)
    }

    /// Returns `true` if the master has just been lost: its heartbeat, or its node guarding.
    pub fn has_lost_master(&mut self, now_ns: Nanoseconds) -> bool {
        let mut is_lost = self.guard_deadline_ns <= now_ns;
        if is_lost {
            self.guard_deadline_ns = NEVER;
        }
        for watched in self.watched.iter_mut().filter(|watched| watched.deadline_ns <= now_ns) {
            watched.deadline_ns = NEVER;
            is_lost = true;
        }
        is_lost
    }

    /// Changes the NMT state after a communication error, by object 1029; without it an operational node becomes
    /// pre-operational (CiA 301, 7.5.2.32).
    pub fn follow_error_behaviour(&mut self, dictionary: &SimulatedDictionary) {
        match dictionary.number_at(self.places.error_behaviour).unwrap_or(0) {
            0 if self.state == NodeState::Operational => self.state = NodeState::PreOperational,
            2 => self.state = NodeState::Stopped,
            _ => {}
        }
    }
}
