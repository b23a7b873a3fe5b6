//! Whether the joint of an enabled drive keeps to its limits, by what the drive reports.
//!
//! The guard checks set-points. Where a drive plans by itself, or makes of a set-point what it likes, only its reports show what the
//! joint does.

use super::Axis;
use crate::fault::Fault;
use crate::guard::AxisLimits;

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

/// What an axis has been reported to do since its drive was enabled.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Measured {
    /// How far below and above the position limits the joint may be: it was enabled there, and has not come nearer to them yet.
    outside: (f64, f64),
    /// Reports in a row beyond a limit.
    beyond_position: u32,
    beyond_velocity: u32,
    beyond_torque: u32,
}

fn count(reports: &mut u32, is_beyond: bool) {
    *reports = if is_beyond { reports.saturating_add(1) } else { 0 };
}

impl Measured {
    /// The drive is not enabled: its joint may be moved by hand.
    fn restart(&mut self, position: f64, limits: &AxisLimits) {
        *self = Self { outside: outside(position, limits), ..Self::default() };
    }

    /// Takes a position outside of the limits, with the following error that is allowed there.
    fn take_outside(&mut self, position: f64, limits: &AxisLimits, margin: f64) {
        let is_beyond = self.limit_beyond(position, limits, margin).is_some();
        let (below, above) = outside(position, limits);
        self.outside = (self.outside.0.min(below), self.outside.1.min(above));
        count(&mut self.beyond_position, is_beyond);
    }

    /// The position limit beyond which the joint is by more than a following error may be.
    fn limit_beyond(&self, position: f64, limits: &AxisLimits, margin: f64) -> Option<f64> {
        let (below, above) = outside(position, limits);
        let (allowed_below, allowed_above) = self.outside;
        if below > allowed_below + margin {
            Some(limits.position_min)
        } else if above > allowed_above + margin {
            Some(limits.position_max)
        } else {
            None
        }
    }
}

/// How far a position is below the lowest one and above the highest one.
fn outside(position: f64, limits: &AxisLimits) -> (f64, f64) {
    ((limits.position_min - position).max(0.0), (position - limits.position_max).max(0.0))
}

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
