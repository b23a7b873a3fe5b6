//! The four RPDOs and four TPDOs with fixed mapping, and their transmission types (manual 5.08).

use takt_rt::{Frame, Id, Nanoseconds};

use super::dictionary::YzAimDictionary;
use super::objects::at;

/// PDOs in each direction.
pub const PDOS: usize = 4;
/// RPDO4, whose data waits for SYNC, and TPDO4, its reply.
pub const PDO4: usize = 3;
/// The mapping of each RPDO.
pub const RPDO_MAPPING: [&[usize]; PDOS] = [
    &[at::CONTROLWORD, at::OPERATION_MODE, at::TARGET_POSITION],
    &[at::TARGET_POSITION, at::PROFILE_VELOCITY],
    &[at::CONTROLWORD, at::OPERATION_MODE, at::TARGET_VELOCITY],
    &[at::TARGET_POSITION],
];
const RPDO: [usize; PDOS] = [at::RPDO1, at::RPDO2, at::RPDO3, at::RPDO4];
const TPDO: [usize; PDOS] = [at::TPDO1, at::TPDO2, at::TPDO3, at::TPDO4];
const RPDO_ID: [u16; PDOS] = [0x200, 0x300, 0x400, 0x500];
const TPDO_ID: [u16; PDOS] = [0x180, 0x280, 0x380, 0x480];
const TPDO_MAPPING: [usize; PDOS] =
    [at::TPDO1_MAPPING, at::TPDO2_MAPPING, at::TPDO3_MAPPING, at::TPDO4_MAPPING];
// Entries of a mapping: index, sub-index and length in bits.
const STATUSWORD: i64 = 0x6041_0010;
const POSITION: i64 = 0x6064_0020;
const VELOCITY: i64 = 0x606C_0020;
const INHIBIT_UNIT_NS: Nanoseconds = 100_000;
const EVENT_UNIT_NS: Nanoseconds = 1_000_000;
/// FrameOnWire types up to this one are synchronous.
const LAST_SYNCHRONOUS: i64 = 240;
const NEVER: Nanoseconds = Nanoseconds::MAX;

/// The values that TPDOs carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct YzAimFeedback {
    /// 6064h
    pub position: i32,
    /// 6041h
    pub statusword: u16,
    /// 606Ch in the scale of TPDO3.
    pub velocity: i32,
}

#[derive(Clone, Copy, Debug)]
struct Outbound {
    /// The values to send.
    sampled: YzAimFeedback,
    /// When they are to be sent.
    due_ns: Nanoseconds,
    /// When the inhibit time ends.
    free_ns: Nanoseconds,
    /// When the event timer ends.
    event_ns: Nanoseconds,
    syncs: i64,
}

const AT_REST: Outbound = Outbound {
    sampled: YzAimFeedback { position: 0, statusword: 0, velocity: 0 },
    due_ns: NEVER,
    free_ns: 0,
    event_ns: NEVER,
    syncs: 0,
};

/// All PDOs of the drive.
#[derive(Clone, Copy, Debug)]
pub struct YzAimProcessData {
    held: [Option<[u8; 8]>; PDOS],
    outbound: [Outbound; PDOS],
}

impl YzAimProcessData {
    /// No data held, nothing to send.
    pub const fn at_rest() -> Self {
        Self { held: [None; PDOS], outbound: [AT_REST; PDOS] }
    }

    /// Enters NMT operational: the event timers start.
    pub fn start(&mut self, now_ns: Nanoseconds, dictionary: &YzAimDictionary) {
        *self = Self::at_rest();
        self.schedule_events(now_ns, dictionary);
    }

    /// Restarts the event timers, as after a write of them.
    pub fn schedule_events(&mut self, now_ns: Nanoseconds, dictionary: &YzAimDictionary) {
        for (outbound, parameters) in self.outbound.iter_mut().zip(TPDO) {
            outbound.event_ns = event_ns(now_ns, parameters, dictionary);
        }
    }

    /// The RPDO that an identifier belongs to.
    pub fn number(id: Id, node: u8) -> Option<usize> {
        RPDO_ID.iter().position(|function| Id::canopen(*function, node) == id)
    }

    /// Whether the data of an RPDO waits for SYNC.
    pub fn waits_for_sync(number: usize, dictionary: &YzAimDictionary) -> bool {
        dictionary.get(RPDO[number] + 2) <= LAST_SYNCHRONOUS
    }

    /// Holds the data of an RPDO until SYNC; newer data replaces older data.
    pub fn hold(&mut self, number: usize, data: [u8; 8]) {
        self.held[number] = Some(data);
    }

