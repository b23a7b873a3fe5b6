//! Trajectories: the host has them, checked; the group is carried along them cycle by cycle, exactly.
//!
//! Another trajectory takes the place of the present one at a cycle that is stated in advance: a new motion, or the same path at
//! another speed. So whoever makes it knows the state from which it begins.

use arrayvec::ArrayVec;

use super::Engine;
use super::execution::{Execution, Successor};
use super::group::GroupContext;
use super::requests::Handled;
use super::state::GroupState;
use super::step::Failure;
use crate::axis::Axis;
use crate::fault::Fault;
use crate::host::HostInterface;
use crate::phase::Phase;
use crate::plan::State;
use crate::rejection::RejectReason;
use crate::request::{ExecutionStart, RequestId, TrajectoryId};
use crate::source::TrajectorySample;
use crate::stop::{Origin, StopCause};
use crate::stop_category::StopCategory;

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// Asks the host for what the trajectories want in the next cycle, and tells it which of them are needed.
    pub(super) fn sample_trajectories(&mut self, host: &mut impl HostInterface<AXES, BUSES>) {
        let period_s = self.shared.period_s;
        for group in &mut self.groups {
            let number = group.number;
            let GroupState::Executing(execution) = &mut group.state else {
                host.keep_trajectories(number, [None; 2]);
                continue;
            };
            let at_s = (execution.cycles + 1) as f64 * period_s;
            execution.wanted = host.trajectory(number, execution.trajectory, at_s);
            host.keep_trajectories(number, execution.in_use());
        }
    }
}

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// Begins a trajectory of the host.
    pub(super) fn begin_execution(
        &mut self,
        id: RequestId,
        (trajectory, start): (TrajectoryId, ExecutionStart),
        host: &mut impl HostInterface<AXES, BUSES>,
    ) -> Handled {
        let number = self.group.number;
        // Asked for in any case, so that the host gets it back in any case.
        let first = host.trajectory(number, trajectory, 0.0);
        self.require_phase(&[Phase::Holding, Phase::Moving])?;
        self.require_no_fault()?;
        let first = first.ok_or(RejectReason::UnknownTrajectory)?;
        match start {
            ExecutionStart::Now => {
                self.require_phase(&[Phase::Holding])?;
                let here = |axis: &Axis| axis.set_point();
                self.check_first(&first, here)?;
                self.shared.snapshot.motions.begin(id, number, None, |axis| axis.is_none());
                self.group.stop = None;
                let execution =
                    Execution { motion: id, trajectory, cycles: 0, successor: None, wanted: None };
                self.enter(GroupState::Executing(execution));
            }
            ExecutionStart::After { trajectory: present, cycles, is_same_motion } => {
                let GroupState::Executing(execution) = self.group.state else {
                    return Err(RejectReason::Phase.into());
                };
                if execution.successor.is_some() {
                    return Err(RejectReason::SuccessorPending.into());
                }
                let at_s = cycles as f64 * self.shared.period_s;
                let then = host.trajectory(number, present, at_s);
                let then = then.filter(|then| then.remaining_s > 0.0 && present == execution.trajectory);
                let then = then.filter(|_| cycles > execution.cycles).ok_or(RejectReason::TooLate)?;
                self.check_first(&first, |axis| axis.own(&then.states))?;
                if !is_same_motion {
                    self.shared.snapshot.motions.begin(id, number, None, |_| false);
                }
                let motion = if is_same_motion { execution.motion } else { id };
                let successor = Successor { trajectory, motion, after_cycles: cycles };
                let execution = Execution { successor: Some(successor), ..execution };
                self.group.state = GroupState::Executing(execution);
            }
        }
        Ok(())
    }

    /// Checks that a trajectory begins where the axes are, but for rounding.
    fn check_first(&self, first: &TrajectorySample<AXES>, here: impl Fn(&Axis) -> State) -> Handled {
        for axis in self.axes.iter().filter(|axis| !axis.is_profile()) {
            let (begins, here, limits) = (axis.own(&first.states), here(axis), &axis.parameters().limits);
            let steepest = limits.acceleration.max(limits.deceleration);
            let is_close = |one: f64, other: f64, room: f64| (one - other).abs() <= room;
            let is_same = is_close(begins.position, here.position, ROUNDING * (1.0 + here.position.abs()))
                && is_close(begins.velocity, here.velocity, SAME_RATE * limits.velocity)
                && (limits.jerk.is_infinite()
                    || is_close(begins.acceleration, here.acceleration, SAME_RATE * steepest));
            if !is_same {
                let (position, present) = (begins.position, here.position);
                return Err(RejectReason::StartMismatch { position, present }.of_axis(axis.number()));
            }
        }
        Ok(())
    }

    /// Goes on by one cycle of the trajectory.
    pub(super) fn step_execution(&mut self, execution: &Execution<AXES>) -> Result<(), Failure> {
        let Some(wanted) = execution.wanted else {
            return Err((Origin::Group, Fault::StaleCommand { age_cycles: 1 }));
        };
        let mut next: ArrayVec<State, AXES> = ArrayVec::new();
        next.extend(self.axes.iter().map(|axis| axis.own(&wanted.states)));
        self.check(&next)?;
        self.take_set_points(&next);
        let following = execution.after_cycle();
        if following.motion != execution.motion {
            self.shared.snapshot.motions.replace(execution.motion, following.motion);
        }
        self.group.state = GroupState::Executing(following);
        if wanted.remaining_s <= 0.0 {
            self.end_execution(&next);
        }
        Ok(())
    }

    /// The last point has been reached. One that is passed in motion goes over into a stop.
    fn end_execution(&mut self, last: &[State]) {
        self.finish_motions();
        let mut states = self.axes.iter().zip(last).filter(|(axis, _)| !axis.is_profile());
        if states.any(|(_, state)| state.velocity != 0.0) {
            self.begin_stop(StopCause::Requested, Origin::Group, StopCategory::Two);
        } else {
            self.enter(GroupState::Holding);
        }
    }
}

/// By how much the first position of a trajectory may be off, relative to it or to 1 rad.
const ROUNDING: f64 = 1e-12;
/// The same for its velocity and acceleration, relative to their limits.
const SAME_RATE: f64 = 1e-6;
