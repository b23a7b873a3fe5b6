//! Why a controller does not start, a command is not given, a motion does not get to its end.

use takt_rt::stop::{Phase, StopReason};

use crate::controller::session::{Session, SessionError};

/// Why there is no controller.
#[derive(Debug, thiserror::Error)]
pub enum StartFailure {
    /// Nothing was begun.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The drives could not be brought up or enabled; what is left of the attempt.
    #[error("the drives could not be enabled: {:?}", .0.outcome)]
    NotEnabled(Box<Session>),
    /// The thread that leads the controller has died, which only a defect of takt can bring about.
    #[error("the thread that leads the controller has died")]
    Died,
}

/// Why a command was not given; nothing has changed then.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CommandError {
    /// A value for each axis is needed.
    #[error("{given} values for {axes} axes")]
    Count {
        /// How many there were.
        given: usize,
        /// How many there are to be.
        axes: usize,
    },
    /// There is no such axis.
    #[error("there is no axis {axis}: the controller has {axes}")]
    NoSuchAxis {
        /// The number asked for.
        axis: usize,
        /// How many there are.
        axes: usize,
    },
    /// The value is outside the limits of the axis, or no number.
    #[error("{axis}: {value} is outside {lowest} to {highest}")]
    OutsideLimits {
        /// The axis.
        axis: String,
        /// What was asked for: rad, rad/s, N·m (m, m/s, N).
        value: f64,
        /// The lowest that is allowed.
        lowest: f64,
        /// The highest that is allowed.
        highest: f64,
    },
    /// The axis is not in the mode that takes this.
    #[error("{axis} is not in {needed}")]
    WrongMode {
        /// The axis.
        axis: String,
        /// The mode that takes it.
        needed: &'static str,
    },
    /// More has been asked for than the real-time thread has taken up yet; a stop always finds room.
    #[error("{waiting} requests are waiting already")]
    Full {
        /// How many.
        waiting: usize,
    },
    /// The controller has ended.
    #[error("the controller has ended")]
    Ended,
}

/// Why a motion did not get to its end.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// The group has stopped.
    #[error("the group has stopped: {0:?}")]
    Stopped(StopReason),
    /// The real-time thread refused it: another phase, or a latched fault. Or it was never asked: too much was waiting, or a
    /// stop has overtaken it.
    #[error("the motion was refused while {phase:?}")]
    Refused {
        /// The phase that the group was in.
        phase: Phase,
    },
    /// It was not over in time; it goes on.
    #[error("the motion was not over in time")]
    NotInTime,
    /// The controller has ended.
    #[error("the controller has ended")]
    Ended,
}
