//! Checked trajectories on their way to the real-time thread, and back: the loop borrows them, and never frees one.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use arrayvec::ArrayVec;
use takt_rt::{TrajectoryId, TrajectorySample};

use super::ring::{Consumer, Producer, ring};
use crate::trajectory::Trajectory;

/// The most trajectories that are with the real-time thread, or on their way there or back.
pub(super) const TRAJECTORIES_AT_MOST: usize = 16;

/// A trajectory that the real-time thread has been given, and how far it is.
#[derive(Debug)]
pub struct GivenTrajectory {
    trajectory: Trajectory,
    /// The time of the newest cycle, in seconds after the beginning, as bits.
    at_s: AtomicU64,
}

impl GivenTrajectory {
    /// One that has yet to begin.
    pub fn new(trajectory: Trajectory) -> Self {
        Self { trajectory, at_s: AtomicU64::new(0.0_f64.to_bits()) }
    }

    /// The trajectory.
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    /// The time of the newest cycle, in seconds after the beginning; 0 before it has begun.
    pub fn at_s(&self) -> f64 {
        f64::from_bits(self.at_s.load(Ordering::Relaxed))
    }
}

/// A trajectory for a group, under its number.
pub(super) struct Handed {
    pub group: u8,
    pub id: TrajectoryId,
    pub given: Arc<GivenTrajectory>,
}

/// The two ends of the way there and back.
pub(super) fn trajectories() -> (TrajectoryGiver, TrajectoryTaker) {
    let (give, take) = ring(TRAJECTORIES_AT_MOST);
    let (give_back, take_back) = ring(TRAJECTORIES_AT_MOST);
    (
        TrajectoryGiver { give, take_back, given: 0 },
        TrajectoryTaker { take, give_back, held: ArrayVec::new() },
    )
}

/// The end that gives trajectories, and frees those that come back.
pub(super) struct TrajectoryGiver {
    give: Producer<Handed>,
    take_back: Consumer<Arc<GivenTrajectory>>,
    /// How many have not come back.
    given: usize,
}

impl TrajectoryGiver {
    /// Whether one more can be given. As many as fit into a ring are under way at most: so there is always room to give one back.
    pub(super) fn has_room(&mut self) -> bool {
        self.release();
        self.given < TRAJECTORIES_AT_MOST
    }

    /// Gives a trajectory; see [`TrajectoryGiver::has_room`].
    pub(super) fn give(&mut self, handed: Handed) {
        self.given += usize::from(self.give.push(handed));
    }

    /// Frees what has come back.
    pub(super) fn release(&mut self) {
        while self.take_back.pop().is_some() {
            self.given -= 1;
        }
    }
}

/// The end of the real-time thread.
pub(super) struct TrajectoryTaker {
    take: Consumer<Handed>,
    give_back: Producer<Arc<GivenTrajectory>>,
    held: ArrayVec<Held, TRAJECTORIES_AT_MOST>,
}

struct Held {
    handed: Handed,
    asked_s: f64,
}

impl TrajectoryTaker {
    /// See [`takt_rt::HostInterface::trajectory`].
    pub(super) fn sample(&mut self, group: u8, id: TrajectoryId, at_s: f64) -> Option<TrajectorySample> {
        let is_wanted = |held: &Held| held.handed.id == id && held.handed.group == group;
        // Trajectories come in the order of their requests.
        while !self.held.iter().any(is_wanted) && !self.held.is_full() {
            let handed = self.take.pop()?;
            self.held.push(Held { handed, asked_s: 0.0 });
        }
        let held = self.held.iter_mut().find(|held| is_wanted(held))?;
        held.asked_s = at_s;
        Some(held.handed.given.trajectory.sample(at_s))
    }

    /// See [`takt_rt::HostInterface::keep_trajectories`].
    pub(super) fn keep(&mut self, group: u8, needed: [Option<TrajectoryId>; 2]) {
        let mut index = 0;
        while let Some(held) = self.held.get(index) {
            if held.handed.group != group || needed.contains(&Some(held.handed.id)) {
                held.handed.given.at_s.store(held.asked_s.to_bits(), Ordering::Relaxed);
                index += 1;
            } else if let Some(held) = self.held.swap_pop(index) {
                self.give_back.push(held.handed.given);
            }
        }
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
        Arc::new(GivenTrajectory::new(Trajectory::new(&[point], &conditions).unwrap()))
    }

    #[test]
    fn a_trajectory_is_borrowed_under_its_number_and_comes_back_when_it_is_not_needed() {
        let (mut giver, mut taker) = trajectories();
        let all: Vec<Arc<GivenTrajectory>> = (1..=3).map(|number| given(f64::from(number))).collect();
        for (id, given) in (1..).map(TrajectoryId).zip(&all) {
            giver.give(Handed { group: 0, id, given: Arc::clone(given) });
        }
        let position = |taker: &mut TrajectoryTaker, id: u64| {
            taker.sample(0, TrajectoryId(id), 0.5).map(|sample| sample.states[0].position)
        };
        assert_eq!(position(&mut taker, 2), Some(2.0));
        assert_eq!(taker.sample(1, TrajectoryId(2), 0.5), None, "it is for another group");
        assert_eq!(all[1].at_s(), 0.0, "the cycle is not over");
        taker.keep(0, [Some(TrajectoryId(2)), None]);
        assert_eq!(all[1].at_s(), 0.5);
        giver.release();
        // The first one has been passed over, the second is needed, and the third was asked for by nobody but is here.
        assert_eq!(all.iter().map(Arc::strong_count).collect::<Vec<_>>(), [1, 2, 1]);
        taker.keep(0, [None; 2]);
        giver.release();
        assert_eq!((Arc::strong_count(&all[1]), giver.given), (1, 0));
        assert_eq!(position(&mut taker, 2), None);
    }

    #[test]
    fn no_more_are_given_than_can_come_back() {
        let (mut giver, mut taker) = trajectories();
        let one = given(1.0);
        let mut count = 0;
        while giver.has_room() {
            count += 1;
            giver.give(Handed { group: 0, id: TrajectoryId(count), given: Arc::clone(&one) });
        }
        assert_eq!(count, TRAJECTORIES_AT_MOST as u64);
        assert!(taker.sample(0, TrajectoryId(count), 0.0).is_some());
        taker.keep(0, [None; 2]);
        assert!(giver.has_room());
        assert_eq!((Arc::strong_count(&one), giver.given), (1, 0));
    }
}
