//! The last seconds of a run, in memory that is allocated at the start. A new entry replaces the oldest ones.

use std::collections::VecDeque;

use takt_rt::{
    AxisRecord, CycleRecord, CycleTiming, Event, Frame, FrameKind, GroupRecord, Id, MAX_AXES, MAX_GROUPS,
    Nanoseconds, Phase,
};

use crate::link::trace::{TracedFrame, TracedHealth};

/// Memory for the frames of one bus in one second. At 1 Mbit/s, a frame of eight bytes takes 111 bits on the wire and 23
/// bytes here.
const FRAME_BYTES_PER_SECOND: usize = 256 * 1024;
/// The most events that are kept. A run without faults has far fewer in this time.
const EVENTS: usize = 1024;
/// The most changes of bus health that are kept. In a bad case there is one in each cycle.
const HEALTH_CHANGES: usize = 4096;

/// A cycle without its axes.
#[derive(Clone, Copy)]
struct Times {
    timing: CycleTiming,
    group_count: u8,
    groups: [GroupRecord; MAX_GROUPS],
    is_commanded: bool,
}

/// Something on one of the buses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OnBus<T> {
    /// The number of the bus in the order of the configuration.
    pub bus: usize,
    /// The frame, or the health of the bus.
    pub what: T,
}

