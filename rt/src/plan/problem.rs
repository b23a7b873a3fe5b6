//! The planning problem of one axis: where it is, where it shall be, what it must keep.

use super::choice::smaller;
use super::error::{Limit, PlanError, Quantity};

/// The state of motion of one axis, in rad, rad/s and rad/s² (m, m/s and m/s² for a linear axis).
///
/// The planner itself is free of units: any consistent set will do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Position.
    pub position: f64,
    /// Velocity.
    pub velocity: f64,
    /// Acceleration. Second-order planning neither reads it in a start state nor reaches it in a target state.
    pub acceleration: f64,
}

impl State {
    /// At rest at this position.
    pub const fn rest(position: f64) -> Self {
        Self { position, velocity: 0.0, acceleration: 0.0 }
    }

    /// After this time with the same acceleration; before it, if the time is negative.
    pub fn after(&self, time_s: f64) -> Self {
        let Self { position, velocity, acceleration } = *self;
        Self {
            position: position + time_s * (velocity + 0.5 * acceleration * time_s),
            velocity: velocity + acceleration * time_s,
            acceleration,
        }
    }
}

/// What the motion of one axis must keep.
///
/// The upper limits of velocity and acceleration are positive and the lower ones negative. A limit may be far
/// away, but not infinite, except for the position and the jerk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest velocity, positive.
    pub velocity_max: f64,
    /// Smallest velocity, negative.
    pub velocity_min: f64,
    /// Largest acceleration, positive.
    pub acceleration_max: f64,
    /// Smallest acceleration, negative.
    pub acceleration_min: f64,
    /// Largest magnitude of the jerk, positive. `f64::INFINITY` gives the second-order problem: the
    /// acceleration may jump.
    pub jerk_max: f64,
    /// Largest position; `f64::INFINITY` where there is none.
    pub position_max: f64,
    /// Smallest position; `f64::NEG_INFINITY` where there is none.
    pub position_min: f64,
}

impl Limits {
    /// The same limits in both directions, and no limit of position. All arguments are positive magnitudes.
    pub const fn symmetric(velocity: f64, acceleration: f64, jerk: f64) -> Self {
        Self::asymmetric(velocity, -velocity, acceleration, -acceleration, jerk)
    }

    /// Different limits in the two directions, and no limit of position. The minima are negative.
    pub const fn asymmetric(
        velocity_max: f64,
        velocity_min: f64,
        acceleration_max: f64,
        acceleration_min: f64,
        jerk_max: f64,
    ) -> Self {
        Self {
            velocity_max,
            velocity_min,
            acceleration_max,
            acceleration_min,
            jerk_max,
            position_max: f64::INFINITY,
            position_min: f64::NEG_INFINITY,
        }
    }

    /// The same limits with these limits of position.
    pub const fn with_position(mut self, position_min: f64, position_max: f64) -> Self {
        self.position_min = position_min;
        self.position_max = position_max;
        self
    }

    /// Whether the jerk is unlimited.
    pub(super) fn is_second_order(&self) -> bool {
        self.jerk_max == f64::INFINITY
    }

    /// The smallest magnitude among the limits of velocity, acceleration and jerk.
    #[inline]
    fn least(&self) -> f64 {
        let velocity = smaller(self.velocity_max, -self.velocity_min);
        let acceleration = smaller(self.acceleration_max, -self.acceleration_min);
        smaller(smaller(velocity, acceleration), self.jerk_max)
    }

    /// Whether no limit but an infinite jerk is too large.
    #[inline]
    fn is_moderate(&self) -> bool {
        let widths =
            (self.velocity_max - self.velocity_min) + (self.acceleration_max - self.acceleration_min);
        widths < SIZE_MAX && (self.jerk_max < SIZE_MAX || self.is_second_order())
    }

