//! What a call has come to: a code, and of a failure a text and numbers.

use std::cell::RefCell;
use std::ffi::{CString, c_char};

use takt::trajectory::{RateError, TrajectoryError};
use takt::{CommandError, Error, MotionError, PointRefusal, Refused, RejectReason, StreamError, WaitError};
use takt_remote::ConnectError;

use crate::scope::Scope;

/// What a call has come to. Below 0 is a failure: then takt_last_error() and takt_last_error_text() say more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum takt_result {
    /// Done.
    TAKT_OK = 0,
    /// The motion is still under way. Not a failure.
    TAKT_UNDER_WAY = 1,
    /// A pointer is null, a count is wrong, or a value means nothing. Nothing has changed.
    TAKT_ERROR_ARGUMENT = -1,
    /// The handle is null, closed, or of another kind.
    TAKT_ERROR_HANDLE = -2,
    /// The configuration, or the fault scenario, cannot be read or used.
    TAKT_ERROR_CONFIGURATION = -3,
    /// The controller could not be started: a bus, a right or a drive is missing; or none is served by this name. Nothing has moved.
    TAKT_ERROR_START = -4,
    /// A limit would be broken. Nothing has changed.
    TAKT_ERROR_LIMIT = -5,
    /// The mode of an axis does not take this. Nothing has changed.
    TAKT_ERROR_MODE = -6,
    /// The real-time thread has refused it in its present phase. Nothing has changed.
    TAKT_ERROR_REFUSED = -7,
    /// Too much is waiting already. Nothing has changed.
    TAKT_ERROR_FULL = -8,
    /// A stop has discarded it before it began.
    TAKT_ERROR_OVERTAKEN = -9,
    /// A later motion has taken its place.
    TAKT_ERROR_REPLACED = -10,
    /// The axes have stopped.
    TAKT_ERROR_STOPPED = -11,
    /// Its result is no longer known, because many others have followed it.
    TAKT_ERROR_FORGOTTEN = -12,
    /// The motion is not a trajectory under way.
    TAKT_ERROR_NO_TRAJECTORY = -13,
    /// It has not happened in time. What was waited for goes on. Of a controller of another process also: that has not answered, and may
    /// still carry the command out.
    TAKT_ERROR_TIMEOUT = -14,
    /// The controller has ended. In a fork of the process that has opened the handle: it is that process's. Nothing has changed.
    TAKT_ERROR_ENDED = -15,
    /// A callback has called a function that may wait or allocate. Nothing has changed. It leaves the last error as it is.
    TAKT_ERROR_IN_CALLBACK = -16,
    /// A defect of takt, please report it. The program may go on; the drives are stopped when the controller is closed.
    TAKT_ERROR_DEFECT = -17,
    /// Another process commands the controller, or this one may only observe it. Nothing has changed.
    TAKT_ERROR_LEASE = -18,
    /// Only the process that has opened the controller can do this. Nothing has changed.
    TAKT_ERROR_NOT_OWN = -19,
}

/// The last failure of a call in this thread. Set `size` to `sizeof(takt_error)`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_error {
    /// `sizeof(takt_error)`
    pub size: u32,
    /// What the call returned.
    pub result: takt_result,
    /// The point of a trajectory or of a chunk that it concerns, from 0 on; -1 where it is none.
    pub point: i32,
    /// The axis that it concerns, from 0 on, as the call counts the axes; -1 where it is none.
    pub axis: i32,
    /// The value that is beyond a limit: rad, rad/s, rad/s^2, rad/s^3, N·m (m, N); NAN where there is none.
    pub value: f64,
    /// The limit that it is beyond; NAN where there is none.
    pub limit: f64,
}

/// Why a call has failed.
#[derive(Debug)]
pub(crate) struct Failure {
    result: takt_result,
    words: String,
    point: Option<usize>,
    axis: Option<usize>,
    beyond: Option<(f64, f64)>,
}

struct LastError {
    error: takt_error,
    words: CString,
}

thread_local! {
    static LAST: RefCell<LastError> = RefCell::new(LastError { error: NONE, words: CString::default() });
}

const NONE: takt_error = takt_error {
    size: size_of::<takt_error>() as u32,
    result: takt_result::TAKT_OK,
    point: -1,
    axis: -1,
    value: f64::NAN,
    limit: f64::NAN,
};

/// Makes a failure the last error of this thread.
pub(crate) fn keep(failure: Failure) -> takt_result {
    let number = |of: Option<usize>| of.and_then(|of| i32::try_from(of).ok()).unwrap_or(-1);
    let (value, limit) = failure.beyond.unwrap_or((f64::NAN, f64::NAN));
    let result = failure.result;
    let error =
        takt_error { result, point: number(failure.point), axis: number(failure.axis), value, limit, ..NONE };
    let words = CString::new(failure.words.replace('\0', "")).unwrap_or_default();
    // The thread may be ending.
    let _ = LAST.try_with(|last| *last.borrow_mut() = LastError { error, words });
    result
}

