//! What the cycle begins with: the slot, the frames that have arrived, and what the drives report by them.

use super::shared::Shared;
use super::{CycleInput, Deadline, Engine, has_cycle};
use crate::axis::{Axis, FeedbackSince};
use crate::dispatch::Destination;
use crate::frame::Frame;
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
                let state = received.frame.payload().first().copied();
                if let (Some(axis), Some(state)) = (self.axes.get_mut(usize::from(place)), state) {
                    axis.receive_error_control(state);
                }
            }
            Destination::Foreign => {
                self.shared.foreign_frame.get_or_insert((bus as u8, received.frame.id()));
                self.receive_foreign_nmt(bus, &received.frame);
            }
            Destination::Service => self.receive_sdo_response(bus, &received.frame),
        }
    }

    fn receive_emergency(&mut self, place: usize, received: &Received) {
        let [low, high, register, manufacturer @ ..] = received.frame.first_word().to_le_bytes();
        let code = u16::from_le_bytes([low, high]);
        let group = self.group_at(place);
        let Some(axis) = self.axes.get_mut(place) else { return };
        axis.receive_emergency(code);
        let kind = EventKind::Emergency { axis: axis.number(), code, register, manufacturer };
        self.shared.events.push(Event {
            slot: self.shared.present_slot(),
            at_ns: received.at_ns,
            group,
            kind,
        });
    }

    /// The number of the group of the axis at a place.
    fn group_at(&self, place: usize) -> Option<u8> {
        self.groups.iter().find(|group| group.places.contains(&place)).map(|group| group.number)
    }

    /// Takes what another master has told the nodes of a bus.
    fn receive_foreign_nmt(&mut self, bus: usize, frame: &Frame) {
        let (0, &[command, node]) = (frame.id().value(), frame.payload()) else { return };
        for axis in self.axes_of(bus).filter(|axis| node == 0 || node == axis.parameters().node) {
            axis.receive_foreign_nmt(command);
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
        if let Some(time) = &mut self.shared.time {
            time.pass(elapsed, input.now_ns);
        }
        self.shared.backlog.pass(input.behind, self.shared.buses_in_cycle(input.slot));
        let elapsed_s = self.shared.period_s * elapsed as f64;
        let asked_by_sync = core::mem::take(&mut self.shared.asked_by_sync);
        let Shared { snapshot, buses, requested, .. } = &mut self.shared;
        for axis in &mut self.axes {
            // A drive that was not asked, because the thread was late or the bus behind, has not missed its answer.
            let is_unasked = requested.sync
                && axis.parameters().feedback_since == FeedbackSince::Sync
                && !asked_by_sync.contains(axis.parameters().bus.into());
            let bus = buses.get(usize::from(axis.parameters().bus));
            if bus.is_some_and(|bus| has_cycle(bus, input.slot)) && !is_unasked {
                let has_reported = axis.begin_cycle(elapsed_s);
                let shown = snapshot.axes.get_mut(usize::from(axis.number()));
                if let Some(shown) = shown.filter(|_| has_reported) {
                    (shown.feedback_slot, shown.feedback_ns) = (input.slot, input.now_ns);
                }
                if axis.parameters().feedback_since != FeedbackSince::Sync {
                    axis.expect_feedback(input.now_ns);
                }
            } else {
                axis.wait(elapsed_s)
            }
            axis.watch();
        }
        self.report_drive_states();
    }

    /// Emits an event for each drive whose state has changed since the last record.
    fn report_drive_states(&mut self) {
        for place in 0..self.axes.len() {
            let Some(axis) = self.axes.get(place) else { continue };
            let (number, state, statusword) = (axis.number(), axis.drive_state(), axis.statusword());
            let recorded = self.shared.record.axes.get(usize::from(number));
            if recorded.is_some_and(|recorded| recorded.drive_state != state) {
                let kind = EventKind::DriveState { axis: number, state, statusword };
                self.shared.emit(self.group_at(place), kind);
            }
        }
    }
}
