//! What a page may ask for, and how it is carried out. Numbers are rad, rad/s, N·m (m, m/s, N) and seconds.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use takt_rt::{OperationMode, RequestTarget};

use takt::command::{
    AnyHandle, CommandError, MotionError, MotionId, MoveOptions, RecoveryError, Refused, StreamError,
};
use takt::telemetry::{self, Machine};
use takt::words;
use takt::words::Words;

/// How long a command waits to learn that its motion was refused. A cycle takes a few milliseconds at most.
const REFUSED_WITHIN: Duration = Duration::from_millis(60);

/// A command of a page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// Enables the axes of a group, or of all.
    Enable {
        /// The group; all axes without it.
        group: Option<u8>,
    },
    /// Brings the axes to rest and disables them.
    Disable {
        /// The group; all axes without it.
        group: Option<u8>,
    },
    /// Clears latched faults.
    ClearFaults {
        /// The group; all axes without it.
        group: Option<u8>,
    },
    /// Brings the drives up again.
    BringUp {
        /// The group; all axes without it.
        group: Option<u8>,
    },
    /// Moves one axis to a position, or by a distance. The others of its group stay.
    Move {
        /// The axis.
        axis: usize,
        /// The position, or the distance.
        to: f64,
        /// True if it is a distance from the present set-point.
        relative: bool,
        /// The fraction of the velocity limits.
        velocity: f64,
        /// The fraction of the acceleration and jerk limits.
        acceleration: f64,
    },
    /// Moves the axes of a group together.
    MoveGroup {
        /// The group.
        group: u8,
        /// A position for each of its axes.
        to: Vec<f64>,
        /// The fraction of the velocity limits.
        velocity: f64,
        /// The fraction of the acceleration and jerk limits.
        acceleration: f64,
    },
    /// Moves one axis to and fro between two positions until it is stopped.
    Reciprocate {
        /// The axis.
        axis: usize,
        /// The positions.
        between: [f64; 2],
        /// The fraction of the velocity limits.
        velocity: f64,
        /// The fraction of the acceleration and jerk limits.
        acceleration: f64,
    },
    /// Moves one axis at a velocity, or drives it by a torque.
    Drive {
        /// The axis.
        axis: usize,
        /// What is given.
        quantity: Quantity,
        /// How much of it.
        value: f64,
        /// How long it lasts.
        #[serde(rename = "while")]
        lasts: Lasts,
    },
    /// Gives what [`Command::Drive`] has begun another value, and goes on with it.
    Renew {
        /// The axis.
        axis: usize,
        /// The new value.
        value: f64,
    },
    /// Ends what [`Command::Drive`] or [`Command::Reciprocate`] has begun, at rest and under power.
    Release {
        /// The axis.
        axis: usize,
    },
    /// Changes the mode of operation of one axis.
    ChangeMode {
        /// The axis.
        axis: usize,
        /// The number of the mode in object 6060.
        mode: i8,
    },
}

impl Command {
    /// The axes that it sets in motion; `None` if it begins no motion.
    ///
    /// # Errors
    /// [`CommandRefusal::NoSuchGroup`], [`CommandError::NoSuchAxis`].
    pub fn moved(&self, machine: &Machine) -> Result<Option<RequestTarget>, CommandRefusal> {
        match self {
            Self::Move { axis, .. } | Self::Reciprocate { axis, .. } | Self::Drive { axis, .. } => {
                target_of_axis(*axis, machine).map(Some)
            }
            Self::MoveGroup { group, .. } => target_of(Some(*group), machine).map(Some),
            _ => Ok(None),
        }
    }
}

/// What an axis is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// A velocity: rad/s (m/s).
    Velocity,
    /// A torque: N·m (N).
    Torque,
}

/// How long a velocity or a torque lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lasts {
    /// While it is renewed, as by a held key.
    Held,
    /// While the page is there that has begun it.
    Open,
}

