//! What can be wrong with a planning problem.

use core::fmt;

/// A quantity of the start or target state of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The position of the start state.
    StartPosition,
    /// The velocity of the start state.
    StartVelocity,
    /// The acceleration of the start state.
    StartAcceleration,
    /// The position of the target state.
    TargetPosition,
    /// The velocity of the target state.
    TargetVelocity,
    /// The acceleration of the target state.
    TargetAcceleration,
}

/// One of the limits of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// [`Limits::position_max`](super::Limits::position_max).
    PositionMax,
    /// [`Limits::position_min`](super::Limits::position_min).
    PositionMin,
    /// [`Limits::velocity_max`](super::Limits::velocity_max).
    VelocityMax,
    /// [`Limits::velocity_min`](super::Limits::velocity_min).
    VelocityMin,
    /// [`Limits::acceleration_max`](super::Limits::acceleration_max).
    AccelerationMax,
    /// [`Limits::acceleration_min`](super::Limits::acceleration_min).
    AccelerationMin,
    /// [`Limits::jerk_max`](super::Limits::jerk_max).
    JerkMax,
}

/// Why there is no trajectory.
///
/// `axis` is the index of the axis in the slices that were handed in, from 0. It is 0 where only one axis was handed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanError {
    /// A number of the start or target state is infinite or not a number.
    NotFinite {
        /// The axis.
        axis: usize,
        /// The quantity.
        quantity: Quantity,
    },
    /// A limit has the wrong sign, is zero, is infinite where it must not be, or is not a number. Or the smallest position is not
    /// below the largest one.
    InvalidLimit {
        /// The axis.
        axis: usize,
        /// The limit.
        limit: Limit,
    },
    /// The target state breaks a limit, or no motion reaches it without breaking that limit just before.
    TargetBeyondLimit {
        /// The axis.
        axis: usize,
        /// The limit that the target breaks.
        limit: Limit,
    },
    /// Every trajectory to the target that the planner found leaves a position limit.
    ///
    /// The profiles hold the coordinated [`stop`](super::stop) of all axes.
    PositionBeyondLimit {
        /// The axis.
        axis: usize,
        /// The position limit that the trajectory would leave.
        limit: Limit,
    },
    /// The start and target states of this axis are not in proportion to those of the others, so the motion is not on a straight
    /// line.
    NotStraight {
        /// The axis.
        axis: usize,
    },
    /// A number is larger than 1e30, or a limit is smaller than 1e-30: the powers of such numbers leave the range of `f64`.
    NotRepresentable {
        /// The axis.
        axis: usize,
    },
    /// Slices that belong together differ in length.
    LengthMismatch {
        /// The number of problems, or of start states.
        expected: usize,
        /// The length of the slice that differs.
        received: usize,
    },
    /// The minimum duration is not from 0 to 1e30 s, or the cycle is not between 1e-30 s and 1e30 s.
    InvalidTiming,
}

impl PlanError {
    /// The axis that the error belongs to; `None` for an error that belongs to no single axis.
    pub const fn axis(&self) -> Option<usize> {
        match self {
            Self::NotFinite { axis, .. }
            | Self::InvalidLimit { axis, .. }
            | Self::TargetBeyondLimit { axis, .. }
            | Self::PositionBeyondLimit { axis, .. }
            | Self::NotStraight { axis }
            | Self::NotRepresentable { axis } => Some(*axis),
            Self::LengthMismatch { .. } | Self::InvalidTiming => None,
        }
    }

    /// The same error, with this index as its axis.
    pub(super) fn on_axis(mut self, index: usize) -> Self {
        match &mut self {
            Self::NotFinite { axis, .. }
            | Self::InvalidLimit { axis, .. }
            | Self::TargetBeyondLimit { axis, .. }
            | Self::PositionBeyondLimit { axis, .. }
            | Self::NotStraight { axis }
            | Self::NotRepresentable { axis } => *axis = index,
            Self::LengthMismatch { .. } | Self::InvalidTiming => {}
        }
        self
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::StartPosition => "start position",
            Self::StartVelocity => "start velocity",
            Self::StartAcceleration => "start acceleration",
            Self::TargetPosition => "target position",
            Self::TargetVelocity => "target velocity",
            Self::TargetAcceleration => "target acceleration",
        })
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::PositionMax => "largest position",
            Self::PositionMin => "smallest position",
            Self::VelocityMax => "largest velocity",
            Self::VelocityMin => "smallest velocity",
            Self::AccelerationMax => "largest acceleration",
            Self::AccelerationMin => "smallest acceleration",
            Self::JerkMax => "largest jerk",
        })
    }
}

impl Limit {
    /// What the limit must be.
    const fn requirement(self) -> &'static str {
        match self {
            Self::PositionMax => "must be a number above the smallest position, or infinite",
            Self::PositionMin => "must be a number below the largest position, or infinite",
            Self::VelocityMax | Self::AccelerationMax => "must be positive and finite",
            Self::VelocityMin | Self::AccelerationMin => "must be negative and finite",
            Self::JerkMax => "must be positive, or infinite",
        }
    }
}

impl fmt::Display for PlanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { axis, quantity } => {
                write!(f, "axis {axis}: the {quantity} is not a finite number")
            }
            Self::InvalidLimit { axis, limit } => {
                write!(f, "axis {axis}: the {limit} {}", limit.requirement())
            }
            Self::TargetBeyondLimit { axis, limit } => {
                write!(f, "axis {axis}: no motion reaches the target without leaving the {limit}")
            }
            Self::PositionBeyondLimit { axis, limit } => {
                write!(f, "axis {axis}: every trajectory to the target leaves the {limit}")
            }
            Self::NotStraight { axis } => {
                write!(
                    f,
                    "axis {axis}: its start and target are not on a straight line with those of the other axes"
                )
            }
            Self::NotRepresentable { axis } => {
                write!(f, "axis {axis}: a number is above 1e30, or a limit is below 1e-30")
            }
            Self::LengthMismatch { expected, received } => {
                write!(f, "slices of different lengths: expected {expected} axes, received {received}")
            }
            Self::InvalidTiming => f.write_str(
                "the minimum duration must be from 0 s to 1e30 s, and the cycle between 1e-30 s and 1e30 s",
            ),
        }
    }
}

impl core::error::Error for PlanError {}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn every_error_says_the_axis_and_what_was_expected() {
        let cases = [
            (
                PlanError::NotFinite { axis: 2, quantity: Quantity::TargetVelocity },
                "axis 2: the target velocity is not a finite number",
            ),
            (
                PlanError::InvalidLimit { axis: 0, limit: Limit::VelocityMin },
                "axis 0: the smallest velocity must be negative and finite",
            ),
            (
                PlanError::PositionBeyondLimit { axis: 1, limit: Limit::PositionMax },
                "axis 1: every trajectory to the target leaves the largest position",
            ),
            (
                PlanError::LengthMismatch { expected: 6, received: 5 },
                "slices of different lengths: expected 6 axes, received 5",
            ),
        ];
        for (error, text) in cases {
            assert_eq!(error.to_string(), text);
        }
    }
}
