//! Computes how long before a deadline the sleep must end.

use crate::time::Nanoseconds;

/// The resolution of the measurement: the cap is divided into this many buckets.
const BUCKETS: usize = 64;

/// One sample in this many may be later than the guard time.
const TOLERATED: u32 = 5_000;

/// After this many samples all counts are halved. So the guard time follows a load that changes within seconds, in both
/// directions, and no counter overflows.
const MEMORY: u32 = 16_384;

/// Computes the guard time from measured wake-up latencies.
///
/// It is the shortest time that absorbs all but one in five thousand of about the last ten thousand wake-ups, and one bucket (1/64
/// of the cap) for the time from the timer to the spin.
///
/// It is a percentile and not the maximum: a single stall of milliseconds, as on virtual machines, must not turn the rest of the
/// run into spinning. The cap bounds the processor time that the spin takes.
#[derive(Clone, Debug)]
pub struct SpinGuard {
    cap_ns: Nanoseconds,
    /// The count of samples in each bucket.
    within: [u32; BUCKETS],
    /// The count of samples later than the cap.
    beyond: u32,
    /// The count of all samples.
    samples: u32,
}

impl SpinGuard {
    /// A guard time of at most `cap_ns`, in ns; a tenth of the period is a good value. With 0 there is no spin.
    pub const fn new(cap_ns: Nanoseconds) -> Self {
        Self { cap_ns, within: [0; BUCKETS], beyond: 0, samples: 0 }
    }

    /// Adds a sample: by how many ns the thread was ready later than its timer.
    pub fn record(&mut self, latency_ns: Nanoseconds) {
        if self.samples >= MEMORY {
            self.forget_half();
        }
        let bucket = usize::try_from(latency_ns / self.bucket_ns()).unwrap_or(usize::MAX);
        *self.within.get_mut(bucket).unwrap_or(&mut self.beyond) += 1;
        self.samples += 1;
    }

    /// The guard time in ns: 0 before the first sample, at most the cap.
    pub fn guard_ns(&self) -> Nanoseconds {
        if self.samples == 0 {
            return 0;
        }
        let tolerated = self.samples / TOLERATED;
        let mut covered = 0;
        let mut edge_ns = self.bucket_ns();
        for count in self.within {
            covered += count;
            edge_ns = edge_ns.saturating_add(self.bucket_ns());
            if covered + tolerated >= self.samples {
                break;
            }
        }
        edge_ns.min(self.cap_ns)
    }

    /// Halves all counts. The sum is computed again, because halves are rounded down.
    fn forget_half(&mut self) {
        self.within.iter_mut().chain([&mut self.beyond]).for_each(|count| *count /= 2);
        self.samples = self.within.iter().sum::<u32>() + self.beyond;
    }

    fn bucket_ns(&self) -> Nanoseconds {
        self.cap_ns.div_ceil(BUCKETS as u64).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::SpinGuard;
    use proptest::prelude::*;

    #[test]
    fn without_a_measurement_there_is_no_spin() {
        assert_eq!(SpinGuard::new(64_000).guard_ns(), 0);
    }

    #[test]
    fn a_cap_of_zero_switches_the_spin_off() {
        let mut guard = SpinGuard::new(0);
        guard.record(7_000);
        assert_eq!(guard.guard_ns(), 0);
    }

    #[test]
    fn the_guard_covers_the_usual_latency_with_a_bucket_to_spare() {
        let mut guard = SpinGuard::new(64_000);
        for _ in 0..100 {
            guard.record(4_500);
        }
        assert_eq!(guard.guard_ns(), 6_000);
    }

    #[test]
    fn a_single_stall_in_five_thousand_cycles_does_not_lengthen_the_guard() {
        let mut guard = SpinGuard::new(64_000);
        for _ in 0..4_999 {
            guard.record(4_500);
        }
        guard.record(30_000_000);
        assert_eq!(guard.guard_ns(), 6_000);
        guard.record(30_000_000);
        assert_eq!(guard.guard_ns(), 64_000);
    }

    #[test]
    fn the_guard_follows_a_load_that_comes_and_goes() {
        let mut guard = SpinGuard::new(64_000);
        let mut run = |cycles, latency_ns: fn(u64) -> u64| {
            (0..cycles).for_each(|cycle| guard.record(latency_ns(cycle)));
            guard.guard_ns()
        };
        assert_eq!(run(1_000_000, |cycle| 3_500 + cycle % 2_000), 7_000);
        assert_eq!(run(2_000, |cycle| if cycle % 50 == 0 { 20_500 } else { 4_500 }), 22_000);
        assert_eq!(run(100_000, |_| 4_500), 6_000);
    }

    proptest! {
        #[test]
        fn the_guard_is_capped_and_covers_all_but_one_in_five_thousand(
            cap in 0u64..200_000,
            latencies in proptest::collection::vec(0u64..250_000, 1..400),
        ) {
            let mut guard = SpinGuard::new(cap);
            for latency in &latencies {
                guard.record(*latency);
            }
            let guard_ns = guard.guard_ns();
            prop_assert!(guard_ns <= cap);
            let later = latencies.iter().filter(|latency| **latency > guard_ns).count();
            prop_assert!(guard_ns == cap || later * 5_000 <= latencies.len());
        }
    }
}
