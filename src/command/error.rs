//! Why a command, a motion, a point or a wait did not come to what it was for. Their `Debug` text is their `Display` text, so that `?` in `main` prints a sentence.

use std::fmt;
use std::time::Duration;

use takt_rt::{RequestError, StopReason};
use takt_wire::printable::Shown;

use super::point_check::PointRefusal;
use super::question::QuestionError;
use crate::telemetry::{self, Machine};
use crate::trajectory::{RateError, TrajectoryError, axis_name};
use crate::words;
use crate::words::Words;

const ENDED: &str = "the controller has ended";

/// The real-time thread has refused a request.
#[derive(Clone, PartialEq, bitcode::Encode, bitcode::Decode, thiserror::Error)]
#[error("{words}")]
pub struct Refused {
    /// The request and the reason; `None` if many later refusals have replaced it.
    pub refusal: Option<RequestError>,
    words: String,
}

impl Refused {
    pub fn new(refusal: Option<RequestError>, machine: &Machine) -> Self {
        let forgotten = || {
            "the request was refused; the reason is no longer known, because many later requests were refused"
                .to_owned()
        };
        let words = refusal
            .map_or_else(forgotten, |refusal| telemetry::words::rejection(&refusal, machine).to_string());
        Self { refusal, words }
    }
}

/// The group has stopped.
#[derive(Clone, PartialEq, thiserror::Error)]
#[error("the group has stopped: {words}")]
pub struct Stopped {
    /// Why.
    pub reason: StopReason,
    words: String,
}

impl Stopped {
    pub(crate) fn new(reason: StopReason, machine: &Machine) -> Self {
        Self { reason, words: telemetry::words::stop(&reason, machine).to_string() }
    }
}

/// Modes that commands need, as [`CommandError::WrongMode`] names them.
#[doc(hidden)]
pub mod needed {
    /// For a velocity.
    pub const PROFILE_VELOCITY: &str = "profile velocity, mode = \"pv\"";
    /// For a torque.
    pub const PROFILE_TORQUE: &str = "profile torque, mode = \"pt\"";
    /// For a trajectory.
    pub const SET_POINTS: &str = "a mode that follows set-points";
    /// All of them.
    pub const ALL: [&str; 3] = [PROFILE_VELOCITY, PROFILE_TORQUE, SET_POINTS];
}

