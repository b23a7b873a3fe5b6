//! The PDOs of a simulated device: parameters and mappings in its dictionary, compiled, and the transmission types (CiA 301,
//! 7.2.2).

mod parameters;

use takt_rt::{Frame, Id, MappedObject, Nanoseconds};

use super::object_dictionary::SimulatedDictionary;

pub use parameters::{check_parameter, is_parameter};

/// The most objects in a PDO.
const MAX_OBJECTS: usize = 64;
/// Bit 31 of a PDO's COB-ID: the PDO is invalid.
const INVALID: i64 = 1 << 31;
const ID: i64 = 0x7FF;
const INHIBIT_UNIT_NS: Nanoseconds = 100_000;
const MILLISECOND_NS: Nanoseconds = 1_000_000;
/// Minimum interval of an event-driven TPDO without an inhibit time.
const LEAST_INTERVAL_NS: Nanoseconds = 1_000_000;
const NEVER: Nanoseconds = Nanoseconds::MAX;

/// One mapped object and its position in the payload.
#[derive(Clone, Copy, Debug)]
struct Field {
    /// Its place in the dictionary; `None` for a placeholder.
    place: Option<usize>,
    shift: u32,
    bits: u32,
    /// True if its change is an event of the device, and not only another measurement.
    is_event: bool,
}

impl Field {
    fn mask(self) -> u64 {
        if self.bits >= 64 { u64::MAX } else { (1 << self.bits) - 1 }
    }

    fn pack(self, dictionary: &SimulatedDictionary) -> u64 {
        let number = dictionary.number_at(self.place).unwrap_or(0);
        (number.cast_unsigned() & self.mask()) << self.shift
    }
}

/// The places of a PDO's parameters in the dictionary; an object that the device lacks has none.
#[derive(Clone, Copy, Debug)]
struct Places {
    communication: u16,
    mapping: u16,
}

/// A PDO compiled from its parameters.
#[derive(Clone, Debug)]
struct Pdo {
    places: Places,
    /// `None` while the PDO is invalid.
    id: Option<Id>,
    transmission_type: u8,
    inhibit_ns: Nanoseconds,
    event_ns: Nanoseconds,
    /// TPDO: the value of the SYNC counter with which the synchronous transmission starts.
    sync_start: u8,
    fields: Vec<Field>,
    bytes: usize,
}

impl Pdo {
    fn new(places: Places) -> Self {
        Self {
            places,
            id: None,
            transmission_type: 255,
            inhibit_ns: 0,
            event_ns: 0,
            sync_start: 0,
            fields: Vec::with_capacity(MAX_OBJECTS),
            bytes: 0,
        }
    }

    fn compile(&mut self, dictionary: &SimulatedDictionary, is_measured: fn(u16) -> bool) {
        let Places { communication, mapping } = self.places;
        let number = |index, subindex| dictionary.number_at(dictionary.place(index, subindex));
        let id = number(communication, 1).unwrap_or(INVALID);
        self.id = (id & INVALID == 0).then(|| Id::base((id & ID) as u32).ok()).flatten();
        self.transmission_type = number(communication, 2).unwrap_or(255) as u8;
        self.inhibit_ns = number(communication, 3).unwrap_or(0) as Nanoseconds * INHIBIT_UNIT_NS;
        self.event_ns = number(communication, 5).unwrap_or(0) as Nanoseconds * MILLISECOND_NS;
        self.sync_start = number(communication, 6).unwrap_or(0) as u8;
        self.fields.clear();
        let mut shift = 0;
        for subindex in 1..=number(mapping, 0).unwrap_or(0).clamp(0, MAX_OBJECTS as i64) as u8 {
            let Some(parameter) = number(mapping, subindex) else { break };
            let object = MappedObject::from_parameter(parameter as u32);
            let place = dictionary.place(object.index, object.subindex);
            let bits = u32::from(object.bits);
            if shift + bits > 64 || bits == 0 || place.is_none() && !dictionary.is_dummy(object.index) {
                break;
            }
            let is_event = place.is_some() && !is_measured(object.index);
            self.fields.push(Field { place, shift, bits, is_event });
            shift += bits;
        }
        self.bytes = (shift as usize).div_ceil(8);
    }

    /// Returns `true` if it is synchronous: transmission types 0 to 240.
    fn is_synchronous(&self) -> bool {
        self.transmission_type <= 240
    }

    /// Returns `true` if an event sends it: transmission types 254 and 255. An empty one is not sent.
    fn is_event_driven(&self) -> bool {
        self.id.is_some() && self.transmission_type >= 254 && self.bytes > 0
    }

