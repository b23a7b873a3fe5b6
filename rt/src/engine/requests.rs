//! What is asked of the controller. What is asked of one of its groups goes on to `group_requests`.

use super::Engine;
use super::shared::Ending;
use super::targets::Rejection;
use crate::axis::Axis;
use crate::host::HostInterface;
use crate::phase::Phase;
use crate::record::EventKind;
use crate::request::{RejectReason, Request, RequestEnvelope, RequestError, RequestId};

/// Requests that are handled in one cycle; the rest waits, so that a flood of them costs a bounded time.
const REQUESTS_PER_CYCLE: usize = 4;

/// The first group.
const FIRST: u8 = 0;

/// Done, or why not; nothing has changed then.
pub(super) type Handled = Result<(), Rejection>;

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    pub(super) fn handle_requests(&mut self, host: &mut impl HostInterface<AXES, BUSES>) {
        for _ in 0..REQUESTS_PER_CYCLE {
            let Some(envelope) = host.request() else { break };
            self.handle_request(&envelope, host);
        }
    }

    fn handle_request(
        &mut self,
        envelope: &RequestEnvelope<AXES>,
        host: &mut impl HostInterface<AXES, BUSES>,
    ) {
        let RequestEnvelope { id, request } = envelope;
        let rejected = self.try_request(*id, request, host).err().map(|Rejection { reason, axis }| {
            RequestError { request: request.kind(), reason, axis, phase: self.phase() }
        });
        self.shared.snapshot.answers.note(*id, rejected);
        if let Some(rejected) = rejected {
            self.shared.snapshot.rejected += 1;
            self.shared.emit(EventKind::Rejected(rejected));
        }
    }

    fn try_request(
        &mut self,
        id: RequestId,
        request: &Request<AXES>,
        host: &mut impl HostInterface<AXES, BUSES>,
    ) -> Handled {
        match request {
            Request::Sync(is_on) => {
                if *is_on && !self.shared.requested.sync {
                    self.axes.iter_mut().for_each(Axis::begin_sync);
                }
                self.shared.requested.sync = *is_on;
            }
            Request::TimeOfDay { at_zero_ns } => {
                self.shared.time.as_mut().ok_or(RejectReason::NoTime)?.set(*at_zero_ns);
            }
            Request::RatedTorque { axis, torque } => self.set_rated_torque(*axis, *torque)?,
            Request::ProcessData(data) => self.set_process_data(data)?,
            Request::Position { axis, counts } => self.axis_mut(*axis)?.set_reported_position(*counts),
            Request::Activate
            | Request::Enable
            | Request::Move(_)
            | Request::SetProfileTarget(_)
            | Request::Stream
            | Request::Stop(_)
            | Request::Disable
            | Request::ResetFaults => {
                self.group(FIRST).map_or(Ok(()), |mut group| group.try_request(id, request))?;
            }
            Request::Execute { trajectory, start } => {
                let (group, execution) = (self.group(FIRST), (*trajectory, *start));
                group.map_or(Ok(()), |mut group| group.begin_execution(FIRST, id, execution, host))?;
            }
            Request::InhibitEnable => {
                self.shared.requested.ending = self.shared.requested.ending.max(Ending::EnableInhibited)
            }
            Request::Shutdown => self.shared.requested.ending = Ending::Shutdown,
        }
        Ok(())
    }

    /// Checks the phase of the group of an axis.
    pub(super) fn require_phase_of(&self, axis: u8, possible: &[Phase]) -> Handled {
        let place = self.axes.iter().position(|own| own.number() == axis);
        let group = self.groups.iter().find(|group| place.is_some_and(|place| group.places.contains(&place)));
        require_phase(group.map_or(Phase::Passive, |group| group.state.phase()), possible)
    }

    pub(super) fn axis_mut(&mut self, number: u8) -> Result<&mut Axis, Rejection> {
        let unknown = RejectReason::UnknownAxis { axis: number, axes: self.axes.len() as u8 };
        self.axes.iter_mut().find(|axis| axis.number() == number).ok_or(unknown.into())
    }

    /// What is commanded in per mille of the rated torque must not leap: it changes without power only.
    fn set_rated_torque(&mut self, axis: u8, torque: f64) -> Handled {
        self.require_phase_of(axis, &[Phase::Passive, Phase::Disabled])?;
        if self.axis_mut(axis)?.set_rated_torque(torque) {
            Ok(())
        } else {
            Err(RejectReason::RatedTorque { torque }.of_axis(axis))
        }
    }
}

/// Checks a phase.
pub(super) fn require_phase(present: Phase, possible: &[Phase]) -> Handled {
    if possible.contains(&present) { Ok(()) } else { Err(RejectReason::Phase.into()) }
}
