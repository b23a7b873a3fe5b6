//! The change of an axis' mode of operation at run time, without a bump.
//!
//! Object 6060 is sent, and the drive shows in object 6061 when it has taken the new mode. From one to the other it may be in
//! either mode. So the targets of both keep the joint where it is:
//!
//! | mode | target until the drive shows the new mode | from then on |
//! | --- | --- | --- |
//! | CSP | the set-point as it is held | the set-point |
//! | CSV | to it: 0; from it: what its position loop makes | what its position loop makes |
//! | CST | to it: what its loop makes, with so much fed forward that it begins at the torque that the drive has reported; from it: what its loop makes | what its loop makes, with the same fed forward until a source commands a torque |
//!
//! The target of a mode that an axis may be changed to is always one at rest, whatever mode the axis is in.

use super::mode::Mode;
use super::torque_loop::TorqueLoop;
use super::{Axis, AxisParameters};
use crate::cia402::OperationMode;
use crate::control::{ControlLaw, TorqueDemand};
use crate::pdo::CommandSlot;

impl Axis {
    /// The law for a mode: the present one, or one that the axis may be changed to.
    pub fn law_for(&self, mode: OperationMode) -> Option<&ControlLaw> {
        let laws = core::iter::once(&self.parameters.law).chain(&self.parameters.mode_changes.laws);
        laws.into_iter().find(|law| law.operation_mode() == mode)
    }

    /// Closes the loops of each mode as another axis does. The mode stays.
    #[cfg(feature = "checkpoint")]
    pub(super) fn take_laws_of(&mut self, other: &Self) {
        let take = |law: &mut ControlLaw| *law = *other.law_for(law.operation_mode()).unwrap_or(law);
        take(&mut self.parameters.law);
        self.parameters.mode_changes.laws.iter_mut().for_each(take);
        self.parameters.mode_changes.timeout_cycles = other.parameters.mode_changes.timeout_cycles;
        if let Mode::Changing { to, .. } = &mut self.mode {
            take(to);
        }
    }

    /// Returns `true` if the process data of the drive carry a number to it.
    pub fn sends(&self, slot: CommandSlot) -> bool {
        self.parameters.exchange.sends(slot)
    }

    /// Object 6060 as it is sent.
    pub fn mode_set(&self) -> i8 {
        self.command.command(CommandSlot::OperationMode) as i8
    }

    /// Returns `true` if the drive is told another mode and has not shown it yet.
    pub fn is_changing_mode(&self) -> bool {
        self.mode != Mode::Settled
    }

    /// Returns `true` if the drive shows the mode that it is told.
    pub fn shows_commanded_mode(&self) -> bool {
        self.mode() == Some(self.mode_set())
    }

    /// Tells the drive another mode, from the next command on.
    pub fn begin_mode_change(&mut self, to: ControlLaw) {
        let of_loop = to.torque(&self.loop_input(), &TorqueDemand::default());
        let holding = self.torque().unwrap_or(0.0) - of_loop;
        self.mode = Mode::Changing { to, holding };
        self.command.set(CommandSlot::OperationMode, to.operation_mode() as i32);
    }

    /// Puts the law of a mode in force, if the axis has one.
    fn use_law_of(&mut self, mode: OperationMode) {
        let laws = &mut self.parameters.mode_changes.laws;
        if let Some(place) = laws.iter_mut().find(|law| law.operation_mode() == mode) {
            core::mem::swap(place, &mut self.parameters.law);
        }
    }

    /// Puts the law in force with which the axis has begun: the drive is about to be brought up in its mode.
    pub(super) fn return_to_first_mode(&mut self) {
        self.use_law_of(self.first_mode);
    }

    /// The drive shows the new mode: its law is in force.
    pub fn end_mode_change(&mut self) {
        let Mode::Changing { to, holding } = core::mem::take(&mut self.mode) else { return };
        let was_torque = matches!(self.parameters.law, ControlLaw::Torque { .. });
        let is_torque = matches!(to, ControlLaw::Torque { .. });
        self.use_law_of(to.operation_mode());
        // The offsets are those of the new mode from now on.
        self.command.set(CommandSlot::VelocityOffset, 0);
        self.command.set(CommandSlot::TorqueOffset, 0);
        if is_torque {
            self.torque_loop.begin_holding(holding);
        } else if was_torque {
            self.torque_loop = TorqueLoop::default();
            if self.parameters.feed_forward.has_torque() {
                self.torque_loop.begin_holding(self.torque_set);
            }
        }
    }

    /// The drive is told its former mode again, whose law has been in force all the time.
    pub fn cancel_mode_change(&mut self) {
        self.mode = Mode::Settled;
        self.command.set(CommandSlot::OperationMode, self.parameters.law.operation_mode() as i32);
    }

    /// Writes the targets of the modes that the axis is not in, beside the command of its own law. Comes after [`Axis::command`].
    #[inline(never)]
    pub fn command_other_modes(&mut self) {
        let is_enabled = self.is_enabled();
        let Self { parameters, command, .. } = self;
        // Of a drive that is not enabled it follows the joint within the limits, as in CSP.
        let position = self.set_points.sent_now().position;
        let position = parameters.scale.position_command(position, &parameters.limits);
        for law in &parameters.mode_changes.laws {
            command.set(law.target_slot(), law.idle(position));
        }
        if let (Mode::Changing { to, holding }, true) = (self.mode, is_enabled)
            && to.target_slot() == CommandSlot::TargetTorque
        {
            let torque = self.torque_while_changing(&to, holding);
            self.command.set(CommandSlot::TargetTorque, torque);
        }
    }

    /// Object 6071 for a drive that may be in CST already, and adds the torque offset of its former mode then.
    fn torque_while_changing(&self, to: &ControlLaw, holding: f64) -> i32 {
        let AxisParameters { scale, limits, .. } = &self.parameters;
        let torque = to.torque(&self.loop_input(), &TorqueDemand::Law { torque: holding });
        let offset = self.command.command(CommandSlot::TorqueOffset);
        scale.torque_command(torque.clamp(-limits.torque, limits.torque), limits).saturating_sub(offset)
    }
}
