//! Integer nanoseconds and the time grid.
//!
//! Slot `k` starts at `epoch + k · period`, always: the grid is never moved by what happened in an earlier
//! slot, so the mean period is exact however late a single wake-up was.

/// A point on the monotonic clock, or a length of time, in nanoseconds.
pub type Nanoseconds = u64;

/// Nanoseconds in one second.
pub const NANOSECONDS_PER_SECOND: u64 = 1_000_000_000;

/// The absolute time grid of the cycle.
///
/// ```
/// use takt_rt::Grid;
/// let grid = Grid::new(5_000, 1_000_000).unwrap();
/// assert_eq!(grid.slot_start_ns(3), 3_005_000);
/// assert_eq!(grid.slot_at(3_004_999), 2);
/// assert_eq!(grid.next_slot(3_005_000), 4);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    epoch_ns: Nanoseconds,
    period_ns: Nanoseconds,
}

impl Grid {
    /// A grid whose slot 0 starts at `epoch_ns`. `None` when the period is zero.
    pub const fn new(epoch_ns: Nanoseconds, period_ns: Nanoseconds) -> Option<Self> {
        if period_ns == 0 { None } else { Some(Self { epoch_ns, period_ns }) }
    }

    /// The length of a slot in nanoseconds.
    pub const fn period_ns(&self) -> Nanoseconds {
        self.period_ns
    }

    /// The length of a slot in seconds.
    pub fn period_s(&self) -> f64 {
        self.period_ns as f64 / NANOSECONDS_PER_SECOND as f64
    }

    /// The start of slot `slot`. Saturates at the end of representable time (584 years).
    pub const fn slot_start_ns(&self, slot: u64) -> Nanoseconds {
        self.epoch_ns.saturating_add(slot.saturating_mul(self.period_ns))
    }

    /// The slot that contains `now_ns`; 0 before the epoch.
    pub const fn slot_at(&self, now_ns: Nanoseconds) -> u64 {
        now_ns.saturating_sub(self.epoch_ns) / self.period_ns
    }

    /// The first slot that starts after `now_ns`.
    pub const fn next_slot(&self, now_ns: Nanoseconds) -> u64 {
        if now_ns < self.epoch_ns { 0 } else { self.slot_at(now_ns) + 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::Grid;
    use proptest::prelude::*;

    #[test]
    fn a_grid_needs_a_period() {
        assert_eq!(Grid::new(0, 0), None);
    }

    #[test]
    fn before_the_epoch_the_next_slot_is_the_first() {
        let grid = Grid::new(1_000, 100).unwrap();
        assert_eq!(grid.next_slot(999), 0);
        assert_eq!(grid.next_slot(1_000), 1);
    }

    #[test]
    fn a_billion_cycles_do_not_drift_by_a_nanosecond() {
        let grid = Grid::new(123_456_789, 1_000_000).unwrap();
        let mut slot = 0;
        let mut start_ns = grid.slot_start_ns(0);
        while slot < 1_000_000_000 {
            slot += 999_983;
            start_ns += 999_983 * 1_000_000;
            assert_eq!(grid.slot_start_ns(slot), start_ns);
        }
    }

    proptest! {
        #[test]
        fn every_instant_lies_in_the_slot_that_is_named(epoch in 0u64..1 << 50, period in 1u64..1 << 32, after in 0u64..1 << 60) {
            let grid = Grid::new(epoch, period).unwrap();
            let now = epoch + after;
            let slot = grid.slot_at(now);
            prop_assert!(grid.slot_start_ns(slot) <= now);
            prop_assert!(now < grid.slot_start_ns(slot + 1));
            prop_assert_eq!(grid.next_slot(now), slot + 1);
        }
    }
}
