//! What comes from the buses and what goes to them: SYNC, feedback, controlwords and set-points, the heartbeat, services.

use super::{
    BusSet, Engine, FAULT_RESET_CYCLES, Heartbeat, SendBatch, Transmission, has_cycle, has_cycle_of,
};
use crate::axis::FeedbackSince;
use crate::cia402::{Goal, controlword};
use crate::dispatch::Destination;
use crate::door::Door;
use crate::frame::{Frame, Id};
use crate::port::Received;
use crate::record::EventKind;
use crate::stop::Phase;
use crate::time::Nanoseconds;

/// Cycles of the slowest bus for which the heartbeat waits after the controller was away for more than its period.
/// A drive that has stopped for want of it may go on with its old target once it is back: until then what the drives
/// report must have been heard, and their targets and controlwords be new ones.
const HEARTBEAT_HELD_BUS_CYCLES: u32 = 4;
/// One alone might be lost on the wire, and the drive that has not heard it runs unwatched for a whole period.
const HEARTBEATS_BEFORE_ENABLING: u32 = 2;
const NMT_OPERATIONAL: u8 = 5;
/// Cycles from one look for late drives to the next: their silence must have been heard.
const LOOK_AGAIN_CYCLES: u32 = 64;

impl Engine {
    /// The SYNC of a bus, if one is to be sent in this slot, now. Answers to an earlier one are late from now on.
    pub fn sync(&mut self, bus: usize, slot: u64, now_ns: Nanoseconds) -> Option<Frame> {
        let parameters = self.buses.get(bus)?;
        if !self.is_sync_on || !has_cycle(parameters, slot) {
            return None;
        }
        let is_left_out = self.left_out.take(bus);
        for axis in self.axes.iter_mut().filter(|axis| usize::from(axis.parameters().bus) == bus) {
            match axis.parameters().feedback_since {
                FeedbackSince::Sync if is_left_out => axis.leave_out(now_ns),
                FeedbackSince::Sync => axis.ask(now_ns),
                FeedbackSince::SetPoint | FeedbackSince::CommandPhase => {}
            }
        }
        (!is_left_out).then(|| Frame::of(parameters.sync_id, []))
    }

    /// Leaves out what asks a drive that has not answered every time in its own cycle, a SYNC of its bus or a set-point: before
    /// the drives are led up, that disturbs nothing.
    pub(super) fn look_for_late_drives(&mut self) {
        if !self.phase_cycles.is_multiple_of(LOOK_AGAIN_CYCLES) {
            return;
        }
        for axis in self.axes.iter_mut().filter(|axis| axis.is_doubtful()) {
            match axis.parameters().feedback_since {
                FeedbackSince::SetPoint => axis.leave_out_set_point(),
                _ => self.left_out.insert(axis.parameters().bus.into()),
            }
        }
    }

