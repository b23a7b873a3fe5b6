//! How punctual the real-time loop is, as counts of all its cycles since the start: for views that follow a run, and for other processes.

use takt_rt::{CycleTiming, Nanoseconds};

use crate::channels::{Allocated, Attempt, LatestReader, LatestWriter, Words, latest};

/// The upper ends of the ranges in which times are counted, each of which belongs to its range. One range more counts what is longer.
pub const TIME_BOUNDS_NS: [Nanoseconds; 22] = [
    500, 1_000, 2_000, 3_000, 5_000, 7_000, 10_000, 15_000, 20_000, 30_000, 50_000, 70_000, 100_000, 150_000,
    200_000, 300_000, 500_000, 700_000, 1_000_000, 2_000_000, 5_000_000, 10_000_000,
];

/// The ranges of [`TimeCounts`].
const RANGES: usize = TIME_BOUNDS_NS.len() + 1;
/// The words of [`TimeCounts`].
const TIME_WORDS: usize = RANGES + 2;
/// The words of [`LoopTiming`].
pub const LOOP_TIMING_WORDS: usize = 3 * TIME_WORDS;

/// How many times were how long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TimeCounts {
    /// How many times are in each range: up to the first of [`TIME_BOUNDS_NS`], up to the second …, and longer than the last.
    pub counts: [u64; RANGES],
    /// The sum of all times.
    pub sum_ns: Nanoseconds,
    /// The longest time.
    pub max_ns: Nanoseconds,
}

impl TimeCounts {
    /// Counts a time.
    pub fn add(&mut self, ns: Nanoseconds) {
        let range = TIME_BOUNDS_NS.partition_point(|bound| *bound < ns);
        if let Some(count) = self.counts.get_mut(range) {
            *count += 1;
        }
        self.sum_ns = self.sum_ns.saturating_add(ns);
        self.max_ns = self.max_ns.max(ns);
    }

    /// How many times were counted.
    pub fn count(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// What has been counted since an earlier state of the same counts. Its longest time is that of both, since that alone is known.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        let mut counts = self.counts;
        counts.iter_mut().zip(earlier.counts).for_each(|(now, before)| *now = now.saturating_sub(before));
        Self { counts, sum_ns: self.sum_ns.saturating_sub(earlier.sum_ns), max_ns: self.max_ns }
    }

    /// The upper end of the range in which the time is that the fraction `quantile` (0 to 1) of all does not exceed, and no more than the
    /// longest time; `None` if nothing was counted.
    pub fn quantile_ns(&self, quantile: f64) -> Option<Nanoseconds> {
        let all = self.count();
        let rank = ((all as f64 * quantile).ceil() as u64).clamp(1, all.max(1));
        let mut below = 0;
        let range = self.counts.iter().position(|count| {
            below += count;
            below >= rank
        })?;
        Some(TIME_BOUNDS_NS.get(range).map_or(self.max_ns, |bound| (*bound).min(self.max_ns)))
    }

    fn put(&self, words: &mut Words<'_>) {
        self.counts.iter().for_each(|count| words.put(*count));
        words.put(self.sum_ns);
        words.put(self.max_ns);
    }

    fn take(words: &mut Words<'_>) -> Self {
        Self { counts: [(); RANGES].map(|()| words.take()), sum_ns: words.take(), max_ns: words.take() }
    }
}

/// The times of all cycles since the start. All of them are 0 in virtual time, in which no time passes within a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LoopTiming {
    /// [`CycleTiming::wake_ns`]
    pub wake: TimeCounts,
    /// [`CycleTiming::sync_ns`]
    pub sync: TimeCounts,
    /// [`CycleTiming::compute_ns`]
    pub compute: TimeCounts,
}

impl LoopTiming {
    /// Counts the times of a cycle.
    pub fn add(&mut self, cycle: &CycleTiming) {
        self.wake.add(cycle.wake_ns);
        self.sync.add(cycle.sync_ns);
        self.compute.add(cycle.compute_ns);
    }

