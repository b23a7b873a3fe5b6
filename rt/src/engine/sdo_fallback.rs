//! Stopping drives that PDOs do not reach: their controlword (object 6040) by SDO, or without SDO by the frame that carries it, or that
//! means the same to a drive of bit fields, from the real-time thread, before the service frames of the host. PDOs do not reach a node
//! that another master has stopped or reset, and none while the thread is always late or the bus always behind: the way to stop a drive
//! and to switch it off does not need a punctual set-point.

use super::Engine;
use super::group::{Group, GroupContext};
use super::shared::Shared;
use super::state::GroupState;
use crate::axis::Axis;
use crate::cia402::controlword;
use crate::frame::Frame;
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// How long an SDO server may take: a drive answers within a millisecond, one that has just been reset is there within
/// another.
const ANSWER_NS: Nanoseconds = NANOSECONDS_PER_SECOND / 100;
/// How long drives that receive PDOs take to obey the controlwords of disabling, and to show it: those whose controlwords are
/// spaced are told again after 20 ms.
const OBEYING_NS: Nanoseconds = NANOSECONDS_PER_SECOND / 20;

/// How far along a group is in switching its drives off or in stopping.
#[derive(Clone, Copy)]
struct Need {
    is_disabling: bool,
    is_stopping: bool,
    is_overdue: bool,
}

impl<const AXES: usize, const BUSES: usize> Shared<AXES, BUSES> {
    #[inline]
    fn need_of(&self, group: &Group<AXES, BUSES>) -> Need {
        Need {
            is_disabling: matches!(group.state, GroupState::Disabled | GroupState::Disabling(_)),
            is_stopping: matches!(group.state, GroupState::Stopping),
            is_overdue: Nanoseconds::from(group.state_cycles).saturating_mul(self.period_ns) > OBEYING_NS,
        }
    }

    /// Returns the controlword that a drive which may have power gets by SDO.
    #[inline]
    fn word_by_sdo(&self, need: Need, axis: &Axis) -> Option<u16> {
        if need.is_disabling {
            self.must_be_switched_off(axis, need.is_overdue).then_some(controlword::DISABLE_VOLTAGE)
        } else {
            self.must_stop(axis, need.is_stopping).then(|| axis.sdo_stop_word())
        }
    }

    fn must_be_switched_off(&self, axis: &Axis, is_overdue: bool) -> bool {
        let is_always_late = self.slots.late_cycles > self.not_transmitted_cycles;
        let is_cut_off = is_always_late || self.is_on_stuck_bus(axis);
        // Whether such a drive receives its PDOs is not known. A drive outside of the cycle is asked again by its own requests.
        let is_silent =
            !axis.is_off_cycle() && axis.feedback_age() > axis.parameters().missed_feedback_cycles;
        axis.is_pdo_unreachable() || axis.may_have_torque() && (is_cut_off || is_silent && is_overdue)
    }

    #[inline]
    fn must_stop(&self, axis: &Axis, is_stopping: bool) -> bool {
        // A drive without SDO has no controlword that stops it and leaves it its power.
        let has_sdo = || axis.has_pdos() && self.is_canopen(axis.parameters().bus.into());
        axis.is_pdo_unreachable()
            || is_stopping && self.is_on_stuck_bus(axis) && axis.may_have_torque() && has_sdo()
    }

    fn is_on_stuck_bus(&self, axis: &Axis) -> bool {
        self.backlog.behind_cycles(axis.parameters().bus.into()) > self.not_transmitted_cycles
    }

    /// Lets a drive have this controlword by SDO, and its bus the time for it.
    #[inline]
    fn command_by_service(&mut self, axis: &mut Axis, word: Option<u16>) {
        axis.command_by_service(word);
        if word.is_some() {
            self.stopped_by_sdo.insert(axis.parameters().bus.into());
        }
    }
}

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// Decides which drives get their controlword by SDO.
    #[inline]
    pub(super) fn update_sdo_fallback(&mut self) {
        if !self.group.state.has_power() {
            self.switch_off_unreleased();
            return;
        }
        let need = self.shared.need_of(self.group);
        for axis in self.axes.iter_mut() {
            axis.note_pdo_reachability();
            let word = self.shared.word_by_sdo(need, axis);
            self.shared.command_by_service(axis, word);
        }
    }

    /// Keeps switching off the drives that a disabled group has not waited for: they may be reached again, and not by their PDOs.
    #[cold]
    fn switch_off_unreleased(&mut self) {
        let need = self.shared.need_of(self.group);
        let is_disabled = matches!(self.group.state, GroupState::Disabled);
        for axis in self.axes.iter_mut() {
            let mut word = None;
            if is_disabled && !axis.is_power_off() {
                axis.note_pdo_reachability();
                word = self.shared.word_by_sdo(need, axis);
            }
            self.shared.command_by_service(axis, word);
        }
    }
}

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// The frame that is due for a drive on a bus, whatever else may leave there.
    pub(super) fn fallback_frame(&mut self, bus: usize) -> Option<Frame> {
        if !self.shared.stopped_by_sdo.contains(bus) {
            return None;
        }
        // Every other drive has its turn before one is told again: two frames each, one in a slot.
        let turns = 2 * self.axes.len() as u32;
        let repeat_slots =
            u32::try_from(ANSWER_NS.div_ceil(self.shared.period_ns)).unwrap_or(u32::MAX).max(turns);
        let is_canopen = self.shared.is_canopen(bus);
        for place in self.shared.places_on(bus).iter() {
            let has_sdo = is_canopen && self.axes.get(place).is_some_and(Axis::has_pdos);
            // The axes of a node have one SDO server, which answers one of them before it takes a request for the next.
            if has_sdo && self.is_node_asked(place, repeat_slots / 2) {
                continue;
            }
            let Some(axis) = self.axes.get_mut(place) else { continue };
            let frame =
                if has_sdo { axis.service_frame(repeat_slots) } else { axis.stop_frame(repeat_slots) };
            if frame.is_some() {
                return frame;
            }
        }
        None
    }

    /// Returns `true` if another axis of the node at this place has been asked and may still be about to answer.
    fn is_node_asked(&self, place: usize, left_slots: u32) -> bool {
        let node = |axis: &Axis| (axis.parameters().bus, axis.parameters().node);
        let own = self.axes.get(place).map(node);
        let mut others = self.axes.iter().enumerate().filter(|(other, _)| *other != place);
        others.any(|(_, other)| Some(node(other)) == own && other.is_asked_by_service(left_slots))
    }

    /// Takes a frame that may be a drive's answer.
    pub(super) fn receive_sdo_response(&mut self, bus: usize, frame: &Frame) {
        self.axes_of(bus).for_each(|axis| axis.receive_service(frame));
    }
}
