//! How far a group is on a trajectory.

use crate::request::{RequestId, TrajectoryId};
use crate::source::TrajectorySample;

/// A trajectory that the group is on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Execution<const AXES: usize> {
    /// The request that began the motion.
    pub(super) motion: RequestId,
    /// The number under which the host has the trajectory.
    pub(super) trajectory: TrajectoryId,
    /// Cycles of the trajectory that have been carried out.
    pub(super) cycles: u64,
    /// What takes its place.
    pub(super) successor: Option<Successor>,
    /// What is wanted in the next cycle; `None` if the host has nothing.
    pub(super) wanted: Option<TrajectorySample<AXES>>,
}

/// What takes the place of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Successor {
    pub(super) trajectory: TrajectoryId,
    /// The motion that goes on with it: the present one, or one of its own.
    pub(super) motion: RequestId,
    /// Once so many cycles of the present trajectory have been carried out.
    pub(super) after_cycles: u64,
}

impl<const AXES: usize> Execution<AXES> {
    /// As it is when one more cycle has been carried out. What takes its place does so at once: from then on, another one may be to
    /// take the place of that.
    pub(super) fn after_cycle(&self) -> Self {
        let cycles = self.cycles + 1;
        match self.successor {
            Some(Successor { trajectory, motion, after_cycles }) if cycles >= after_cycles => {
                Self { motion, trajectory, cycles: 0, successor: None, wanted: self.wanted }
            }
            _ => Self { cycles, ..*self },
        }
    }

    /// The trajectories that are still needed.
    pub(super) fn in_use(&self) -> [Option<TrajectoryId>; 2] {
        [Some(self.trajectory), self.successor.map(|successor| successor.trajectory)]
    }
}
