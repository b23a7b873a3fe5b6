//! Checked trajectories on their way to the real-time thread, and back: the loop borrows them, and never frees one.
//!
//! No call waits for another thread. A slot is used by one side at a time: by whoever has claimed it, by the real-time thread from
//! when it has taken the trajectory, and by whoever frees what has come back.
//!
//! ```text
//! give:       claim a slot (id 0 → CLAIMED) → put the trajectory in → show its id
//! real time:  find the id → take the trajectory → … → put it into `back`
//! release:    take it from `back` → free it → give the slot back (id 0)
//! ```

use std::sync::Arc;

use arrayvec::ArrayVec;
use takt_rt::{TrajectoryId, TrajectorySample};

use super::axis_places::AxisPlaces;
use super::primitives::{AtomicCell, AtomicU64, Ordering};
use crate::trajectory::Trajectory;

/// The most trajectories that are with the real-time thread, or on their way there or back.
const TRAJECTORIES_AT_MOST: usize = 16;

/// A slot that nobody uses, and one that has been claimed.
const FREE: u64 = 0;
const CLAIMED: u64 = u64::MAX;

/// A trajectory that the real-time thread has been given, and how far it is.
#[derive(Debug)]
pub struct GivenTrajectory {
    trajectory: Trajectory,
    axes: AxisPlaces,
    /// The time of the newest cycle, in seconds after the beginning, as bits.
    at_s: AtomicU64,
}

impl GivenTrajectory {
    /// One of the axes of a group, in the order of the group, that has yet to begin.
    pub fn new(trajectory: Trajectory, axes: AxisPlaces) -> Self {
        Self { trajectory, axes, at_s: AtomicU64::new(0.0_f64.to_bits()) }
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

/// A trajectory for a group.
struct Handed {
    group: u8,
    given: Arc<GivenTrajectory>,
}

struct Slot {
    id: AtomicU64,
    there: AtomicCell<Option<Box<Handed>>>,
    back: AtomicCell<Option<Box<Handed>>>,
}

struct Table {
    newest: AtomicU64,
    slots: [Slot; TRAJECTORIES_AT_MOST],
}

/// The two ends of the way there and back.
pub(super) fn trajectories() -> (TrajectoryGiver, TrajectoryTaker) {
    let slot =
        || Slot { id: AtomicU64::new(FREE), there: AtomicCell::new(None), back: AtomicCell::new(None) };
    let table = Arc::new(Table { newest: AtomicU64::new(0), slots: std::array::from_fn(|_| slot()) });
    (TrajectoryGiver { table: Arc::clone(&table) }, TrajectoryTaker { table, held: ArrayVec::new() })
}

/// The end that gives trajectories, and frees those that come back. Clone it for every thread.
#[derive(Clone)]
pub struct TrajectoryGiver {
    table: Arc<Table>,
}

impl TrajectoryGiver {
    /// Gives a trajectory for a group, and returns its number. `None` if too many are with the real-time thread.
    pub fn give(&self, group: u8, given: &Arc<GivenTrajectory>) -> Option<TrajectoryId> {
        self.release();
        let claimed = |slot: &&Slot| {
            slot.id.compare_exchange(FREE, CLAIMED, Ordering::Acquire, Ordering::Relaxed).is_ok()
        };
        let slot = self.table.slots.iter().find(claimed)?;
        let id = self.table.newest.fetch_add(1, Ordering::Relaxed) + 1;
        slot.there.store(Some(Box::new(Handed { group, given: Arc::clone(given) })));
        slot.id.store(id, Ordering::Release);
        Some(TrajectoryId(id))
    }

    /// Takes a trajectory back for which the real-time thread will not ask: its request was not submitted, or was discarded.
    pub fn take_back(&self, TrajectoryId(id): TrajectoryId) {
        for slot in self.table.slots.iter().filter(|slot| slot.id.load(Ordering::Acquire) == id) {
            if slot.there.take().is_some() {
                slot.id.store(FREE, Ordering::Release);
            }
        }
    }

    /// Frees what has come back.
    pub fn release(&self) {
        for slot in &self.table.slots {
            if slot.back.take().is_some() {
                slot.id.store(FREE, Ordering::Release);
            }
        }
    }
}

/// The end of the real-time thread.
pub(super) struct TrajectoryTaker {
    table: Arc<Table>,
    held: ArrayVec<Held, TRAJECTORIES_AT_MOST>,
}

struct Held {
    id: TrajectoryId,
    slot: usize,
    handed: Box<Handed>,
    asked_s: f64,
}

impl TrajectoryTaker {
    /// See [`takt_rt::HostInterface::trajectory`].
    pub(super) fn sample(&mut self, group: u8, id: TrajectoryId, at_s: f64) -> Option<TrajectorySample> {
        if !self.held.iter().any(|held| held.id == id) {
            self.take(id)?;
        }
        let is_wanted = |held: &&mut Held| held.id == id && held.handed.group == group;
        let held = self.held.iter_mut().find(is_wanted)?;
        held.asked_s = at_s;
        let GivenTrajectory { trajectory, axes, .. } = &*held.handed.given;
        let sample = trajectory.sample(at_s);
        Some(TrajectorySample { states: axes.spread(sample.states), ..sample })
    }

    fn take(&mut self, id: TrajectoryId) -> Option<()> {
        let mut slots = self.table.slots.iter();
        let slot = slots.position(|slot| slot.id.load(Ordering::Acquire) == id.0)?;
        let handed = self.table.slots.get(slot)?.there.take()?;
        // Each slot has one, so there is room.
        self.held.try_push(Held { id, slot, handed, asked_s: 0.0 }).ok()
    }

    /// See [`takt_rt::HostInterface::keep_trajectories`].
    pub(super) fn keep(&mut self, group: u8, needed: [Option<TrajectoryId>; 2]) {
        let mut index = 0;
        while let Some(held) = self.held.get(index) {
            if held.handed.group != group || needed.contains(&Some(held.id)) {
                held.handed.given.at_s.store(held.asked_s.to_bits(), Ordering::Relaxed);
                index += 1;
            } else if let Some(Held { slot, handed, .. }) = self.held.swap_pop(index)
                && let Some(slot) = self.table.slots.get(slot)
            {
                slot.back.store(Some(handed));
            }
        }
    }
}

// A cell with a lock inside could stop the real-time thread.
const _: () = assert!(AtomicCell::<Option<Box<Handed>>>::is_lock_free());

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
            AxisPlaces::new(vec![0]),
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

    #[test]
    fn slots_are_used_again_and_never_more_than_there_are() {
        let (giver, mut taker) = trajectories();
        let one = given(1.0);
        for _ in 0..3 {
            let ids: Vec<TrajectoryId> = std::iter::from_fn(|| giver.give(0, &one)).collect();
            assert_eq!(ids.len(), TRAJECTORIES_AT_MOST);
            for (number, id) in ids.into_iter().enumerate() {
                // Of some the requests are discarded.
                if number % 3 == 0 {
                    giver.take_back(id);
                    assert_eq!(taker.sample(0, id, 0.0), None);
                } else {
                    assert!(taker.sample(0, id, 0.0).is_some());
                    giver.take_back(id);
                    assert!(taker.sample(0, id, 0.0).is_some(), "it has been taken");
                }
            }
            taker.keep(0, [None; 2]);
        }
        giver.release();
        assert_eq!(Arc::strong_count(&one), 1);
    }
}
