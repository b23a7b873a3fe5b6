//! What a running controller can be asked, and what it answers.

use std::time::Duration;

use bitcode::{Decode, Encode};
use takt_rt::{Frame, OperationMode, RequestTarget};

use super::motion::{MotionId, MoveOptions, TrajectoryProgress};
use crate::trajectory::TrajectoryPoint;

/// What a running controller can be asked, but for stops and points of streams. One of another process is sent the same.
///
/// `target` says whose axes are meant: all of the controller, or those of one group, by its number in the configuration. Values of axes
/// come in the order of the controller or of the group. Units are rad, rad/s, N·m (m, m/s, N) and seconds.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Command {
    /// To command from now on; in place of another process only if `is_taken_over`.
    Lease {
        /// True if another process loses its lease.
        is_taken_over: bool,
    },
    /// To command no longer.
    Release,
    /// See [`Handle::move_with`](super::Handle::move_with).
    Move {
        /// Whose axes.
        target: RequestTarget,
        /// How.
        options: MoveOptions,
        /// Where to.
        positions: Vec<f64>,
    },
    /// See [`Handle::move_by`](super::Handle::move_by).
    MoveBy {
        /// Whose axes.
        target: RequestTarget,
        /// How.
        options: MoveOptions,
        /// How far.
        distances: Vec<f64>,
    },
    /// See [`Handle::execute`](super::Handle::execute).
    Execute {
        /// Whose axes.
        target: RequestTarget,
        /// Through these points.
        points: Vec<TrajectoryPoint>,
    },
    /// See [`Handle::move_through`](super::Handle::move_through).
    Through {
        /// Whose axes.
        target: RequestTarget,
        /// Through these positions.
        waypoints: Vec<Vec<f64>>,
    },
    /// Another speed along a trajectory.
    SetSpeed {
        /// The trajectory.
        motion: MotionId,
        /// The speed.
        rate: f64,
    },
    /// To pause a trajectory.
    Pause(MotionId),
    /// To go on with it.
    Resume(MotionId),
    /// How far it is.
    Progress(MotionId),
    /// A velocity in profile velocity.
    Velocity {
        /// The axis.
        axis: usize,
        /// rad/s (m/s)
        velocity: f64,
        /// For how long.
        valid_for: Duration,
    },
    /// A torque in profile torque.
    Torque {
        /// The axis.
        axis: usize,
        /// N·m (N)
        torque: f64,
        /// For how long.
        valid_for: Duration,
    },
    /// Another mode of operation for all axes of a target.
    ChangeMode {
        /// Whose axes.
        target: RequestTarget,
        /// The mode.
        mode: OperationMode,
    },
    /// The same for one axis.
    ChangeAxisMode {
        /// The axis.
        axis: usize,
        /// The mode.
        mode: OperationMode,
    },
    /// To enable.
    Enable(RequestTarget),
    /// To disable.
    Disable(RequestTarget),
    /// To clear latched faults.
    ResetFaults(RequestTarget),
    /// To bring drives up again.
    BringUp(RequestTarget),
    /// To say why drives were not brought up again.
    BringUpFailure(RequestTarget),
    /// To follow the points of a stream.
    BeginStream(RequestTarget),
    /// To ask a device that is none of the configuration's.
    Question {
        /// The bus.
        bus: usize,
        /// The question.
        frame: Frame,
    },
}

/// What became of a command that was not refused.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Reply {
    /// It is done, or has begun.
    Done,
    /// A motion has been asked for.
    Motion(MotionId),
    /// How far a trajectory is; `None` if it is none under way.
    Progress(Option<TrajectoryProgress>),
    /// Why drives were not brought up again; `None` if they were, or are being brought up.
    BringUpFailure(Option<String>),
}

impl Command {
    /// Whose axes are meant, where the command says so.
    pub const fn target(&self) -> Option<RequestTarget> {
        match self {
            Self::Lease { .. }
            | Self::Release
            | Self::Velocity { .. }
            | Self::Torque { .. }
            | Self::ChangeAxisMode { .. }
            | Self::Question { .. } => None,
            Self::SetSpeed { motion, .. }
            | Self::Pause(motion)
            | Self::Resume(motion)
            | Self::Progress(motion) => Some(motion.target()),
            Self::Enable(target)
            | Self::Disable(target)
            | Self::ResetFaults(target)
            | Self::BringUp(target)
            | Self::BringUpFailure(target)
            | Self::BeginStream(target)
            | Self::Execute { target, .. }
            | Self::Through { target, .. }
            | Self::Move { target, .. }
            | Self::MoveBy { target, .. }
            | Self::ChangeMode { target, .. } => Some(*target),
        }
    }

    /// True for what changes nothing in the controller, so that whoever may command may ask it at any time.
    pub const fn only_reads(&self) -> bool {
        matches!(self, Self::Progress(_) | Self::BringUpFailure(_) | Self::Question { .. })
    }

    /// True for what begins or changes a motion.
    pub const fn is_discarded_by_stops(&self) -> bool {
        !self.only_reads() && !matches!(self, Self::Lease { .. } | Self::Release | Self::Disable(_))
    }
}