/// Why a command was not carried out.
#[derive(Clone, Debug, PartialEq)]
pub enum CommandRefusal {
    /// The controller refuses it.
    Controller(CommandError),
    /// The motion that it began has ended at once.
    Motion(MotionError),
    /// Drives were not brought up again.
    BringUp(RecoveryError),
    /// There is no such group.
    NoSuchGroup {
        /// What was named.
        group: u8,
        /// How many there are.
        groups: usize,
    },
    /// There is no such mode.
    NoSuchMode {
        /// What was named.
        mode: i8,
    },
    /// The mode of the axis does not take it.
    WrongMode {
        /// The axis.
        axis: String,
        /// Its mode.
        mode: &'static str,
        /// What was given.
        quantity: &'static str,
    },
    /// Nothing is to be renewed or released.
    NothingToRenew,
    /// A stop has come in between.
    Discarded,
    /// Too many commands wait.
    Busy,
    /// Something is done with a drive already.
    BusyWithDrive,
    /// The stream of points is refused.
    Stream(StreamError),
}

macro_rules! from_errors {
    ($($refusal:ident($error:ty),)*) => {$(
        impl From<$error> for CommandRefusal {
            fn from(error: $error) -> Self {
                Self::$refusal(error)
            }
        }
    )*};
}

from_errors!(Controller(CommandError), Motion(MotionError), BringUp(RecoveryError), Stream(StreamError),);

impl CommandRefusal {
    /// Its word for programs.
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Controller(CommandError::Ended) | Self::Motion(MotionError::Ended) => "ended",
            Self::Controller(CommandError::Lease(_)) => "lease",
            Self::NothingToRenew => "nothing_to_renew",
            Self::Discarded => "discarded",
            Self::Busy => "busy",
            Self::BusyWithDrive => "busy_with_drive",
            _ => "refused",
        }
    }

    /// The sentence about a machine.
    fn words_about(&self, machine: &Machine) -> Words {
        match self {
            Self::Controller(CommandError::Refused(Refused { refusal: Some(refusal), .. }))
            | Self::Motion(MotionError::Refused(Refused { refusal: Some(refusal), .. }))
            | Self::BringUp(RecoveryError::Command(CommandError::Refused(Refused {
                refusal: Some(refusal),
                ..
            }))) => telemetry::words::rejection(refusal, machine),
            Self::Motion(MotionError::Stopped(stopped)) | Self::BringUp(RecoveryError::Stopped(stopped)) => {
                let stop = telemetry::words::stop(&stopped.reason, machine);
                words!("the group has stopped: {stop}", stop)
            }
            _ => self.words(),
        }
    }

    fn words(&self) -> Words {
        match self {
            Self::Controller(error) => error.words(),
            Self::Motion(error) => error.words(),
            Self::BringUp(error) => error.words(),
            Self::Stream(error) => error.words(),
            Self::NoSuchGroup { group, groups } => {
                words!("there is no group {group}: there are {groups}, counted from 0", group, groups)
            }
            Self::NoSuchMode { mode } => words!("there is no mode {mode}", mode),
            Self::WrongMode { axis, mode, quantity } => words!(
                "{axis} is in {mode}, which takes no {quantity} from here",
                axis,
                mode = Words::from(*mode),
                quantity = Words::from(*quantity)
            ),
            Self::NothingToRenew => "the motion has ended; begin it again".into(),
            Self::Discarded => "a stop has discarded the command before it began".into(),
            Self::Busy => "too many commands wait for the controller".into(),
            Self::BusyWithDrive => {
                "something is done with a drive already: wait for its end, or end it".into()
            }
        }
    }

    /// As pages are told it. A rejection and a stop are worded with the names of the machine; without it, in English.
    pub fn view(&self, machine: Option<&Machine>) -> ProblemView {
        ProblemView::of(self.key(), machine.map_or_else(|| self.words(), |machine| self.words_about(machine)))
    }
}

/// A problem as pages are told it.
#[derive(Debug, Serialize)]
pub struct ProblemView {
    /// Its word for programs.
    error: &'static str,
    words: Words,
}

impl ProblemView {
    /// A problem in words.
    pub fn of(error: &'static str, words: impl Into<Words>) -> Self {
        Self { error, words: words.into() }
    }
}

/// The groups as pages number them: one where the configuration has none.
pub fn group_count(machine: &Machine) -> usize {
    machine.groups.len().max(1)
}

