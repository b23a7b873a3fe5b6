//! A group that a callback leads: a function of the owner, called once a slot, in the real-time thread.
//!
//! The host has the function. It is called after everything that could stop the group has been looked at, and only in cycles whose
//! set-points go on.

use arrayvec::ArrayVec;

use super::CycleInput;
use super::group::GroupContext;
use super::in_loop::InLoop;
use super::requests::Handled;
use super::state::GroupState;
use super::step::Failure;
use crate::fault::Fault;
use crate::host::HostInterface;
use crate::phase::Phase;
use crate::plan::State;
use crate::record::EventKind;
use crate::rejection::RejectReason;
use crate::request::RequestId;
use crate::source::{AxisTarget, CallbackCycle, CallbackOutcome, CallbackRun, StreamSample, StreamState};
use crate::stop::Origin;

/// To come to rest wherever the joint can.
const HOLD: AxisTarget = AxisTarget::Velocity { velocity: 0.0, acceleration: 0.0 };

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// Lets a callback of the host lead the group. It may take the place of another one.
    pub(super) fn begin_in_loop(
        &mut self,
        id: RequestId,
        run: &CallbackRun,
        host: &mut impl HostInterface<AXES, BUSES>,
    ) -> Handled {
        // Taken in any case, so that the host gets it back in any case.
        let is_there = host.take_callback(self.group.number, run.callback);
        if !matches!(self.group.state, GroupState::InLoop(_)) {
            self.require_phase(&[Phase::Holding])?;
        }
        self.require_no_fault()?;
        self.require_punctuality()?;
        if !is_there {
            return Err(RejectReason::UnknownCallback.into());
        }
        self.group.stop = None;
        self.group.stream = StreamSample::default();
        for axis in self.axes.iter_mut() {
            axis.derive_from_steps(self.shared.period_s);
            axis.follow_as(run.follow);
        }
        self.shared.snapshot.motions.begin(id, self.group.number, None, |axis| axis.is_none());
        self.enter(GroupState::InLoop(InLoop::new(*run)));
        self.emit(EventKind::Stream { state: StreamState::Callback });
        Ok(())
    }

    /// Calls the callback that leads the group, if one does.
    pub(super) fn call_in_loop(
        &mut self,
        input: &CycleInput<'_>,
        host: &mut impl HostInterface<AXES, BUSES>,
    ) {
        let shared = &mut *self.shared;
        let GroupState::InLoop(in_loop) = &mut self.group.state else { return };
        for axis in self.axes.iter() {
            let number = usize::from(axis.number());
            if let Some(shown) = shared.snapshot.axes.get_mut(number) {
                axis.show(shown);
            }
            if let Some(target) = shared.callback_targets.get_mut(number) {
                *target = None;
            }
        }
        let slots = in_loop.called_in.map_or(1, |last| input.slot.saturating_sub(last)).max(1);
        let cycle = CallbackCycle {
            slot: input.slot,
            slot_start_ns: input.slot_start_ns,
            now_ns: input.now_ns,
            period_s: shared.period_s,
            dt_s: slots as f64 * shared.period_s,
            missed_slots: slots - 1,
            budget_ns: in_loop.run.budget_ns,
            set_points_due_ns: input.set_points_due_ns,
            time_left_ns: 0,
        };
        let cycle = cycle.beginning_at(input.now_ns);
        let (callback, targets) = (in_loop.callback(), &mut shared.callback_targets);
        let returned = host.callback(self.group.number, callback, &cycle, &shared.snapshot.axes, targets);
        self.group.callback_ns = Some(returned.spent_ns);
        in_loop.returns(input.slot, returned);
    }

    /// Carries out what the callback has commanded.
    pub(super) fn step_in_loop(&mut self, in_loop: InLoop) -> Result<(), Failure> {
        if let Some(fault) = in_loop.fault() {
            return Err((Origin::Group, fault));
        }
        if in_loop.returned.outcome == CallbackOutcome::Finished {
            return self.finish_in_loop();
        }
        let mut resting = in_loop.resting;
        let mut next: ArrayVec<State, AXES> = ArrayVec::new();
        let period_s = self.shared.period_s;
        for axis in self.axes.iter_mut() {
            let (target, number) = (axis.own(&self.shared.callback_targets), axis.number().into());
            let is_led = axis.is_enabled() && !axis.is_profile();
            let of_axis = match target {
                _ if !is_led => Ok(axis.set_point()),
                Some(target) => {
                    resting.take(number);
                    axis.streamed(&target, period_s)
                }
                None => {
                    let begun = match resting.contains(number) {
                        false => axis.begin_rest(&HOLD, period_s),
                        true => Ok(()),
                    };
                    resting.insert(number);
                    begun.and_then(|()| axis.resting(period_s))
                }
            };
            next.push(of_axis.map_err(|fault| (Origin::Axis(axis.number()), fault))?);
        }
        self.check(&next)?;
        self.take_set_points(&next);
        self.group.state = GroupState::InLoop(InLoop { resting, ..in_loop });
        Ok(())
    }

    /// The callback is over: the rest of its motion is the way to rest.
    fn finish_in_loop(&mut self) -> Result<(), Failure> {
        self.plan_stop().map_err(|_| (Origin::Group, Fault::NoTrajectory))?;
        self.enter(GroupState::Moving { is_reported: false });
        self.step_move(false)
    }
}
