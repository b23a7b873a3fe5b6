//! What is asked of the controller. What is asked of one of its groups goes on to `group_requests`.

use core::ops::Range;

use super::Engine;
use super::shared::Ending;
use super::state::GroupState;
use super::targets::Rejection;
use crate::axis::Axis;
use crate::bit_set::BitSet;
use crate::host::HostInterface;
use crate::phase::Phase;
use crate::record::EventKind;
use crate::rejection::{RejectReason, RequestError};
use crate::request::{ExecutionStart, Request, RequestEnvelope, RequestId, RequestTarget, TrajectoryId};
use crate::source::CallbackRun;

/// Requests that are handled in one cycle; the rest waits, so that a flood of them costs a bounded time.
const REQUESTS_PER_CYCLE: usize = 4;

/// Done, or why not; nothing has changed then.
pub(super) type Handled = Result<(), Rejection>;

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    pub(super) fn handle_requests(&mut self, host: &mut impl HostInterface<AXES, BUSES>) {
        for _ in 0..REQUESTS_PER_CYCLE {
            let Some(envelope) = host.request() else { break };
            // Stops and requests take effect in their order: a group that is commanded after a stop is not stopped by it.
            self.couple_stops();
            self.handle_request(&envelope, host);
        }
    }

    fn handle_request(
        &mut self,
        envelope: &RequestEnvelope<AXES>,
        host: &mut impl HostInterface<AXES, BUSES>,
    ) {
        let RequestEnvelope { id, target, request } = envelope;
        let rejection = self.try_request(*id, *target, request, host).err();
        let of_group = rejection.and_then(|Rejection { axis, group, .. }| {
            group.or_else(|| axis.and_then(|axis| self.group_of(axis).ok()))
        });
        let rejected = rejection.map(|Rejection { reason, axis, .. }| RequestError {
            request: request.kind(),
            reason,
            axis,
            phase: self.phase(of_group.unwrap_or(0)).unwrap_or_default(),
        });
        self.shared.snapshot.answers.note(*id, rejected);
        if let Some(rejected) = rejected {
            self.shared.snapshot.rejected += 1;
            self.shared.emit(of_group, EventKind::Rejected(rejected));
        }
    }

    fn try_request(
        &mut self,
        id: RequestId,
        target: RequestTarget,
        request: &Request<AXES>,
        host: &mut impl HostInterface<AXES, BUSES>,
    ) -> Handled {
        match request {
            Request::Sync(is_on) => {
                if *is_on && !self.shared.requested.sync {
                    self.axes.iter_mut().for_each(Axis::begin_sync);
                    self.shared.guards.begin();
                }
                self.shared.requested.sync = *is_on;
            }
            Request::TimeOfDay { at_zero_ns } => {
                self.shared.time.as_mut().ok_or(RejectReason::NoTime)?.set(*at_zero_ns);
            }
            Request::RatedTorque { axis, torque, limit_per_mille } => {
                self.set_rated_torque(*axis, *torque, *limit_per_mille)?;
            }
            Request::ProcessData(data) => self.set_process_data(data)?,
            Request::Position { axis, counts } => self.axis_mut(*axis)?.set_reported_position(*counts),
            Request::Activate
            | Request::BringUp
            | Request::ConfirmBringUp
            | Request::Enable
            | Request::Move(_)
            | Request::SetProfileTarget(_)
            | Request::ChangeMode(_)
            | Request::Stream
            | Request::Stop(_)
            | Request::Disable
            | Request::ResetFaults => self.ask_groups(id, target, request)?,
            Request::Execute { trajectory, start } => {
                self.execute(id, target, request, (*trajectory, *start), host)?
            }
            Request::RunCallback(run) => self.run_callback(id, target, request, run, host)?,
            Request::InhibitEnable => {
                self.shared.requested.ending = self.shared.requested.ending.max(Ending::EnableInhibited)
            }
            Request::Shutdown => self.shared.requested.ending = Ending::Shutdown,
        }
        Ok(())
    }

    /// Hands a request to the groups that it is for. Where one of them rejects it, none carries it out.
    fn ask_groups(&mut self, id: RequestId, target: RequestTarget, request: &Request<AXES>) -> Handled {
        let asked = match (self.asked_groups(target, request)?, request) {
            (asked, Request::BringUp) => self.with_groups_of_same_nodes(asked),
            (asked, Request::Disable) => self.without_passive_groups(asked),
            (asked, _) => asked.map(usize::from).collect(),
        };
        for number in asked.iter().map(|group| group as u8) {
            let rejection = self.group(number).and_then(|group| group.check_request(request).err());
            if let Some(rejection) = rejection {
                return Err(Rejection { group: Some(number), ..rejection });
            }
        }
        if *request == Request::Enable && !self.groups.iter().any(|group| group.state.has_power()) {
            self.forget_observations();
        }
        for number in asked.iter().map(|group| group as u8) {
            if let Some(mut group) = self.group(number) {
                group
                    .try_request(id, request)
                    .map_err(|rejection| Rejection { group: Some(number), ..rejection })?;
            }
        }
        Ok(())
    }

    /// These groups, and those with axes of the same nodes.
    fn with_groups_of_same_nodes(&self, asked: Range<u8>) -> BitSet {
        let node_of = |axis: &Axis| (axis.parameters().bus, axis.parameters().node);
        let mut found: BitSet = asked.map(usize::from).collect();
        loop {
            let of_found =
                |axis: &&Axis| self.group_of(axis.number()).is_ok_and(|group| found.contains(group.into()));
            let is_beside =
                |axis: &&Axis| self.axes.iter().filter(of_found).any(|other| node_of(other) == node_of(axis));
            let beside =
                self.axes.iter().filter(is_beside).filter_map(|axis| self.group_of(axis.number()).ok());
            let all = beside.map(usize::from).collect::<BitSet>().union(found);
            if all == found {
                return found;
            }
            found = all;
        }
    }

    /// Those of these groups that are not passive: they have no power to be taken. All of them, if every one is.
    fn without_passive_groups(&self, asked: Range<u8>) -> BitSet {
        let all: BitSet = asked.map(usize::from).collect();
        let is_passive = |group: &usize| {
            self.groups.get(*group).is_some_and(|group| matches!(group.state, GroupState::Passive))
        };
        let active: BitSet = all.iter().filter(|group| !is_passive(group)).collect();
        if active.is_empty() { all } else { active }
    }

    /// Forgets what was observed while nothing could move.
    fn forget_observations(&mut self) {
        self.shared.foreign_frames.forget();
        self.shared.slots.forgive();
        if let Some(level) = self.shared.slots.changed_level() {
            self.shared.emit(None, EventKind::Timing { level });
        }
    }

    /// Begins a trajectory of the host. It is asked for in any case, so that the host gets it back in any case.
    fn execute(
        &mut self,
        id: RequestId,
        target: RequestTarget,
        request: &Request<AXES>,
        execution: (TrajectoryId, ExecutionStart),
        host: &mut impl HostInterface<AXES, BUSES>,
    ) -> Handled {
        let asked = self.asked_groups(target, request);
        if asked.is_err() {
            let _ = host.trajectory(0, execution.0, 0.0);
        }
        let number = asked?.start;
        let Some(mut group) = self.group(number) else { return Ok(()) };
        let begun = group.begin_execution(id, execution, host);
        begun.map_err(|rejection| Rejection { group: Some(number), ..rejection })
    }

    /// Lets a callback of the host lead a group. It is taken in any case, so that the host gets it back in any case.
    fn run_callback(
        &mut self,
        id: RequestId,
        target: RequestTarget,
        request: &Request<AXES>,
        run: &CallbackRun,
        host: &mut impl HostInterface<AXES, BUSES>,
    ) -> Handled {
        let asked = self.asked_groups(target, request);
        if asked.is_err() {
            host.take_callback(0, run.callback);
        }
        let number = asked?.start;
        let Some(mut group) = self.group(number) else { return Ok(()) };
        let begun = group.begin_in_loop(id, run, host);
        begun.map_err(|rejection| Rejection { group: Some(number), ..rejection })
    }

    /// The numbers of the groups that a request is for.
    fn asked_groups(&self, target: RequestTarget, request: &Request<AXES>) -> Result<Range<u8>, Rejection> {
        let groups = self.groups.len() as u8;
        let of_axis = match request {
            Request::SetProfileTarget(wanted) => Some(self.group_of(wanted.axis)?),
            _ => None,
        };
        let asked = match target {
            RequestTarget::Group(group) if group >= groups => {
                return Err(RejectReason::UnknownGroup { group, groups }.into());
            }
            RequestTarget::Group(asked) => Some(asked),
            RequestTarget::All => of_axis,
        };
        match (asked, of_axis, request) {
            (Some(asked), Some(of_axis), _) if asked != of_axis => {
                Err(RejectReason::OtherGroup { asked, of_axis }.into())
            }
            (Some(asked), ..) => Ok(asked..asked + 1),
            (
                None,
                _,
                Request::Move(_)
                | Request::ChangeMode(_)
                | Request::Stream
                | Request::Execute { .. }
                | Request::RunCallback(_),
            ) if groups > 1 => Err(RejectReason::GroupNotNamed { groups }.into()),
            (None, ..) => Ok(0..groups),
        }
    }

    /// The group of an axis.
    fn group_of(&self, axis: u8) -> Result<u8, Rejection> {
        let place = self.place_of(axis)?;
        let group = self.groups.iter().find(|group| group.places.contains(place));
        Ok(group.map_or(0, |group| group.number))
    }

    /// Where an axis stands among those of the engine.
    pub(super) fn place_of(&self, axis: u8) -> Result<usize, Rejection> {
        let unknown = RejectReason::UnknownAxis { axis, axes: self.axes.len() as u8 };
        self.axes.iter().position(|own| own.number() == axis).ok_or(unknown.into())
    }

    /// Checks the phase of the group of an axis.
    pub(super) fn require_phase_of(&self, axis: u8, possible: &[Phase]) -> Handled {
        require_phase(self.phase(self.group_of(axis)?).unwrap_or_default(), possible)
    }

    pub(super) fn axis_mut(&mut self, number: u8) -> Result<&mut Axis, Rejection> {
        let (place, axes) = (self.place_of(number)?, self.axes.len() as u8);
        self.axes.get_mut(place).ok_or(RejectReason::UnknownAxis { axis: number, axes }.into())
    }

    /// What is commanded in per mille of the rated torque must not leap: it changes without power only.
    fn set_rated_torque(&mut self, axis: u8, torque: f64, limit_per_mille: Option<u16>) -> Handled {
        self.require_phase_of(axis, &[Phase::Passive, Phase::Disabled])?;
        if self.axis_mut(axis)?.set_rated_torque(torque, limit_per_mille) {
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