    /// Takes a frame that arrived on a bus.
    pub fn receive(&mut self, bus: usize, received: &Received, door: &mut impl Door) {
        let Some(table) = self.dispatch.get(bus) else { return };
        match table.destination(&received.frame) {
            Destination::Feedback { axis, pdo } => {
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    // One that is too short counts as not received, which the feedback's age then shows.
                    let _ = axis.receive(pdo.into(), &received.frame, received.at_ns);
                }
            }
            Destination::Emergency { axis } => {
                let [low, high, register, manufacturer @ ..] = received.frame.first_word().to_le_bytes();
                let code = u16::from_le_bytes([low, high]);
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.receive_emergency(code);
                }
                self.happened(
                    received.at_ns,
                    EventKind::Emergency { axis, code, register, manufacturer },
                    door,
                );
                self.hand_over(bus, received, door);
            }
            Destination::ErrorControl { axis } => {
                let state = received.frame.payload().first().copied();
                if let (Some(axis), Some(state)) = (self.axes.get_mut(usize::from(axis)), state) {
                    axis.receive_error_control(state);
                }
                self.hand_over(bus, received, door);
            }
            Destination::Foreign => {
                self.foreign_id.get_or_insert((bus as u8, received.frame.id().value()));
                self.hear_other_master(bus, &received.frame);
                self.hand_over(bus, received, door);
            }
            Destination::Unused => {}
            Destination::Service => {
                self.hear_answer(bus, &received.frame);
                self.hand_over(bus, received, door);
            }
        }
    }

    fn hand_over(&mut self, bus: usize, received: &Received, door: &mut impl Door) {
        if !door.received(bus, received) {
            self.dropped += 1;
        }
    }

    /// Names the buses on which own frames still wait for the wire, before [`Engine::compute`]: they get no set-points.
    /// The axes on the others go on.
    pub fn hold_back(&mut self, buses: BusSet) {
        self.held_back = buses;
    }

    /// These interfaces had no room for all that they were handed: set-points may be missing.
    pub fn not_taken(&mut self, buses: BusSet) {
        self.not_taken = buses;
    }

    pub(super) fn write_commands(&mut self, slot: u64) {
        let resetting = self.fault_reset;
        self.fault_reset = resetting.saturating_sub(1);
        // Low first, so that what follows is an edge whatever was sent before; in the end the drives answer.
        let reset_word = match resetting.div_ceil(FAULT_RESET_CYCLES) {
            0 | 1 => None,
            2 => Some(controlword::FAULT_RESET),
            _ => Some(controlword::DISABLE_VOLTAGE),
        };
        // With these commands, or before them.
        let has_beaten = self.heartbeats_awaited <= u32::from(self.heartbeat_due == 0);
        for axis in &mut self.axes {
            let is_held_back = self.held_back.contains(axis.parameters().bus.into());
            if has_cycle_of(&self.buses, axis, slot) && !is_held_back {
                // A drive that falls out of operation enabled is not led back by what the others are still to do; and none
                // is led up before its joint is at rest and its target there, nor before it watches the controller.
                let is_led_up = match self.phase {
                    Phase::Enabling => {
                        has_beaten
                            && axis.is_ready()
                            && (axis.is_enabled() || axis.is_on_joint(self.period_s))
                    }
                    _ => axis.is_enabled(),
                };
                let goal = match self.goal {
                    Goal::Enabled if self.phase == Phase::Stopping && axis.stops_by_itself() => {
                        Goal::QuickStop
                    }
                    // The same as by SDO, should it hear this all the same.
                    Goal::Enabled if axis.is_deaf() => Goal::QuickStop,
                    Goal::Enabled if !is_led_up => Goal::Disabled,
                    Goal::Disabled if self.phase == Phase::Disabling && axis.must_quick_stop() => {
                        Goal::QuickStop
                    }
                    goal => goal,
                };
                axis.command(goal, reset_word.filter(|_| axis.drive_state().is_faulted()));
            }
        }
    }

    /// The set-points of a bus, if it has a cycle in this slot.
    pub fn set_points(&self, bus: usize, slot: u64, batch: &mut SendBatch) {
        let has_cycle = self.buses.get(bus).is_some_and(|parameters| has_cycle(parameters, slot));
        if !has_cycle || self.held_back.contains(bus) {
            return;
        }
        for axis in self.axes.iter().filter(|axis| usize::from(axis.parameters().bus) == bus) {
            for frame in axis.frames() {
                let _ = batch.try_push(frame);
            }
        }
    }

    /// The heartbeat and TIME when they are due, and service frames as far as the budget goes: what follows the set-points.
    pub fn services(&mut self, bus: usize, door: &mut impl Door, batch: &mut SendBatch) {
        if let Some(heartbeat) = self.heartbeat.filter(|_| self.heartbeat_due == 0) {
            let _ = batch.try_push(Frame::of(Id::canopen(0x700, heartbeat.node), [NMT_OPERATIONAL]));
        }
        // A bus that is behind is spared: the next one tells the time as well.
        let time = self.time.filter(|_| !self.held_back.contains(bus)).and_then(|time| time.message());
        if let Some(time) = time {
            let _ = batch.try_push(time);
        }
        let Some(parameters) = self.buses.get(bus) else { return };
        let budget = match self.phase {
            Phase::Passive => parameters.service_frames_passive,
            _ => parameters.service_frames_active,
        };
        for _ in 0..budget.min(batch.remaining_capacity()) {
            match self.last_word(bus).or_else(|| door.service_frame(bus)) {
                Some(frame) => batch.push(frame),
                None => break,
            }
        }
    }

    /// After an absence that a drive may have noticed, the heartbeat waits.
    pub(super) fn hold_heartbeat_back(&mut self, elapsed: u64, transmission: Transmission) {
        let was_away = self.heartbeat.is_some_and(|heartbeat| elapsed > heartbeat.cycles.into());
        let held = if was_away {
            self.heartbeat_held_cycles()
        } else {
            // Only the next slot shows how long the absence was.
            u32::from(transmission == Transmission::TooLate)
        };
        self.heartbeat_due = self.heartbeat_due.max(held);
    }

    /// A drive watches the controller from the first heartbeat on that it hears after it has been set up: that comes before
    /// any is led up, and not only after a whole period.
    pub(super) fn hasten_heartbeats(&mut self) {
        self.heartbeats_awaited = if self.heartbeat.is_some() { HEARTBEATS_BEFORE_ENABLING } else { 0 };
        self.heartbeat_due = self.heartbeat_due.min(self.heartbeat_held_cycles());
    }

    /// A heartbeat has left. While more are awaited, the next one comes as soon as after an absence.
    pub(super) fn has_beaten(&mut self, heartbeat: Heartbeat) {
        self.heartbeats_awaited = self.heartbeats_awaited.saturating_sub(1);
        self.heartbeat_due = heartbeat.cycles.saturating_sub(1);
        if self.heartbeats_awaited > 0 {
            self.heartbeat_due = self.heartbeat_due.min(self.heartbeat_held_cycles());
        }
    }

    fn heartbeat_held_cycles(&self) -> u32 {
        let slowest = self.buses.iter().map(|bus| bus.divider).max().unwrap_or(1);
        HEARTBEAT_HELD_BUS_CYCLES.saturating_mul(slowest)
    }
}