/// A group as a target.
///
/// # Errors
/// [`CommandRefusal::NoSuchGroup`].
pub fn target_of(group: Option<u8>, machine: &Machine) -> Result<RequestTarget, CommandRefusal> {
    let groups = group_count(machine);
    match group {
        Some(group) if usize::from(group) >= groups => Err(CommandRefusal::NoSuchGroup { group, groups }),
        Some(group) if groups > 1 => Ok(RequestTarget::Group(group)),
        _ => Ok(RequestTarget::All),
    }
}

/// The group of an axis as a target.
///
/// # Errors
/// [`CommandError::NoSuchAxis`].
pub fn target_of_axis(axis: usize, machine: &Machine) -> Result<RequestTarget, CommandRefusal> {
    let described = machine.axes.get(axis);
    let described = described.ok_or(CommandError::NoSuchAxis { axis, axes: machine.axes.len() })?;
    // A number of a group fits: there are fewer than 255.
    target_of(u8::try_from(described.group).ok(), machine)
}

/// The set-points of the axes of a target, with one axis somewhere else.
pub fn positions_with(controller: &AnyHandle, target: RequestTarget, axis: usize, position: f64) -> Vec<f64> {
    let state = controller.state();
    let of = |number: &usize| match *number == axis {
        true => position,
        false => state.axes().get(*number).map_or(0.0, |axis| axis.position_set),
    };
    controller.of(target).axis_numbers().iter().map(of).collect()
}

/// Begins a move, and waits whether it is refused at once.
///
/// # Errors
/// See [`CommandRefusal`]; nothing moves then.
pub fn begin_move(
    controller: &AnyHandle,
    target: RequestTarget,
    positions: &[f64],
    options: MoveOptions,
) -> Result<MotionId, CommandRefusal> {
    let motion = controller.of(target).move_with(positions, options)?;
    not_refused(controller, motion)
}

/// Waits whether a motion is refused at once.
///
/// # Errors
/// [`CommandRefusal::Motion`].
pub fn not_refused(controller: &AnyHandle, motion: MotionId) -> Result<MotionId, CommandRefusal> {
    match controller.wait(motion, REFUSED_WITHIN) {
        Ok(()) | Err(MotionError::NotInTime) => Ok(motion),
        Err(error) => Err(error.into()),
    }
}

/// Changes the mode of operation of an axis.
///
/// # Errors
/// See [`CommandRefusal`].
pub fn change_mode(controller: &AnyHandle, axis: usize, mode: i8) -> Result<(), CommandRefusal> {
    let mode = OperationMode::from_number(mode).ok_or(CommandRefusal::NoSuchMode { mode })?;
    let change = controller.change_axis_mode(axis, mode)?;
    not_refused(controller, change).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Command, String> {
        serde_json::from_str(text).map_err(|error| error.to_string())
    }

    #[test]
    fn a_command_is_read_from_its_word_and_its_numbers() {
        assert_eq!(parsed(r#"{"do":"enable"}"#), Ok(Command::Enable { group: None }));
        assert_eq!(parsed(r#"{"do":"disable","group":1}"#), Ok(Command::Disable { group: Some(1) }));
        let drive = Command::Drive { axis: 2, quantity: Quantity::Torque, value: -1.5, lasts: Lasts::Held };
        assert_eq!(
            parsed(r#"{"do":"drive","axis":2,"quantity":"torque","value":-1.5,"while":"held"}"#),
            Ok(drive)
        );
    }

    #[test]
    fn what_is_no_command_is_refused_with_what_is_wrong() {
        for (text, wrong) in [
            (r#"{"do":"explode"}"#, "unknown variant"),
            (r#"{"do":"renew","axis":0}"#, "missing field `value`"),
            (r#"{"do":"renew","axis":-1,"value":1}"#, "invalid value"),
            (r#"{"do":"renew","axis":0,"value":1,"extra":1}"#, "unknown field"),
            (r#"{"do":"renew","axis":0,"value":1e999}"#, "number out of range"),
            (r#"{"do":"enable","group":256}"#, "invalid value"),
            ("", "EOF"),
            ("[]", "missing field `do`"),
        ] {
            let error = parsed(text).unwrap_err();
            assert!(error.contains(wrong), "{text}: {error}");
        }
    }
}
