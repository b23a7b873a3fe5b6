//! What the drive of an axis reports beyond the limits of its joint.

use crate::guard::AxisLimits;

/// What an axis has been reported to do since its drive was enabled.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Measured {
    /// How far below and above the position limits the joint may be: it was enabled there, and has not come nearer to them yet.
    pub(super) outside: (f64, f64),
    /// Reports in a row beyond a limit.
    pub(super) beyond_position: u32,
    pub(super) beyond_velocity: u32,
    pub(super) beyond_torque: u32,
}

/// Counts a report in a row beyond a limit, or begins anew.
pub(super) fn count(reports: &mut u32, is_beyond: bool) {
    *reports = if is_beyond { reports.saturating_add(1) } else { 0 };
}

impl Measured {
    /// The drive is not enabled: its joint may be moved by hand.
    pub(super) fn restart(&mut self, position: f64, limits: &AxisLimits) {
        *self = Self { outside: outside(position, limits), ..Self::default() };
    }

    /// Takes a position outside of the limits, with the following error that is allowed there.
    pub(super) fn take_outside(&mut self, position: f64, limits: &AxisLimits, margin: f64) {
        let is_beyond = self.limit_beyond(position, limits, margin).is_some();
        let (below, above) = outside(position, limits);
        self.outside = (self.outside.0.min(below), self.outside.1.min(above));
        count(&mut self.beyond_position, is_beyond);
    }

    /// The position limit beyond which the joint is by more than a following error may be.
    pub(super) fn limit_beyond(&self, position: f64, limits: &AxisLimits, margin: f64) -> Option<f64> {
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
