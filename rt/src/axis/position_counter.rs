//! The position counter of a drive: it wraps, and the joint turns on.

/// The counts that a drive reports as its position (object 6064). The count after the highest one is the lowest one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct PositionCounter {
    lowest: i32,
    highest: i32,
}

impl Default for PositionCounter {
    fn default() -> Self {
        Self::BITS_32
    }
}

impl PositionCounter {
    /// All counts of 32 bits.
    pub const BITS_32: Self = Self { lowest: i32::MIN, highest: i32::MAX };

    /// The counter from the lowest to the highest count; `None` unless the one is below the other.
    pub const fn new(lowest: i32, highest: i32) -> Option<Self> {
        if lowest < highest { Some(Self { lowest, highest }) } else { None }
    }

    /// The lowest count.
    pub const fn lowest(self) -> i32 {
        self.lowest
    }

    /// The highest count.
    pub const fn highest(self) -> i32 {
        self.highest
    }

    /// Counts of one lap of the counter.
    pub const fn lap(self) -> i64 {
        self.highest as i64 - self.lowest as i64 + 1
    }

    /// The way from one reported count to another one, by the shorter side.
    #[inline]
    pub(super) const fn step(self, from: i32, to: i32) -> i64 {
        let (way, lap) = (to as i64 - from as i64, self.lap());
        if 2 * way >= lap {
            way - lap
        } else if 2 * way < -lap {
            way + lap
        } else {
            way
        }
    }

    /// Of all counts that the drive reports as this one, that which is nearest to another one. One that is not finite is near none.
    pub(super) fn nearest(self, reported: i32, to: f64) -> i64 {
        let laps = libm::rint((to - f64::from(reported)) / self.lap() as f64);
        // Within what a number holds without rounding.
        let laps = if laps.abs() < 1e6 { laps as i64 } else { 0 };
        i64::from(reported) + laps * self.lap()
    }

    /// Returns `true` if the drive reports a count as it is.
    pub(super) const fn contains(self, count: i64) -> bool {
        self.lowest as i64 <= count && count <= self.highest as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const COUNTERS: [PositionCounter; 4] = [
        PositionCounter { lowest: i32::MIN, highest: i32::MAX },
        PositionCounter { lowest: 0, highest: 0xFFFF },
        PositionCounter { lowest: -0x80_0000, highest: 0x7F_FFFF },
        PositionCounter { lowest: 0, highest: 359 },
    ];

    proptest! {
        #[test]
        fn a_joint_that_goes_less_than_half_a_lap_between_reports_is_followed_over_every_wrap(
            counter in 0usize..4, ways in prop::collection::vec(-0.49f64..0.49, 1..50),
        ) {
            let counter = COUNTERS[counter];
            let reported = |joint: i64| (joint - i64::from(counter.lowest)).rem_euclid(counter.lap()) as i32;
            let reported = |joint: i64| (i64::from(reported(joint) as u32) + i64::from(counter.lowest)) as i32;
            let (mut joint, mut counted) = (i64::from(counter.lowest), i64::from(counter.lowest));
            for way in ways {
                let before = reported(joint);
                joint += (way * counter.lap() as f64) as i64;
                counted += counter.step(before, reported(joint));
                prop_assert_eq!(counted, joint);
                prop_assert_eq!(counter.nearest(reported(joint), joint as f64), joint);
            }
        }
    }

    #[test]
    fn the_nearest_count_is_the_reported_one_where_nothing_says_otherwise() {
        for to in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, 2e9, -2e9] {
            assert_eq!(PositionCounter::default().nearest(5, to), 5, "{to}");
        }
        assert_eq!(PositionCounter::default().nearest(i32::MIN, 2e9), 1 << 31);
    }
}
