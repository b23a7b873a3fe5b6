//! Why a controller does not start, a command is not given, a motion does not get to its end.

use takt_rt::{RequestError, StopReason};

use crate::controller::session::{Session, SessionError};
use crate::telemetry::{Machine, words};

/// Why there is no controller.
#[derive(Debug, thiserror::Error)]
pub enum StartFailure {
    /// Nothing was begun.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The drives could not be brought up or enabled; what is left of the attempt.
    #[error("the drives could not be enabled: {}", .0.outcome.words(&.0.log.machine))]
    NotEnabled(Box<Session>),
    /// The thread that leads the controller has died, which only a defect of takt can bring about.
    #[error("the thread that leads the controller has died")]
    Died,
}

/// The real-time thread has refused a request.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{words}")]
pub struct Refused {
    /// What was refused and why; `None` when so many others were refused since that it is no longer known.
    pub refusal: Option<RequestError>,
    words: String,
}

impl Refused {
    pub(super) fn new(refusal: Option<RequestError>, machine: &Machine) -> Self {
        let forgotten =
            || "the request was refused, as were so many since that why is no longer known".to_owned();
        let words = refusal.map_or_else(forgotten, |refusal| words::rejection(&refusal, machine));
        Self { refusal, words }
    }
}

/// The group has stopped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the group has stopped: {words}")]
pub struct Stopped {
    /// Why.
    pub reason: StopReason,
    words: String,
}

impl Stopped {
    pub(super) fn new(reason: StopReason, machine: &Machine) -> Self {
        Self { reason, words: words::stop(&reason, machine) }
    }
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
    /// The real-time thread has refused it.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// So many requests have followed it that what became of it is not known.
    #[error("too many requests have followed it to know what became of it")]
    Unanswered,
    /// A stop has overtaken it before the real-time thread had taken it up.
    #[error("a stop has overtaken the request")]
    Overtaken,
    /// The controller has ended.
    #[error("the controller has ended")]
    Ended,
}

/// Why a motion did not get to its end.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// The group has stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The real-time thread has refused it.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// A stop has overtaken it before the real-time thread had taken it up.
    #[error("a stop has overtaken the motion")]
    Overtaken,
    /// It was not over in time; it goes on.
    #[error("the motion was not over in time")]
    NotInTime,
    /// The controller has ended.
    #[error("the controller has ended")]
    Ended,
}
