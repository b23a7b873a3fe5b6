//! The state and the events of a controller in shared memory, for their only writer and for any number of readers in other processes.
//!
//! They are the mailboxes of `channels`, over other words: a value that its writer has left half-written, because it was killed, is never
//! counted as complete, and the one before stays readable.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use takt::channels::{
    Attempt, Cells, EventReader, EventWriter, LatestReader, LatestWriter, put_snapshot, take_snapshot,
};
use takt::telemetry::{LoopTiming, newest_timing};
use takt_rt::linux::MonotonicClock;
use takt_rt::{Clock, Event, RequestId, RequestTarget, Snapshot};

use crate::layout::{Description, Header, Layout, LeaseShown, MAGIC, STOP_WORDS, Slots, VERSION};
use crate::memory::{Memory, wait_while, wake};

/// The slots of one mailbox in the memory.
pub struct ShownSlots {
    memory: Arc<Memory>,
    completed: fn(&Header) -> &AtomicU64,
    slots: Slots,
}

impl ShownSlots {
    fn states(memory: &Arc<Memory>, layout: &Layout) -> Arc<Self> {
        let slots = layout.states;
        Arc::new(Self { memory: Arc::clone(memory), completed: |header| &header.states_completed, slots })
    }

    fn events(memory: &Arc<Memory>, layout: &Layout) -> Arc<Self> {
        let slots = layout.events;
        Arc::new(Self { memory: Arc::clone(memory), completed: |header| &header.events_completed, slots })
    }

    fn timings(memory: &Arc<Memory>, layout: &Layout) -> Arc<Self> {
        let slots = layout.timings;
        Arc::new(Self { memory: Arc::clone(memory), completed: |header| &header.timings_completed, slots })
    }
}

impl Cells for ShownSlots {
    fn completed(&self) -> &AtomicU64 {
        (self.completed)(self.memory.header())
    }

    fn slot(&self, number: u64) -> &[AtomicU64] {
        self.slots.of(self.memory.words(), number)
    }

    fn slot_count(&self) -> u64 {
        self.slots.count
    }
}

/// The end of the process of the controller.
pub struct ShownWriter {
    memory: Arc<Memory>,
    states: LatestWriter<ShownSlots>,
    events: EventWriter<ShownSlots>,
    timings: LatestWriter<ShownSlots>,
    timing: LoopTiming,
}

impl ShownWriter {
    /// New memory with this description.
    pub fn new(description: &Description) -> io::Result<Self> {
        let encoded = bitcode::encode(description);
        let layout = Layout::new(description, encoded.len(), description.machine.buses.len());
        let memory = Arc::new(Memory::create(layout.words())?);
        let header = memory.header();
        let words = memory.words().get(layout.description.clone()).unwrap_or_default();
        for (word, bytes) in words.iter().zip(encoded.chunks(size_of::<u64>())) {
            let mut whole = [0; size_of::<u64>()];
            whole.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
            word.store(u64::from_ne_bytes(whole), Ordering::Relaxed);
        }
        layout.put(header);
        header.process.store(std::process::id().into(), Ordering::Relaxed);
        header.started_ns.store(now_ns(), Ordering::Relaxed);
        header.version.store(VERSION, Ordering::Relaxed);
        header.magic.store(MAGIC, Ordering::Release);
        Ok(Self {
            states: LatestWriter::over(ShownSlots::states(&memory, &layout)),
            events: EventWriter::over(LatestWriter::over(ShownSlots::events(&memory, &layout))),
            timings: LatestWriter::over(ShownSlots::timings(&memory, &layout)),
            timing: LoopTiming::default(),
            memory,
        })
    }

    /// The memory, to be handed to other processes.
    pub fn memory(&self) -> Arc<Memory> {
        Arc::clone(&self.memory)
    }

    /// Shows an event.
    pub fn event(&mut self, event: &Event) {
        self.events.write(event);
    }

    /// Shows how many events were lost before they came here.
    pub fn events_lost(&self, lost: u64) {
        self.memory.header().events_lost.store(lost, Ordering::Relaxed);
    }

    /// Shows how punctual the loop is, if that has changed.
    pub fn timing(&mut self, timing: LoopTiming) {
        if timing != self.timing {
            self.timings.write(|words| timing.put(words));
            self.timing = timing;
        }
    }