    fn pack(&self, dictionary: &SimulatedDictionary) -> u64 {
        self.fields.iter().fold(0, |word, field| word | field.pack(dictionary))
    }

    fn pack_events(&self, dictionary: &SimulatedDictionary) -> u64 {
        let events = self.fields.iter().filter(|field| field.is_event);
        events.fold(0, |word, field| word | field.pack(dictionary))
    }

    fn frame(&self, word: u64) -> Option<Frame> {
        Frame::data(self.id?, &word.to_le_bytes()[..self.bytes]).ok()
    }
}

/// The result of receiving an RPDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RpdoReception {
    /// The identifier belongs to no RPDO of this device.
    NotMine,
    /// The data of the RPDO with this number, counted from 0, waits for SYNC.
    Latched(usize),
    /// The data of the RPDO with this number has been written to the dictionary.
    Applied(usize),
    /// The frame is shorter than the mapping and was ignored.
    TooShort,
}

/// Writes one object from an RPDO; the device may refuse the value.
pub type WriteField<'a> = &'a mut dyn FnMut(&mut SimulatedDictionary, usize, u64);

#[derive(Clone, Debug)]
struct Inbound {
    pdo: Pdo,
    latched: Option<u64>,
    /// When the event timer of the RPDO runs out; it starts with the first frame.
    deadline_ns: Nanoseconds,
}

impl Inbound {
    fn reset(&mut self) {
        self.latched = None;
        self.deadline_ns = NEVER;
    }

    fn unpack(&self, word: u64, dictionary: &mut SimulatedDictionary, write: WriteField<'_>) {
        for field in &self.pdo.fields {
            if let Some(place) = field.place {
                write(dictionary, place, word >> field.shift & field.mask());
            }
        }
    }
}

#[derive(Clone, Debug)]
struct Outbound {
    pdo: Pdo,
    syncs: u8,
    /// True if the synchronous transmission has started.
    has_started: bool,
    /// The sampled payload, and when it is to be sent.
    sampled: u64,
    due_ns: Nanoseconds,
    /// The event objects of the last sent payload, to detect a change.
    events: u64,
    last_ns: Nanoseconds,
    /// When its inhibit time ends.
    free_ns: Nanoseconds,
    /// When its event timer ends, where events are the timers only.
    timer_ns: Nanoseconds,
    is_sent: bool,
}

impl Outbound {
    fn reset(&mut self) {
        self.syncs = 0;
        self.has_started = false;
        self.sampled = 0;
        self.due_ns = NEVER;
        self.events = 0;
        self.last_ns = 0;
        self.free_ns = 0;
        self.timer_ns = NEVER;
        self.is_sent = false;
    }

    fn start_timer(&mut self, now_ns: Nanoseconds) {
        self.timer_ns = if self.pdo.event_ns == 0 { NEVER } else { now_ns + self.pdo.event_ns };
    }
}

/// All PDOs of a device.
#[derive(Clone, Debug)]
pub struct PdoEngine {
    inbound: Vec<Inbound>,
    outbound: Vec<Outbound>,
    features: PdoFeatures,
    /// The time of the next action: of the first sampled TPDO, or of the first event timer that ends.
    due_ns: Nanoseconds,
    /// True if an event can send a TPDO.
    has_events: bool,
}

/// What a device does with its PDOs.
#[derive(Clone, Copy, Debug)]
pub struct PdoFeatures {
    /// Whether an object is a measured value, which changes all the time.
    pub is_measured: fn(u16) -> bool,
    /// True if it watches the event timers of its RPDOs.
    pub watches_rpdos: bool,
    /// True if each RPDO is answered by the TPDO with its number, and the only other events are the event timers.
    pub answers_rpdos: bool,
}

impl PdoEngine {
    /// The PDOs that the dictionary has.
    pub fn new(dictionary: &SimulatedDictionary, features: PdoFeatures) -> Self {
        let places = |first: u16| {
            let numbers = (0..0x200u16).filter(move |number| dictionary.place(first + number, 1).is_some());
            numbers
                .map(move |number| Places { communication: first + number, mapping: first + 0x200 + number })
        };
        let inbound = places(0x1400);
        let inbound =
            inbound.map(|places| Inbound { pdo: Pdo::new(places), latched: None, deadline_ns: NEVER });
        let outbound = places(0x1800).map(|places| Outbound {
            pdo: Pdo::new(places),
            syncs: 0,
            has_started: false,
            sampled: 0,
            due_ns: NEVER,
            events: 0,
            last_ns: 0,
            free_ns: 0,
            timer_ns: NEVER,
            is_sent: false,
        });
        let (inbound, outbound) = (inbound.collect(), outbound.collect());
        let mut engine = Self { inbound, outbound, features, due_ns: NEVER, has_events: false };
        engine.compile(dictionary);
        engine
    }

