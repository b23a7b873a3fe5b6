//! Rates of each identifier, and the load of a bus.

use std::collections::BTreeMap;

use takt_rt::{Frame, NANOSECONDS_PER_SECOND, Nanoseconds};
use takt_wire::wire_length::WireLength;

/// The load is measured in windows of this length, to find the busiest one.
const WINDOW_NS: Nanoseconds = 100_000_000;
/// The most identifiers that are told apart. There are 2048 of 11 bits.
const MOST_IDS: usize = 1 << 14;

/// What was seen of one identifier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdStatistics {
    /// How many frames.
    pub frames: u64,
    /// When the first one came.
    pub first_ns: Nanoseconds,
    /// When the last one came.
    pub last_ns: Nanoseconds,
    /// The shortest time from one to the next; `None` for a single frame.
    pub shortest_ns: Option<Nanoseconds>,
    /// The longest time from one to the next.
    pub longest_ns: Option<Nanoseconds>,
    /// How long they occupied the bus.
    pub busy_ns: Nanoseconds,
    /// The last one.
    pub last: Frame,
}

impl IdStatistics {
    /// The mean time from one to the next.
    pub fn mean_ns(&self) -> Option<Nanoseconds> {
        (self.last_ns - self.first_ns).checked_div(self.frames - 1)
    }
}

/// What was seen of a bus.
#[derive(Clone, Debug)]
pub struct BusStatistics {
    bit_rate: u32,
    data_bit_rate: Option<u32>,
    ids: BTreeMap<u64, IdStatistics>,
    frames: u64,
    busy_ns: Nanoseconds,
    span: Option<(Nanoseconds, Nanoseconds)>,
    /// The window that is being filled: its number, and how long the bus was occupied in it.
    window: (u64, Nanoseconds),
    busiest_ns: Nanoseconds,
}

impl BusStatistics {
    /// Of a bus with these bit rates, in bit/s.
    pub fn new(bit_rate: u32, data_bit_rate: Option<u32>) -> Self {
        Self {
            bit_rate: bit_rate.max(1),
            data_bit_rate: data_bit_rate.filter(|rate| *rate > 0),
            ids: BTreeMap::new(),
            frames: 0,
            busy_ns: 0,
            span: None,
            window: (0, 0),
            busiest_ns: 0,
        }
    }

    /// Takes a frame. Those of a log may be out of order.
    pub fn add(&mut self, at_ns: Nanoseconds, frame: &Frame) {
        let busy_ns = WireLength::of(frame).duration_ns(self.bit_rate, self.data_bit_rate);
        self.frames += 1;
        self.busy_ns = self.busy_ns.saturating_add(busy_ns);
        let (first, last) = self.span.unwrap_or((at_ns, at_ns));
        self.span = Some((first.min(at_ns), last.max(at_ns)));
        let window = at_ns / WINDOW_NS;
        if window != self.window.0 {
            self.window = (window, 0);
        }
        self.window.1 = self.window.1.saturating_add(busy_ns);
        self.busiest_ns = self.busiest_ns.max(self.window.1);
        let key = frame.id().arbitration_key();
        if self.ids.len() >= MOST_IDS && !self.ids.contains_key(&key) {
            return;
        }
        let new = IdStatistics {
            frames: 0,
            first_ns: at_ns,
            last_ns: at_ns,
            shortest_ns: None,
            longest_ns: None,
            busy_ns: 0,
            last: *frame,
        };
        let id = self.ids.entry(key).or_insert(new);
        if id.frames > 0 {
            let gap_ns = at_ns.saturating_sub(id.last_ns);
            id.shortest_ns = Some(id.shortest_ns.map_or(gap_ns, |shortest| shortest.min(gap_ns)));
            id.longest_ns = Some(id.longest_ns.map_or(gap_ns, |longest| longest.max(gap_ns)));
        }
        id.frames += 1;
        id.first_ns = id.first_ns.min(at_ns);
        id.last_ns = id.last_ns.max(at_ns);
        id.busy_ns = id.busy_ns.saturating_add(busy_ns);
        id.last = *frame;
    }

    /// How many frames there were.
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// From the first frame to the last one.
    pub fn duration_ns(&self) -> Nanoseconds {
        self.span.map_or(0, |(first, last)| last - first)
    }

    /// Frames per second; `None` where the time between them is not known.
    pub fn rate(&self) -> Option<f64> {
        let duration_ns = self.duration_ns();
        (duration_ns > 0)
            .then(|| (self.frames - 1) as f64 * NANOSECONDS_PER_SECOND as f64 / duration_ns as f64)
    }

    /// The part of the time in which the bus was occupied, 0 to 1; `None` where the time is not known.
    pub fn load(&self) -> Option<f64> {
        let duration_ns = self.duration_ns();
        (duration_ns > 0).then(|| (self.busy_ns as f64 / duration_ns as f64).min(1.0))
    }

    /// The load of the busiest tenth of a second; `None` where the frames took less time altogether.
    pub fn busiest(&self) -> Option<f64> {
        let is_long = self.duration_ns() >= WINDOW_NS;
        is_long.then(|| (self.busiest_ns as f64 / WINDOW_NS as f64).min(1.0))
    }

    /// What was seen of each identifier, the one with the highest priority first.
    pub fn ids(&self) -> impl Iterator<Item = &IdStatistics> {
        self.ids.values()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::Id;

    const MS: Nanoseconds = 1_000_000;

    #[test]
    fn rates_and_periods_are_those_of_each_identifier() {
        let mut statistics = BusStatistics::new(1_000_000, None);
        for slot in 0..1000 {
            statistics.add(slot * MS, &Frame::of(Id::canopen(0x080, 0), []));
            statistics.add(slot * MS + slot % 3 * 10_000, &Frame::of(Id::canopen(0x180, 1), [0; 8]));
        }
        let ids: Vec<&IdStatistics> = statistics.ids().collect();
        assert_eq!((ids[0].frames, ids[0].mean_ns()), (1000, Some(MS)));
        assert_eq!((ids[1].shortest_ns, ids[1].longest_ns), (Some(980_000), Some(1_010_000)));
        assert!((statistics.rate().unwrap() - 2000.0).abs() < 3.0, "{:?}", statistics.rate());
        // 47 bits of SYNC, and at least 111 of eight bytes: the stuff bits come on top.
        let load = statistics.load().unwrap();
        assert!((0.158..0.2).contains(&load), "{load}");
        // The whole is measured from the first frame to the last, which is a period less than the busiest second.
        assert!(statistics.busiest().unwrap() >= load * 0.999);
    }

    #[test]
    fn frames_without_times_have_no_rate() {
        let mut statistics = BusStatistics::new(0, None);
        for _ in 0..3 {
            statistics.add(0, &Frame::of(Id::canopen(0x080, 0), []));
        }
        assert_eq!((statistics.frames(), statistics.rate(), statistics.load()), (3, None, None));
        assert_eq!(statistics.ids().next().unwrap().mean_ns(), Some(0));
    }
}