    /// Shows a state, with the newest stop of each target in it, and wakes who waits for it.
    pub fn state(&mut self, state: &Snapshot, newest_stop: impl Fn(RequestTarget) -> RequestId) {
        self.states.write(|words| {
            targets().for_each(|target| words.put(newest_stop(target).0));
            put_snapshot(state, words);
        });
        self.is_alive();
        wake(&self.memory.header().states_completed);
    }

    /// Shows that this process is alive.
    pub fn is_alive(&self) {
        self.memory.header().alive_ns.store(now_ns(), Ordering::Relaxed);
    }

    /// Shows who commands.
    pub fn lease(&self, lease: LeaseShown) {
        let header = self.memory.header();
        header.lease_process.store(lease.process.into(), Ordering::Relaxed);
        header.lease_until_ns.store(lease.until_ns, Ordering::Relaxed);
        header.lease_generation.store(lease.generation, Ordering::Relaxed);
    }

    /// Shows that the controller has ended.
    pub fn end(&self) {
        self.memory.header().has_ended.store(1, Ordering::Release);
        wake(&self.memory.header().states_completed);
    }
}

/// The targets in the order of their stops: all axes, then each group.
fn targets() -> impl Iterator<Item = RequestTarget> {
    (0..STOP_WORDS).map(|place| match place.checked_sub(1) {
        None => RequestTarget::All,
        Some(group) => RequestTarget::Group(group as u8),
    })
}

/// The end of another process. It only reads.
#[derive(Clone)]
pub struct Shown {
    memory: Arc<Memory>,
    states: LatestReader<ShownSlots>,
    events: Arc<ShownSlots>,
    timings: LatestReader<ShownSlots>,
}

/// A state, and the newest stop of each target in it.
#[derive(Clone, Copy)]
pub struct ShownState {
    /// The state.
    pub snapshot: Snapshot,
    stops: [RequestId; STOP_WORDS],
}

impl ShownState {
    /// The newest stop that concerns a target.
    pub fn newest_stop(&self, target: RequestTarget) -> RequestId {
        let place = targets().position(|other| other == target).unwrap_or(0);
        self.stops.get(place).copied().unwrap_or_default()
    }
}

/// Why memory cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unreadable {
    /// It is not that of a controller.
    Foreign,
    /// It is that of another version of takt.
    Version(u64),
}

impl Shown {
    /// What the memory of another process shows, and its description.
    pub fn of(memory: Memory) -> Result<(Self, Description), Unreadable> {
        let header = memory.header();
        if header.magic.load(Ordering::Acquire) != MAGIC {
            return Err(Unreadable::Foreign);
        }
        let version = header.version.load(Ordering::Relaxed);
        if version != VERSION {
            return Err(Unreadable::Version(version));
        }
        let layout = Layout::of(header, memory.words().len()).ok_or(Unreadable::Foreign)?;
        let words = memory.words().get(layout.description.clone()).unwrap_or_default();
        let bytes: Vec<u8> =
            words.iter().flat_map(|word| word.load(Ordering::Relaxed).to_ne_bytes()).collect();
        let encoded = bytes.get(..layout.description_bytes).unwrap_or_default();
        let description = bitcode::decode(encoded).map_err(|_| Unreadable::Foreign)?;
        let memory = Arc::new(memory);
        let states = LatestReader::over(ShownSlots::states(&memory, &layout));
        let events = ShownSlots::events(&memory, &layout);
        let timings = LatestReader::over(ShownSlots::timings(&memory, &layout));
        Ok((Self { memory, states, events, timings }, description))
    }

    /// The newest state. The first one is there before the memory is handed over.
    pub fn state(&self) -> ShownState {
        loop {
            let read = self.states.attempt(0, |words| {
                let stops = [(); STOP_WORDS].map(|()| RequestId(words.take()));
                ShownState { stops, snapshot: take_snapshot(words) }
            });
            match read {
                Attempt::Whole(state, _) => return state,
                // Three cycles have passed during the read, because this thread was preempted.
                Attempt::Torn | Attempt::Nothing => std::thread::yield_now(),
            }
        }
    }

    /// The newest timing.
    pub fn timing(&self) -> LoopTiming {
        newest_timing(&self.timings)
    }

    /// How many states there have been, for [`Shown::wait`].
    pub fn states(&self) -> u64 {
        self.states.completed()
    }

    /// Waits for another number of states than `seen`, for no longer than `at_most`.
    pub fn wait(&self, seen: u64, at_most: Duration) {
        wait_while(&self.memory.header().states_completed, seen, at_most);
    }

