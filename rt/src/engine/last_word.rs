//! Stopping drives that process data do not reach: their controlword by SDO, from the real-time thread, in place of the
//! service frames of others.

use super::Engine;
use crate::axis::Axis;
use crate::cia402::controlword;
use crate::frame::Frame;
use crate::stop::Phase;
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// How long an SDO server may take: a drive answers within a millisecond, one that has just been reset is there within
/// another.
const ANSWER_NS: Nanoseconds = NANOSECONDS_PER_SECOND / 100;
/// How long drives that hear process data take to obey the controlwords of disabling, and to say so: a YZ-AIM is told
/// again after 20 ms.
const OBEYING_NS: Nanoseconds = NANOSECONDS_PER_SECOND / 20;

impl Engine {
    /// Decides which drives are to be stopped by SDO.
    pub(super) fn command_by_service(&mut self) {
        let has_power = !matches!(self.phase, Phase::Passive | Phase::Disabled);
        let is_overdue = Nanoseconds::from(self.phase_cycles).saturating_mul(self.period_ns) > OBEYING_NS;
        for axis in &mut self.axes {
            if has_power {
                axis.note_pdo_reachability();
            }
            let is_silent = axis.feedback_age() > axis.parameters().missed_feedback_cycles;
            let word = match self.phase {
                _ if !has_power => None,
                Phase::Disabling if axis.is_pdo_unreachable() => Some(controlword::DISABLE_VOLTAGE),
                // Nobody knows whether it hears.
                Phase::Disabling if is_silent && is_overdue && axis.drive_state().has_torque() => {
                    Some(controlword::DISABLE_VOLTAGE)
                }
                _ if axis.is_pdo_unreachable() => Some(axis.sdo_stop_word()),
                _ => None,
            };
            axis.command_by_service(word);
        }
    }

    /// The frame that is due for a drive on a bus.
    pub(super) fn last_word(&mut self, bus: usize) -> Option<Frame> {
        // Every other drive has its turn before one is told again: two frames each, one in a slot.
        let turns = 2 * self.axes.len() as u32;
        let repeat_slots = u32::try_from(ANSWER_NS.div_ceil(self.period_ns)).unwrap_or(u32::MAX).max(turns);
        self.axes_of(bus).find_map(|axis| axis.service_frame(repeat_slots))
    }

    /// Takes what another master has told the nodes of a bus.
    pub(super) fn hear_other_master(&mut self, bus: usize, frame: &Frame) {
        let (0, &[command, node]) = (frame.id().value(), frame.payload()) else { return };
        for axis in self.axes_of(bus).filter(|axis| node == 0 || node == axis.parameters().node) {
            axis.receive_foreign_nmt(command);
        }
    }

    /// Takes a frame that may be a drive's answer.
    pub(super) fn hear_answer(&mut self, bus: usize, frame: &Frame) {
        self.axes_of(bus).for_each(|axis| axis.receive_service(frame));
    }

    fn axes_of(&mut self, bus: usize) -> impl Iterator<Item = &mut Axis> {
        self.axes.iter_mut().filter(move |axis| usize::from(axis.parameters().bus) == bus)
    }
}
