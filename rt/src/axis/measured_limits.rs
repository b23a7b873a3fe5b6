//! Whether the joint of an enabled drive keeps to its limits, by what the drive reports.
//!
//! The guard checks set-points. Where a drive plans by itself, or makes of a set-point what it likes, only its reports show what the
//! joint does.

use super::Axis;
use super::measured::count;
use crate::fault::Fault;

/// How far a measured speed or torque may exceed its limit: the loops of the drive overshoot.
const OVERSHOOT: f64 = 1.2;
/// How near to the torque to which the drive limits itself (object 6072) a torque is that one.
const AT_DRIVE_LIMIT: f64 = 0.02;
/// Reports in a row beyond a limit after which it counts as broken: one report may be corrupted.
const REPORTS: u32 = 8;
/// The same for a speed and for a torque, as a multiple of those for which a following error may last. A joint that was held up catches up
/// with its set-point, accelerates with more torque than its limit for a moment, and is a following error first when it is blocked. Where
/// the drive plans, there is nothing to catch up with: [`REPORTS`] hold for the speed.
const PATIENCE: u32 = 4;

impl Axis {
    /// Takes what a report says of the joint.
    #[inline]
    pub(super) fn note_measured(&mut self) {
        let (position, limits) = (self.joint.position(), &self.parameters.limits);
        if !self.is_enabled() {
            self.measured.restart(position, limits);
            return;
        }
        if limits.contain(position) {
            (self.measured.outside, self.measured.beyond_position) = ((0.0, 0.0), 0);
        } else {
            self.measured.take_outside(position, limits, self.parameters.following_error_limit);
        }
        let is_beyond_velocity =
            self.velocity().abs() - self.joint.velocity_uncertainty() > OVERSHOOT * limits.velocity;
        let is_beyond_torque = self.torque().is_some_and(|torque| self.is_torque_beyond(torque));
        count(&mut self.measured.beyond_velocity, is_beyond_velocity);
        count(&mut self.measured.beyond_torque, is_beyond_torque);
    }

    fn is_torque_beyond(&self, torque: f64) -> bool {
        let (torque, of_drive) = (torque.abs(), self.torque_limit_of_drive);
        let is_at_limit_of_drive =
            torque >= of_drive * (1.0 - AT_DRIVE_LIMIT) && torque <= of_drive * (1.0 + AT_DRIVE_LIMIT);
        torque > OVERSHOOT * self.parameters.limits.torque && !is_at_limit_of_drive
    }

    /// Checks what the drive reports of its joint, if there is feedback of this cycle.
    #[inline]
    pub fn check_measured(&self) -> Result<(), Fault> {
        let measured = &self.measured;
        let reports = [measured.beyond_position, measured.beyond_velocity, measured.beyond_torque];
        if reports.iter().all(|reports| *reports < REPORTS) || self.feedback_age() > 0 {
            return Ok(());
        }
        let patience = PATIENCE.saturating_mul(self.parameters.following_error_cycles).max(REPORTS);
        let velocity_reports = if self.is_profile() { REPORTS } else { patience };
        let limits = &self.parameters.limits;
        if measured.beyond_position >= REPORTS {
            let margin = self.parameters.following_error_limit;
            let limit = measured.limit_beyond(self.position(), limits, margin).unwrap_or(f64::NAN);
            return Err(Fault::MeasuredPosition { position: self.position(), limit });
        }
        if measured.beyond_velocity >= velocity_reports {
            return Err(Fault::MeasuredVelocity { velocity: self.velocity(), limit: limits.velocity });
        }
        if measured.beyond_torque >= patience {
            let torque = self.torque().unwrap_or(f64::NAN);
            return Err(Fault::MeasuredTorque { torque, limit: limits.torque });
        }
        Ok(())
    }
}
