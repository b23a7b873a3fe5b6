//! `takt drive … enable | disable | move | velocity | torque | home`

use std::time::Duration;

use clap::{Args, Subcommand, ValueEnum};

use takt::config::Quantity;
use takt_tools::commission::command_value::{self, CommandValueError};
use takt_tools::commission::{CommandValue, Failure, MotionProfile, MoveKind, TargetDrive, Task};

use super::super::configuration;

/// Moving a drive.
#[derive(Subcommand, Debug)]
pub enum Action {
    /// Torque on at the present position, held until Ctrl-C (or left on with --keep-enabled)
    Enable(Enable),
    /// Stop in control, then torque off
    Disable,
    /// Move: absolute, relative, reciprocate, continuous
    Move(Move),
    /// Run at a velocity until Ctrl-C
    Velocity(Velocity),
    /// Apply a torque until Ctrl-C; the axis stops when it gets too fast
    Torque(Torque),
    /// Find the home position
    Home(Home),
}

#[derive(Args, Debug)]
pub struct Enable {
    /// Hold for this many seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = configuration::seconds)]
    duration: Option<Duration>,
    /// Leave the torque on
    #[arg(long, conflicts_with = "duration")]
    keep_enabled: bool,
}

#[derive(Args, Debug)]
#[command(subcommand_value_name = "absolute|relative|reciprocate|continuous")]
pub struct Move {
    #[command(subcommand)]
    kind: MoveKindArguments,
}

#[derive(Subcommand, Debug)]
enum MoveKindArguments {
    /// To a position
    Absolute {
        /// "90 deg", "0.2 m"; --raw: counts
        #[arg(allow_hyphen_values = true)]
        position: String,
        /// Have the drive adopt the target at once (controlword bit 5; some drives always do)
        #[arg(long)]
        immediate: bool,
        #[command(flatten)]
        profile: MotionProfileArguments,
    },
    /// By a distance
    Relative {
        /// "-5 deg"; --raw: counts
        #[arg(allow_hyphen_values = true)]
        distance: String,
        #[command(flatten)]
        profile: MotionProfileArguments,
    },
    /// To a position and back
    Reciprocate {
        /// "90 deg", "0.2 m"; --raw: counts
        #[arg(allow_hyphen_values = true)]
        position: String,
        /// The number of repetitions
        #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
        times: u32,
        /// Go on until Ctrl-C
        #[arg(long, conflicts_with = "times")]
        endless: bool,
        /// Seconds of standstill at each end
        #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = configuration::seconds)]
        dwell: Option<Duration>,
        #[command(flatten)]
        profile: MotionProfileArguments,
    },
    /// Without end in one direction, until Ctrl-C or a limit
    Continuous {
        /// The direction
        direction: Direction,
        /// Stop after this many seconds
        #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = configuration::seconds)]
        duration: Option<Duration>,
        #[command(flatten)]
        profile: MotionProfileArguments,
    },
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Direction {
    Forward,
    Backward,
}

/// The motion profile. A value that is not given is a tenth of the axis' limit, or the drive's own where no limits are known.
#[derive(Args, Debug)]
struct MotionProfileArguments {
    /// Profile velocity: "20 deg/s" [default: a tenth of the axis' limit]
    #[arg(long, value_name = "V", allow_hyphen_values = true)]
    velocity: Option<String>,
    #[command(flatten)]
    ramps: RampArguments,
    /// Leave the torque on at the end
    #[arg(long)]
    keep_enabled: bool,
}

#[derive(Args, Debug)]
struct RampArguments {
    /// Profile acceleration: "90 deg/s^2" [default: a tenth of the axis' limit]
    #[arg(long, value_name = "A", allow_hyphen_values = true)]
    acceleration: Option<String>,
    /// Profile deceleration [default: a tenth of the axis' limit]
    #[arg(long, value_name = "A", allow_hyphen_values = true)]
    deceleration: Option<String>,
}

#[derive(Args, Debug)]
pub struct Velocity {
    /// "-10 deg/s"; --raw: the drive's unit
    #[arg(allow_hyphen_values = true)]
    velocity: String,
    /// Stop after this many seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = configuration::seconds)]
    duration: Option<Duration>,
    #[command(flatten)]
    ramps: RampArguments,
    /// Leave the torque on at the end, at standstill
    #[arg(long)]
    keep_enabled: bool,
}

#[derive(Args, Debug)]
pub struct Torque {
    /// "2.5 Nm"; --raw: the drive's unit, for CiA 402 drives per mille of the rated torque
    #[arg(allow_hyphen_values = true)]
    torque: String,
    /// The axis is stopped above this velocity: "10 deg/s" [default: a quarter of the axis' limit]
    #[arg(long, value_name = "V", allow_hyphen_values = true)]
    max_velocity: Option<String>,
    /// End after this many seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = configuration::seconds)]
    duration: Option<Duration>,
}

#[derive(Args, Debug)]
pub struct Home {
    /// Homing method (object 6098)
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    method: Option<i8>,
    /// Give up and stop after this many seconds
    #[arg(long, value_name = "S", default_value = "60", allow_negative_numbers = true, value_parser = configuration::seconds)]
    within: Duration,
    /// Try a method that the drive's manual does not describe
    #[arg(long)]
    force: bool,
}

impl Action {
    /// Its name on the command line.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Enable(_) => "enable",
            Self::Disable => "disable",
            Self::Move(_) => "move",
            Self::Velocity(_) => "velocity",
            Self::Torque(_) => "torque",
            Self::Home(_) => "home",
        }
    }

    /// The task to the drive.
    pub fn task(&self, target: &TargetDrive, is_raw: bool) -> Result<Task, Failure> {
        let read = |text: &str, quantity| read(text, quantity, is_raw);
        Ok(match self {
            Self::Enable(enable) => {
                Task::Enable { hold_ns: nanoseconds(enable.duration), keeps_enabled: enable.keep_enabled }
            }
            Self::Disable => Task::Disable,
            Self::Move(arguments) => arguments.kind.task(target, is_raw)?,
            Self::Velocity(arguments) => Task::Velocity {
                velocity: read(&arguments.velocity, target.velocity_quantity())?,
                profile: arguments.ramps.profile(target, None, is_raw)?,
                duration_ns: nanoseconds(arguments.duration),
                keeps_enabled: arguments.keep_enabled,
            },
            Self::Torque(arguments) => Task::Torque {
                torque: read(&arguments.torque, target.effort_quantity())?,
                velocity_limit: optional(
                    arguments.max_velocity.as_ref(),
                    target.velocity_quantity(),
                    is_raw,
                )?,
                duration_ns: nanoseconds(arguments.duration),
            },
            Self::Home(arguments) => Task::Home {
                method: arguments.method,
                within_ns: arguments.within.as_nanos() as u64,
                is_forced: arguments.force,
            },
        })
    }
}

