//! Checked trajectories on their way to the real-time thread, and back: the loop borrows them, and never frees one.

use std::sync::{Arc, Mutex, PoisonError};

use takt_rt::{TrajectoryId, TrajectorySample};

use super::group_axes::GroupAxes;
use super::lending::{Borrower, LENT_AT_MOST, Lender, lending};
use super::primitives::{AtomicU64, Ordering};
use crate::trajectory::Trajectory;

/// A trajectory that the real-time thread has been given, and how far it is.
#[derive(Debug)]
pub struct GivenTrajectory {
    trajectory: Trajectory,
    axes: GroupAxes,
    /// The time of the newest cycle, in seconds after the beginning, as bits.
    at_s: AtomicU64,
}

impl GivenTrajectory {
    /// One of the axes of a group, in the order of the group, that has yet to begin.
    pub fn new(trajectory: Trajectory, axes: GroupAxes) -> Self {
        Self { trajectory, axes, at_s: AtomicU64::new(0.0_f64.to_bits()) }
    }

    /// The trajectory.
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    /// What it wants of the axes of the controller so many seconds after its beginning.
    pub fn sample(&self, at_s: f64) -> TrajectorySample {
        let mut sample = self.trajectory.sample(at_s);
        self.axes.spread(&mut sample.states);
        sample
    }

    /// Its axes.
    pub fn axes(&self) -> &GroupAxes {
        &self.axes
    }

    /// The time of the newest cycle, in seconds after the beginning; 0 before it has begun.
    pub fn at_s(&self) -> f64 {
        f64::from_bits(self.at_s.load(Ordering::Relaxed))
    }
}

/// A trajectory for a group.
struct Handed {
    group: u8,
    given: Arc<GivenTrajectory>,
    /// For which time the real-time thread has asked last.
    asked_s: f64,
}

/// The two ends of the way there and back.
pub(super) fn trajectories() -> (TrajectoryGiver, TrajectoryTaker) {
    let (lender, borrower) = lending(LENT_AT_MOST);
    (TrajectoryGiver { lender, journal: None }, TrajectoryTaker(borrower))
}

/// A trajectory under the number that the real-time thread knows it by, with its group.
pub type NumberedTrajectory = (TrajectoryId, u8, Arc<GivenTrajectory>);

/// The end that gives trajectories, and frees those that come back. Clone it for every thread.
#[derive(Clone)]
pub struct TrajectoryGiver {
    lender: Lender<Handed>,
    /// Where each of them is noted for the journal.
    journal: Option<Arc<Mutex<Vec<NumberedTrajectory>>>>,
}

impl TrajectoryGiver {
    /// Gives a trajectory for a group, and returns its number. `None` if too many are with the real-time thread.
    pub fn give(&self, group: u8, given: &Arc<GivenTrajectory>) -> Option<TrajectoryId> {
        self.release();
        let handed = Handed { group, given: Arc::clone(given), asked_s: 0.0 };
        let id = self.lender.lend(Box::new(handed)).ok().map(TrajectoryId)?;
        if let Some(journal) = &self.journal {
            let mut noted = journal.lock().unwrap_or_else(PoisonError::into_inner);
            noted.push((id, group, Arc::clone(given)));
        }
        Some(id)
    }

    /// From now on what this end and its clones give is noted in the journal, too.
    pub(super) fn note_in(&mut self, journal: Arc<Mutex<Vec<NumberedTrajectory>>>) {
        self.journal = Some(journal);
    }

    /// Takes a trajectory back for which the real-time thread will not ask: its request was not submitted, or was discarded.
    pub fn take_back(&self, TrajectoryId(id): TrajectoryId) {
        drop(self.lender.take_back(id));
    }

    /// Frees what has come back.
    pub fn release(&self) {
        self.lender.collect(drop);
    }
}

/// The end of the real-time thread.
pub(super) struct TrajectoryTaker(Borrower<Handed>);

impl TrajectoryTaker {
    /// See [`takt_rt::HostInterface::trajectory`].
    pub(super) fn sample(
        &mut self,
        group: u8,
        TrajectoryId(id): TrajectoryId,
        at_s: f64,
    ) -> Option<TrajectorySample> {
        let handed = self.0.borrow(id).filter(|handed| handed.group == group)?;
        handed.asked_s = at_s;
        Some(handed.given.sample(at_s))
    }

    /// See [`takt_rt::HostInterface::keep_trajectories`].
    pub(super) fn keep(&mut self, group: u8, needed: [Option<TrajectoryId>; 2]) {
        self.0.keep(|id, handed| {
            let is_needed = handed.group != group || needed.contains(&Some(TrajectoryId(id)));
            if is_needed {
                handed.given.at_s.store(handed.asked_s.to_bits(), Ordering::Relaxed);
            }
            is_needed
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{TrajectoryConditions, TrajectoryPoint};
    use takt_rt::{AxisLimits, plan::State};

    fn given(position: f64) -> Arc<GivenTrajectory> {
        let limits = [AxisLimits {
            position_min: -9.0,
            position_max: 9.0,
            velocity: 9.0,
            acceleration: 99.0,
            deceleration: 99.0,
            jerk: 999.0,
            torque: 9.0,
        }];
        let start = [State::rest(position)];
        let conditions = TrajectoryConditions { start: &start, limits: &limits, period_s: 0.001 };
        let point = TrajectoryPoint { time_s: 1.0, positions: vec![position], ..TrajectoryPoint::default() };
        Arc::new(GivenTrajectory::new(
            Trajectory::new(&[point], &conditions).unwrap(),
            GroupAxes::new(vec![0]),
        ))
    }

    #[test]
    fn a_trajectory_is_borrowed_under_its_number_and_comes_back_when_it_is_not_needed() {
        let (giver, mut taker) = trajectories();
        let all: Vec<Arc<GivenTrajectory>> = (1..=2).map(|number| given(f64::from(number))).collect();
        let [first, second] = [0, 1].map(|index: usize| giver.give(0, &all[index]).unwrap());
        let position = |taker: &mut TrajectoryTaker, id: TrajectoryId| {
            taker.sample(0, id, 0.5).map(|sample| sample.states[0].position)
        };
        assert_eq!((position(&mut taker, second), position(&mut taker, first)), (Some(2.0), Some(1.0)));
        assert_eq!(taker.sample(1, second, 0.5), None, "it is for another group");
        assert_eq!(all[1].at_s(), 0.0, "the cycle is not over");
        taker.keep(0, [Some(second), None]);
        assert_eq!(all[1].at_s(), 0.5);
        giver.release();
        assert_eq!(all.iter().map(Arc::strong_count).collect::<Vec<_>>(), [1, 2]);
        taker.keep(1, [None; 2]);
        assert_eq!(position(&mut taker, second), Some(2.0), "another group does not need it");
        taker.keep(0, [None; 2]);
        assert_eq!(Arc::strong_count(&all[1]), 2, "it is not freed there");
        giver.release();
        assert_eq!((Arc::strong_count(&all[1]), position(&mut taker, second)), (1, None));
    }
}
