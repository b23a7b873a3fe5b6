//! What leaves in a cycle: SYNC, controlwords and set-points, the heartbeat, TIME, a request of node guarding, service frames.
//!
//! One rule decides, in one place ([`Engine::may_leave`]): after its deadline, or behind a backlog, nothing leaves except what
//! stops the drives, and from time to time one SYNC that shows whether the backlog is one ([`Backlog`](super::backlog::Backlog)).

use super::group::{Commands, Group};
use super::heartbeat::HeartbeatProducer;
use super::parameters::CanopenNetwork;
use super::shared::{Shared, has_cycle};
use super::shared_frames::SharedFrames;
use super::state::{GroupState, PowerRemoval};
use super::{Deadline, Engine, SendBatch};
use crate::axis::{Axis, FeedbackSince};
use crate::bit_set::BitSet;
use crate::cia402::{Goal, controlword};
use crate::frame::Frame;
use crate::host::HostInterface;
use crate::time::Nanoseconds;

/// How long controlword bit 7 is held low before, and high in, a fault reset, and how long the drives have to answer it; longer where the
/// cycle of a bus is, so that its drives see each part.
pub(super) const FAULT_RESET_CYCLES: u32 = 10;

/// What a frame is for. What stops a drive leaves in any case, and does not ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    /// It lets the drives report, and take up their set-points.
    Sync,
    /// It keeps the drives working.
    Operate,
}

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// Returns false after the deadline, and behind a backlog except for one SYNC as a trial.
    fn may_leave(&self, bus: usize, deadline: Deadline, purpose: Purpose) -> bool {
        let held_back = match purpose {
            Purpose::Sync => self.shared.backlog.without_sync(),
            Purpose::Operate => self.shared.backlog.held_back(),
        };
        deadline == Deadline::Met && !held_back.contains(bus)
    }

    /// The buses that were behind in the last cycle: before [`Engine::sync`], whoever drives the engine may look again, and name
    /// those that have caught up since by [`Engine::note_caught_up`].
    pub fn behind(&self) -> BitSet {
        self.shared.backlog.behind()
    }

    /// Takes the buses that have caught up since the last cycle.
    pub fn note_caught_up(&mut self, buses: BitSet) {
        self.shared.backlog.clear(buses);
    }

    /// The SYNC of a bus, if one is to be sent in this slot, now. Answers to an earlier one are late from now on.
    pub fn sync(&mut self, bus: usize, slot: u64, now_ns: Nanoseconds) -> Option<Frame> {
        let parameters = self.shared.buses.get(bus)?;
        let CanopenNetwork { sync_id } = parameters.canopen?;
        let is_due = self.shared.requested.sync && has_cycle(parameters, slot);
        if !is_due || !self.may_leave(bus, Deadline::Met, Purpose::Sync) {
            return None;
        }
        self.shared.asked_by_sync.insert(bus);
        let is_skipped = self.shared.skip_sync.take(bus);
        if !is_skipped {
            self.shared.backlog.note_leaving(bus);
        }
        for place in self.shared.places_on(bus).iter() {
            let Some(axis) = self.axes.get_mut(place) else { break };
            match axis.parameters().feedback_since {
                FeedbackSince::Sync if is_skipped => axis.skip_request(now_ns),
                FeedbackSince::Sync => axis.request_feedback(now_ns),
                FeedbackSince::SetPoint | FeedbackSince::CommandPhase => {}
            }
        }
        (!is_skipped).then(|| Frame::of(sync_id, []))
    }

    /// These interfaces had no room for all that they were handed: set-points may be missing.
    pub fn not_taken(&mut self, buses: BitSet) {
        self.shared.backlog.note_not_taken(buses);
    }

    /// The frames of a bus in this cycle, in the order in which they are to leave. Ask for it after [`Engine::compute`], with
    /// whether the deadline was met by the clock at that moment.
    pub fn encode(
        &mut self,
        bus: usize,
        deadline: Deadline,
        host: &mut impl HostInterface<AXES, BUSES>,
        batch: &mut SendBatch,
    ) {
        self.shared.deadline = deadline;
        if self.may_leave(bus, deadline, Purpose::Operate) {
            for group in &mut self.groups {
                let Some(axes) = self.axes.get_mut(group.places.range()) else { continue };
                group.encode_set_points(bus, axes, &mut self.shared, batch);
            }
            self.encode_heartbeat_and_time(bus, batch);
            if let Some(request) = self.shared.guards.take_request(bus) {
                self.push(request, batch);
            }
        }
        self.encode_services(bus, deadline, host, batch);
        if !batch.is_empty() {
            self.shared.backlog.note_leaving(bus);
        }
    }

    fn push(&mut self, frame: Frame, batch: &mut SendBatch) {
        self.shared.dropped += u64::from(batch.try_push(frame).is_err());
    }

    fn encode_heartbeat_and_time(&mut self, bus: usize, batch: &mut SendBatch) {
        if !self.shared.is_canopen(bus) {
            return;
        }
        let heartbeat = self.shared.heartbeat.as_mut().and_then(|heartbeat| heartbeat.take(bus));
        if let Some(frame) = heartbeat {
            self.push(frame, batch);
        }
        if let Some(frame) = self.shared.time.as_ref().and_then(|time| time.message()) {
            self.push(frame, batch);
        }
    }

    /// Service frames as far as the budget goes. Those that stop a drive come first, and leave in any case.
    fn encode_services(
        &mut self,
        bus: usize,
        deadline: Deadline,
        host: &mut impl HostInterface<AXES, BUSES>,
        batch: &mut SendBatch,
    ) {
        let Some(parameters) = self.shared.buses.get(bus) else { return };
        let is_passive = self.groups.iter().all(|group| matches!(group.state, GroupState::Passive));
        let budget =
            if is_passive { parameters.service_frames_passive } else { parameters.service_frames_active };
        let may_serve = self.may_leave(bus, deadline, Purpose::Operate);
        for number in 0..budget.max(1).min(batch.remaining_capacity()) {
            let stopping = self.fallback_frame(bus);
            let frame = match stopping {
                None if may_serve && number < budget => host.service_frame(bus),
                stopping => stopping,
            };
            match frame {
                Some(frame) => self.push(frame, batch),
                None => break,
            }
        }
    }
}

