//! The trajectories that were given to a controller, and those of them that are under way.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use takt_rt::{MAX_GROUPS, RequestId, TrajectoryId};

use crate::channels::{GivenTrajectory, TrajectoryGiver};

/// The trajectories of the handles of a controller.
pub(super) struct Trajectories {
    pub giver: TrajectoryGiver,
    /// Those of each group.
    groups: [Mutex<TrajectoryState>; MAX_GROUPS],
}

#[derive(Default)]
pub(super) struct TrajectoryState {
    /// The trajectory that was granted last.
    pub present: Option<Present>,
    /// Those whose requests may not have been taken yet.
    pub submitted: Vec<(TrajectoryId, RequestId)>,
}

/// A trajectory that was granted.
#[derive(Clone)]
pub(super) struct Present {
    pub motion: RequestId,
    pub id: TrajectoryId,
    pub given: Arc<GivenTrajectory>,
    /// The rate that it has while it is not paused.
    pub rate: f64,
    pub is_paused: bool,
}

impl Trajectories {
    pub fn new(giver: TrajectoryGiver) -> Self {
        Self { giver, groups: Default::default() }
    }

    /// Commands of trajectories of a group wait for one another; no other call needs this lock.
    pub fn lock(&self, group: u8) -> MutexGuard<'_, TrajectoryState> {
        let [first, ..] = &self.groups;
        let state = self.groups.get(usize::from(group)).unwrap_or(first);
        // A panic of another holder of the lock leaves the state consistent.
        state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