    /// Compiles the parameters of the dictionary. Latched and sampled data is discarded.
    pub fn compile(&mut self, dictionary: &SimulatedDictionary) {
        for inbound in &mut self.inbound {
            inbound.pdo.compile(dictionary, self.features.is_measured);
        }
        for outbound in &mut self.outbound {
            outbound.pdo.compile(dictionary, self.features.is_measured);
        }
        self.has_events = !self.features.answers_rpdos
            && self.outbound.iter().any(|outbound| outbound.pdo.is_event_driven());
        self.stop();
    }

    /// Starts the event timers, when NMT operational begins.
    pub fn start(&mut self, now_ns: Nanoseconds) {
        if self.features.answers_rpdos {
            self.outbound.iter_mut().for_each(|outbound| outbound.start_timer(now_ns));
            self.schedule();
        }
    }

    /// Notes the time of the next action, after one of those times has changed.
    fn schedule(&mut self) {
        let sampled = self.outbound.iter().map(|outbound| outbound.due_ns.min(outbound.timer_ns));
        let deadlines = self.inbound.iter().map(|inbound| inbound.deadline_ns);
        self.due_ns = sampled.chain(deadlines).fold(NEVER, Nanoseconds::min);
    }

    /// Returns `true` if this is the identifier of an RPDO.
    pub fn takes(&self, id: Id) -> bool {
        self.inbound.iter().any(|inbound| inbound.pdo.id == Some(id))
    }

    /// Receives a frame in NMT operational. A synchronous RPDO waits for SYNC, the others act at once.
    pub fn receive(
        &mut self,
        now_ns: Nanoseconds,
        frame: &Frame,
        dictionary: &mut SimulatedDictionary,
        write: WriteField<'_>,
    ) -> RpdoReception {
        let mut inbounds = self.inbound.iter_mut().enumerate();
        let Some((number, inbound)) = inbounds.find(|(_, inbound)| inbound.pdo.id == Some(frame.id())) else {
            return RpdoReception::NotMine;
        };
        if frame.payload().len() < inbound.pdo.bytes {
            return RpdoReception::TooShort;
        }
        let is_watched = self.features.watches_rpdos && inbound.pdo.event_ns > 0;
        if is_watched {
            inbound.deadline_ns = now_ns + inbound.pdo.event_ns;
        }
        let reception = if inbound.pdo.is_synchronous() {
            inbound.latched = Some(frame.first_word());
            RpdoReception::Latched(number)
        } else {
            inbound.unpack(frame.first_word(), dictionary, write);
            RpdoReception::Applied(number)
        };
        if is_watched {
            self.schedule();
        }
        reception
    }

    /// The number of RPDOs.
    pub fn rpdos(&self) -> usize {
        self.inbound.len()
    }

    /// SYNC, first part: applies the latched data of an RPDO. Returns whether there was any.
    pub fn apply_latched(
        &mut self,
        number: usize,
        dictionary: &mut SimulatedDictionary,
        write: WriteField<'_>,
    ) -> bool {
        let inbound = &mut self.inbound[number];
        let Some(word) = inbound.latched.take() else { return false };
        inbound.unpack(word, dictionary, write);
        true
    }

    /// Returns `true` if an RPDO carries an object.
    pub fn carries(&self, number: usize, place: Option<usize>) -> bool {
        place.is_some() && self.inbound[number].pdo.fields.iter().any(|field| field.place == place)
    }

    /// SYNC, second part: samples the synchronous TPDOs, which are sent `latency_ns` later. `counter` is that of the SYNC
    /// message, if it has one.
    pub fn sample(
        &mut self,
        now_ns: Nanoseconds,
        latency_ns: Nanoseconds,
        counter: Option<u8>,
        dictionary: &SimulatedDictionary,
    ) {
        let synchronous = self.outbound.iter_mut().filter(|outbound| {
            outbound.pdo.id.is_some()
                && (outbound.pdo.is_synchronous() || outbound.pdo.transmission_type == 252)
        });
        for outbound in synchronous {
            let word = outbound.pdo.pack(dictionary);
            if outbound.pdo.transmission_type == 252 {
                outbound.sampled = word;
                continue;
            }
            let start = outbound.pdo.sync_start;
            if !outbound.has_started && start > 0 && counter.is_some_and(|counter| counter != start) {
                continue;
            }
            // The first one leaves with the SYNC that has the start value.
            let is_first = !outbound.has_started && start > 0 && counter.is_some();
            outbound.has_started = true;
            let is_due = if outbound.pdo.transmission_type == 0 {
                !outbound.is_sent || word != outbound.sampled
            } else {
                outbound.syncs += 1;
                outbound.syncs >= outbound.pdo.transmission_type || is_first
            };
            if is_due {
                outbound.syncs = 0;
                outbound.is_sent = true;
                outbound.sampled = word;
                outbound.due_ns = now_ns + latency_ns;
            }
        }
        self.schedule();
    }

