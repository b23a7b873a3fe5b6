//! What is asked of a group, and what of it is possible now.

use super::encode::FAULT_RESET_CYCLES;
use super::group::GroupContext;
use super::requests::{Handled, require_phase};
use super::shared::Ending;
use super::state::{AtRest, GroupState, PowerRemoval, Stream};
use super::targets::{Rejection, check_profile_target, check_scales, check_target};
use crate::axis::Axis;
use crate::control::ControlLaw;
use crate::group_trajectory::Leg;
use crate::guard::AxisLimits;
use crate::phase::Phase;
use crate::plan::{PlanError, State};
use crate::profile::ProfileTarget;
use crate::rejection::RejectReason;
use crate::request::{Move, ProfileMove, Request, RequestId};
use crate::source::StreamSample;
use crate::stop::{Origin, StopCause};
use crate::stop_category::StopCategory;
use crate::time::Nanoseconds;
use crate::watch::TimingLevel;

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// Returns `true` if the group can do now what was asked of it. What its numbers say is checked when it is carried out.
    pub(super) fn check_request(&self, request: &Request<AXES>) -> Handled {
        match request {
            Request::Activate => self.require_phase(&[Phase::Passive]),
            Request::BringUp | Request::Enable if self.shared.requested.ending >= Ending::EnableInhibited => {
                Err(RejectReason::EnableInhibited.into())
            }
            Request::BringUp | Request::ConfirmBringUp => self.require_phase(&[Phase::Disabled]),
            Request::Enable => {
                self.require_phase(&[Phase::Disabled])?;
                self.require_bring_up()?;
                self.require_no_fault()?;
                self.require_commandable_positions()
            }
            Request::Move(_) if matches!(self.group.state, GroupState::InLoop(_)) => self.require_no_fault(),
            Request::Move(_) | Request::SetProfileTarget(_) => {
                self.require_phase(&[Phase::Holding, Phase::Moving])?;
                self.require_no_fault()
            }
            Request::ChangeMode(change) => self.check_mode_change(change),
            Request::Stream => self.check_stream(),
            Request::Disable if matches!(self.group.state, GroupState::Passive) => {
                Err(RejectReason::Phase.into())
            }
            Request::ResetFaults => self.require_phase(&[Phase::Disabled, Phase::Holding]),
            _ => Ok(()),
        }
    }

    /// Carries out what was asked of the group, after [`GroupContext::check`].
    pub(super) fn try_request(&mut self, id: RequestId, request: &Request<AXES>) -> Handled {
        match request {
            Request::Activate => self.activate(),
            Request::BringUp => self.return_to_passive(),
            Request::ConfirmBringUp => self.group.needs_bring_up = false,
            Request::Enable => self.begin_enabling(),
            Request::Move(parameters) => self.begin_move(id, parameters)?,
            Request::SetProfileTarget(target) => self.set_profile_target(id, target)?,
            Request::ChangeMode(change) => self.begin_mode_change(id, change),
            Request::Stream => self.begin_stream(),
            Request::Stop(category) => self.begin_stop(StopCause::Requested, Origin::Group, *category),
            Request::Disable => self.begin_disabling(),
            Request::ResetFaults => self.reset_faults(),
            // The engine has handled what concerns all groups, or the host.
            Request::Sync(_)
            | Request::TimeOfDay { .. }
            | Request::RatedTorque { .. }
            | Request::ProcessData(_)
            | Request::Position { .. }
            | Request::Execute { .. }
            | Request::RunCallback(_)
            | Request::InhibitEnable
            | Request::Shutdown => {}
        }
        Ok(())
    }

    pub(super) fn require_phase(&self, possible: &[Phase]) -> Handled {
        if matches!(self.group.state, GroupState::ChangingMode(_)) {
            return Err(RejectReason::ModeChanging.into());
        }
        require_phase(self.group.state.phase(), possible)
    }

    fn axis_mut(&mut self, number: u8) -> Result<&mut Axis, Rejection> {
        let unknown = RejectReason::UnknownAxis { axis: number, axes: self.shared.snapshot.axis_count };
        self.axes.iter_mut().find(|axis| axis.number() == number).ok_or(unknown.into())
    }

    /// A fault that has stopped the group must be reset before anything moves.
    pub(super) fn require_no_fault(&self) -> Handled {
        match self.group.stop.filter(|stop| !stop.is_requested()) {
            Some(stop) => {
                Err(Rejection { axis: stop.axis(), ..RejectReason::StopLatched { rule: stop.rule() }.into() })
            }
            None => Ok(()),
        }
    }

    /// Drives that a failed bring-up has left are not configured, or were reset: those that have no fault would be blamed for it.
    pub(super) fn require_bring_up(&self) -> Handled {
        if self.group.needs_bring_up { Err(RejectReason::NotBroughtUp.into()) } else { Ok(()) }
    }

    /// No joint may be enabled beyond a wrap of its drive's position counter: the drive might go around the world to its set-point.
    fn require_commandable_positions(&self) -> Handled {
        match self.axes.iter().find(|axis| !axis.is_position_commandable()) {
            Some(axis) => {
                let position = axis.position();
                let AxisLimits { position_min, position_max, .. } = axis.parameters().limits;
                let limit = position.clamp(position_min, position_max);
                Err(RejectReason::BeyondCounter { position, limit }.of_axis(axis.number()))
            }
            None => Ok(()),
        }
    }

    fn activate(&mut self) {
        self.axes.iter_mut().for_each(|axis| {
            axis.start_from_actual();
            axis.begin_reports();
        });
        self.enter(GroupState::Disabled);
    }

    #[cold]
    fn return_to_passive(&mut self) {
        self.axes.iter_mut().for_each(Axis::begin_again);
        self.group.fault_reset_cycles = 0;
        self.group.needs_bring_up = true;
        self.enter(GroupState::Passive);
    }

    fn begin_enabling(&mut self) {
        self.group.stop = None;
        self.axes.iter_mut().for_each(Axis::begin_watch);
        if let Some(heartbeat) = &mut self.shared.heartbeat {
            heartbeat.hasten();
        }
        self.enter(GroupState::Enabling);
    }

    fn check_stream(&self) -> Handled {
        self.require_phase(&[Phase::Holding])?;
        self.require_no_fault()?;
        self.require_punctuality()
    }

    /// What comes from outside in every slot needs slots that are not missed.
    pub(super) fn require_punctuality(&self) -> Handled {
        if self.shared.slots.level() >= TimingLevel::Degraded {
            let (missed, _) = self.shared.slots.unforgiven();
            return Err(RejectReason::MissedSlots { missed, limit: self.shared.slots.degraded() }.into());
        }
        Ok(())
    }

    fn begin_stream(&mut self) {
        self.group.stop = None;
        self.group.stream = StreamSample::default();
        self.axes.iter_mut().for_each(|axis| axis.follow_as(None));
        self.enter(GroupState::Streaming(Stream::Requested));
    }

    fn enter_motion(&mut self) {
        self.group.stop = None;
        self.enter(GroupState::Moving { is_reported: false });
    }

    fn begin_move(&mut self, id: RequestId, parameters: &Move<AXES>) -> Handled {
        check_scales(parameters)?;
        let target_of = |axis: &Axis| (axis.own(&parameters.target), axis.own(&parameters.target_velocity));
        for axis in self.axes.iter() {
            let (position, velocity) = target_of(axis);
            check_target(axis, position, velocity, self.shared.period_s)
                .map_err(|reason| reason.of_axis(axis.number()))?;
        }
        // It may take the place of a callback.
        if matches!(self.group.state, GroupState::InLoop(_)) {
            for axis in self.axes.iter_mut() {
                axis.derive_from_steps(self.shared.period_s);
                axis.end_stream(self.shared.period_s);
            }
        }
        let legs = self.axes.iter().map(|axis| {
            let (position, velocity) = target_of(axis);
            let start = axis.set_point();
            let target = State { position, velocity, acceleration: 0.0 };
            let limits = &axis.parameters().limits;
            // A drive in a profile mode makes its own way: nothing is planned for it.
            if axis.is_profile() {
                Leg::standing(start.position, limits)
            } else {
                Leg { start, target, limits }
            }
        });
        let minimum_duration_s = parameters.minimum_duration_s;
        self.group
            .motion
            .move_to(
                self.profiles,
                legs,
                parameters.velocity_scale,
                parameters.acceleration_scale,
                minimum_duration_s,
            )
            .map_err(|error| self.plan_rejection(error, minimum_duration_s))?;
        for axis in self.axes.iter_mut() {
            let position = axis.own(&parameters.target);
            if axis.accepts(ProfileTarget::Position(position)) {
                axis.set_profile_target(ProfileTarget::Position(position), Nanoseconds::MAX);
            }
        }
        // It takes over what was planned, and the drives that find their own way to a position.
        let is_positioned = |number: u8| {
            let mut positioned =
                self.axes.iter().filter(|axis| axis.parameters().law == ControlLaw::ProfilePosition);
            positioned.any(|axis| axis.number() == number)
        };
        self.shared
            .snapshot
            .motions
            .begin(id, self.group.number, None, |axis| axis.is_none_or(is_positioned));
        self.enter_motion();
        Ok(())
    }

    /// What keeps a motion from being planned. The planner counts the axes of the group.
    fn plan_rejection(&self, error: PlanError, minimum_duration_s: f64) -> Rejection {
        let axis = error.axis().and_then(|place| self.axes.get(place));
        match (error, axis) {
            (PlanError::InvalidTiming, _) => {
                RejectReason::MinimumDuration { duration_s: minimum_duration_s }.into()
            }
            (_, Some(axis)) => RejectReason::NoTrajectory.of_axis(axis.number()),
            (_, None) => RejectReason::NoTrajectory.into(),
        }
    }

    fn set_profile_target(&mut self, id: RequestId, wanted: &ProfileMove) -> Handled {
        if matches!(self.group.state, GroupState::Executing(_)) {
            return Err(RejectReason::Phase.into());
        }
        check_profile_target(self.axis_mut(wanted.axis)?, wanted.target)
            .map_err(|reason| reason.of_axis(wanted.axis))?;
        // The other axes stay where they are, not where the last trajectory ended.
        if matches!(self.group.state, GroupState::Holding) {
            self.plan_standstill().map_err(|error| self.plan_rejection(error, 0.0))?;
        }
        self.axis_mut(wanted.axis)?.set_profile_target(wanted.target, wanted.valid_until_ns);
        let is_position = matches!(wanted.target, ProfileTarget::Position(_));
        let takes_over = |axis: Option<u8>| axis.map_or(is_position, |axis| axis == wanted.axis);
        self.shared.snapshot.motions.begin(id, self.group.number, Some(wanted.axis), takes_over);
        self.enter_motion();
        Ok(())
    }

    fn begin_disabling(&mut self) {
        match self.group.state {
            GroupState::Passive
            | GroupState::Disabled
            | GroupState::ChangingMode(AtRest::Disabled)
            | GroupState::Disabling(_) => {}
            GroupState::ChangingMode(AtRest::Holding) => {
                self.begin_stop(StopCause::Requested, Origin::Group, StopCategory::One);
            }
            _ if self.must_come_to_rest() || matches!(self.group.state, GroupState::Stopping) => {
                self.begin_stop(StopCause::Requested, Origin::Group, StopCategory::One);
            }
            _ => self.enter(GroupState::Disabling(PowerRemoval::Shutdown)),
        }
    }

    fn reset_faults(&mut self) {
        if matches!(self.group.state, GroupState::Disabled) {
            let slowest = self.axes.iter().map(|axis| self.shared.divider_of(axis)).max().unwrap_or(1);
            self.group.fault_reset_part = slowest.max(FAULT_RESET_CYCLES);
            self.group.fault_reset_cycles = self.group.fault_reset_part.saturating_mul(3);
            self.axes.iter_mut().for_each(Axis::begin_fault_reset);
        }
        self.group.stop = None;
        if matches!(self.group.state, GroupState::Disabled) {
            self.settle_power(false);
        }
    }
}
