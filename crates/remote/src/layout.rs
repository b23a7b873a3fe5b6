//! What is where in the memory that a controller shows itself by.
//!
//! The memory is a sequence of 64-bit words in the byte order of the computer: the [`Header`], the description, the slots of the state, the
//! slots of the events, those of the timing. The header says where they begin. `f64` stands as its bits.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use bitcode::{Decode, Encode};
use takt::channels::{EVENT_WORDS, snapshot_words};
use takt::command::AxisProperties;
use takt::telemetry::{LOOP_TIMING_WORDS, Machine};
use takt_rt::{MAX_GROUPS, RequestTarget};

/// `takt mem`, as bytes.
pub const MAGIC: u64 = u64::from_ne_bytes(*b"takt mem");
/// Counts changes of the memory, the packets and their meaning. Both sides must have the same.
pub const VERSION: u64 = 6;

/// Events that an observer can be behind, and one that is being written.
const EVENT_SLOTS: u64 = 1024 + 1;
/// The newest state, and those that a slow reader still reads.
const STATE_SLOTS: u64 = 4;
/// The same of the timing.
const TIMING_SLOTS: u64 = 4;
/// The newest stop of each target: of all axes, and of each group.
pub const STOP_WORDS: usize = 1 + MAX_GROUPS;

/// The first words.
#[repr(C)]
pub struct Header {
    /// [`MAGIC`].
    pub magic: AtomicU64,
    /// [`VERSION`].
    pub version: AtomicU64,
    /// The process of the controller.
    pub process: AtomicU64,
    /// When it began, by `CLOCK_MONOTONIC`, in nanoseconds.
    pub started_ns: AtomicU64,
    /// The first word of the description, and its length in bytes.
    pub description: [AtomicU64; 2],
    /// The first word of the slots of the state, the words of a slot, and the slots.
    pub states: [AtomicU64; 3],
    /// The first word of the slots of the events, the words of a slot, and the slots.
    pub events: [AtomicU64; 3],
    /// The same of the slots of the timing.
    pub timings: [AtomicU64; 3],
    /// How many states are complete: state `n` is in slot `n` modulo the slots. Its lower half is the futex of a new cycle.
    pub states_completed: AtomicU64,
    /// The same of the events.
    pub events_completed: AtomicU64,
    /// The same of the timing.
    pub timings_completed: AtomicU64,
    /// Events that the process of the controller itself was too slow for.
    pub events_lost: AtomicU64,
    /// When the process of the controller last wrote here, by `CLOCK_MONOTONIC`, in nanoseconds.
    pub alive_ns: AtomicU64,
    /// 1 from the end of the controller on.
    pub has_ended: AtomicU64,
    /// The process that commands; 0 if none does.
    pub lease_process: AtomicU64,
    /// When its lease expires, by `CLOCK_MONOTONIC`, in nanoseconds.
    pub lease_until_ns: AtomicU64,
    /// How often the lease has changed hands.
    pub lease_generation: AtomicU64,
}

/// Who commands, as observers see it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeaseShown {
    /// The process; 0 if none does.
    pub process: u32,
    /// When the lease expires, by `CLOCK_MONOTONIC`.
    pub until_ns: u64,
    /// How often it has changed hands.
    pub generation: u64,
}

/// What does not change while a controller runs.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Description {
    /// Names and units.
    pub machine: Machine,
    /// The axes of each group; none where all axes are one group.
    pub groups: Vec<Vec<usize>>,
    /// What the configuration says of each axis.
    pub axes: Vec<AxisProperties>,
}

impl Description {
    /// The axes that a target means.
    pub fn axes_of(&self, target: RequestTarget) -> Vec<usize> {
        match target {
            RequestTarget::Group(group) if group > 0 || !self.groups.is_empty() => {
                self.groups.get(usize::from(group)).cloned().unwrap_or_default()
            }
            _ => (0..self.machine.axes.len()).collect(),
        }
    }
}

/// The parts behind the header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Bytes of the description.
    pub description_bytes: usize,
    /// Its words.
    pub description: Range<usize>,
    /// The slots of the state.
    pub states: Slots,
    /// The slots of the events.
    pub events: Slots,
    /// The slots of the timing.
    pub timings: Slots,
}

/// Slots of the same length, one behind another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slots {
    /// The first word of the first one.
    pub first: usize,
    /// The words of each.
    pub words: usize,
    /// How many.
    pub count: u64,
}

impl Slots {
    fn end(&self) -> Option<usize> {
        self.words.checked_mul(usize::try_from(self.count).ok()?)?.checked_add(self.first)
    }

    /// The words of the slot of a value.
    pub fn of<'a>(&self, words: &'a [AtomicU64], number: u64) -> &'a [AtomicU64] {
        // Two or more slots are within the memory: `is_within`.
        let first = self.first + self.words * (number % self.count.max(1)) as usize;
        words.get(first..first + self.words).unwrap_or_default()
    }

    fn is_within(&self, words: usize) -> bool {
        self.count >= 2 && self.words > 0 && self.end().is_some_and(|end| end <= words)
    }
}