    /// Checks signs and finiteness.
    ///
    /// # Errors
    /// [`PlanError::InvalidLimit`] with axis 0 and the first limit that cannot be kept by any motion.
    #[inline]
    pub fn validate(&self) -> Result<(), PlanError> {
        let positive = |value: f64| value > 0.0 && value < f64::INFINITY;
        // The usual case at once: a sum is finite only if all of its numbers are.
        let signs = (self.velocity_max > 0.0)
            & (self.velocity_min < 0.0)
            & (self.acceleration_max > 0.0)
            & (self.acceleration_min < 0.0)
            & (self.jerk_max > 0.0)
            & (self.position_min < self.position_max);
        let widths =
            (self.velocity_max - self.velocity_min) + (self.acceleration_max - self.acceleration_min);
        if signs & (widths < f64::INFINITY) {
            return Ok(());
        }
        let checks = [
            (positive(self.velocity_max), Limit::VelocityMax),
            (positive(-self.velocity_min), Limit::VelocityMin),
            (positive(self.acceleration_max), Limit::AccelerationMax),
            (positive(-self.acceleration_min), Limit::AccelerationMin),
            (self.jerk_max > 0.0, Limit::JerkMax),
            (!self.position_max.is_nan(), Limit::PositionMax),
            (self.position_min < self.position_max, Limit::PositionMin),
        ];
        match checks.iter().find(|(kept, _)| !kept) {
            Some((_, limit)) => Err(PlanError::InvalidLimit { axis: 0, limit: *limit }),
            None => Ok(()),
        }
    }
}

/// Larger numbers are refused, limits too, and limits smaller than its inverse: their powers would leave the range of `f64`.
pub(super) const SIZE_MAX: f64 = 1e30;

/// Relative to a limit, being beyond it by this much is rounding.
const ROUNDING: f64 = 1e-13;

/// From where to where, within which limits: the problem of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Problem {
    /// The state at time 0. It may be outside the limits: the motion then first returns into them.
    pub start: State,
    /// The state at the end. The velocity interface does not read its position.
    pub target: State,
    /// What the motion keeps.
    pub limits: Limits,
}

impl Problem {
    /// Checks that every number is finite, the limits are limits, and the target keeps them.
    #[inline]
    pub(super) fn validate(&self) -> Result<(), PlanError> {
        self.limits.validate()?;
        let second_order = self.limits.is_second_order();
        let (start, target) = (&self.start, &self.target);
        let sum = start.position.abs() + start.velocity.abs() + target.position.abs() + target.velocity.abs();
        let accelerations =
            if second_order { 0.0 } else { start.acceleration.abs() + target.acceleration.abs() };
        if sum + accelerations < SIZE_MAX {
            if self.limits.least() < 1.0 / SIZE_MAX || !self.limits.is_moderate() {
                return Err(PlanError::NotRepresentable { axis: 0 });
            }
            return self.validate_target(second_order);
        }
        let finite = |value: f64, quantity| {
            if value.is_finite() { Ok(()) } else { Err(PlanError::NotFinite { axis: 0, quantity }) }
        };
        finite(start.position, Quantity::StartPosition)?;
        finite(start.velocity, Quantity::StartVelocity)?;
        finite(target.position, Quantity::TargetPosition)?;
        finite(target.velocity, Quantity::TargetVelocity)?;
        if !second_order {
            finite(start.acceleration, Quantity::StartAcceleration)?;
            finite(target.acceleration, Quantity::TargetAcceleration)?;
        }
        Err(PlanError::NotRepresentable { axis: 0 })
    }

    fn validate_target(&self, second_order: bool) -> Result<(), PlanError> {
        let (target, limits) = (&self.target, &self.limits);
        let beyond = |limit| Err(PlanError::TargetBeyondLimit { axis: 0, limit });
        if target.velocity > limits.velocity_max {
            return beyond(Limit::VelocityMax);
        }
        if target.velocity < limits.velocity_min {
            return beyond(Limit::VelocityMin);
        }
        if !second_order {
            if target.acceleration > limits.acceleration_max {
                return beyond(Limit::AccelerationMax);
            }
            if target.acceleration < limits.acceleration_min {
                return beyond(Limit::AccelerationMin);
            }
        }
        Ok(())
    }
    /// Checks that the target can be reached without breaking a velocity limit just before.
    pub(super) fn validate_approach(&self) -> Result<(), PlanError> {
        let (target, limits) = (&self.target, &self.limits);
        if limits.is_second_order() {
            return Ok(());
        }
        // At least this was the velocity when the jerk began to build up the acceleration.
        let before =
            target.velocity - 0.5 * target.acceleration * target.acceleration.abs() / limits.jerk_max;
        if before > limits.velocity_max * (1.0 + ROUNDING) {
            Err(PlanError::TargetBeyondLimit { axis: 0, limit: Limit::VelocityMax })
        } else if before < limits.velocity_min * (1.0 + ROUNDING) {
            Err(PlanError::TargetBeyondLimit { axis: 0, limit: Limit::VelocityMin })
        } else {
            Ok(())
        }
    }
}