    /// Returns `true` if an event can send a TPDO now.
    pub fn has_events(&self, now_ns: Nanoseconds) -> bool {
        self.has_events || self.outbound.iter().any(|outbound| outbound.timer_ns <= now_ns)
    }

    /// Checks the event-driven TPDOs (types 254 and 255). Events: the first time, the event timer, and a change of a
    /// mapped object other than measured values.
    pub fn sample_events(&mut self, now_ns: Nanoseconds, dictionary: &SimulatedDictionary) {
        if self.features.answers_rpdos {
            for number in 0..self.outbound.len() {
                if self.outbound[number].timer_ns <= now_ns {
                    self.outbound[number].start_timer(now_ns);
                    self.answer(number, now_ns, 0, dictionary);
                }
            }
            return;
        }
        for outbound in &mut self.outbound {
            let pdo = &outbound.pdo;
            if !pdo.is_event_driven() || outbound.due_ns != NEVER {
                continue;
            }
            let since_ns = now_ns.saturating_sub(outbound.last_ns);
            if outbound.is_sent && since_ns < pdo.inhibit_ns.max(LEAST_INTERVAL_NS) {
                continue;
            }
            let events = pdo.pack_events(dictionary);
            let is_timed_out = pdo.event_ns > 0 && since_ns >= pdo.event_ns;
            if !outbound.is_sent || events != outbound.events || is_timed_out {
                outbound.events = events;
                outbound.sampled = outbound.pdo.pack(dictionary);
                outbound.due_ns = now_ns;
            }
        }
        self.schedule();
    }

    /// Samples the TPDO with this number, if there is one. It is sent `latency_ns` later, or when its inhibit time is over.
    pub fn answer(
        &mut self,
        number: usize,
        now_ns: Nanoseconds,
        latency_ns: Nanoseconds,
        dictionary: &SimulatedDictionary,
    ) {
        let Some(outbound) = self.outbound.get_mut(number) else { return };
        outbound.sampled = outbound.pdo.pack(dictionary);
        outbound.due_ns = outbound.due_ns.min((now_ns + latency_ns).max(outbound.free_ns));
        self.schedule();
    }

    /// Returns `true` if the event timer of an RPDO has just run out.
    pub fn has_lost_rpdo(&mut self, now_ns: Nanoseconds) -> bool {
        if now_ns < self.due_ns {
            return false;
        }
        let mut has_lost = false;
        for inbound in self.inbound.iter_mut().filter(|inbound| inbound.deadline_ns <= now_ns) {
            inbound.deadline_ns = NEVER;
            has_lost = true;
        }
        self.schedule();
        has_lost
    }

    /// The time of the next action.
    pub fn due_ns(&self) -> Nanoseconds {
        self.due_ns
    }

    /// A TPDO that is due.
    pub fn next(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        if now_ns < self.due_ns {
            return None;
        }
        let outbound = self.outbound.iter_mut().find(|outbound| outbound.due_ns <= now_ns)?;
        outbound.due_ns = NEVER;
        outbound.is_sent = true;
        outbound.last_ns = now_ns;
        outbound.free_ns = now_ns + outbound.pdo.inhibit_ns;
        let frame = outbound.pdo.frame(outbound.sampled);
        self.schedule();
        frame
    }

    /// Answers a remote request for a TPDO: with the values of the last SYNC (type 252), or the current ones.
    pub fn requested(&self, id: Id, dictionary: &SimulatedDictionary) -> Option<Frame> {
        let outbound = self.outbound.iter().find(|outbound| outbound.pdo.id == Some(id))?;
        let is_of_sync = outbound.pdo.transmission_type == 252;
        outbound.pdo.frame(if is_of_sync { outbound.sampled } else { outbound.pdo.pack(dictionary) })
    }

    /// Discards latched and sampled data, when NMT operational ends.
    pub fn stop(&mut self) {
        self.inbound.iter_mut().for_each(Inbound::reset);
        self.outbound.iter_mut().for_each(Outbound::reset);
        self.schedule();
    }
}