impl Layout {
    /// The layout for a description of so many bytes, and a state of so many buses.
    pub fn new(description: &Description, description_bytes: usize, buses: usize) -> Self {
        let first = size_of::<Header>() / size_of::<u64>();
        let description_end = first + description_bytes.div_ceil(size_of::<u64>());
        let groups = description.groups.len().max(1);
        let state_words = STOP_WORDS + snapshot_words(groups, description.machine.axes.len(), buses);
        let states = Slots { first: description_end, words: state_words, count: STATE_SLOTS };
        let events_first = description_end + state_words * STATE_SLOTS as usize;
        let events = Slots { first: events_first, words: EVENT_WORDS, count: EVENT_SLOTS };
        let timings_first = events_first + EVENT_WORDS * EVENT_SLOTS as usize;
        let timings = Slots { first: timings_first, words: LOOP_TIMING_WORDS, count: TIMING_SLOTS };
        Self { description_bytes, description: first..description_end, states, events, timings }
    }

    /// All words.
    pub fn words(&self) -> usize {
        self.timings.first + self.timings.words * self.timings.count as usize
    }

    /// Writes it to the header.
    pub fn put(&self, header: &Header) {
        let numbers = [self.description.start, self.description_bytes];
        header
            .description
            .iter()
            .zip(numbers)
            .for_each(|(to, from)| to.store(from as u64, Ordering::Relaxed));
        let parts =
            [(&header.states, self.states), (&header.events, self.events), (&header.timings, self.timings)];
        for (to, from) in parts {
            let numbers = [from.first as u64, from.words as u64, from.count];
            to.iter().zip(numbers).for_each(|(to, from)| to.store(from, Ordering::Relaxed));
        }
    }

    /// The layout that a header of memory of so many words shows; `None` if it is not within the memory.
    pub fn of(header: &Header, words: usize) -> Option<Self> {
        let number = |from: &AtomicU64| from.load(Ordering::Relaxed);
        let place = |from: &AtomicU64| usize::try_from(number(from)).ok();
        let slots = |[first, words, count]: &[AtomicU64; 3]| {
            Some(Slots { first: place(first)?, words: place(words)?, count: number(count) })
        };
        let [first, bytes] = &header.description;
        let (first, description_bytes) = (place(first)?, place(bytes)?);
        let description = first..first.checked_add(description_bytes.div_ceil(size_of::<u64>()))?;
        let layout = Self {
            description_bytes,
            description,
            states: slots(&header.states)?,
            events: slots(&header.events)?,
            timings: slots(&header.timings)?,
        };
        let is_within = layout.description.end <= words
            && layout.states.is_within(words)
            && layout.events.is_within(words)
            && layout.timings.is_within(words);
        is_within.then_some(layout)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use takt::Config;

    fn description() -> Description {
        let config = Config::load(Path::new("../../configs/arm-and-gripper.toml")).unwrap();
        let mut axes: Vec<AxisProperties> = config.axes.iter().map(AxisProperties::of).collect();
        axes[0].limits.jerk = f64::INFINITY;
        let groups = config.groups.iter().map(|group| group.axes.clone()).collect();
        Description { machine: Machine::of(&config), groups, axes }
    }

    #[test]
    fn a_description_comes_out_of_its_bytes_as_it_went_in() {
        let description = description();
        assert_eq!(bitcode::decode::<Description>(&bitcode::encode(&description)).unwrap(), description);
        assert_eq!(description.axes_of(RequestTarget::Group(1)), [3]);
        assert_eq!(description.axes_of(RequestTarget::All), [0, 1, 2, 3]);
        assert!(description.axes_of(RequestTarget::Group(2)).is_empty());
    }

    #[test]
    fn a_header_whose_parts_are_not_within_the_memory_is_no_layout() {
        let layout = Layout::new(&description(), 100, 2);
        let words = layout.words();
        let header = || Header {
            magic: AtomicU64::new(MAGIC),
            version: AtomicU64::new(VERSION),
            process: AtomicU64::default(),
            started_ns: AtomicU64::default(),
            description: Default::default(),
            states: Default::default(),
            events: Default::default(),
            timings: Default::default(),
            states_completed: AtomicU64::default(),
            events_completed: AtomicU64::default(),
            timings_completed: AtomicU64::default(),
            events_lost: AtomicU64::default(),
            alive_ns: AtomicU64::default(),
            has_ended: AtomicU64::default(),
            lease_process: AtomicU64::default(),
            lease_until_ns: AtomicU64::default(),
            lease_generation: AtomicU64::default(),
        };
        assert_eq!(Layout::of(&header(), words), None);
        let whole = header();
        layout.put(&whole);
        assert_eq!(Layout::of(&whole, words), Some(layout.clone()));
        assert_eq!(Layout::of(&whole, words - 1), None);
        for number in [0, 1, u64::MAX, u64::MAX / 2, words as u64] {
            for part in 0..11 {
                let broken = header();
                layout.put(&broken);
                let slots = [&broken.states, &broken.events, &broken.timings].into_iter().flatten();
                let parts: Vec<&AtomicU64> = broken.description.iter().chain(slots).collect();
                parts[part].store(number, Ordering::Relaxed);
                // Whatever is taken for a layout is within the memory.
                let Some(layout) = Layout::of(&broken, words) else { continue };
                for slots in [layout.states, layout.events, layout.timings] {
                    assert!((0..slots.count.min(2000)).all(|slot| {
                        let first = slots.first + slots.words * slot as usize;
                        first + slots.words <= words
                    }));
                }
                assert!(layout.description.end <= words);
            }
        }
    }
}
