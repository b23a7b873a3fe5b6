//! What can be wrong with a planning problem.

/// A quantity of the state of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The position at the start of the motion.
    StartPosition,
    /// The velocity at the start of the motion.
    StartVelocity,
    /// The acceleration at the start of the motion.
    StartAcceleration,
    /// The position at the end of the motion.
    TargetPosition,
    /// The velocity at the end of the motion.
    TargetVelocity,
    /// The acceleration at the end of the motion.
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
/// `axis` is the index of the axis in the slices that were handed in; it is 0 where only one axis was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanError {
    /// A number of the start or target state is infinite or not a number.
    NotFinite {
        /// The axis.
        axis: usize,
        /// The quantity.
        quantity: Quantity,
    },
    /// A limit has the wrong sign, is zero, or is not a number; or the position limits exclude each other.
    InvalidLimit {
        /// The axis.
        axis: usize,
        /// The limit.
        limit: Limit,
    },
    /// The target state breaks a limit by itself, or cannot be reached without breaking it just before.
    TargetBeyondLimit {
        /// The axis.
        axis: usize,
        /// The limit that the target breaks.
        limit: Limit,
    },
    /// Every trajectory to the target that was found leaves the position limits.
    ///
    /// The profiles then hold the coordinated [`stop`](super::stop) of all axes.
    PositionBeyondLimit {
        /// The axis.
        axis: usize,
        /// The position limit that would be left.
        limit: Limit,
    },
    /// The axis is not in proportion to the others, so the motion is not on a straight line.
    NotStraight {
        /// The axis.
        axis: usize,
    },
    /// The numbers are so large or so small that the trajectory cannot be represented.
    NotRepresentable {
        /// The axis.
        axis: usize,
    },
    /// The slices that belong together differ in length.
    LengthMismatch {
        /// The number of problems or start states.
        expected: usize,
        /// The length of the slice that differs.
        received: usize,
    },
    /// The minimum duration is negative, the cycle is not positive, or one of them is no number or of no size that can be
    /// reckoned with.
    InvalidTiming,
}

impl PlanError {
    /// The axis at fault; `None` when it is not one axis.
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

    /// The same error, for the axis with this index.
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
