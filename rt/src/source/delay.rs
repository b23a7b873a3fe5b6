//! How far behind the stamps of its points a stream runs, so that the points do not run out.

use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// How far behind the stamps of its points a stream runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum StreamDelay {
    /// As far as the interval of the points and their lateness ask for.
    #[default]
    Automatic,
    /// So far.
    Fixed(Nanoseconds),
}

/// The longest delay that is chosen here.
const LONGEST_NS: i64 = NANOSECONDS_PER_SECOND as i64;
/// Arrivals that are remembered.
const ARRIVALS: usize = 64;
/// Intervals that are remembered.
const INTERVALS: usize = 8;
/// How fast the delay may grow while the axes move, in seconds a second: the motion is so much slower meanwhile.
const FASTEST_GROWTH: f64 = 0.25;
/// How fast it may shrink: the motion is so much faster meanwhile.
const FASTEST_SHRINKING: f64 = 0.03;
/// How fast either may change: 1/s.
const RATE_RAMP: f64 = 2.0;

/// Learns the interval of the points and how late they come, and leads the delay to what that asks for.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct DelayEstimator {
    period_ns: i64,
    delay: StreamDelay,
    /// The last intervals between stamps.
    intervals_ns: [i64; INTERVALS],
    interval_count: usize,
    interval_ns: i64,
    /// For each of the last arrivals: how long after the last stamp of the points before it has come.
    behind_ns: [i64; ARRIVALS],
    arrival_count: usize,
    /// The second largest of them. One that is late by itself does not make the delay longer.
    second_ns: i64,
    present_ns: f64,
    /// Seconds a second.
    rate: f64,
    goal_ns: i64,
}

impl DelayEstimator {
    pub(super) fn new(period_ns: Nanoseconds, delay: StreamDelay) -> Self {
        let goal_ns = match delay {
            StreamDelay::Automatic => 0,
            StreamDelay::Fixed(fixed_ns) => i64::try_from(fixed_ns).unwrap_or(LONGEST_NS),
        };
        Self {
            period_ns: i64::try_from(period_ns).unwrap_or(i64::MAX).max(1),
            delay,
            intervals_ns: [0; INTERVALS],
            interval_count: 0,
            interval_ns: 0,
            behind_ns: [0; ARRIVALS],
            arrival_count: 0,
            second_ns: 0,
            present_ns: goal_ns as f64,
            rate: 0.0,
            goal_ns,
        }
    }

    /// What this one has learnt, with the settings of another one.
    #[cfg(feature = "checkpoint")]
    pub(super) fn with_parameters_of(self, other: &Self) -> Self {
        let goal_ns = match other.delay {
            StreamDelay::Automatic => self.goal_ns,
            StreamDelay::Fixed(_) => other.goal_ns,
        };
        Self { period_ns: other.period_ns, delay: other.delay, goal_ns, ..self }
    }

    /// A stream begins: forgets those before it.
    pub(super) fn restart(&mut self) {
        *self = Self::new(self.period_ns.unsigned_abs(), self.delay);
    }

    /// The usual interval between points; 0 while it is not known.
    pub(super) const fn interval_ns(&self) -> i64 {
        self.interval_ns
    }

    /// The longest time by which the set-points can be behind a stamp: the longest delay, and the slot in which a point arrives.
    pub(super) fn longest_ns(&self) -> Nanoseconds {
        let longest_ns = match self.delay {
            StreamDelay::Automatic => LONGEST_NS.unsigned_abs(),
            StreamDelay::Fixed(fixed_ns) => fixed_ns,
        };
        longest_ns.saturating_add(self.period_ns.unsigned_abs())
    }

    /// The present delay.
    pub(super) fn present_ns(&self) -> Nanoseconds {
        libm::round(self.present_ns.max(0.0)) as Nanoseconds
    }

    /// How fast time passes for the points: 1 while the delay stays.
    pub(super) const fn time_rate(&self) -> f64 {
        1.0 - self.rate
    }

    /// Takes the interval between two stamps.
    pub(super) fn note_interval(&mut self, interval_ns: i64) {
        if let Some(place) = self.intervals_ns.get_mut(self.interval_count % INTERVALS) {
            *place = interval_ns;
        }
        self.interval_count += 1;
        let mut sorted = self.intervals_ns;
        let known = self.interval_count.min(INTERVALS);
        let Some(sorted) = sorted.get_mut(..known) else { return };
        sorted.sort_unstable();
        // Of two in the middle the shorter one: points that are lost make others longer.
        self.interval_ns = sorted.get((known - 1) / 2).copied().unwrap_or(0);
    }

    /// Takes how long after the last stamp before it a point or a chunk has come; less than nothing if it has come before.
    pub(super) fn note_arrival(&mut self, behind_ns: i64) {
        if let Some(place) = self.behind_ns.get_mut(self.arrival_count % ARRIVALS) {
            *place = behind_ns;
        }
        self.arrival_count += 1;
        let (mut largest, mut second) = (i64::MIN, i64::MIN);
        for value in self.behind_ns.iter().take(self.arrival_count).copied() {
            (largest, second) = if value > largest { (value, largest) } else { (largest, second.max(value)) };
        }
        self.second_ns = if self.arrival_count == 1 { largest } else { second };
        self.choose_goal();
    }

