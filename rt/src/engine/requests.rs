//! What is asked of the group, and what of it is possible now.

use super::encode::FAULT_RESET_CYCLES;
use super::state::{GroupState, PowerRemoval, Stream};
use super::targets::{Rejection, check_profile_target, check_scales, check_target, plan_rejection};
use super::{Ending, Engine};
use crate::axis::Axis;
use crate::control::ControlLaw;
use crate::group_trajectory::Leg;
use crate::host::HostInterface;
use crate::phase::Phase;
use crate::plan::State;
use crate::profile::ProfileTarget;
use crate::record::EventKind;
use crate::request::{Move, ProfileMove, RejectReason, Request, RequestEnvelope, RequestError, RequestId};
use crate::stop::{Origin, StopCause};
use crate::stop_category::StopCategory;
use crate::time::Nanoseconds;
use crate::watch::TimingLevel;

/// Requests that are handled in one cycle; the rest waits, so that a flood of them costs a bounded time.
const REQUESTS_PER_CYCLE: usize = 4;

/// Done, or why not; nothing has changed then.
type Handled = Result<(), Rejection>;

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    pub(super) fn handle_requests(&mut self, host: &mut impl HostInterface<AXES, BUSES>) {
        for _ in 0..REQUESTS_PER_CYCLE {
            let Some(envelope) = host.request() else { break };
            self.handle_request(&envelope);
        }
        if let GroupState::Streaming(stream) = &mut self.state
            && let Some(command) = host.stream()
        {
            stream.receive(command, self.now_ns);
        }
    }

    fn handle_request(&mut self, envelope: &RequestEnvelope<AXES>) {
        let RequestEnvelope { id, request } = envelope;
        let rejected = self.try_request(*id, request).err().map(|Rejection { reason, axis }| RequestError {
            request: request.kind(),
            reason,
            axis,
            phase: self.state.phase(),
        });
        self.snapshot.answers.note(*id, rejected);
        if let Some(rejected) = rejected {
            self.snapshot.rejected += 1;
            self.emit(EventKind::Rejected(rejected));
        }
    }

    fn try_request(&mut self, id: RequestId, request: &Request<AXES>) -> Handled {
        match request {
            Request::Sync(is_on) => {
                if *is_on && !self.requested.sync {
                    self.axes.iter_mut().for_each(Axis::begin_sync);
                }
                self.requested.sync = *is_on;
            }
            Request::TimeOfDay { at_zero_ns } => {
                self.time.as_mut().ok_or(RejectReason::NoTime)?.set(*at_zero_ns);
            }
            Request::RatedTorque { axis, torque } => self.set_rated_torque(*axis, *torque)?,
            Request::ProcessData(data) => self.set_process_data(data)?,
            Request::Position { axis, counts } => self.axis_mut(*axis)?.set_reported_position(*counts),
            Request::Activate => self.activate()?,
            Request::Enable => self.begin_enabling()?,
            Request::Move(parameters) => self.begin_move(id, parameters)?,
            Request::SetProfileTarget(target) => self.set_profile_target(id, target)?,
            Request::Stream => self.begin_stream()?,
            Request::Stop(category) => self.begin_stop(StopCause::Requested, Origin::Group, *category),
            Request::Disable => self.begin_disabling()?,
            Request::ResetFaults => self.reset_faults()?,
            Request::InhibitEnable => {
                self.requested.ending = self.requested.ending.max(Ending::EnableInhibited)
            }
            Request::Shutdown => self.requested.ending = Ending::Shutdown,
        }
        Ok(())
    }

    pub(super) fn require_phase(&self, possible: &[Phase]) -> Handled {
        if possible.contains(&self.state.phase()) { Ok(()) } else { Err(RejectReason::Phase.into()) }
    }

    /// A fault that has stopped the group must be reset before anything moves.
    fn require_no_fault(&self) -> Handled {
        match self.stop.filter(|stop| !stop.is_requested()) {
            Some(stop) => {
                Err(Rejection { reason: RejectReason::StopLatched { rule: stop.rule() }, axis: stop.axis() })
            }
            None => Ok(()),
        }
    }

    pub(super) fn axis_mut(&mut self, number: u8) -> Result<&mut Axis, Rejection> {
        let unknown = RejectReason::UnknownAxis { axis: number, axes: self.axes.len() as u8 };
        self.axes.get_mut(usize::from(number)).ok_or(unknown.into())
    }

    /// What is commanded in per mille of the rated torque must not leap: it changes without power only.
    fn set_rated_torque(&mut self, axis: u8, torque: f64) -> Handled {
        self.require_phase(&[Phase::Passive, Phase::Disabled])?;
        if self.axis_mut(axis)?.set_rated_torque(torque) {
            Ok(())
        } else {
            Err(RejectReason::RatedTorque { torque }.of_axis(axis.into()))
        }
    }

    fn activate(&mut self) -> Handled {
        self.require_phase(&[Phase::Passive])?;
        self.axes.iter_mut().for_each(Axis::start_from_actual);
        self.enter(GroupState::Disabled);
        Ok(())
    }

    fn begin_enabling(&mut self) -> Handled {
        if self.requested.ending >= Ending::EnableInhibited {
            return Err(RejectReason::EnableInhibited.into());
        }
        self.require_phase(&[Phase::Disabled])?;
        self.require_no_fault()?;
        self.stop = None;
        self.forget_observations();
        if let Some(heartbeat) = &mut self.heartbeat {
            heartbeat.hasten();
        }
        self.enter(GroupState::Enabling);
        Ok(())
    }

    /// Forgets what was observed while nothing could move.
    fn forget_observations(&mut self) {
        self.axes.iter_mut().for_each(Axis::begin_watch);
        self.foreign_frame = None;
        self.slots.forgive();
        if let Some(level) = self.slots.changed_level() {
            self.emit(EventKind::Timing { level });
        }
    }

    fn begin_stream(&mut self) -> Handled {
        self.require_phase(&[Phase::Holding])?;
        self.require_no_fault()?;
        if self.slots.level() >= TimingLevel::Degraded {
            let (missed, _) = self.slots.unforgiven();
            return Err(RejectReason::MissedSlots { missed, limit: self.slots.degraded() }.into());
        }
        self.stop = None;
        self.axes.iter_mut().for_each(Axis::begin_stream);
        self.enter(GroupState::Streaming(Stream::Awaited));
        Ok(())
    }

    fn enter_motion(&mut self) {
        self.stop = None;
        self.enter(GroupState::Moving { is_reported: false });
    }

    fn begin_move(&mut self, id: RequestId, parameters: &Move<AXES>) -> Handled {
        self.require_phase(&[Phase::Holding, Phase::Moving])?;
        self.require_no_fault()?;
        check_scales(parameters)?;
        let targets = || parameters.target.into_iter().zip(parameters.target_velocity);
        for (index, (axis, (position, velocity))) in self.axes.iter().zip(targets()).enumerate() {
            check_target(axis, position, velocity, self.period_s).map_err(|reason| reason.of_axis(index))?;
        }
        let legs = self.axes.iter().zip(targets()).map(|(axis, (position, velocity))| {
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
        self.motion
            .move_to(legs, parameters.velocity_scale, parameters.acceleration_scale, minimum_duration_s)
            .map_err(|error| plan_rejection(error, minimum_duration_s))?;
        for (axis, position) in self.axes.iter_mut().zip(parameters.target) {
            if axis.accepts(ProfileTarget::Position(position)) {
                axis.set_profile_target(ProfileTarget::Position(position), Nanoseconds::MAX);
            }
        }
        // It takes over what was planned, and the drives that find their own way to a position.
        let law = |axis: u8| self.axes.get(usize::from(axis)).map(|axis| axis.parameters().law);
        let is_positioned = |axis: u8| law(axis) == Some(ControlLaw::ProfilePosition);
        self.snapshot.motions.begin(id, None, |axis| axis.is_none_or(is_positioned));
        self.enter_motion();
        Ok(())
    }

    fn set_profile_target(&mut self, id: RequestId, wanted: &ProfileMove) -> Handled {
        let index = usize::from(wanted.axis);
        self.require_phase(&[Phase::Holding, Phase::Moving])?;
        self.require_no_fault()?;
        check_profile_target(self.axis_mut(wanted.axis)?, wanted.target)
            .map_err(|reason| reason.of_axis(index))?;
        // The other axes stay where they are, not where the last trajectory ended.
        if self.state == GroupState::Holding {
            self.plan_standstill().map_err(|error| plan_rejection(error, 0.0))?;
        }
        self.axis_mut(wanted.axis)?.set_profile_target(wanted.target, wanted.valid_until_ns);
        let is_position = matches!(wanted.target, ProfileTarget::Position(_));
        let takes_over = |axis: Option<u8>| axis.map_or(is_position, |axis| axis == wanted.axis);
        self.snapshot.motions.begin(id, Some(wanted.axis), takes_over);
        self.enter_motion();
        Ok(())
    }

    fn begin_disabling(&mut self) -> Handled {
        match self.state {
            GroupState::Passive => return Err(RejectReason::Phase.into()),
            GroupState::Disabled | GroupState::Disabling(_) => {}
            _ if self.must_come_to_rest() || self.state == GroupState::Stopping => {
                self.begin_stop(StopCause::Requested, Origin::Group, StopCategory::One);
            }
            _ => self.enter(GroupState::Disabling(PowerRemoval::Shutdown)),
        }
        Ok(())
    }

    fn reset_faults(&mut self) -> Handled {
        self.require_phase(&[Phase::Disabled, Phase::Holding])?;
        if self.state == GroupState::Disabled {
            self.fault_reset_cycles = 3 * FAULT_RESET_CYCLES;
            self.axes.iter_mut().for_each(Axis::begin_fault_reset);
        }
        self.stop = None;
        Ok(())
    }
}
