//! The four RPDOs and four TPDOs: parameters, compiled mappings, and transmission types (CiA 301, 7.2.2).

use takt_rt::{Frame, Id, MappedObject, Nanoseconds};

use super::dictionary::{ErobDictionary, at};
use super::objects::{ErobAccess, OBJECTS, find, place};
use crate::sim::sdo_reply::AbortCode;

/// PDOs in each direction.
pub const PDOS: usize = 4;
const MAX_OBJECTS: usize = 8;
const MAX_BITS: u32 = 64;

const RPDO_COMMUNICATION: [usize; PDOS] =
    [place(0x1400, 0), place(0x1401, 0), place(0x1402, 0), place(0x1403, 0)];
const RPDO_MAPPING: [usize; PDOS] = [place(0x1600, 0), place(0x1601, 0), place(0x1602, 0), place(0x1603, 0)];
const TPDO_COMMUNICATION: [usize; PDOS] =
    [place(0x1800, 0), place(0x1801, 0), place(0x1802, 0), place(0x1803, 0)];
const TPDO_MAPPING: [usize; PDOS] = [place(0x1A00, 0), place(0x1A01, 0), place(0x1A02, 0), place(0x1A03, 0)];

/// Bit 31 of a PDO's COB-ID: the PDO is invalid.
const INVALID: u32 = 1 << 31;
/// Bit 29 of a COB-ID: a 29-bit identifier, which this drive does not support.
const EXTENDED: u32 = 1 << 29;
const ID: u32 = 0x7FF;
const INHIBIT_UNIT_NS: Nanoseconds = 100_000;
const EVENT_UNIT_NS: Nanoseconds = 1_000_000;
/// Minimum interval of an event-driven TPDO without an inhibit time.
const LEAST_INTERVAL_NS: Nanoseconds = 1_000_000;
const NEVER: Nanoseconds = Nanoseconds::MAX;

/// One mapped object: its entry, and its position in the payload.
#[derive(Clone, Copy, Debug, Default)]
struct Field {
    at: usize,
    shift: u32,
    bits: u32,
}

impl Field {
    fn mask(self) -> u64 {
        (1 << self.bits) - 1
    }
}

/// A PDO compiled from its parameters.
#[derive(Clone, Copy, Debug, Default)]
struct Pdo {
    /// `None` while the PDO is invalid.
    id: Option<Id>,
    transmission_type: u8,
    inhibit_ns: Nanoseconds,
    event_ns: Nanoseconds,
    fields: [Field; MAX_OBJECTS],
    count: usize,
    bytes: usize,
}

impl Pdo {
    fn compile(communication: usize, mapping: usize, dictionary: &ErobDictionary) -> Self {
        let id = dictionary.get(communication + 1);
        let mut pdo = Self {
            id: (id & INVALID == 0).then(|| Id::base(id & ID).ok()).flatten(),
            transmission_type: dictionary.get(communication + 2) as u8,
            inhibit_ns: Nanoseconds::from(dictionary.get(communication + 3)) * INHIBIT_UNIT_NS,
            event_ns: Nanoseconds::from(dictionary.get(communication + 4)) * EVENT_UNIT_NS,
            ..Self::default()
        };
        let count = dictionary.get(mapping) as usize;
        let mut shift = 0;
        for (field, entry) in pdo.fields.iter_mut().zip(mapping + 1..).take(count) {
            let object = MappedObject::from_parameter(dictionary.get(entry));
            let Ok(at) = find(object.index, object.subindex) else { break };
            *field = Field { at, shift, bits: object.bits.into() };
            shift += u32::from(object.bits);
            pdo.count += 1;
        }
        pdo.bytes = shift as usize / 8;
        pdo
    }

    fn fields(&self) -> &[Field] {
        &self.fields[..self.count]
    }

    /// Whether it is synchronous: transmission types 0 to 240.
    fn is_synchronous(&self) -> bool {
        self.transmission_type <= 240
    }
}

/// The result of receiving an RPDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RpdoReception {
    /// The identifier belongs to no RPDO of this drive.
    NotMine,
    /// The data waits for SYNC.
    Latched,
    /// The data has been written to the dictionary.
    Applied,
    /// The frame is shorter than the mapping and was ignored.
    TooShort,
}

#[derive(Clone, Copy, Debug, Default)]
struct Inbound {
    pdo: Pdo,
    latched: Option<u64>,
}

#[derive(Clone, Copy, Debug)]
struct Outbound {
    pdo: Pdo,
    syncs: u8,
    /// The sampled payload, and when it is to be sent.
    sampled: u64,
    due_ns: Nanoseconds,
    /// The event objects of the last sent payload, to detect a change.
    events: u64,
    last_ns: Nanoseconds,
    is_sent: bool,
}

impl Default for Outbound {
    fn default() -> Self {
        Self {
            pdo: Pdo::default(),
            syncs: 0,
            sampled: 0,
            due_ns: NEVER,
            events: 0,
            last_ns: 0,
            is_sent: false,
        }
    }
}

