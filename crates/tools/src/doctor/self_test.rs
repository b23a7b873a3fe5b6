//! The self-test: the loop runs for some seconds, and is graded on how far SYNC was from its grid.

use serde::Serialize;

use crate::jitter::{Measurement, PassReport};

/// The grade of a machine, by the largest deviation of SYNC from the grid, in parts of the period.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Grade {
    /// Below 1 %, as on a PREEMPT_RT kernel with a CPU of its own.
    Excellent,
    /// Below 5 %.
    Good,
    /// No slot was missed.
    Fair,
    /// Slots were missed.
    Poor,
}

/// What the self-test measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SelfTest {
    /// The grade.
    pub grade: Grade,
    /// The period of the cycle.
    pub cycle_ns: u64,
    /// True if it ran to its end.
    pub is_whole: bool,
    /// What was measured, sleeping, then spinning.
    #[serde(flatten)]
    pub pass: PassReport,
}

impl SelfTest {
    /// Grades a measurement. `None` when there was no cycle in it.
    pub fn new(measurement: &Measurement, cycle_ns: u64) -> Option<Self> {
        let pass = PassReport::new(measurement);
        (pass.cycles > 0).then(|| Self {
            grade: grade(pass.sync_ns.max, pass.missed_slots, cycle_ns),
            cycle_ns,
            is_whole: measurement.is_whole,
            pass,
        })
    }
}

fn grade(largest_ns: u64, missed_slots: u64, cycle_ns: u64) -> Grade {
    match largest_ns.saturating_mul(100) {
        _ if missed_slots > 0 => Grade::Poor,
        hundredfold if hundredfold < cycle_ns => Grade::Excellent,
        hundredfold if hundredfold < 5 * cycle_ns => Grade::Good,
        _ => Grade::Fair,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_deviation_and_missed_slots_make_the_grade() {
        assert_eq!(grade(9_999, 0, 1_000_000), Grade::Excellent);
        assert_eq!(grade(10_000, 0, 1_000_000), Grade::Good);
        assert_eq!(grade(49_999, 0, 1_000_000), Grade::Good);
        assert_eq!(grade(99_000, 0, 1_000_000), Grade::Fair);
        assert_eq!(grade(100, 1, 1_000_000), Grade::Poor);
        assert_eq!(grade(15_000, 0, 2_000_000), Grade::Excellent);
    }
}