    /// Takes the held data of an RPDO.
    pub fn release(&mut self, number: usize) -> Option<[u8; 8]> {
        self.held[number].take()
    }

    /// Sends a TPDO `latency_ns` from now, or when its inhibit time is over.
    pub fn answer(
        &mut self,
        number: usize,
        now_ns: Nanoseconds,
        latency_ns: Nanoseconds,
        feedback: YzAimFeedback,
    ) {
        let outbound = &mut self.outbound[number];
        outbound.sampled = feedback;
        outbound.due_ns = outbound.due_ns.min((now_ns + latency_ns).max(outbound.free_ns));
    }

    /// Handles SYNC: the synchronous TPDOs are due with the current values.
    pub fn sync(
        &mut self,
        now_ns: Nanoseconds,
        latency_ns: Nanoseconds,
        feedback: YzAimFeedback,
        dictionary: &YzAimDictionary,
    ) {
        for (number, parameters) in TPDO.into_iter().enumerate() {
            let every = dictionary.get(parameters + 2);
            let outbound = &mut self.outbound[number];
            outbound.syncs += 1;
            if every <= LAST_SYNCHRONOUS && outbound.syncs >= every {
                outbound.syncs = 0;
                self.answer(number, now_ns, latency_ns, feedback);
            }
        }
    }

    /// Sends every TPDO whose event timer has ended.
    pub fn run_events(&mut self, now_ns: Nanoseconds, feedback: YzAimFeedback, dictionary: &YzAimDictionary) {
        for (number, parameters) in TPDO.into_iter().enumerate() {
            if self.outbound[number].event_ns <= now_ns {
                self.outbound[number].event_ns = event_ns(now_ns, parameters, dictionary);
                self.answer(number, now_ns, 0, feedback);
            }
        }
    }

    /// The time of the next action.
    pub fn due_ns(&self) -> Nanoseconds {
        let due = self.outbound.iter().map(|outbound| outbound.due_ns.min(outbound.event_ns));
        due.min().unwrap_or(NEVER)
    }

    /// A TPDO that is due.
    pub fn next(&mut self, now_ns: Nanoseconds, node: u8, dictionary: &YzAimDictionary) -> Option<Frame> {
        let number = self.outbound.iter().position(|outbound| outbound.due_ns <= now_ns)?;
        let outbound = &mut self.outbound[number];
        let inhibit = dictionary.get(TPDO[number] + 3) as Nanoseconds;
        outbound.due_ns = NEVER;
        outbound.free_ns = now_ns + inhibit * INHIBIT_UNIT_NS;
        let id = Id::canopen(TPDO_ID[number], node);
        Some(pack(id, TPDO_MAPPING[number], outbound.sampled, dictionary))
    }
}

fn event_ns(now_ns: Nanoseconds, parameters: usize, dictionary: &YzAimDictionary) -> Nanoseconds {
    match dictionary.get(parameters + 5) as Nanoseconds {
        0 => NEVER,
        period_ms => now_ns + period_ms * EVENT_UNIT_NS,
    }
}

/// Sets the TPDO mapping of firmware that sends the statusword first.
pub fn report_state_first(dictionary: &mut YzAimDictionary) {
    for mapping in [at::TPDO1_MAPPING, at::TPDO2_MAPPING, at::TPDO4_MAPPING] {
        dictionary.set_factory(mapping + 1, STATUSWORD);
        dictionary.set_factory(mapping + 2, POSITION);
    }
    dictionary.set_factory(at::TPDO3_MAPPING + 1, VELOCITY);
    dictionary.set_factory(at::TPDO3_MAPPING + 2, STATUSWORD);
}

/// Encodes a TPDO by its mapping.
fn pack(id: Id, mapping: usize, feedback: YzAimFeedback, dictionary: &YzAimDictionary) -> Frame {
    let mut payload = [0; 8];
    let mut length = 0;
    for entry in (mapping + 1..).take(dictionary.get(mapping) as usize) {
        let (value, bytes) = match dictionary.get(entry) {
            STATUSWORD => (feedback.statusword.into(), 2),
            VELOCITY => (feedback.velocity, 4),
            _ => (feedback.position, 4),
        };
        for (to, byte) in payload[length..].iter_mut().zip(&value.to_le_bytes()[..bytes]) {
            *to = *byte;
        }
        length += bytes;
    }
    Frame::data(id, &payload[..length.min(8)]).unwrap_or_else(|_| Frame::of(id, payload))
}
