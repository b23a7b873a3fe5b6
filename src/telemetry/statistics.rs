//! Statistics of the cycle records.

use hdrhistogram::Histogram;
use takt_rt::{AxisRecord, CycleRecord, Nanoseconds, Phase};

use super::machine::SetPointMagnitudes;

/// Times are resolved to three digits, up to a minute. A longer time counts as a minute, except in the maximum.
const LONGEST_NS: u64 = 60_000_000_000;

/// The distribution of a time.
#[derive(Clone, Debug)]
pub struct Latency {
    histogram: Option<Histogram<u64>>,
    count: u64,
    min_ns: u64,
    max_ns: u64,
}

impl Default for Latency {
    fn default() -> Self {
        // The histogram accepts these constant bounds. If it did not, there would be no quantiles.
        let histogram = Histogram::new_with_bounds(1, LONGEST_NS, 3).ok();
        Self { histogram, count: 0, min_ns: u64::MAX, max_ns: 0 }
    }
}

impl Latency {
    /// Adds a time.
    pub fn add(&mut self, ns: u64) {
        if let Some(histogram) = &mut self.histogram {
            histogram.saturating_record(ns.min(LONGEST_NS));
        }
        self.count += 1;
        self.min_ns = self.min_ns.min(ns);
        self.max_ns = self.max_ns.max(ns);
    }

    /// Adds the times of another distribution.
    fn add_all(&mut self, other: &Self) {
        if let (Some(own), Some(other)) = (&mut self.histogram, &other.histogram) {
            // Both have the same bounds, so that every time finds its place.
            let _ = own.add(other);
        }
        self.count += other.count;
        self.min_ns = self.min_ns.min(other.min_ns);
        self.max_ns = self.max_ns.max(other.max_ns);
    }

    /// The number of times that were added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The shortest, exactly; 0 when there is none.
    pub fn min_ns(&self) -> u64 {
        self.min_ns.min(self.max_ns)
    }

    /// The longest, exactly; 0 when there is none.
    pub fn max_ns(&self) -> u64 {
        self.max_ns
    }

    /// The time that the fraction `quantile` (0 to 1) of all did not exceed, to three digits.
    pub fn quantile_ns(&self, quantile: f64) -> u64 {
        let value = self.histogram.as_ref().map_or(0, |histogram| histogram.value_at_quantile(quantile));
        value.clamp(self.min_ns(), self.max_ns)
    }

    /// The counts in the ranges between neighbouring `bounds_ns`. The bounds ascend, and a bound belongs to the range above
    /// it. Times outside all ranges count in the first and the last range.
    pub fn counts(&self, bounds_ns: &[u64]) -> Vec<u64> {
        let mut counts = vec![0; bounds_ns.len().saturating_sub(1)];
        for step in self.histogram.iter().flat_map(Histogram::iter_recorded) {
            let above = bounds_ns.partition_point(|bound| *bound <= step.value_iterated_to());
            let range = above.saturating_sub(1).min(counts.len().saturating_sub(1));
            if let Some(count) = counts.get_mut(range) {
                *count += step.count_at_value();
            }
        }
        counts
    }
}

/// The largest following error of an axis, and the state of the axis at that moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FollowingErrorMaximum {
    /// rad (m), without sign.
    pub error: f64,
    /// Start of the cycle in which it was seen.
    pub at_ns: Nanoseconds,
    /// The phase of its group then.
    pub phase: Phase,
    /// The velocity set-point then, in rad/s (m/s).
    pub velocity_set: f64,
    /// The acceleration set-point then, in rad/s² (m/s²).
    pub acceleration_set: f64,
}

/// An axis over the whole run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisStatistics {
    /// The largest following error while the axis was enabled; `None` when it never was.
    pub following_error_max: Option<FollowingErrorMaximum>,
    /// The largest magnitudes of the set-points that were sent while the axis was enabled.
    pub set_point_max: SetPointMagnitudes,
    /// The lowest and the highest position that the drive has reported; `None` if it has reported none.
    pub position_range: Option<(f64, f64)>,
    /// The largest torque that the drive has reported, without sign, in N·m (N).
    pub torque_max: f64,
    /// The last set-point while enabled, in rad (m). If the axis was never enabled, the last one of the run.
    pub position_set: f64,
    /// The position reported together with it; if the drive did not report any more, its last position before.
    pub position: f64,
    /// The slot in which that position was reported; `None` if the drive has never reported.
    pub reported_slot: Option<u64>,
    /// True if the drive still reported in the cycle of that set-point.
    pub is_reported: bool,
    was_enabled: bool,
}