/// The last error of this thread.
pub(crate) fn last() -> takt_error {
    LAST.try_with(|last| last.borrow().error).unwrap_or(NONE)
}

/// The words of the last error of this thread. They stay until the next one.
pub(crate) fn last_words() -> *const c_char {
    LAST.try_with(|last| last.borrow().words.as_ptr()).unwrap_or(c"".as_ptr())
}

impl Failure {
    pub(crate) fn new(result: takt_result, words: impl Into<String>) -> Self {
        Self { result, words: words.into(), point: None, axis: None, beyond: None }
    }

    pub(crate) fn argument(words: impl Into<String>) -> Self {
        Self::new(takt_result::TAKT_ERROR_ARGUMENT, words)
    }

    pub(crate) fn defect() -> Self {
        Self::new(takt_result::TAKT_ERROR_DEFECT, "takt has panicked; this is a defect, please report it")
    }

    /// At a point and an axis.
    pub(crate) fn at(self, point: usize, axis: usize) -> Self {
        self.at_point(Some(point)).on_axis(Some(axis))
    }

    fn on_axis(self, axis: Option<usize>) -> Self {
        Self { axis, ..self }
    }

    fn at_point(self, point: Option<usize>) -> Self {
        Self { point, ..self }
    }

    fn beyond(self, value: f64, limit: f64) -> Self {
        Self { beyond: Some((value, limit)), ..self }
    }

    /// Only the process of the controller can do it.
    pub(crate) fn not_own(what: &str) -> Self {
        let words = format!(
            "{what}, and this controller is in another process: do it there, in the program that opens it"
        );
        Self::new(takt_result::TAKT_ERROR_NOT_OWN, words)
    }

    /// Of a command for these axes.
    pub(crate) fn of_command(error: &CommandError, scope: &Scope) -> Self {
        let (axes, names) = (&scope.axes, scope.axis_names());
        let by_name = |name: &str| names.iter().position(|axis| *axis == name);
        let failure = Self::new(result_of(error), error.naming(&names));
        match error {
            CommandError::NoSuchAxis { axis, .. } => failure.on_axis(Some(*axis)),
            CommandError::OutsideLimits { axis, value, lowest, highest } => {
                let limit = if *value < *lowest { *lowest } else { *highest };
                failure.on_axis(by_name(axis)).beyond(*value, limit)
            }
            CommandError::WrongMode { axis, .. } => failure.on_axis(by_name(axis)),
            CommandError::Trajectory(error) => {
                let failure = failure.at_point(error.point()).on_axis(error.axis());
                match error {
                    TrajectoryError::Limit { value, limit, .. } => failure.beyond(*value, *limit),
                    TrajectoryError::NoRoomToStop { rest, limit, .. } => failure.beyond(*rest, *limit),
                    _ => failure,
                }
            }
            CommandError::Rate(RateError::Limit { point, axis, .. }) => {
                failure.at_point(Some(*point)).on_axis(Some(*axis))
            }
            CommandError::Refused(refused) => failure.refused(refused, axes),
            _ => failure,
        }
    }

    fn refused(self, refused: &Refused, axes: &[usize]) -> Self {
        let Some(refusal) = refused.refusal else { return self };
        let axis = refusal.axis.and_then(|axis| axes.iter().position(|own| *own == usize::from(axis)));
        let failure = self.on_axis(axis);
        match refusal.reason {
            RejectReason::PositionLimit { position: value, limit }
            | RejectReason::VelocityLimit { velocity: value, limit }
            | RejectReason::TorqueLimit { torque: value, limit }
            | RejectReason::NoRoomToStop { rest: value, limit } => failure.beyond(value, limit),
            _ => failure,
        }
    }

    /// Of a motion of these axes.
    pub(crate) fn of_motion(error: &MotionError, axes: &[usize]) -> Self {
        let result = match error {
            MotionError::CallbackPanicked { .. } | MotionError::Stopped(_) => takt_result::TAKT_ERROR_STOPPED,
            MotionError::Refused(refused) => result_of_refusal(refused),
            MotionError::Overtaken => takt_result::TAKT_ERROR_OVERTAKEN,
            MotionError::Replaced => takt_result::TAKT_ERROR_REPLACED,
            MotionError::Forgotten => takt_result::TAKT_ERROR_FORGOTTEN,
            MotionError::NotInTime => takt_result::TAKT_ERROR_TIMEOUT,
            MotionError::Ended => takt_result::TAKT_ERROR_ENDED,
            _ => takt_result::TAKT_ERROR_REFUSED,
        };
        let failure = Self::new(result, error.to_string());
        match error {
            MotionError::Refused(refused) => failure.refused(refused, axes),
            MotionError::Stopped(stopped) => {
                let own = |axis: u8| axes.iter().position(|own| *own == usize::from(axis));
                failure.on_axis(stopped.reason.axis().and_then(own))
            }
            _ => failure,
        }
    }
}