    /// The delay has to last for what is waited for, and for one interval more: the motion to a point depends on the one
    /// behind it. Beside that it has some room.
    fn choose_goal(&mut self) {
        if self.delay != StreamDelay::Automatic {
            return;
        }
        let needed_ns = self.second_ns.saturating_add(self.interval_ns);
        let room_ns = self.interval_ns / 8 + self.period_ns;
        let whole = |delay_ns: i64| {
            let delay_ns = delay_ns.clamp(0, LONGEST_NS);
            (delay_ns + self.period_ns - 1) / self.period_ns * self.period_ns
        };
        let chosen_ns = whole(needed_ns.saturating_add(room_ns));
        let is_too_short = needed_ns > self.goal_ns;
        let is_too_long =
            self.arrival_count > ARRIVALS && self.goal_ns - chosen_ns > room_ns.saturating_mul(2);
        if is_too_short || is_too_long {
            self.goal_ns = chosen_ns;
        }
    }

    /// Nothing moves: the delay is at once what it is to be.
    pub(super) fn settle(&mut self) {
        self.present_ns = self.goal_ns as f64;
        self.rate = 0.0;
    }

    /// Goes on by a time in which the axes move: leads the delay to what it is to be without a jolt.
    pub(super) fn advance(&mut self, elapsed_ns: Nanoseconds) {
        let distance_ns = self.goal_ns as f64 - self.present_ns;
        if distance_ns == 0.0 && self.rate == 0.0 {
            return;
        }
        let per_second = 1.0 / NANOSECONDS_PER_SECOND as f64;
        let elapsed_s = elapsed_ns as f64 * per_second;
        let fastest = if distance_ns > 0.0 { FASTEST_GROWTH } else { FASTEST_SHRINKING };
        let ending = libm::sqrt(2.0 * RATE_RAMP * distance_ns.abs() * per_second);
        let wanted = fastest.min(ending).copysign(distance_ns);
        let most = RATE_RAMP * elapsed_s;
        self.rate += (wanted - self.rate).clamp(-most, most);
        let step_ns = self.rate * elapsed_ns as f64;
        if distance_ns.abs() <= step_ns.abs() || distance_ns.abs() < 1.0 {
            self.settle();
        } else {
            self.present_ns += step_ns;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MILLISECOND_NS: i64 = 1_000_000;

    fn estimator(intervals_ms: i64, behind_ms: &[i64]) -> DelayEstimator {
        let mut estimator = DelayEstimator::new(1_000_000, StreamDelay::Automatic);
        (0..INTERVALS).for_each(|_| estimator.note_interval(intervals_ms * MILLISECOND_NS));
        behind_ms.iter().for_each(|behind_ms| estimator.note_arrival(behind_ms * MILLISECOND_NS));
        estimator.settle();
        estimator
    }

    #[test]
    fn the_delay_is_a_little_more_than_two_intervals_where_points_come_in_time() {
        // 10 ms that are waited for, 10 ms more, and some room; in whole periods.
        assert_eq!(estimator(10, &[10; 100]).present_ns(), 23_000_000);
        assert_eq!(estimator(1, &[1; 100]).present_ns(), 4_000_000);
        assert_eq!(estimator(10, &[-500; 100]).present_ns(), 0, "they come ahead of their time");
    }

    #[test]
    fn one_late_arrival_does_not_make_the_delay_longer_but_two_do() {
        let mut arrivals = [10; 50];
        arrivals[20] = 200;
        assert_eq!(estimator(10, &arrivals).present_ns(), 23_000_000);
        arrivals[40] = 150;
        assert_eq!(estimator(10, &arrivals).present_ns(), 163_000_000);
    }

    #[test]
    fn points_that_are_lost_do_not_make_the_interval_longer() {
        let mut estimator = estimator(10, &[10; 10]);
        for interval_ms in [10, 20, 10, 30, 10, 20, 10, 20] {
            estimator.note_interval(interval_ms * MILLISECOND_NS);
        }
        assert_eq!(estimator.interval_ns(), 10 * MILLISECOND_NS);
    }

    #[test]
    fn the_delay_grows_and_shrinks_without_a_jolt_to_where_it_is_to_be() {
        let mut estimator = estimator(10, &[10; 100]);
        for (behind_ms, expected_ns) in [(100, 113_000_000), (10, 23_000_000)] {
            (0..100).for_each(|_| estimator.note_arrival(behind_ms * MILLISECOND_NS));
            let mut last = estimator.time_rate();
            let mut last_ns = estimator.present_ns();
            for _ in 0..6_000 {
                estimator.advance(1_000_000);
                let rate = estimator.time_rate();
                assert!((rate - last).abs() < 0.06 && (0.75..=1.031).contains(&rate), "{last} to {rate}");
                assert!(estimator.present_ns().abs_diff(last_ns) <= 250_001);
                (last, last_ns) = (rate, estimator.present_ns());
            }
            assert_eq!((estimator.present_ns(), estimator.time_rate()), (expected_ns, 1.0));
        }
    }

    #[test]
    fn a_delay_that_was_asked_for_stays() {
        let mut estimator = DelayEstimator::new(1_000_000, StreamDelay::Fixed(40_000_000));
        (0..100).for_each(|_| estimator.note_arrival(500 * MILLISECOND_NS));
        estimator.advance(1_000_000);
        assert_eq!((estimator.present_ns(), estimator.time_rate()), (40_000_000, 1.0));
    }
}