/// One entry of the history.
#[derive(Clone, Copy, Debug)]
pub enum Entry<'a> {
    Cycle(&'a CycleRecord),
    Event(&'a Event),
    Frame(OnBus<TracedFrame>),
    Health(&'a OnBus<TracedHealth>),
}

/// The place of an entry: its index, or for a frame its position in the store.
#[derive(Clone, Copy)]
enum Place {
    Cycle(usize),
    Event(usize),
    Frame(usize),
    Health(usize),
}

/// The last seconds of a run.
pub struct History {
    span_ns: Nanoseconds,
    axis_count: usize,
    cycles: VecDeque<Times>,
    /// The axes of every cycle, one after the other.
    axes: VecDeque<AxisRecord>,
    events: VecDeque<Event>,
    frames: FrameStore,
    health: VecDeque<OnBus<TracedHealth>>,
}

impl History {
    /// Room for a time span of a machine with so many axes and buses.
    pub fn new(span_ns: Nanoseconds, cycle_ns: Nanoseconds, axes: usize, buses: usize) -> Self {
        let cycles = span_ns.div_ceil(cycle_ns.max(1)) as usize;
        let seconds = span_ns as f64 * 1e-9;
        Self {
            span_ns,
            axis_count: axes.min(MAX_AXES),
            cycles: VecDeque::with_capacity(cycles),
            axes: VecDeque::with_capacity(cycles * axes.min(MAX_AXES)),
            events: VecDeque::with_capacity(EVENTS),
            frames: FrameStore::new((seconds * FRAME_BYTES_PER_SECOND as f64) as usize * buses.max(1)),
            health: VecDeque::with_capacity(HEALTH_CHANGES),
        }
    }

    /// The time span that it keeps.
    pub const fn span_ns(&self) -> Nanoseconds {
        self.span_ns
    }

    /// Adds a cycle, and removes the entries that are older than the time span.
    pub fn cycle(&mut self, record: &CycleRecord) {
        let oldest_ns = record.timing.slot_start_ns.saturating_sub(self.span_ns);
        while let Some(first) = self.cycles.front()
            && (self.cycles.len() == self.cycles.capacity() || first.timing.slot_start_ns <= oldest_ns)
        {
            self.cycles.pop_front();
            self.axes.drain(..self.axis_count.min(self.axes.len()));
        }
        let times = Times {
            timing: record.timing,
            group_count: record.group_count,
            groups: record.groups,
            is_commanded: record.is_commanded,
        };
        self.cycles.push_back(times);
        let absent = std::iter::repeat(AxisRecord::default());
        self.axes.extend(record.axes().iter().copied().chain(absent).take(self.axis_count));
        forget(&mut self.events, |event| event.at_ns < oldest_ns);
        forget(&mut self.health, |health| health.what.at_ns < oldest_ns);
        self.frames.forget(oldest_ns);
    }

    /// Adds an event.
    pub fn event(&mut self, event: &Event) {
        push(&mut self.events, *event);
    }

    /// Adds a frame.
    pub fn frame(&mut self, frame: &OnBus<TracedFrame>) {
        self.frames.push(frame);
    }

    /// Adds a change of the health of a bus.
    pub fn health(&mut self, health: &OnBus<TracedHealth>) {
        push(&mut self.health, *health);
    }

    /// Passes every entry to `visit` in the order of time, until `visit` fails.
    pub fn visit<E>(&self, mut visit: impl FnMut(Entry<'_>) -> Result<(), E>) -> Result<(), E> {
        let cycles = self.cycles.iter().map(|times| times.timing.slot_start_ns).zip((0..).map(Place::Cycle));
        let events = self.events.iter().map(|event| event.at_ns).zip((0..).map(Place::Event));
        let health = self.health.iter().map(|health| health.what.at_ns).zip((0..).map(Place::Health));
        let frames = self.frames.places().map(|(at_ns, place)| (at_ns, Place::Frame(place)));
        let mut places: Vec<_> = cycles.chain(events).chain(health).chain(frames).collect();
        places.sort_by_key(|(at_ns, _)| *at_ns);
        for (_, place) in places {
            match place {
                Place::Cycle(index) => self.record(index).map(|record| visit(Entry::Cycle(&record))),
                Place::Event(index) => self.events.get(index).map(|event| visit(Entry::Event(event))),
                Place::Health(index) => self.health.get(index).map(|health| visit(Entry::Health(health))),
                Place::Frame(place) => self.frames.get(place).map(|frame| visit(Entry::Frame(frame))),
            }
            .transpose()?;
        }
        Ok(())
    }

    fn record(&self, index: usize) -> Option<CycleRecord> {
        let Times { timing, group_count, groups, is_commanded } = *self.cycles.get(index)?;
        let mut record = CycleRecord {
            timing,
            group_count,
            groups,
            is_commanded,
            axis_count: self.axis_count as u8,
            ..CycleRecord::default()
        };
        let first = index * self.axis_count;
        let axes = (first..first + self.axis_count).filter_map(|index| self.axes.get(index));
        record.axes.iter_mut().zip(axes).for_each(|(to, from)| *to = *from);
        Some(record)
    }

    /// The error code that the drive of an axis last showed.
    pub fn last_error_code(&self, axis: usize) -> u16 {
        let last = self.axes.len().saturating_sub(self.axis_count);
        self.axes.get(last + axis).map_or(0, |axis| axis.error_code)
    }

    /// The phase of a group in the last cycle.
    pub fn last_phase(&self, group: usize) -> Phase {
        let last = self.cycles.back().and_then(|times| times.groups.get(group));
        last.map_or(Phase::Passive, |group| group.phase)
    }

    /// The slot and the start of the last cycle.
    pub fn last_slot(&self) -> Option<(u64, Nanoseconds)> {
        self.cycles.back().map(|times| (times.timing.slot, times.timing.slot_start_ns))
    }
}

fn push<T>(queue: &mut VecDeque<T>, item: T) {
    if queue.len() == queue.capacity() {
        queue.pop_front();
    }
    queue.push_back(item);
}

fn forget<T>(queue: &mut VecDeque<T>, is_old: impl Fn(&T) -> bool) {
    while queue.front().is_some_and(&is_old) {
        queue.pop_front();
    }
}

/// Frames of any length, one behind the other in a ring of bytes: time, identifier, bus, kind, length, payload.
struct FrameStore {
    bytes: VecDeque<u8>,
    capacity: usize,
}

const HEADER_BYTES: usize = 15;
const EXTENDED: u32 = 1 << 31;
const SENT: u8 = 1 << 7;
const KINDS: [FrameKind; 4] = [FrameKind::Data, FrameKind::Remote, FrameKind::Fd, FrameKind::FdBitRateSwitch];

impl FrameStore {
    fn new(capacity: usize) -> Self {
        let capacity = capacity.max(HEADER_BYTES + Frame::MAX_BYTES);
        Self { bytes: VecDeque::with_capacity(capacity), capacity }
    }

    fn push(&mut self, OnBus { bus, what }: &OnBus<TracedFrame>) {
        let (frame, id) = (&what.frame, what.frame.id());
        while self.bytes.len() + HEADER_BYTES + frame.payload().len() > self.capacity {
            self.pop();
        }
        let kind = KINDS.iter().position(|kind| *kind == frame.kind()).unwrap_or(0) as u8;
        self.bytes.extend(what.at_ns.to_le_bytes());
        self.bytes.extend((id.value() | if id.is_extended() { EXTENDED } else { 0 }).to_le_bytes());
        self.bytes.extend([*bus as u8, kind | if what.is_sent { SENT } else { 0 }, frame.length() as u8]);
        self.bytes.extend(frame.payload());
    }

    /// The time of the frame at `at`, and the position of the next frame.
    fn header(&self, at: usize) -> Option<(Nanoseconds, usize)> {
        let byte = |offset: usize| self.bytes.get(at + offset).copied();
        let mut time = [0; 8];
        for (offset, to) in time.iter_mut().enumerate() {
            *to = byte(offset)?;
        }
        let is_remote = KINDS.get(usize::from(byte(13)? & !SENT)) == Some(&FrameKind::Remote);
        let payload = if is_remote { 0 } else { usize::from(byte(14)?) };
        Some((Nanoseconds::from_le_bytes(time), at + HEADER_BYTES + payload))
    }

    fn pop(&mut self) {
        let end = self.header(0).map_or(self.bytes.len(), |(_, end)| end.min(self.bytes.len()));
        self.bytes.drain(..end);
    }

    fn forget(&mut self, oldest_ns: Nanoseconds) {
        while self.header(0).is_some_and(|(at_ns, _)| at_ns < oldest_ns) {
            self.pop();
        }
    }

    /// The times and positions of all frames.
    fn places(&self) -> impl Iterator<Item = (Nanoseconds, usize)> + '_ {
        let mut at = 0;
        std::iter::from_fn(move || {
            let (at_ns, end) = self.header(at)?;
            Some((at_ns, std::mem::replace(&mut at, end)))
        })
    }

    fn get(&self, at: usize) -> Option<OnBus<TracedFrame>> {
        let (at_ns, end) = self.header(at)?;
        let mut bytes = [0; HEADER_BYTES + Frame::MAX_BYTES];
        bytes.iter_mut().zip(self.bytes.range(at..end)).for_each(|(to, from)| *to = *from);
        let (_, rest) = bytes.get(..end - at)?.split_first_chunk::<8>()?;
        let (id, rest) = rest.split_first_chunk::<4>()?;
        let ([bus, kind, length], payload) = rest.split_first_chunk::<3>()?;
        let frame = frame(u32::from_le_bytes(*id), kind & !SENT, *length, payload)?;
        let what = TracedFrame { at_ns, is_sent: kind & SENT != 0, frame };
        Some(OnBus { bus: usize::from(*bus), what })
    }
}

fn frame(id: u32, kind: u8, length: u8, payload: &[u8]) -> Option<Frame> {
    let id = if id & EXTENDED == 0 { Id::base(id) } else { Id::extended(id & !EXTENDED) }.ok()?;
    match KINDS.get(usize::from(kind))? {
        FrameKind::Data => Frame::data(id, payload),
        FrameKind::Remote => Frame::remote(id, length),
        FrameKind::Fd => Frame::fd(id, payload, false),
        FrameKind::FdBitRateSwitch => Frame::fd(id, payload, true),
    }
    .ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;
    use takt_rt::EventKind;

    const CYCLE_NS: Nanoseconds = 1_000_000;

    fn record(slot: u64) -> CycleRecord {
        let mut record = CycleRecord { axis_count: 2, group_count: 2, ..CycleRecord::default() };
        record.groups[1].phase = Phase::Moving;
        record.timing = CycleTiming { slot, slot_start_ns: slot * CYCLE_NS, ..CycleTiming::default() };
        record.axes[0].position = slot as f64;
        record.axes[1].error_code = slot as u16;
        record
    }

    fn traced(at_ns: Nanoseconds, bus: usize, is_sent: bool, frame: Frame) -> OnBus<TracedFrame> {
        OnBus { bus, what: TracedFrame { at_ns, is_sent, frame } }
    }

    #[test]
    fn entries_come_out_in_the_order_of_time_and_older_ones_are_removed() {
        let mut history = History::new(10 * CYCLE_NS, CYCLE_NS, 2, 1);
        let frame = Frame::of(Id::canopen(0x180, 1), [1, 2]);
        for slot in 0..35 {
            history.frame(&traced(slot * CYCLE_NS + 2, 0, false, frame));
            history.event(&Event {
                slot,
                at_ns: slot * CYCLE_NS + 1,
                group: None,
                kind: EventKind::MissedSlots { count: slot },
            });
            history.cycle(&record(slot));
        }
        let (mut kinds, mut last) = (vec![], None);
        let Ok(()) = history.visit(|entry| {
            kinds.push(match entry {
                Entry::Cycle(record) => {
                    last = Some(*record);
                    (0, record.timing.slot)
                }
                Entry::Event(event) => (1, event.slot),
                Entry::Frame(frame) => (2, frame.what.at_ns / CYCLE_NS),
                Entry::Health(_) => (3, 0),
            });
            Ok::<_, Infallible>(())
        });
        // The oldest event and the oldest frame lie within the ten milliseconds. Their cycle began earlier.
        let expected: Vec<_> = (24..35).flat_map(|slot| [(0, slot), (1, slot), (2, slot)]).skip(1).collect();
        assert_eq!(kinds, expected);
        assert_eq!((history.last_slot(), history.last_error_code(1)), (Some((34, 34 * CYCLE_NS)), 34));
        assert_eq!(last, Some(record(34)));
    }

    #[test]
    fn missed_slots_do_not_make_the_time_span_longer() {
        let mut history = History::new(10 * CYCLE_NS, CYCLE_NS, 2, 1);
        for slot in (0..20).chain(100..104) {
            history.cycle(&record(slot));
        }
        assert_eq!(history.cycles.len(), 4);
    }

    #[test]
    fn no_memory_is_allocated_after_the_start() {
        let mut history = History::new(10 * CYCLE_NS, CYCLE_NS, 2, 2);
        let sizes = |history: &History| {
            [
                history.cycles.capacity(),
                history.axes.capacity(),
                history.events.capacity(),
                history.frames.bytes.capacity(),
                history.health.capacity(),
            ]
        };
        let before = sizes(&history);
        let frame = Frame::of(Id::canopen(0x180, 1), [0; 8]);
        let health = TracedHealth { at_ns: 1, health: takt_rt::BusHealth::default() };
        for slot in 0..50 {
            history.cycle(&record(slot));
            for at in 0..200 {
                history.frame(&traced(slot * CYCLE_NS + at, 1, true, frame));
                history.event(&Event {
                    slot,
                    at_ns: slot * CYCLE_NS,
                    group: None,
                    kind: EventKind::MissedSlots { count: 1 },
                });
                history.health(&OnBus { bus: 0, what: health });
            }
        }
        assert_eq!(sizes(&history), before);
    }

    #[test]
    fn frames_of_every_kind_are_kept_unchanged_and_replace_the_oldest() {
        let mut store = FrameStore::new(190);
        let bytes: Vec<u8> = (0..64).collect();
        let id = Id::extended(0x1ABC_DEF0).unwrap();
        let frames = [
            traced(1, 0, true, Frame::data(Id::canopen(0x80, 0), &[]).unwrap()),
            traced(2, 1, false, Frame::remote(id, 8).unwrap()),
            traced(3, 11, true, Frame::fd(id, &bytes, true).unwrap()),
            traced(4, 0, false, Frame::fd(id, &bytes[..12], false).unwrap()),
        ];
        frames.iter().for_each(|frame| store.push(frame));
        let kept: Vec<_> = store.places().filter_map(|(_, place)| store.get(place)).collect();
        assert_eq!(kept, frames);
        store.push(&traced(5, 2, true, frames[2].what.frame));
        let times: Vec<_> = store.places().map(|(at_ns, _)| at_ns).collect();
        assert_eq!(times, [3, 4, 5]);
        store.forget(5);
        assert_eq!(store.places().count(), 1);
    }
}