pub(crate) fn result_of(error: &CommandError) -> takt_result {
    match error {
        CommandError::Count { .. }
        | CommandError::NoSuchAxis { .. }
        | CommandError::NoSuchGroup { .. }
        | CommandError::SeveralGroups { .. }
        | CommandError::Budget { .. }
        | CommandError::Question(_)
        | CommandError::Rate(RateError::NotARate { .. }) => takt_result::TAKT_ERROR_ARGUMENT,
        CommandError::Trajectory(
            TrajectoryError::Limit { .. }
            | TrajectoryError::NoRoomToStop { .. }
            | TrajectoryError::Unreachable { .. },
        )
        | CommandError::OutsideLimits { .. }
        | CommandError::Rate(RateError::Limit { .. } | RateError::NoRamp { .. }) => {
            takt_result::TAKT_ERROR_LIMIT
        }
        CommandError::Trajectory(_) => takt_result::TAKT_ERROR_ARGUMENT,
        CommandError::WrongMode { .. } => takt_result::TAKT_ERROR_MODE,
        CommandError::Full { .. } | CommandError::TooManyCallbacks => takt_result::TAKT_ERROR_FULL,
        CommandError::Rate(_) | CommandError::NoTrajectory => takt_result::TAKT_ERROR_NO_TRAJECTORY,
        CommandError::Refused(refused) => result_of_refusal(refused),
        CommandError::Unanswered => takt_result::TAKT_ERROR_FORGOTTEN,
        CommandError::Overtaken => takt_result::TAKT_ERROR_OVERTAKEN,
        CommandError::Lease(_) => takt_result::TAKT_ERROR_LEASE,
        CommandError::NoReply { .. } => takt_result::TAKT_ERROR_TIMEOUT,
        CommandError::Ended => takt_result::TAKT_ERROR_ENDED,
        _ => takt_result::TAKT_ERROR_REFUSED,
    }
}

/// A limit that the real-time thread has found broken is one.
fn result_of_refusal(refused: &Refused) -> takt_result {
    match refused.refusal.map(|refusal| refusal.reason) {
        Some(
            RejectReason::PositionLimit { .. }
            | RejectReason::VelocityLimit { .. }
            | RejectReason::TorqueLimit { .. }
            | RejectReason::NoRoomToStop { .. },
        ) => takt_result::TAKT_ERROR_LIMIT,
        Some(RejectReason::WrongMode { .. } | RejectReason::UnknownMode { .. }) => {
            takt_result::TAKT_ERROR_MODE
        }
        Some(RejectReason::UnknownTrajectory | RejectReason::TooLate) => {
            takt_result::TAKT_ERROR_NO_TRAJECTORY
        }
        _ => takt_result::TAKT_ERROR_REFUSED,
    }
}

impl Failure {
    /// Of points for these axes.
    pub(crate) fn of_stream(error: StreamError, scope: &Scope) -> Self {
        let words = error.naming(&scope.axis_names());
        match error {
            StreamError::Refused { point, axis, reason } => {
                let (result, beyond) = match reason {
                    PointRefusal::Torque { torque: value, limit }
                    | PointRefusal::Stiffness { stiffness: value, limit }
                    | PointRefusal::Damping { damping: value, limit } => {
                        (takt_result::TAKT_ERROR_LIMIT, Some((value, limit)))
                    }
                    PointRefusal::NotFinite { .. } => (takt_result::TAKT_ERROR_ARGUMENT, None),
                    _ => (takt_result::TAKT_ERROR_MODE, None),
                };
                Self { result, words, point: Some(point), axis: Some(axis), beyond }
            }
            StreamError::Count { .. } => Self::argument(words),
            StreamError::NotStreaming => Self::new(takt_result::TAKT_ERROR_REFUSED, words),
            StreamError::Full => Self::new(takt_result::TAKT_ERROR_FULL, words),
            StreamError::Lease(_) => Self::new(takt_result::TAKT_ERROR_LEASE, words),
            StreamError::NoReply { .. } => Self::new(takt_result::TAKT_ERROR_TIMEOUT, words),
            _ => Self::new(takt_result::TAKT_ERROR_ENDED, words),
        }
    }
}

impl From<WaitError> for Failure {
    fn from(error: WaitError) -> Self {
        let result = match error {
            WaitError::NotInTime => takt_result::TAKT_ERROR_TIMEOUT,
            WaitError::Ended => takt_result::TAKT_ERROR_ENDED,
        };
        Self::new(result, error.to_string())
    }
}

/// Of connecting to a controller of another process.
impl From<ConnectError> for Failure {
    fn from(error: ConnectError) -> Self {
        let result = match error {
            ConnectError::Name { .. } => takt_result::TAKT_ERROR_ARGUMENT,
            _ => takt_result::TAKT_ERROR_START,
        };
        Self::new(result, error.to_string())
    }
}

/// Of opening a controller. A file that is wrong is shown with each problem at its line.
impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let result = match error {
            Error::Config(_) | Error::Override(_) | Error::Scenario(_) => {
                takt_result::TAKT_ERROR_CONFIGURATION
            }
            _ => takt_result::TAKT_ERROR_START,
        };
        Self::new(result, format!("{error:?}"))
    }
}