    /// The events from now on.
    pub fn events(&self) -> EventReader<ShownSlots> {
        EventReader::over(LatestReader::over(Arc::clone(&self.events))).begin_now()
    }

    /// Events that were lost before they came to the memory.
    pub fn events_lost(&self) -> u64 {
        self.memory.header().events_lost.load(Ordering::Relaxed)
    }

    /// Returns `true` if the controller has ended. Its process may have, too, without a word.
    pub fn has_ended(&self) -> bool {
        self.memory.header().has_ended.load(Ordering::Acquire) != 0
    }

    /// The process of the controller.
    pub fn process(&self) -> u32 {
        self.memory.header().process.load(Ordering::Relaxed) as u32
    }

    /// How long ago the process of the controller last wrote here.
    pub fn silent_for(&self) -> Duration {
        Duration::from_nanos(now_ns().saturating_sub(self.memory.header().alive_ns.load(Ordering::Relaxed)))
    }

    /// Who commands.
    pub fn lease(&self) -> LeaseShown {
        let header = self.memory.header();
        LeaseShown {
            process: header.lease_process.load(Ordering::Relaxed) as u32,
            until_ns: header.lease_until_ns.load(Ordering::Relaxed),
            generation: header.lease_generation.load(Ordering::Relaxed),
        }
    }
}

/// The time of all processes of this computer (`CLOCK_MONOTONIC`), in ns.
pub fn now_ns() -> u64 {
    MonotonicClock::default().now_ns()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use takt::Config;
    use takt::command::AxisProperties;
    use takt::telemetry::Machine;
    use takt_rt::EventKind;

    fn shown() -> (ShownWriter, Shown) {
        let config = Config::load(Path::new("../../configs/arm-and-gripper.toml")).unwrap();
        let axes = config.axes.iter().map(AxisProperties::of).collect();
        let groups = config.groups.iter().map(|group| group.axes.clone()).collect();
        let description = Description { machine: Machine::of(&config), groups, axes };
        let writer = ShownWriter::new(&description).unwrap();
        let file = writer.memory().file().try_clone_to_owned().unwrap();
        let (shown, read) = Shown::of(Memory::of_other(file).unwrap()).unwrap();
        assert_eq!(read, description);
        (writer, shown)
    }

    fn state(slot: u64) -> Snapshot {
        Snapshot { slot, axis_count: 4, group_count: 2, bus_count: 2, ..Snapshot::default() }
    }

    #[test]
    fn what_is_shown_is_read_and_a_half_written_state_leaves_the_one_before() {
        let (mut writer, shown) = shown();
        let stop = |target| match target {
            RequestTarget::All => RequestId(7),
            RequestTarget::Group(group) => RequestId(u64::from(group) + 10),
        };
        writer.state(&state(1), stop);
        let read = shown.state();
        assert_eq!(read.snapshot, state(1));
        assert_eq!(read.newest_stop(RequestTarget::All), RequestId(7));
        assert_eq!(read.newest_stop(RequestTarget::Group(1)), RequestId(11));
        writer.states.write(|words| {
            words.put(99);
            assert_eq!(shown.state().snapshot, state(1));
        });
        let mut events = shown.events();
        for slot in 1..=2000 {
            writer.event(&Event {
                slot,
                at_ns: 0,
                group: None,
                kind: EventKind::MissedSlots { count: slot },
            });
        }
        assert_eq!(events.next().map(|event| event.slot), Some(2000 - 1023));
        assert_eq!(events.missed(), 2000 - 1024);
        assert!(!shown.has_ended());
        writer.end();
        assert!(shown.has_ended());
    }

    #[test]
    fn memory_of_another_version_or_of_something_else_is_refused() {
        let (writer, _) = shown();
        let memory = writer.memory();
        let read = || Shown::of(Memory::of_other(memory.file().try_clone_to_owned().unwrap()).unwrap()).err();
        memory.header().version.store(VERSION + 1, Ordering::Relaxed);
        assert_eq!(read(), Some(Unreadable::Version(VERSION + 1)));
        memory.header().magic.store(1, Ordering::Relaxed);
        assert_eq!(read(), Some(Unreadable::Foreign));
        memory.header().magic.store(MAGIC, Ordering::Relaxed);
        memory.header().version.store(VERSION, Ordering::Relaxed);
        assert_eq!(read(), None);
        memory.header().description[1].store(10, Ordering::Relaxed);
        assert_eq!(read(), Some(Unreadable::Foreign), "half a description");
    }
}