/// Why a command was not executed. It has changed nothing.
#[derive(Clone, PartialEq, bitcode::Encode, bitcode::Decode, thiserror::Error)]
#[error("{}", self.words())]
#[non_exhaustive]
pub enum CommandError {
    /// The number of values is not the number of axes.
    Count {
        /// The number of values.
        given: usize,
        /// The number of axes.
        axes: usize,
    },
    /// There is no such axis.
    NoSuchAxis {
        /// The number of the axis.
        axis: usize,
        /// The number of axes.
        axes: usize,
    },
    /// There is no group of this name.
    NoSuchGroup {
        /// The name.
        name: String,
        /// The names of the groups; none where all axes are one group.
        groups: Vec<String>,
    },
    /// The value is outside the limits of the axis, or not a number.
    OutsideLimits {
        /// The axis.
        axis: String,
        /// The value: rad, rad/s, N·m (m, m/s, N).
        value: f64,
        /// The lowest allowed value.
        lowest: f64,
        /// The highest allowed value.
        highest: f64,
    },
    /// The mode of the axis does not take this command.
    WrongMode {
        /// The axis.
        axis: String,
        /// The mode that takes this command.
        needed: String,
    },
    /// Too many requests wait for the real-time thread. A stop always finds room.
    Full {
        /// The number of waiting requests.
        waiting: usize,
    },
    /// The points of a trajectory break a limit, or are wrong. Axes and points are counted from 0.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// The rate of a trajectory cannot be changed so.
    #[error(transparent)]
    Rate(#[from] RateError),
    /// A callback may not take so long, or not so short.
    Budget {
        /// The budget.
        budget: Duration,
        /// The longest one.
        longest: Duration,
    },
    /// Too many callbacks are with the real-time thread.
    TooManyCallbacks,
    /// It is for one group, and there are several.
    SeveralGroups {
        /// The names of the groups.
        groups: Vec<String>,
    },
    /// The motion is not a trajectory under way.
    NoTrajectory,
    /// The real-time thread has refused it.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// Its answer is no longer known, because many requests have followed it.
    Unanswered,
    /// A stop has discarded the request before the real-time thread took it.
    Overtaken,
    /// A question to a device on a bus is not sent.
    #[error(transparent)]
    Question(#[from] QuestionError),
    /// This client of another process may not command now.
    #[error(transparent)]
    Lease(#[from] LeaseError),
    /// The process of the controller is there and does not answer. The command may still be carried out.
    NoReply {
        /// For how long.
        after: Duration,
    },
    /// The controller has ended, or the process that it runs in.
    Ended,
}

impl CommandError {
    /// The sentence, for a page in another language.
    pub fn words(&self) -> Words {
        match self {
            Self::Count { given, axes } => words!("{given} values were given for {axes} axes", given, axes),
            Self::NoSuchAxis { axis, axes } => {
                words!("there is no axis {axis}: the controller has {axes} axes", axis, axes)
            }
            Self::NoSuchGroup { name, groups } if groups.is_empty() => words!(
                "there is no group {name}: all axes are one group, without a name",
                name = format!("{name:?}")
            ),
            Self::NoSuchGroup { name, groups } => words!(
                "there is no group {name}: the groups are: {groups}",
                name = format!("{name:?}"),
                groups = groups.join(", ")
            ),
            Self::OutsideLimits { axis, value, lowest, highest } => words!(
                "{axis}: {value} is not within its limits, {lowest} to {highest}",
                axis,
                value = Shown(*value),
                lowest = Shown(*lowest),
                highest = Shown(*highest)
            ),
            Self::WrongMode { axis, needed } => {
                words!("{axis} is not in {needed}", axis, needed = Words::from(needed.clone()))
            }
            Self::Full { waiting } => words!("{waiting} requests are already waiting", waiting),
            Self::Trajectory(error) => error.to_string().into(),
            Self::Rate(error) => error.to_string().into(),
            Self::Budget { budget, longest } => words!(
                "a call of a callback cannot have {budget}: set-points must be ready within {longest}",
                budget = format!("{budget:?}"),
                longest = format!("{longest:?}")
            ),
            Self::TooManyCallbacks => "too many callbacks are with the real-time thread".into(),
            Self::SeveralGroups { groups } => {
                words!("it is for one group, and must name it: {groups}", groups = groups.join(", "))
            }
            Self::NoTrajectory => "the motion is not a trajectory under way".into(),
            Self::Refused(refused) => refused.words.clone().into(),
            Self::Unanswered => {
                "the answer to the request is no longer known, because many requests have followed it".into()
            }
            Self::Overtaken => "a stop has discarded the request before it began".into(),
            Self::Question(error) => error.to_string().into(),
            Self::Lease(error) => error.words(),
            Self::NoReply { after } => words!(
                "the process of the controller has not answered for {after}: it is paused, or overloaded; the command may still be carried out",
                after = format!("{after:?}")
            ),
            Self::Ended => ENDED.into(),
        }
    }

    /// The text, with every axis by its name. `axes` are the names of those that the command was for, in their order.
    pub fn naming(&self, axes: &[&str]) -> String {
        match self {
            Self::Trajectory(error) => error.naming(axes),
            Self::Rate(error) => error.naming(axes),
            _ => self.to_string(),
        }
    }
}

/// Why a client of another process may not command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bitcode::Encode, bitcode::Decode, thiserror::Error)]
#[error("{}", self.words())]
#[non_exhaustive]
pub enum LeaseError {
    /// Another client commands.
    Held {
        /// The process that commands.
        process: u32,
        /// When its lease expires, unless it gives another command.
        expires_in: Duration,
    },
    /// Another client has taken this one's place. It commands again once it takes its place back.
    TakenOver {
        /// The process that has taken over.
        process: u32,
    },
    /// The file permissions let this process observe, and not command.
    ReadOnly,
    /// The process of the controller has no room for another client that commands.
    TooManyClients,
    /// The lease has ended while points of a trajectory came, and they were forgotten with it. None of them is carried out.
    Lost,
}

impl LeaseError {
    /// The sentence, for a page in another language.
    pub fn words(&self) -> Words {
        match self {
            Self::Held { process, expires_in } => words!(
                "process {process} commands this controller, until {ms} ms after its last command; to command in its place, take it over",
                process,
                ms = expires_in.as_millis() as u64
            ),
            Self::TakenOver { process } => words!(
                "process {process} has taken over from this client; to command again, take it over",
                process
            ),
            Self::ReadOnly => {
                "this process may observe the controller, and not command it: it may not write to its socket"
                    .into()
            }
            Self::TooManyClients => "too many clients are connected to the controller".into(),
            Self::Lost => {
                "the lease has ended before all points of the trajectory came: send it again".into()
            }
        }
    }
}

/// Why points were not taken; none of them was, then.
#[derive(Clone, Copy, Debug, PartialEq, bitcode::Encode, bitcode::Decode, thiserror::Error)]
#[error("{}", self.words())]
#[non_exhaustive]
pub enum StreamError {
    /// A point needs an entry for each axis.
    Count {
        /// The entries.
        given: usize,
        /// The axes.
        axes: usize,
    },
    /// An axis does not take what a point says of it.
    Refused {
        /// Which point, from 0 on.
        point: usize,
        /// Which axis, from 0 on.
        axis: usize,
        /// Why.
        reason: PointRefusal,
    },
    /// No stream takes the points: none has begun, or a stop has ended it.
    NotStreaming,
    /// Too many points wait: the stream gets more than it can look ahead.
    Full,
    /// This client of another process may not command now.
    #[error(transparent)]
    Lease(#[from] LeaseError),
    /// The process of the controller is there and does not answer. The points may still be taken.
    NoReply {
        /// For how long.
        after: Duration,
    },
    /// The controller has ended, or is about to.
    Ended,
}

impl StreamError {
    /// The text, with the axis by its name. `axes` are the names of those that the points are for, in their order.
    pub fn naming(&self, axes: &[&str]) -> String {
        self.words_naming(axes).to_string()
    }

    /// The sentence, for a page in another language.
    pub fn words(&self) -> Words {
        self.words_naming(&[])
    }

    fn words_naming(&self, axes: &[&str]) -> Words {
        match self {
            Self::Count { given, axes } => {
                words!("there are {axes} axes, and the point has entries for {given}", axes, given)
            }
            Self::Refused { point, axis, reason } => words!(
                "point {point}, {axis}: {reason}",
                point,
                axis = axis_name(axes, *axis),
                reason = reason.words()
            ),
            Self::NotStreaming => "no stream is running: begin one first; every stop ends it".into(),
            Self::Full => "too many points wait for the controller".into(),
            Self::Lease(error) => error.words(),
            Self::NoReply { after } => words!(
                "the process of the controller has not answered for {after}: it is paused, or overloaded",
                after = format!("{after:?}")
            ),
            Self::Ended => ENDED.into(),
        }
    }
}

/// Why a motion did not reach its targets.
#[derive(Clone, PartialEq, thiserror::Error)]
#[error("{}", self.words())]
#[non_exhaustive]
pub enum MotionError {
    /// The callback has panicked, and the group has stopped.
    CallbackPanicked {
        /// The message of the panic, and where it was.
        message: String,
        /// The stop.
        stopped: Stopped,
    },
    /// The group has stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The real-time thread has refused it.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// A stop has discarded the request before the real-time thread took it.
    Overtaken,
    /// A later motion has replaced it.
    Replaced,
    /// Its result is no longer known, because many motions have followed it.
    Forgotten,
    /// It has not ended in time, and goes on.
    NotInTime,
    /// The controller has ended.
    Ended,
}

impl MotionError {
    /// The sentence, for a page in another language.
    pub fn words(&self) -> Words {
        match self {
            Self::CallbackPanicked { message, stopped } => words!(
                "the callback has panicked ({message}): {stopped}",
                message,
                stopped = stopped.to_string()
            ),
            Self::Stopped(stopped) => stopped.to_string().into(),
            Self::Refused(refused) => refused.words.clone().into(),
            Self::Overtaken => "a stop has discarded the motion before it began".into(),
            Self::Replaced => "a later motion has replaced the motion".into(),
            Self::Forgotten => {
                "the result of the motion is no longer known, because many motions have followed it".into()
            }
            Self::NotInTime => "the motion has not ended in time, and goes on".into(),
            Self::Ended => ENDED.into(),
        }
    }
}

/// Why a wait has not ended with what it was for.
#[derive(Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.words())]
pub enum WaitError {
    /// It did not happen in time.
    NotInTime,
    /// The controller has ended.
    Ended,
}

impl WaitError {
    /// The sentence, for a page in another language.
    pub fn words(&self) -> Words {
        match self {
            Self::NotInTime => "what was waited for has not happened in time".into(),
            Self::Ended => ENDED.into(),
        }
    }
}

/// Why a group was not brought up again, or does not hold its position.
#[derive(Clone, PartialEq, thiserror::Error)]
#[error("{}", self.words())]
#[non_exhaustive]
pub enum RecoveryError {
    /// A request was not executed.
    #[error(transparent)]
    Command(#[from] CommandError),
    /// It has not come about in time, or the controller has ended.
    #[error(transparent)]
    Wait(#[from] WaitError),
    /// Drives were not brought up. Enabling them is refused until a bring-up has succeeded.
    NotBroughtUp {
        /// Each drive, the step that failed, and what to do.
        words: String,
    },
    /// A fault has stopped the group while it was enabled.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl RecoveryError {
    /// The sentence, for a page in another language.
    pub fn words(&self) -> Words {
        match self {
            Self::Command(error) => error.words(),
            Self::Wait(error) => error.words(),
            Self::NotBroughtUp { words } => words.clone().into(),
            Self::Stopped(stopped) => stopped.to_string().into(),
        }
    }
}

/// `main` prints the error that `?` hands it by `Debug`.
macro_rules! debug_as_displayed {
    ($($error:ty),*) => {$(
        impl fmt::Debug for $error {
            fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(self, formatter)
            }
        }
    )*};
}

debug_as_displayed!(Refused, Stopped, CommandError, MotionError, WaitError, RecoveryError);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_that_does_not_exist_is_told_with_those_that_do() {
        let text = |groups: &[&str]| {
            let groups = groups.iter().map(|group| (*group).to_owned()).collect();
            CommandError::NoSuchGroup { name: "hand".to_owned(), groups }.to_string()
        };
        assert_eq!(text(&["arm", "gripper"]), "there is no group \"hand\": the groups are: arm, gripper");
        assert_eq!(text(&[]), "there is no group \"hand\": all axes are one group, without a name");
    }
}