impl AxisStatistics {
    fn add(&mut self, cycle: &CycleRecord, phase: Phase, axis: &AxisRecord) {
        let timing = &cycle.timing;
        let is_enabled = is_enabled(phase);
        if axis.feedback_age == 0 && axis.position.is_finite() {
            let (low, high) = self.position_range.unwrap_or((axis.position, axis.position));
            self.position_range = Some((low.min(axis.position), high.max(axis.position)));
            self.torque_max = self.torque_max.max(f64::from(axis.torque.abs()));
        }
        if is_enabled || !self.was_enabled {
            self.position_set = axis.position_set;
            self.is_reported = axis.feedback_age == 0;
            if self.is_reported {
                self.position = axis.position;
                self.reported_slot = Some(timing.slot);
            }
        }
        if !is_enabled {
            return;
        }
        self.was_enabled = true;
        if cycle.is_commanded {
            let larger = |known: f64, seen: f32| known.max(f64::from(seen.abs()));
            self.set_point_max = SetPointMagnitudes {
                velocity: larger(self.set_point_max.velocity, axis.velocity_set),
                acceleration: larger(self.set_point_max.acceleration, axis.acceleration_set),
                jerk: larger(self.set_point_max.jerk, axis.jerk_set),
            };
        }
        let error = f64::from(axis.following_error).abs();
        if !error.is_nan() && self.following_error_max.is_none_or(|largest| error > largest.error) {
            self.following_error_max = Some(FollowingErrorMaximum {
                error,
                at_ns: timing.slot_start_ns,
                phase,
                velocity_set: axis.velocity_set.into(),
                acceleration_set: axis.acceleration_set.into(),
            });
        }
    }
}

/// Returns `true` if all drives are meant to follow set-points in this phase.
const fn is_enabled(phase: Phase) -> bool {
    matches!(phase, Phase::Holding | Phase::Moving | Phase::Streaming | Phase::Stopping)
}

/// A whole run.
#[derive(Clone, Debug, Default)]
pub struct Statistics {
    /// Cycles seen.
    pub cycles: u64,
    /// Slots that passed unused.
    pub missed_slots: u64,
    /// Start of the first cycle seen.
    pub first_ns: Nanoseconds,
    /// Start of the last cycle seen.
    pub last_ns: Nanoseconds,
    /// [`CycleTiming::wake_ns`](takt_rt::CycleTiming::wake_ns)
    pub wake: Latency,
    /// [`CycleTiming::sync_ns`](takt_rt::CycleTiming::sync_ns)
    pub sync: Latency,
    /// [`CycleTiming::compute_ns`](takt_rt::CycleTiming::compute_ns)
    pub compute: Latency,
    /// [`CycleTiming::sent_ns`](takt_rt::CycleTiming::sent_ns)
    pub sent: Latency,
    /// The callbacks of each group; `None`, or absent, where none was called.
    callbacks: Vec<Option<Latency>>,
    /// The axes in the order of the configuration.
    pub axes: Vec<AxisStatistics>,
    /// The group of each axis.
    groups: Vec<usize>,
}

impl Statistics {
    /// Statistics for axes in these groups.
    pub fn new(groups: Vec<usize>) -> Self {
        Self { axes: vec![AxisStatistics::default(); groups.len()], groups, ..Self::default() }
    }

    /// How long the calls of the callbacks of a group took; `None` if none was called.
    pub(crate) fn callback_of(&self, group: usize) -> Option<&Latency> {
        self.callbacks.get(group).and_then(Option::as_ref)
    }