impl<const AXES: usize, const BUSES: usize> Group<AXES, BUSES> {
    /// Controlwords and set-points, where the bus has a cycle in this slot.
    #[inline]
    fn encode_set_points(
        &mut self,
        bus: usize,
        axes: &mut [Axis],
        shared: &mut Shared<AXES, BUSES>,
        batch: &mut SendBatch,
    ) {
        if self.commands != Commands::Made || !self.buses.contains(bus) {
            return;
        }
        let slot = shared.present_slot();
        if !shared.buses.get(bus).is_some_and(|bus| has_cycle(bus, slot)) {
            return;
        }
        self.unsent.clear(bus);
        let mut shared_frames = SharedFrames::default();
        let goal = self.state.goal();
        for place in shared.places_on(bus).iter() {
            let own_place = place.checked_sub(self.places.first);
            let Some(axis) = own_place.and_then(|place| axes.get_mut(place)) else { continue };
            let is_faulted = axis.drive_state().is_faulted();
            let reset_word = if is_faulted { self.fault_reset_word() } else { None };
            axis.command(self.goal_of(axis, goal, shared), reset_word);
            if self.has_other_modes {
                axis.command_other_modes();
            }
            if let Some(frame) = axis.field_frame() {
                shared.dropped += u64::from(batch.try_push(*frame).is_err());
            }
            for command in axis.due_commands() {
                let is_taken = if command.axes == 1 {
                    batch.try_push(axis.frame_of(command)).is_ok()
                } else {
                    shared_frames.add(&axis.frame_of(command), command.axes, batch)
                };
                shared.dropped += u64::from(!is_taken);
            }
        }
        shared_frames.leave_out_incomplete(batch);
    }

    /// Returns the goal of a drive in this cycle, in which its group has this goal.
    ///
    /// A drive that falls out of operation enabled is not enabled again by what the others are still to do. None is enabled
    /// before its joint is at rest with its target there, nor before it watches the controller by the heartbeat.
    #[inline]
    fn goal_of(&self, axis: &Axis, goal: Goal, shared: &Shared<AXES, BUSES>) -> Goal {
        let is_shutting_down = matches!(self.state, GroupState::Disabling(PowerRemoval::Shutdown));
        if is_shutting_down && axis.must_quick_stop() {
            return Goal::QuickStop;
        }
        if goal != Goal::Enabled {
            return if axis.is_not_released() { Goal::NoVoltage } else { goal };
        }
        let is_stopping = matches!(self.state, GroupState::Stopping);
        // A drive that PDOs do not reach is told the same by SDO.
        if axis.is_pdo_unreachable() || is_stopping && axis.stops_by_itself() {
            return Goal::QuickStop;
        }
        let may_be_enabled = match self.state {
            GroupState::Enabling => axis.is_power_granted() && self.may_switch_on(axis, shared),
            _ => axis.is_enabled(),
        };
        if may_be_enabled { Goal::Enabled } else { Goal::Disabled }
    }

    /// Returns `true` if a drive may be led to operation enabled, or is there already. One that has been told to switch on has watched the
    /// heartbeat before, or has replied to node guarding: what another group on its bus begins does not concern it.
    fn may_switch_on(&self, axis: &Axis, shared: &Shared<AXES, BUSES>) -> bool {
        let watches_controller = || {
            let (bus, node) = (axis.parameters().bus, axis.parameters().node);
            let allows = |heartbeat: &HeartbeatProducer<BUSES>| heartbeat.allows_enabling(bus.into());
            shared.heartbeat.as_ref().is_none_or(allows) && shared.guards.allows_enabling(bus, node)
        };
        axis.is_enabled()
            || axis.is_on_joint(shared.period_s) && (axis.may_be_switching_on() || watches_controller())
    }

    /// The controlword of a fault reset, for the drives that are at fault. Bit 7 is low first, so that what follows is an edge
    /// whatever was sent before; in the end the drives have time to answer.
    fn fault_reset_word(&self) -> Option<u16> {
        match self.fault_reset_cycles.div_ceil(self.fault_reset_part.max(1)) {
            0 | 1 => None,
            2 => Some(controlword::FAULT_RESET),
            _ => Some(controlword::DISABLE_VOLTAGE),
        }
    }
}
