//! When the four TPDOs are sent (manual 5.08): each as the reply to the RPDO with its number, at SYNC, and by its event timer.

use takt_rt::Nanoseconds;

use super::objects::at;
use crate::object_dictionary::SimulatedDictionary;
use crate::pdo_engine::{PdoEngine, PdoFeatures};

/// PDOs in each direction.
pub const PDOS: usize = 4;
/// RPDO4, whose data waits for SYNC.
pub const PDO4: usize = 3;
/// No PDO is sent because a value changed, and no event timer of an RPDO exists.
pub const PDO_FEATURES: PdoFeatures = PdoFeatures { is_measured: |_| true, watches_rpdos: false };
// Entries of a mapping: index, sub-index and length in bits.
const STATUSWORD: i64 = 0x6041_0010;
const POSITION: i64 = 0x6064_0020;
const VELOCITY: i64 = 0x606C_0020;
const NEVER: Nanoseconds = Nanoseconds::MAX;

/// What makes the TPDOs due, beside the RPDOs.
#[derive(Clone, Copy, Debug)]
pub struct Transmission {
    /// SYNCs since each TPDO was sent by one.
    syncs: [u8; PDOS],
    /// When each event timer ends.
    event_ns: [Nanoseconds; PDOS],
}

impl Transmission {
    /// Nothing to send.
    pub const fn at_rest() -> Self {
        Self { syncs: [0; PDOS], event_ns: [NEVER; PDOS] }
    }

    /// Enters NMT operational: the event timers start.
    pub fn start(&mut self, now_ns: Nanoseconds, pdos: &PdoEngine) {
        *self = Self::at_rest();
        self.schedule_events(now_ns, pdos);
    }

    /// Restarts the event timers, as after a write of them.
    pub fn schedule_events(&mut self, now_ns: Nanoseconds, pdos: &PdoEngine) {
        for (number, event_ns) in self.event_ns.iter_mut().enumerate() {
            *event_ns = end_of_timer(now_ns, number, pdos);
        }
    }

    /// Handles SYNC: the synchronous TPDOs are due with the current values.
    pub fn sync(
        &mut self,
        now_ns: Nanoseconds,
        latency_ns: Nanoseconds,
        pdos: &mut PdoEngine,
        dictionary: &SimulatedDictionary,
    ) {
        for (number, syncs) in self.syncs.iter_mut().enumerate() {
            *syncs = syncs.saturating_add(1);
            if pdos.syncs_of(number).is_some_and(|every| *syncs >= every) {
                *syncs = 0;
                pdos.trigger(number, now_ns, latency_ns, dictionary);
            }
        }
    }

    /// Returns `true` if an event timer has ended.
    pub fn has_event(&self, now_ns: Nanoseconds) -> bool {
        self.event_ns.iter().any(|event_ns| *event_ns <= now_ns)
    }

    /// Sends every TPDO whose event timer has ended.
    pub fn run_events(
        &mut self,
        now_ns: Nanoseconds,
        pdos: &mut PdoEngine,
        dictionary: &SimulatedDictionary,
    ) {
        for (number, event_ns) in self.event_ns.iter_mut().enumerate() {
            if *event_ns <= now_ns {
                *event_ns = end_of_timer(now_ns, number, pdos);
                pdos.trigger(number, now_ns, 0, dictionary);
            }
        }
    }

    /// The time of the next action.
    pub fn due_ns(&self) -> Nanoseconds {
        self.event_ns.into_iter().min().unwrap_or(NEVER)
    }
}

fn end_of_timer(now_ns: Nanoseconds, number: usize, pdos: &PdoEngine) -> Nanoseconds {
    match pdos.event_timer_of(number) {
        0 => NEVER,
        period_ns => now_ns + period_ns,
    }
}

/// Sets the TPDO mapping of firmware that sends the statusword first.
pub fn report_state_first(dictionary: &mut SimulatedDictionary) {
    for mapping in [at::TPDO1_MAPPING, at::TPDO2_MAPPING, at::TPDO4_MAPPING] {
        dictionary.set_factory(mapping + 1, STATUSWORD);
        dictionary.set_factory(mapping + 2, POSITION);
    }
    dictionary.set_factory(at::TPDO3_MAPPING + 1, VELOCITY);
    dictionary.set_factory(at::TPDO3_MAPPING + 2, STATUSWORD);
}
