//! Command frames of several axes: each axis adds its part, and zeros where the parts of the others are (dummy mapping, CiA 301,
//! 7.4.7.1).
//!
//! A part that is missing would be a controlword and a target of zero. So a frame leaves only with the parts of all of its axes. Those
//! are axes of one group on one bus, which are commanded in the same cycles.

use arrayvec::ArrayVec;

use super::parameters::{EngineParameters, SetUpError};
use super::send_batch::{SEND_BATCH, SendBatch};
use crate::axis::{AxisParameters, CommandPdo, FeedbackSince};
use crate::frame::{Frame, FrameFormat};
use crate::pdo::TransmissionType;

/// The frames of a cycle to which parts are added.
#[derive(Debug, Default)]
pub(super) struct SharedFrames {
    /// Where each is in the batch, and how many parts are still missing in it.
    missing: ArrayVec<(usize, u8), SEND_BATCH>,
}

impl SharedFrames {
    /// Adds the part of an axis to the frame with its identifier, which so many axes have in common. Returns whether it found room.
    pub(super) fn add(&mut self, part: &Frame, axes: u8, batch: &mut SendBatch) -> bool {
        for (place, missing) in &mut self.missing {
            if let Some(frame) = batch.get_mut(*place).filter(|frame| frame.id() == part.id()) {
                *frame = frame.with_bits_of(part);
                *missing = missing.saturating_sub(1);
                return true;
            }
        }
        let place = batch.len();
        batch.try_push(*part).is_ok() && self.missing.try_push((place, axes.saturating_sub(1))).is_ok()
    }

    /// Takes the frames out of the batch in which a part is missing.
    #[inline]
    pub(super) fn leave_out_incomplete(&self, batch: &mut SendBatch) {
        // From the last one on, so that the places before it stay what they are.
        for (place, _) in self.missing.iter().rev().filter(|(_, missing)| *missing > 0) {
            batch.pop_at(*place);
        }
    }
}

impl<const AXES: usize, const BUSES: usize> EngineParameters<AXES, BUSES> {
    /// Checks the commands of an axis that it shares with others.
    pub(super) fn validate_shared_commands(
        &self,
        axis: usize,
        own: &AxisParameters,
    ) -> Result<(), SetUpError> {
        for command in own.exchange.commands().iter().filter(|command| command.axes != 1) {
            if !self.can_share(axis, own, command) {
                return Err(SetUpError::SharedCommand { axis, id: command.pdo.id });
            }
        }
        Ok(())
    }

    /// Returns `true` if there are as many axes with this command as it says, all of one group and bus, and none writes the part of another. All
    /// of them get it in every cycle: a drive that answers set-points may have one left out.
    fn can_share(&self, axis: usize, own: &AxisParameters, command: &CommandPdo) -> bool {
        let group_of = |axis: usize| {
            let is_in =
                |group: &crate::GroupParameters<AXES>| group.axes.iter().any(|own| usize::from(*own) == axis);
            self.groups.iter().position(is_in)
        };
        let (mut count, mut bits) = (0_u8, 0_u64);
        for (other_axis, other) in self.axes.iter().enumerate().filter(|(_, other)| other.bus == own.bus) {
            let same = other.exchange.commands().iter().find(|same| same.pdo.id == command.pdo.id);
            let Some(same) = same else { continue };
            let is_alike = same.axes == command.axes
                && same.transmission == TransmissionType::EveryCycle
                && same.pdo.format == FrameFormat::Classic
                && same.pdo.mapping.length() == command.pdo.mapping.length()
                && other.feedback_since == FeedbackSince::Sync
                && group_of(other_axis) == group_of(axis);
            let own_bits = same.pdo.mapping.own_bits();
            if !is_alike || bits & own_bits != 0 {
                return false;
            }
            bits |= own_bits;
            count = count.saturating_add(1);
        }
        count == command.axes
    }
}