    /// What has been counted since an earlier state: see [`TimeCounts::since`].
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            wake: self.wake.since(&earlier.wake),
            sync: self.sync.since(&earlier.sync),
            compute: self.compute.since(&earlier.compute),
        }
    }

    /// Writes it to the words of a mailbox.
    #[doc(hidden)]
    pub fn put(&self, words: &mut Words<'_>) {
        [&self.wake, &self.sync, &self.compute].into_iter().for_each(|times| times.put(words));
    }

    /// Reads it from the words of a mailbox.
    pub(crate) fn take(words: &mut Words<'_>) -> Self {
        let mut times = || TimeCounts::take(words);
        Self { wake: times(), sync: times(), compute: times() }
    }
}

/// The mailbox by which the logger shows the timing to whoever looks.
pub(crate) fn shown_timing() -> (ShownTimingWriter, ShownTiming) {
    let (writer, reader) = latest(LOOP_TIMING_WORDS);
    (ShownTimingWriter { timing: LoopTiming::default(), writer }, ShownTiming(reader))
}

/// The end of the logger.
pub(crate) struct ShownTimingWriter {
    timing: LoopTiming,
    writer: LatestWriter<Allocated>,
}

impl ShownTimingWriter {
    /// Counts the times of a cycle.
    pub fn add(&mut self, cycle: &CycleTiming) {
        self.timing.add(cycle);
    }

    /// Shows what was counted.
    pub fn show(&mut self) {
        let timing = self.timing;
        self.writer.write(|words| timing.put(words));
    }
}

/// The end of an observer.
#[derive(Clone)]
pub(crate) struct ShownTiming(LatestReader<Allocated>);

impl ShownTiming {
    /// The newest timing; nothing is counted before the first one.
    pub fn newest(&self) -> LoopTiming {
        newest_timing(&self.0)
    }
}

/// The newest timing in a mailbox; nothing is counted before the first one.
pub fn newest_timing<C: crate::channels::Cells>(reader: &LatestReader<C>) -> LoopTiming {
    loop {
        match reader.attempt(0, LoopTiming::take) {
            Attempt::Whole(timing, _) => return timing,
            Attempt::Nothing => return LoopTiming::default(),
            Attempt::Torn => std::thread::yield_now(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(times: &[u64]) -> TimeCounts {
        let mut counts = TimeCounts::default();
        times.iter().for_each(|ns| counts.add(*ns));
        counts
    }

    #[test]
    fn a_time_is_in_the_range_that_ends_with_it_or_above_it() {
        let counts = counted(&[0, 500, 501, 1_000, 10_000_000, 10_000_001, u64::MAX]);
        assert_eq!((counts.counts[0], counts.counts[1]), (2, 2));
        assert_eq!((counts.counts[RANGES - 2], counts.counts[RANGES - 1]), (1, 2));
        assert_eq!((counts.count(), counts.max_ns, counts.sum_ns), (7, u64::MAX, u64::MAX));
        assert!(TIME_BOUNDS_NS.is_sorted());
    }

    #[test]
    fn a_quantile_is_no_shorter_than_the_true_one_and_no_longer_than_the_longest_time() {
        assert_eq!(TimeCounts::default().quantile_ns(0.5), None);
        let counts = counted(&[600, 700, 800, 2_500, 60_000]);
        assert_eq!(counts.quantile_ns(0.0), Some(1_000));
        assert_eq!(counts.quantile_ns(0.5), Some(1_000));
        assert_eq!(counts.quantile_ns(0.8), Some(3_000));
        assert_eq!(counts.quantile_ns(1.0), Some(60_000));
    }

    #[test]
    fn what_was_shown_is_read_and_the_difference_is_what_came_since() {
        let (mut writer, reader) = shown_timing();
        assert_eq!(reader.newest(), LoopTiming::default());
        let cycle = |wake_ns, sync_ns, compute_ns| CycleTiming {
            wake_ns,
            sync_ns,
            compute_ns,
            ..CycleTiming::default()
        };
        writer.add(&cycle(1, 2_000, 30_000));
        writer.show();
        let before = reader.newest();
        assert_eq!((before.wake.max_ns, before.sync.max_ns, before.compute.max_ns), (1, 2_000, 30_000));
        writer.add(&cycle(9_000, 1, 1));
        writer.show();
        let since = reader.newest().since(&before);
        assert_eq!((since.wake.count(), since.wake.sum_ns), (1, 9_000));
        assert_eq!((since.sync.sum_ns, since.compute.sum_ns), (1, 1));
    }
}
