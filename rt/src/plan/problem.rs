//! The planning problem of one axis: its start state, its target state and its limits.

use super::choice::smaller;
use super::error::{Limit, PlanError, Quantity};

/// The state of motion of one axis, in rad, rad/s and rad/s² (m, m/s and m/s² for a linear axis).
///
/// The planner works with any consistent units: encoder counts give the same motion as radians.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct State {
    /// Position, in rad.
    pub position: f64,
    /// Velocity, in rad/s.
    pub velocity: f64,
    /// Acceleration, in rad/s². Second-order planning does not read it: there the acceleration can jump.
    pub acceleration: f64,
}

impl State {
    /// The state at rest at this position, in rad.
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

/// The limits of the motion of one axis.
///
/// Every magnitude must be from 1e-30 to 1e30. Only the position limits and the jerk limit may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest velocity, positive, in rad/s.
    pub velocity_max: f64,
    /// Smallest velocity, negative, in rad/s.
    pub velocity_min: f64,
    /// Largest acceleration, positive, in rad/s².
    pub acceleration_max: f64,
    /// Smallest acceleration, negative, in rad/s².
    pub acceleration_min: f64,
    /// Largest magnitude of the jerk, positive, in rad/s³. `f64::INFINITY` gives the second-order problem, in which the
    /// acceleration can jump.
    pub jerk_max: f64,
    /// Largest position, in rad; `f64::INFINITY` for no limit.
    pub position_max: f64,
    /// Smallest position, in rad, below the largest one; `f64::NEG_INFINITY` for no limit.
    pub position_min: f64,
}

impl Limits {
    /// The same limits in both directions, without position limits. All arguments are positive magnitudes.
    pub const fn symmetric(velocity: f64, acceleration: f64, jerk: f64) -> Self {
        Self::asymmetric(velocity, -velocity, acceleration, -acceleration, jerk)
    }

    /// Different limits in the two directions, without position limits. The minima are negative.
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

    /// These limits with position limits, in rad.
    pub const fn with_position(mut self, position_min: f64, position_max: f64) -> Self {
        self.position_min = position_min;
        self.position_max = position_max;
        self
    }

    /// Returns `true` if the jerk is unlimited.
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

    /// Returns `true` if no limit is too large, apart from an infinite jerk limit.
    #[inline]
    fn is_moderate(&self) -> bool {
        let widths =
            (self.velocity_max - self.velocity_min) + (self.acceleration_max - self.acceleration_min);
        widths < SIZE_MAX && (self.jerk_max < SIZE_MAX || self.is_second_order())
    }

    /// Checks that every limit has the right sign and is finite where it must be.
    ///
    /// # Errors
    /// [`PlanError::InvalidLimit`] with axis 0 and the first limit that is invalid.
    #[inline]
    pub fn validate(&self) -> Result<(), PlanError> {
        let positive = |value: f64| value > 0.0 && value < f64::INFINITY;
        // The usual case is checked at once: a sum is finite only if all of its numbers are.
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

/// The largest number that the planner accepts. It does not accept limits below the inverse of this either: the powers of such
/// numbers would leave the range of `f64`.
pub(super) const SIZE_MAX: f64 = 1e30;

/// Exceeding a limit by this much, relative to the limit, is rounding.
const ROUNDING: f64 = 1e-13;

/// The planning problem of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Problem {
    /// The state at time 0. If it is outside the limits, the motion first returns into them.
    pub start: State,
    /// The state at the end. Planning to a velocity does not read its position.
    pub target: State,
    /// The limits of the motion.
    pub limits: Limits,
}

impl Problem {
    /// Checks that every number is finite, that the limits are valid, and that the target keeps them.
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

    /// Checks that a motion can reach the target without breaking a velocity limit just before.
    pub(super) fn validate_approach(&self) -> Result<(), PlanError> {
        let (target, limits) = (&self.target, &self.limits);
        if limits.is_second_order() {
            return Ok(());
        }
        // The velocity at which the jerk must have begun to build up the acceleration of the target, at the latest.
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