    /// The same of all groups.
    pub fn callback(&self) -> Option<Latency> {
        self.callbacks.iter().flatten().fold(None, |all: Option<Latency>, group| match all {
            Some(mut all) => {
                all.add_all(group);
                Some(all)
            }
            None => Some(group.clone()),
        })
    }

    fn add_callback(&mut self, group: usize, callback_ns: Nanoseconds) {
        if self.callbacks.len() <= group {
            self.callbacks.resize(group + 1, None);
        }
        if let Some(callback) = self.callbacks.get_mut(group) {
            callback.get_or_insert_default().add(callback_ns);
        }
    }

    /// Adds a cycle.
    pub fn add(&mut self, record: &CycleRecord) {
        let timing = &record.timing;
        if self.cycles == 0 {
            self.first_ns = timing.slot_start_ns;
        }
        self.last_ns = timing.slot_start_ns;
        self.cycles += 1;
        self.missed_slots += timing.missed_slots;
        self.wake.add(timing.wake_ns);
        self.sync.add(timing.sync_ns);
        self.compute.add(timing.compute_ns);
        self.sent.add(timing.sent_ns);
        for (group, recorded) in record.groups().iter().enumerate() {
            if let Some(callback_ns) = recorded.callback_ns {
                self.add_callback(group, callback_ns);
            }
        }
        for ((statistics, axis), group) in self.axes.iter_mut().zip(record.axes()).zip(&self.groups) {
            let phase = record.groups.get(*group).map_or(Phase::Passive, |group| group.phase);
            statistics.add(record, phase, axis);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{CycleTiming, GroupRecord, MAX_AXES, MAX_GROUPS};

    fn record(slot: u64, phase: Phase, axis: AxisRecord) -> CycleRecord {
        CycleRecord {
            timing: CycleTiming { slot, slot_start_ns: slot * 1_000_000, ..CycleTiming::default() },
            groups: [GroupRecord { phase, ..GroupRecord::default() }; MAX_GROUPS],
            is_commanded: true,
            axis_count: 1,
            axes: [axis; MAX_AXES],
            ..CycleRecord::default()
        }
    }

    #[test]
    fn quantiles_are_those_of_the_times_and_the_extremes_are_exact() {
        let mut latency = Latency::default();
        (1..=100_000).for_each(|ns| latency.add(ns));
        latency.add(123_456_789);
        assert_eq!((latency.count(), latency.min_ns(), latency.max_ns()), (100_001, 1, 123_456_789));
        for (quantile, exact) in [(0.5, 50_000.0), (0.99, 99_000.0), (0.999, 99_900.0)] {
            let found = latency.quantile_ns(quantile) as f64;
            assert!((found / exact - 1.0).abs() < 1e-3, "{quantile}: {found}");
        }
        assert_eq!(latency.quantile_ns(1.0), 123_456_789);
    }

    #[test]
    fn without_any_time_every_number_is_zero() {
        let latency = Latency::default();
        assert_eq!((latency.min_ns(), latency.max_ns(), latency.quantile_ns(0.99)), (0, 0, 0));
        assert_eq!(latency.counts(&[1, 10, 100]), [0, 0]);
    }

    #[test]
    fn the_maximum_keeps_a_time_that_is_longer_than_the_histogram() {
        let mut latency = Latency::default();
        latency.add(3 * LONGEST_NS);
        assert_eq!(latency.max_ns(), 3 * LONGEST_NS);
    }

    #[test]
    fn every_time_is_counted_in_one_range() {
        let mut latency = Latency::default();
        [0, 5, 9, 10, 99, 100, 5_000].into_iter().for_each(|ns| latency.add(ns));
        assert_eq!(latency.counts(&[1, 10, 100, 1000]), [3, 2, 2]);
    }

    #[test]
    fn the_largest_following_error_is_that_of_an_enabled_axis_with_its_circumstances() {
        let mut statistics = Statistics::new(vec![0]);
        let axis = |following_error, velocity_set| AxisRecord {
            following_error,
            velocity_set,
            ..AxisRecord::default()
        };
        statistics.add(&record(1, Phase::Enabling, axis(9.0, 0.0)));
        statistics.add(&record(2, Phase::Holding, axis(f32::NAN, 0.0)));
        statistics.add(&record(3, Phase::Moving, axis(-0.5, 2.0)));
        statistics.add(&record(4, Phase::Moving, axis(0.25, 1.0)));
        statistics.add(&record(5, Phase::Disabling, axis(7.0, 0.0)));
        let largest = statistics.axes[0].following_error_max.unwrap();
        assert_eq!((largest.error, largest.at_ns, largest.velocity_set), (0.5, 3_000_000, 2.0));
    }

    #[test]
    fn an_axis_is_judged_by_the_phase_of_its_own_group() {
        let mut statistics = Statistics::new(vec![1]);
        let axis = AxisRecord { following_error: 0.5, ..AxisRecord::default() };
        let mut of_two = CycleRecord { group_count: 2, ..record(1, Phase::Disabled, axis) };
        of_two.groups[0].phase = Phase::Moving;
        statistics.add(&of_two);
        assert_eq!(statistics.axes[0].following_error_max, None);
        of_two.groups[1].phase = Phase::Holding;
        statistics.add(&of_two);
        assert_eq!(statistics.axes[0].following_error_max.unwrap().phase, Phase::Holding);
    }

    #[test]
    fn calls_of_callbacks_are_counted_for_each_group_and_for_all() {
        let mut statistics = Statistics::new(vec![0]);
        let mut cycle = CycleRecord { group_count: 3, ..record(1, Phase::Streaming, AxisRecord::default()) };
        statistics.add(&cycle);
        assert!(statistics.callback().is_none(), "none was called");
        for callback_ns in [10, 20, 30] {
            cycle.groups[0].callback_ns = Some(callback_ns);
            cycle.groups[2].callback_ns = (callback_ns > 10).then_some(100 * callback_ns);
            statistics.add(&cycle);
        }
        let seen = |latency: &Latency| (latency.count(), latency.min_ns(), latency.max_ns());
        assert_eq!(seen(statistics.callback_of(0).unwrap()), (3, 10, 30));
        assert!(statistics.callback_of(1).is_none());
        assert_eq!(seen(statistics.callback_of(2).unwrap()), (2, 2_000, 3_000));
        let all = statistics.callback().unwrap();
        assert_eq!((seen(&all), all.quantile_ns(0.5)), ((5, 10, 3_000), 30));
    }

    #[test]
    fn the_final_position_is_the_last_one_under_power() {
        let mut statistics = Statistics::new(vec![0]);
        let axis = |position_set, position| AxisRecord { position_set, position, ..AxisRecord::default() };
        statistics.add(&record(1, Phase::Disabled, axis(0.5, 0.5)));
        assert_eq!(statistics.axes[0].position, 0.5);
        statistics.add(&record(2, Phase::Holding, axis(1.0, 0.99)));
        statistics.add(&record(3, Phase::Disabled, axis(0.8, 0.8)));
        assert_eq!((statistics.axes[0].position_set, statistics.axes[0].position), (1.0, 0.99));
        assert_eq!((statistics.cycles, statistics.first_ns, statistics.last_ns), (3, 1_000_000, 3_000_000));
    }

    #[test]
    fn the_final_position_is_known_to_be_that_of_an_earlier_slot_if_the_drive_has_fallen_silent() {
        let mut statistics = Statistics::new(vec![0]);
        let axis = |position, feedback_age| AxisRecord { position, feedback_age, ..AxisRecord::default() };
        statistics.add(&record(1, Phase::Enabling, axis(0.0, 7)));
        let known = statistics.axes[0];
        assert_eq!((known.reported_slot, known.is_reported), (None, false));
        statistics.add(&record(2, Phase::Moving, axis(0.7, 0)));
        statistics.add(&record(3, Phase::Moving, axis(0.7, 1)));
        statistics.add(&record(4, Phase::Stopping, axis(0.7, 2)));
        // Without power the joint may fall anywhere: this is not its final position.
        statistics.add(&record(5, Phase::Disabled, axis(0.1, 0)));
        let known = statistics.axes[0];
        assert_eq!((known.position, known.reported_slot, known.is_reported), (0.7, Some(2), false));
    }
}
