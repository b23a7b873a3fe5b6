//! The options of a plan: when the motion ends, and what its axes have in common.

use super::error::PlanError;
use super::problem::SIZE_MAX;

/// What the axes of one motion have in common.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Synchronisation {
    /// All axes arrive at the same time, as early as the slowest axis can.
    #[default]
    Time,
    /// As [`Time`](Self::Time), and on a straight line where that takes no longer.
    Phase,
    /// On a straight line, even if that takes longer. Start and target that are not on one line give
    /// [`PlanError::NotStraight`].
    Straight,
    /// Every axis takes its own shortest time. After that it goes on with its target velocity until all axes have arrived.
    Independent,
}

/// How a velocity beyond its limit comes back to the limit, for example after the limit was lowered during a motion.
///
/// In second-order planning both are the same: the deceleration can end at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Return {
    /// As fast as possible. The deceleration is still large when the velocity reaches the limit. So the velocity falls below
    /// the limit, and it can even change its sign, before the motion to the target begins.
    #[default]
    Fastest,
    /// The deceleration is zero when the velocity reaches the limit, and the velocity does not fall below the limit before.
    Settled,
}

/// When a motion ends, and how it gets there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlanOptions {
    /// What the axes have in common.
    pub synchronisation: Synchronisation,
    /// The motion takes at least this long, in s: 0 (as fast as possible) to below 1e30.
    pub minimum_duration_s: f64,
    /// The duration is a multiple of this time, in s, above 1e-30 and below 1e30; `None` for any duration.
    pub cycle_s: Option<f64>,
    /// How a velocity beyond its limit comes back to it.
    pub return_to_limits: Return,
}

impl PlanOptions {
    pub(super) fn validate(&self) -> Result<(), PlanError> {
        let least_valid = self.minimum_duration_s >= 0.0 && self.minimum_duration_s < SIZE_MAX;
        let cycle_valid = self.cycle_s.is_none_or(|cycle_s| cycle_s > 1.0 / SIZE_MAX && cycle_s < SIZE_MAX);
        if least_valid && cycle_valid { Ok(()) } else { Err(PlanError::InvalidTiming) }
    }
}
