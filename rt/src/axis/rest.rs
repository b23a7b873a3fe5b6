//! Whether the joint of an axis has come to rest, by what its drive reports.

use super::Axis;
use crate::cia402::DriveState;
use crate::control::ControlLaw;
use crate::fault::Fault;

impl Axis {
    /// Begins to come to rest: from now on it counts for how long the joint has stood.
    pub fn begin_stop(&mut self) {
        self.stop_profile();
        self.joint.begin_stop();
    }

    /// Returns `true` if a stop of the joint is over. It has stood for several times what its drive may take to act on its last command, and
    /// in profile position it is at its target: a joint that swings back stands for a moment on its way, and so does one before it
    /// begins to move. A joint that follows set-points but does not obey is not waited for.
    pub fn has_stopped(&self) -> bool {
        if !self.is_profile() && !self.is_obeying() {
            return true;
        }
        let is_on_its_way = self.parameters.law == ControlLaw::ProfilePosition && self.is_enabled();
        self.joint.is_settled() && (!is_on_its_way || self.is_target_reached())
    }

    /// Returns `true` if the joint follows set-points that stand, and has not come to rest on them yet.
    pub fn is_catching_up(&self) -> bool {
        !self.is_profile() && self.is_obeying() && !self.joint.is_settled()
    }

    /// Returns `true` if the drive must bring its joint to rest by its own quick stop (object 6085) before its power is taken. The
    /// set-points stand, and the joint still moves: a loop that is closed over the bus makes it swing, and another set-point
    /// would not help.
    pub fn must_quick_stop(&self) -> bool {
        let is_moving = match self.drive_state() {
            DriveState::OperationEnabled => self.is_obeying(),
            DriveState::QuickStopActive => self.feedback_age() <= self.parameters.missed_feedback_cycles,
            _ => false,
        };
        self.has_pdos()
            && self.parameters.codec.has_quick_stop()
            && !self.is_profile()
            && is_moving
            && !self.joint.is_settled()
    }

    /// Returns `true` if the drive reports and is enabled, and the joint is near its set-point, as far as a following error is allowed.
    fn is_obeying(&self) -> bool {
        self.is_enabled()
            && self.feedback_age() <= self.parameters.missed_feedback_cycles
            && self.following.error().abs() <= self.parameters.following_error_limit
    }

    /// Returns `true` if the joint has been reported to stand for some cycles.
    pub fn is_at_rest(&self) -> bool {
        self.joint.is_settled()
    }

    /// Returns the fault of a joint that moves while its drive is to be enabled.
    pub fn motion_before_power(&self) -> Option<Fault> {
        let (velocity, limit) = self.joint.motion(self.parameters.limits.velocity)?;
        Some(Fault::NotAtRest { velocity, limit })
    }

    /// Returns `true` if the joint is reported to be slow, if only for a moment.
    pub(super) fn is_standing(&self) -> bool {
        self.joint.is_standing(self.parameters.limits.velocity)
    }
}