/// All PDOs of the drive.
#[derive(Clone, Debug, Default)]
pub struct ErobProcessData {
    inbound: [Inbound; PDOS],
    outbound: [Outbound; PDOS],
}

impl ErobProcessData {
    /// Compiles the parameters of the dictionary. Latched and sampled data is discarded.
    pub fn compile(&mut self, dictionary: &ErobDictionary) {
        let parameters = RPDO_COMMUNICATION.into_iter().zip(RPDO_MAPPING);
        for (inbound, (communication, mapping)) in self.inbound.iter_mut().zip(parameters) {
            *inbound =
                Inbound { pdo: Pdo::compile(communication, mapping, dictionary), ..Inbound::default() };
        }
        let parameters = TPDO_COMMUNICATION.into_iter().zip(TPDO_MAPPING);
        for (outbound, (communication, mapping)) in self.outbound.iter_mut().zip(parameters) {
            *outbound =
                Outbound { pdo: Pdo::compile(communication, mapping, dictionary), ..Outbound::default() };
        }
    }

    /// Receives a frame in NMT operational. A synchronous RPDO waits for SYNC, the others act at once.
    pub fn receive(
        &mut self,
        frame: &Frame,
        dictionary: &mut ErobDictionary,
        write: WriteField,
    ) -> RpdoReception {
        let Some(inbound) = self.inbound.iter_mut().find(|inbound| inbound.pdo.id == Some(frame.id())) else {
            return RpdoReception::NotMine;
        };
        if frame.payload().len() < inbound.pdo.bytes {
            return RpdoReception::TooShort;
        }
        if inbound.pdo.is_synchronous() {
            inbound.latched = Some(frame.first_word());
            return RpdoReception::Latched;
        }
        unpack(&inbound.pdo, frame.first_word(), dictionary, write);
        RpdoReception::Applied
    }

    /// SYNC, first part: applies the latched data.
    pub fn apply_latched(&mut self, dictionary: &mut ErobDictionary, write: WriteField) {
        for inbound in &mut self.inbound {
            if let Some(word) = inbound.latched.take() {
                unpack(&inbound.pdo, word, dictionary, write);
            }
        }
    }

    /// SYNC, second part: samples the synchronous TPDOs, which are sent `latency_ns` later.
    pub fn sample(&mut self, now_ns: Nanoseconds, latency_ns: Nanoseconds, dictionary: &ErobDictionary) {
        for outbound in &mut self.outbound {
            if outbound.pdo.id.is_none() || !outbound.pdo.is_synchronous() {
                continue;
            }
            let word = pack(outbound.pdo.fields(), dictionary);
            let is_due = if outbound.pdo.transmission_type == 0 {
                !outbound.is_sent || word != outbound.sampled
            } else {
                outbound.syncs += 1;
                outbound.syncs >= outbound.pdo.transmission_type
            };
            if is_due {
                outbound.syncs = 0;
                outbound.is_sent = true;
                outbound.sampled = word;
                outbound.due_ns = now_ns + latency_ns;
            }
        }
    }

    /// Checks the event-driven TPDOs (types 254 and 255). Events: the first time, the event timer, and a change of a
    /// mapped object other than measured values.
    pub fn sample_events(&mut self, now_ns: Nanoseconds, dictionary: &ErobDictionary) {
        for outbound in &mut self.outbound {
            let pdo = &outbound.pdo;
            if pdo.id.is_none() || pdo.transmission_type < 254 || outbound.due_ns != NEVER {
                continue;
            }
            let since_ns = now_ns.saturating_sub(outbound.last_ns);
            if outbound.is_sent && since_ns < pdo.inhibit_ns.max(LEAST_INTERVAL_NS) {
                continue;
            }
            let events = pack_events(pdo.fields(), dictionary);
            let is_timed_out = pdo.event_ns > 0 && since_ns >= pdo.event_ns;
            if !outbound.is_sent || events != outbound.events || is_timed_out {
                outbound.is_sent = true;
                outbound.events = events;
                outbound.last_ns = now_ns;
                outbound.sampled = pack(pdo.fields(), dictionary);
                outbound.due_ns = now_ns;
            }
        }
    }

    /// When the next sampled TPDO is due.
    pub fn due_ns(&self) -> Nanoseconds {
        self.outbound.iter().map(|outbound| outbound.due_ns).min().unwrap_or(NEVER)
    }

    /// A TPDO that is due.
    pub fn next(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        let outbound = self.outbound.iter_mut().find(|outbound| outbound.due_ns <= now_ns)?;
        outbound.due_ns = NEVER;
        let bytes = outbound.sampled.to_le_bytes();
        Frame::data(outbound.pdo.id?, &bytes[..outbound.pdo.bytes]).ok()
    }

    /// Answers a remote request for a TPDO with the current values.
    pub fn requested(&self, id: Id, dictionary: &ErobDictionary) -> Option<Frame> {
        let pdo = &self.outbound.iter().find(|outbound| outbound.pdo.id == Some(id))?.pdo;
        let bytes = pack(pdo.fields(), dictionary).to_le_bytes();
        Frame::data(id, &bytes[..pdo.bytes]).ok()
    }