impl MoveKindArguments {
    fn task(&self, target: &TargetDrive, is_raw: bool) -> Result<Task, Failure> {
        let position = target.position_quantity();
        let (kind, profile) = match self {
            Self::Absolute { position: to, immediate, profile } => {
                (MoveKind::Absolute { to: read(to, position, is_raw)?, is_immediate: *immediate }, profile)
            }
            Self::Relative { distance, profile } => {
                (MoveKind::Relative(read(distance, position, is_raw)?), profile)
            }
            Self::Reciprocate { position: to, times, endless, dwell, profile } => {
                let dwell_ns = nanoseconds(*dwell).unwrap_or(0);
                let times = (!endless).then_some(*times);
                (MoveKind::Reciprocate { to: read(to, position, is_raw)?, times, dwell_ns }, profile)
            }
            Self::Continuous { direction, duration, profile } => {
                let is_forward = matches!(direction, Direction::Forward);
                (MoveKind::Continuous { is_forward, duration_ns: nanoseconds(*duration) }, profile)
            }
        };
        let keeps_enabled = profile.keep_enabled;
        let profile = profile.ramps.profile(target, profile.velocity.as_ref(), is_raw)?;
        Ok(Task::Move { kind, profile, keeps_enabled })
    }
}

impl RampArguments {
    fn profile(
        &self,
        target: &TargetDrive,
        velocity: Option<&String>,
        is_raw: bool,
    ) -> Result<MotionProfile, Failure> {
        let acceleration = target.acceleration_quantity();
        Ok(MotionProfile {
            velocity: optional(velocity, target.velocity_quantity(), is_raw)?,
            acceleration: optional(self.acceleration.as_ref(), acceleration, is_raw)?,
            deceleration: optional(self.deceleration.as_ref(), acceleration, is_raw)?,
        })
    }
}

fn nanoseconds(duration: Option<Duration>) -> Option<u64> {
    duration.map(|duration| duration.as_nanos() as u64)
}

fn read(text: &str, quantity: Quantity, is_raw: bool) -> Result<CommandValue, Failure> {
    command_value::parse(text, quantity, is_raw)
        .map_err(|error: CommandValueError| Failure::Unsuitable(error.to_string()))
}

/// How fast, or how soon: no direction.
fn magnitude(text: &str, quantity: Quantity, is_raw: bool) -> Result<CommandValue, Failure> {
    let command_value = read(text, quantity, is_raw)?;
    match command_value {
        CommandValue::Joint(value) if value < 0.0 => {}
        CommandValue::Drive(value) if value < 0 => {}
        _ => return Ok(command_value),
    }
    Err(Failure::Unsuitable(format!("`{text}` is below zero: a limit and a profile have no direction")))
}

fn optional(
    text: Option<&String>,
    quantity: Quantity,
    is_raw: bool,
) -> Result<Option<CommandValue>, Failure> {
    text.map(|text| magnitude(text, quantity, is_raw)).transpose()
}
