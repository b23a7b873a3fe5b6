//! What the cycle begins with: the slot, the frames that have arrived, and what the drives report by them.

use super::group::Group;
use super::state::GroupState;
use super::{CycleInput, Deadline, Engine};
use crate::axis::{Axis, FeedbackSince};
use crate::bit_set::BitSet;
use crate::dispatch::Destination;
use crate::frame::{Frame, Id};
use crate::function_code;
use crate::host::HostInterface;
use crate::port::Received;
use crate::record::{Event, EventKind};

/// Who a received frame is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Receiver {
    /// The engine has taken all of it.
    Engine,
    /// The host is to have it too: it is no process data.
    Host,
}

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// Takes a frame that arrived on a bus.
    pub fn receive(&mut self, bus: usize, received: &Received) -> Receiver {
        let Some(table) = self.dispatch.get(bus) else { return Receiver::Engine };
        match table.destination(&received.frame) {
            Destination::Feedback { axis: place, pdo } => {
                if let Some(axis) = self.axes.get_mut(usize::from(place)) {
                    // A frame that is too short counts as not received: the age of the feedback shows it.
                    let _ = axis.receive(pdo.into(), &received.frame, received.at_ns);
                }
                Receiver::Engine
            }
            Destination::Unused => Receiver::Engine,
            destination => {
                self.receive_message(bus, destination, received);
                Receiver::Host
            }
        }
    }

    /// Takes a frame that is no process data: a rare one.
    #[cold]
    fn receive_message(&mut self, bus: usize, destination: Destination, received: &Received) {
        match destination {
            Destination::Feedback { .. } | Destination::Unused => {}
            Destination::Emergency { axis: place } => self.receive_emergency(place.into(), received),
            Destination::ErrorControl { axis: place } => {
                if let Some(message) = received.frame.payload().first() {
                    self.receive_error_control(place.into(), *message);
                }
            }
            Destination::Foreign if self.is_read_request(bus, &received.frame) => {}
            Destination::Foreign => {
                self.shared.foreign_frames.note(bus, received.frame.id());
                self.receive_foreign_nmt(bus, &received.frame);
            }
            Destination::Service => self.receive_sdo_response(bus, &received.frame),
        }
    }

    fn receive_error_control(&mut self, place: usize, message: u8) {
        let Some(axis) = self.axes.get_mut(place) else { return };
        let (bus, node) = (axis.parameters().bus, axis.parameters().node);
        if self.shared.guards.accepts(bus, node, message) {
            self.axes_of_node(bus, node).for_each(|axis| axis.receive_error_control(message));
        }
    }

    fn receive_emergency(&mut self, place: usize, received: &Received) {
        let [low, high, register, manufacturer @ ..] = received.frame.first_word().to_le_bytes();
        let code = u16::from_le_bytes([low, high]);
        let node = |axis: &Axis| (axis.parameters().bus, axis.parameters().node);
        let Some(sender) = self.axes.get(place).map(node) else { return };
        for (place, axis) in self.axes.iter_mut().enumerate().filter(|(_, axis)| node(axis) == sender) {
            axis.receive_emergency(code);
            let kind = EventKind::Emergency { axis: axis.number(), code, register, manufacturer };
            self.shared.events.push(Event {
                slot: self.shared.present_slot(),
                at_ns: received.at_ns,
                group: group_at(&self.groups, place),
                kind,
            });
        }
    }

    /// The axes of a node.
    fn axes_of_node(&mut self, bus: u8, node: u8) -> impl Iterator<Item = &mut Axis> {
        self.axes_of(bus.into()).filter(move |axis| axis.parameters().node == node)
    }

    /// Returns `true` if a frame asks a node for the value of an object, which changes nothing.
    fn is_read_request(&mut self, bus: usize, frame: &Frame) -> bool {
        if !self.shared.is_canopen(bus) || is_sdo_download(frame) {
            return false;
        }
        self.axes_of(bus)
            .any(|axis| frame.id() == Id::canopen(function_code::SDO_REQUEST, axis.parameters().node))
    }

    /// Takes what another master has told the nodes of a bus.
    fn receive_foreign_nmt(&mut self, bus: usize, frame: &Frame) {
        let (0, &[command, node], true) = (frame.id().value(), frame.payload(), self.shared.is_canopen(bus))
        else {
            return;
        };
        for axis in self.axes_of(bus).filter(|axis| node == 0 || node == axis.parameters().node) {
            axis.receive_foreign_nmt(command);
        }
    }

    /// Takes what has been said by drives that are spoken to outside of the cycle: no more than one report of each.
    #[cold]
    pub(super) fn take_off_cycle_reports(&mut self, host: &mut impl HostInterface<AXES, BUSES>) {
        for _ in 0..AXES {
            let Some((number, report)) = host.off_cycle_report() else { return };
            if let Some(axis) = self.axes.iter_mut().find(|axis| axis.number() == number) {
                axis.receive_off_cycle(&report);
            }
        }
    }

    /// A received frame for the host found no room there.
    pub fn count_dropped(&mut self) {
        self.shared.dropped += 1;
    }

    pub(super) fn axes_of(&mut self, bus: usize) -> impl Iterator<Item = &mut Axis> {
        self.axes.iter_mut().filter(move |axis| usize::from(axis.parameters().bus) == bus)
    }

    /// Begins the cycle of a slot with what has been received.
    pub(super) fn sense(&mut self, input: &CycleInput<'_>) {
        self.shared.now_ns = input.now_ns;
        self.shared.deadline = Deadline::Met;
        let elapsed = self.shared.slots.begin(input.slot);
        if self.shared.slots.missed_now > 0 {
            self.shared.emit(None, EventKind::MissedSlots { count: self.shared.slots.missed_now });
        }
        if let Some(level) = self.shared.slots.changed_level() {
            self.shared.emit(None, EventKind::Timing { level });
        }
        if let Some(heartbeat) = &mut self.shared.heartbeat {
            heartbeat.pass(elapsed);
        }
        self.shared.guards.pass(elapsed);
        if let Some(time) = &mut self.shared.time {
            time.pass(elapsed, input.now_ns);
        }
        let in_cycle = self.shared.buses_in_cycle(input.slot);
        let with_sync =
            if self.shared.requested.sync { self.shared.canopen_buses } else { BitSet::default() };
        self.shared.backlog.pass(input.behind, in_cycle, with_sync);
        let elapsed_s = self.shared.period_s * elapsed as f64;
        let asked_by_sync = core::mem::take(&mut self.shared.asked_by_sync);
        // A drive that was not asked, because the thread was late or the bus behind, has not missed its answer.
        let unasked =
            if self.shared.requested.sync { in_cycle.without(asked_by_sync) } else { BitSet::default() };
        let to_answer_sync = in_cycle.without(unasked);
        self.drop_reports_of_passive_groups();
        for (place, axis) in self.axes.iter_mut().enumerate() {
            let is_asked_by_sync = axis.parameters().feedback_since == FeedbackSince::Sync;
            let to_report = if is_asked_by_sync { to_answer_sync } else { in_cycle };
            if to_report.contains(axis.parameters().bus.into()) && axis.is_due_to_report() {
                let known_state = axis.drive_state();
                if axis.begin_cycle(elapsed_s) {
                    let number = axis.number();
                    if let Some(shown) = self.shared.snapshot.axes.get_mut(usize::from(number)) {
                        (shown.feedback_slot, shown.feedback_ns) = (input.slot, input.now_ns);
                    }
                    let (state, statusword) = (axis.drive_state(), axis.statusword());
                    if state != known_state {
                        let kind = EventKind::DriveState { axis: number, state, statusword };
                        self.shared.emit(group_at(&self.groups, place), kind);
                    }
                }
            } else {
                axis.wait(elapsed_s)
            }
            if !is_asked_by_sync && in_cycle.contains(axis.parameters().bus.into()) {
                axis.expect_feedback(input.now_ns);
            }
            axis.watch();
        }
        self.watch_guarded_nodes();
    }

    /// Lets a slot pass without a reply, for the axes of the nodes that have been asked for one.
    #[inline]
    fn watch_guarded_nodes(&mut self) {
        for guard in &self.shared.guards.nodes {
            if guard.is_asked() {
                let is_its = |axis: &&mut Axis| {
                    (axis.parameters().bus, axis.parameters().node) == (guard.bus, guard.node)
                };
                self.axes.iter_mut().filter(is_its).for_each(Axis::note_unanswered_guarding);
            }
        }
    }

    /// A drive that is being brought up may be reset at any moment: what it reports counts when its group is active.
    fn drop_reports_of_passive_groups(&mut self) {
        for group in self.groups.iter().filter(|group| matches!(group.state, GroupState::Passive)) {
            let axes = self.axes.get_mut(group.places.range()).unwrap_or_default();
            axes.iter_mut().for_each(Axis::drop_report);
        }
    }
}

/// The number of the group of the axis at a place.
fn group_at<const AXES: usize, const BUSES: usize>(
    groups: &[Group<AXES, BUSES>],
    place: usize,
) -> Option<u8> {
    groups.iter().find(|group| group.places.contains(place)).map(|group| group.number)
}

/// Returns `true` if an SDO request writes (CiA 301, 7.2.4.3): client command specifier 0 and 1 (download), 6 (block download).
fn is_sdo_download(frame: &Frame) -> bool {
    frame.payload().first().is_some_and(|byte| matches!(byte >> 5, 0 | 1 | 6))
}