    /// Discards latched and sampled data, when NMT operational ends.
    pub fn stop(&mut self) {
        for inbound in &mut self.inbound {
            inbound.latched = None;
        }
        for outbound in &mut self.outbound {
            *outbound = Outbound { pdo: outbound.pdo, ..Outbound::default() };
        }
    }
}

/// Writes one entry from an RPDO; the drive may refuse the value.
pub type WriteField = fn(&mut ErobDictionary, usize, u32);

fn unpack(pdo: &Pdo, word: u64, dictionary: &mut ErobDictionary, write: WriteField) {
    for field in pdo.fields() {
        write(dictionary, field.at, (word >> field.shift & field.mask()) as u32);
    }
}

fn pack(fields: &[Field], dictionary: &ErobDictionary) -> u64 {
    fields.iter().fold(0, |word, field| word | u64::from(dictionary.get(field.at)) << field.shift)
}

fn pack_events(fields: &[Field], dictionary: &ErobDictionary) -> u64 {
    let events = fields.iter().filter(|field| !is_measured(field.at));
    events.fold(0, |word, field| word | u64::from(dictionary.get(field.at)) << field.shift)
}

/// Whether an entry is a measured value, which changes all the time.
fn is_measured(at: usize) -> bool {
    matches!(
        at,
        at::POSITION
            | at::VELOCITY
            | at::TORQUE
            | at::CURRENT
            | at::FOLLOWING_ERROR
            | at::MOTOR_ENCODER
            | at::ENCODER_DIFFERENCE
            | at::TORQUE_ESTIMATE
            | at::POSITION_DEMAND
            | at::VELOCITY_DEMAND
            | at::TORQUE_DEMAND
    )
}

/// Checks whether `value` may be written to a PDO parameter now.
///
/// The identifier may only change while the PDO is invalid. The mapping may only change while the PDO is invalid, its
/// entries only while their count is 0.
pub fn check_parameter(dictionary: &ErobDictionary, at: usize, value: u32) -> Result<(), AbortCode> {
    let object = OBJECTS[at];
    let number = usize::from(object.index & 0x1FF).min(PDOS - 1);
    let is_outbound = object.index >= 0x1800;
    let (communication, mapping) = if is_outbound {
        (TPDO_COMMUNICATION[number], TPDO_MAPPING[number])
    } else {
        (RPDO_COMMUNICATION[number], RPDO_MAPPING[number])
    };
    let is_mapping = matches!(object.index & 0xFE00, 0x1600 | 0x1A00);
    match (is_mapping, object.subindex) {
        (false, 1) => check_id(dictionary.get(communication + 1), value),
        (false, 2) if (241..254).contains(&value) => Err(AbortCode::Value),
        (false, _) => Ok(()),
        (true, _) if dictionary.get(communication + 1) & INVALID == 0 => Err(AbortCode::DeviceState),
        (true, 0) => check_count(dictionary, mapping, value),
        (true, _) if dictionary.get(mapping) != 0 => Err(AbortCode::DeviceState),
        (true, _) if value == 0 => Ok(()),
        (true, _) => check_mapped(value, is_outbound).map(|_| ()),
    }
}

fn check_id(present: u32, value: u32) -> Result<(), AbortCode> {
    let stays_valid = (present | value) & INVALID == 0;
    if stays_valid && (present ^ value) & ID != 0 {
        return Err(AbortCode::DeviceState);
    }
    if value & EXTENDED != 0 || value & INVALID == 0 && is_restricted(value & ID) {
        return Err(AbortCode::Value);
    }
    Ok(())
}

/// Identifiers that a PDO must not use (CiA 301, 7.3.5).
fn is_restricted(id: u32) -> bool {
    matches!(id, 0x000..=0x080 | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..=0x7FF)
}

fn check_count(dictionary: &ErobDictionary, mapping: usize, count: u32) -> Result<(), AbortCode> {
    if count as usize > MAX_OBJECTS {
        return Err(AbortCode::PdoTooLong);
    }
    let is_outbound = OBJECTS[mapping].index >= 0x1A00;
    let mut bits = 0;
    for entry in (mapping + 1..).take(count as usize) {
        bits += check_mapped(dictionary.get(entry), is_outbound)?;
    }
    if bits > MAX_BITS { Err(AbortCode::PdoTooLong) } else { Ok(()) }
}

/// Checks one mapping entry and returns its length in bits. An empty entry is not mappable.
fn check_mapped(value: u32, is_outbound: bool) -> Result<u32, AbortCode> {
    let mapped = MappedObject::from_parameter(value);
    let object = OBJECTS[find(mapped.index, mapped.subindex)?];
    let is_allowed = object.is_mappable && (is_outbound || object.access != ErobAccess::ReadOnly);
    if !is_allowed || usize::from(mapped.bits) != 8 * object.data_type.bytes() {
        return Err(AbortCode::NotMappable);
    }
    Ok(mapped.bits.into())
}
