//! The velocity of a joint whose drive reports positions alone.
//!
//! The difference of two positions in whole counts is wrong by up to one count. In one cycle of a coarse encoder, that is more than many
//! a joint may move. So the velocity is that over the shortest time in which the joint has moved by some counts.

/// Counts by which the joint has moved in that time: the velocity is then wrong by one part of these at most.
const COUNTS: u64 = 4;
/// The most reports of which it is made. A joint that moves by less than [`COUNTS`] in them is slow.
const REPORTS: usize = 8;

/// A reported position.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
struct Sample {
    counts: i64,
    at_s: f64,
}

/// A velocity, and by how much it may be wrong: counts/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct CountRate {
    pub(super) rate: f64,
    pub(super) uncertainty: f64,
}

/// The last positions of a joint.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct VelocityEstimate {
    /// A ring.
    samples: [Sample; REPORTS],
    newest: usize,
    /// Samples that there are before the newest.
    known: usize,
    /// Samples from the one from which the velocity is measured to the newest.
    span: usize,
}

impl VelocityEstimate {
    /// Begins with a position: the way to it is not known.
    pub(super) fn begin(counts: i64) -> Self {
        let mut estimate = Self::default();
        estimate.samples[0].counts = counts;
        estimate
    }

    /// Takes a position that was reported so long after the last one.
    #[inline]
    pub(super) fn take(&mut self, counts: i64, elapsed_s: f64) -> CountRate {
        let last = self.back(0);
        let at_s = last.at_s + elapsed_s;
        self.newest = (self.newest + 1) % REPORTS;
        self.samples[self.newest % REPORTS] = Sample { counts, at_s };
        if self.known < REPORTS - 1 {
            self.known += 1;
        }
        // A joint that goes on as fast as that is measured from its last position, as it was before.
        let is_fast = self.span <= 1 && counts.abs_diff(last.counts) >= COUNTS;
        let from = if is_fast { last } else { self.begin_of_span(counts) };
        self.span = if is_fast { 1 } else { self.span };
        let span_s = at_s - from.at_s;
        if span_s > 0.0 {
            CountRate { rate: (counts - from.counts) as f64 / span_s, uncertainty: 1.0 / span_s }
        } else {
            CountRate::default()
        }
    }

    /// The sample from which the velocity to the newest one is measured.
    fn begin_of_span(&mut self, counts: i64) -> Sample {
        self.span = (self.span + 1).min(self.known);
        while self.span > 1 && counts.abs_diff(self.back(self.span - 1).counts) >= COUNTS {
            self.span -= 1;
        }
        self.back(self.span)
    }

    /// The sample so many before the newest.
    #[inline]
    fn back(&self, samples: usize) -> Sample {
        self.samples[(self.newest + REPORTS - samples) % REPORTS]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE_S: f64 = 1e-3;

    /// The velocities that are estimated of a joint at these places, in counts.
    fn estimated(position: impl Fn(f64) -> f64, cycles: u32) -> impl Iterator<Item = (f64, CountRate)> {
        let mut estimate = VelocityEstimate::begin(position(0.0).round() as i64);
        (1..=cycles).map(move |cycle| {
            let at_s = f64::from(cycle) * CYCLE_S;
            (at_s, estimate.take(position(at_s).round() as i64, CYCLE_S))
        })
    }

    #[test]
    fn a_joint_that_moves_by_one_count_now_and_then_is_slow() {
        // 100 counts/s: one cycle shows 0 or 1,000 counts/s.
        for (at_s, shown) in estimated(|at_s| 100.0 * at_s, 200) {
            assert!(at_s < 0.008 || (shown.rate - 100.0).abs() <= shown.uncertainty, "{at_s}: {shown:?}");
            assert!(at_s < 0.008 || shown.rate <= 200.0, "{at_s}: {shown:?}");
        }
    }

    #[test]
    fn a_joint_that_moves_by_many_counts_in_a_cycle_is_as_fast_as_in_the_last_one() {
        let position = |at_s: f64| 400_000.0 * at_s * at_s;
        for (at_s, shown) in estimated(position, 200).skip(25) {
            let mean = (position(at_s) - position(at_s - CYCLE_S)) / CYCLE_S;
            assert!((shown.rate - mean).abs() <= 1_000.0, "{at_s}: {shown:?} for {mean}");
        }
    }

    #[test]
    fn a_joint_that_starts_at_once_is_seen_at_once() {
        let position = |at_s: f64| if at_s < 0.1 { 0.0 } else { 200_000.0 * (at_s - 0.1) };
        let at = |cycle: usize| estimated(position, 110).nth(cycle - 1).unwrap().1.rate;
        assert_eq!(at(99), 0.0);
        assert!((at(102) - 200_000.0).abs() < 1_000.0, "{}", at(102));
    }

    #[test]
    fn nothing_is_known_without_time() {
        let mut estimate = VelocityEstimate::begin(7);
        assert_eq!(estimate.take(9, 0.0), CountRate::default());
        assert_eq!(estimate.take(11, 0.002), CountRate { rate: 2_000.0, uncertainty: 500.0 });
    }
}
