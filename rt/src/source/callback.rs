//! The owner's function in the real-time thread: what it is told in a slot, and what it answers.

use super::target::Follow;
use crate::guard::AxisLimits;
use crate::plan::State;
use crate::time::Nanoseconds;

/// The number under which the host has a callback.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct CallbackId(pub u64);

/// Which callback is to lead a group, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct CallbackRun {
    /// Which.
    pub callback: CallbackId,
    /// How long a call may take.
    pub budget_ns: Nanoseconds,
    /// How many calls in a row may take longer. One more is a stop.
    pub overruns_allowed: u32,
    /// What is done with a command beyond the limits; `None` as each axis is configured.
    pub follow: Option<Follow>,
}

/// When a callback is called.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CallbackCycle {
    /// The slot.
    pub slot: u64,
    /// Its start on the grid.
    pub slot_start_ns: Nanoseconds,
    /// The time at which the computation of the cycle began.
    pub now_ns: Nanoseconds,
    /// The period of the cycle, in seconds: set-points go on by that much in a call, even after missed slots.
    pub period_s: f64,
    /// The time from the start of the slot of the last call to the start of this one, in seconds. In the first call it is one period.
    pub dt_s: f64,
    /// Slots in which it was not called since the last call: the thread was late, or set-points had still to leave.
    pub missed_slots: u64,
    /// How long the call may take.
    pub budget_ns: Nanoseconds,
    /// The time at which the set-points of the cycle must be ready.
    pub set_points_due_ns: Nanoseconds,
    /// How long this call may take, at its beginning: less than the budget when the cycle began late.
    pub time_left_ns: Nanoseconds,
}

impl CallbackCycle {
    /// The same, with the time that is left for a call that begins at `begun_ns`: its budget, or until the set-points must be ready.
    pub const fn beginning_at(self, begun_ns: Nanoseconds) -> Self {
        let until_due_ns = self.set_points_due_ns.saturating_sub(begun_ns);
        let time_left_ns = if until_due_ns < self.budget_ns { until_due_ns } else { self.budget_ns };
        Self { time_left_ns, ..self }
    }
}

/// How a call of a callback has ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum CallbackOutcome {
    /// The host has no such callback.
    #[default]
    Missing,
    /// It has commanded what it wants of the axes.
    Commanded,
    /// It is over: the axes come to rest and hold.
    Finished,
    /// It has panicked, and is not called again.
    Panicked,
}

/// What became of a call, and how long it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct CallbackReturn {
    /// How it has ended.
    pub outcome: CallbackOutcome,
    /// How long it took.
    pub spent_ns: Nanoseconds,
}

/// Makes motion of positions that are commanded one after the other, a period apart: of the last two, and of the next one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionSequence {
    last: f64,
    last_step: f64,
}

impl PositionSequence {
    /// The axis has been resting here.
    pub const fn at_rest(position: f64) -> Self {
        Self { last: position, last_step: 0.0 }
    }

    /// The motion at the next position, as the steps to it show it. Steps that the limits do not allow are a leap: the axis is to rest
    /// behind it.
    pub fn next(&mut self, position: f64, limits: &AxisLimits, period_s: f64) -> State {
        let step = position - self.last;
        let velocity = step / period_s;
        let acceleration = (step - self.last_step) / (period_s * period_s);
        (self.last, self.last_step) = (position, step);
        if velocity.abs() > limits.velocity {
            State::rest(position)
        } else if acceleration.abs() > limits.acceleration.max(limits.deceleration) {
            State { position, velocity, acceleration: 0.0 }
        } else {
            // The step shows the velocity in its middle.
            State { position, velocity: velocity + acceleration * period_s / 2.0, acceleration }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: AxisLimits = AxisLimits { velocity: 2.0, acceleration: 10.0, ..AxisLimits::NONE };
    const PERIOD_S: f64 = 0.001;

    #[test]
    fn the_motion_of_a_sequence_is_that_of_the_curve_that_it_samples() {
        let limits = AxisLimits { deceleration: 10.0, ..LIMITS };
        let mut sequence = PositionSequence::at_rest(0.0);
        for cycle in 1..=1_000 {
            let time_s = f64::from(cycle) * PERIOD_S;
            let motion = sequence.next(2.0 * time_s * time_s, &limits, PERIOD_S);
            if cycle > 2 && 4.0 * time_s < limits.velocity {
                assert!((motion.velocity - 4.0 * time_s).abs() < 1e-9, "{motion:?} at {time_s}");
                assert!((motion.acceleration - 4.0).abs() < 1e-6, "{motion:?} at {time_s}");
            }
        }
    }

    #[test]
    fn a_leap_is_to_be_rested_behind_at_once_and_after_it() {
        let limits = AxisLimits { deceleration: 10.0, ..LIMITS };
        let mut sequence = PositionSequence::at_rest(0.0);
        for _ in 0..3 {
            assert_eq!(sequence.next(1.0, &limits, PERIOD_S), State::rest(1.0));
        }
        assert!(!sequence.next(f64::NAN, &limits, PERIOD_S).position.is_finite());
    }

    #[test]
    fn the_largest_positions_there_are_leave_only_numbers_behind() {
        let limits = AxisLimits { deceleration: 10.0, ..LIMITS };
        let mut sequence = PositionSequence::at_rest(0.0);
        for position in [f64::MAX, f64::MIN, f64::MAX, 0.0, 0.0, f64::MIN, f64::MIN, 1e-3, 1e-3] {
            let State { position, velocity, acceleration } = sequence.next(position, &limits, PERIOD_S);
            assert!(
                position.is_finite() && velocity.abs() <= 2.0 && acceleration.abs() <= 10.0,
                "{position}"
            );
        }
        assert_eq!(sequence.next(1e-3, &limits, PERIOD_S), State::rest(1e-3));
    }

    #[test]
    fn what_is_left_is_the_shorter_one_of_the_budget_and_of_the_time_until_the_set_points_are_due() {
        let cycle = CallbackCycle { budget_ns: 100, set_points_due_ns: 1_000, ..CallbackCycle::default() };
        assert_eq!([700, 950, 1_100].map(|now_ns| cycle.beginning_at(now_ns).time_left_ns), [100, 50, 0]);
    }
}
