//! What a page of commissioning may ask for. Numbers are rad, rad/s, N·m (m, m/s, N) and seconds, or whole numbers of the drive's own where its
//! units are not known.

use serde::Deserialize;
use takt_rt::Nanoseconds;

use takt::words;
use takt::words::Words;
use takt_tools::commission::{CommandValue, Failure, MotionProfile, MoveKind, TargetDrive, Task, ValueText};

/// The longest time that may be named, in seconds.
const LONGEST_S: f64 = 24.0 * 3600.0;
/// How long homing may take.
const HOMING_NS: Nanoseconds = 60_000_000_000;
/// The object with the communication cycle (CiA 301), in µs.
const COMMUNICATION_CYCLE: &str = "1006:00";
/// The communication cycles that may be written, in µs.
const CYCLES_US: std::ops::RangeInclusive<u32> = 0..=1_000_000;
/// Frames of one request, and the shortest time between two of them.
const FRAMES_AT_MOST: u32 = 1000;
const FRAME_PERIOD_MS: std::ops::RangeInclusive<u32> = 10..=10_000;
/// How often readings may come.
const READING_MS: std::ops::RangeInclusive<u32> = 20..=5_000;

/// A command of a page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Ask {
    /// Looks who is on a bus. Nothing moves.
    Scan {
        /// The bus.
        bus: usize,
        /// The first node ID.
        from: u8,
        /// The last one.
        to: u8,
    },
    /// Adds a drive that was not found, by its family.
    Add {
        /// The bus.
        bus: usize,
        /// The node ID.
        node: u8,
        /// The family, as `drive` names it in a configuration.
        family: String,
    },
    /// A task with one drive.
    Task {
        /// The drive.
        drive: usize,
        /// What is done.
        task: AskedTask,
        /// True if it ends when it is not renewed, as with a held key.
        #[serde(default)]
        held: bool,
    },
    /// Goes on with what is held.
    Renew {},
    /// Ends what runs: in control, then without torque.
    End {},
    /// Reads a drive again and again while nothing else is done; none without a drive.
    Watch {
        /// The drive.
        drive: Option<usize>,
        /// The time from one reading to the next.
        every_ms: u32,
    },
    /// Sends a frame. It is refused while a drive has torque.
    Send {
        /// The bus.
        bus: usize,
        /// The frame, as `181#3712`.
        frame: String,
        /// How many times.
        count: u32,
        /// The time from one to the next.
        period_ms: u32,
    },
}

/// A task with one drive.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum AskedTask {
    /// Identity, ratings and condition.
    Info {},
    /// Reads the communication cycle, or writes it first.
    Cycle {
        /// µs
        write_us: Option<u32>,
    },
    /// Torque on, at the present position.
    Enable {},
    /// Stop, then torque off.
    Disable {},
    /// Clears a fault.
    ClearFault {
        /// True if its consequence was agreed to.
        is_confirmed: bool,
    },
    /// To a position.
    Absolute {
        /// The position.
        to: f64,
        /// How fast.
        profile: AskedProfile,
    },
    /// By a distance.
    Relative {
        /// The distance.
        by: f64,
        /// How fast.
        profile: AskedProfile,
    },
    /// To a position and back.
    Reciprocate {
        /// The position.
        to: f64,
        /// How many times; until it is ended without it.
        times: Option<u32>,
        /// The standstill at each end.
        dwell: f64,
        /// How fast.
        profile: AskedProfile,
    },
    /// In one direction until it is ended.
    Continuous {
        /// The direction.
        is_forward: bool,
        /// How fast.
        profile: AskedProfile,
    },
    /// At a velocity until it is ended.
    Velocity {
        /// The velocity.
        value: f64,
        /// How fast.
        profile: AskedProfile,
    },
    /// With a torque until it is ended.
    Torque {
        /// The torque.
        value: f64,
        /// The velocity above which the axis is stopped.
        max_velocity: Option<f64>,
    },
    /// Finds the home position.
    Home {
        /// The method (object 6098).
        method: Option<i8>,
    },
}

/// Velocity and acceleration of a motion; the usual ones where none is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AskedProfile {
    velocity: Option<f64>,
    acceleration: Option<f64>,
}

impl Ask {
    /// What is wrong with its numbers, in words.
    pub fn wrong(&self) -> Option<Words> {
        match self {
            Self::Scan { from, to, .. } => {
                let is_right = (1..=127).contains(from) && (*from..=127).contains(to);
                (!is_right).then(|| "node IDs are 1 to 127".into())
            }
            Self::Add { node, .. } => (!(1..=127).contains(node)).then(|| "node IDs are 1 to 127".into()),
            Self::Watch { every_ms, .. } => {
                let (shortest, longest) = (READING_MS.start(), READING_MS.end());
                (!READING_MS.contains(every_ms))
                    .then(|| words!("readings come every {shortest} to {longest} ms", shortest, longest))
            }
            Self::Send { count, period_ms, .. } => {
                let is_right = (1..=FRAMES_AT_MOST).contains(count) && FRAME_PERIOD_MS.contains(period_ms);
                (!is_right).then(|| {
                    let (shortest, longest) = (FRAME_PERIOD_MS.start(), FRAME_PERIOD_MS.end());
                    words!(
                        "a frame is sent 1 to {most} times, every {shortest} to {longest} ms",
                        most = FRAMES_AT_MOST,
                        shortest,
                        longest
                    )
                })
            }
            Self::Task { .. } | Self::Renew {} | Self::End {} => None,
        }
    }
}

impl AskedTask {
    /// Its name, as `takt drive` has it.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Info {} => "info",
            Self::Cycle { .. } => "cycle",
            Self::Enable {} => "enable",
            Self::Disable {} => "disable",
            Self::ClearFault { .. } => "clear_fault",
            Self::Absolute { .. } => "absolute",
            Self::Relative { .. } => "relative",
            Self::Reciprocate { .. } => "reciprocate",
            Self::Continuous { .. } => "continuous",
            Self::Velocity { .. } => "velocity",
            Self::Torque { .. } => "torque",
            Self::Home { .. } => "home",
        }
    }

    /// Returns `true` if the drive may have torque while it runs, or after it.
    pub const fn may_give_torque(&self) -> bool {
        !matches!(self, Self::Info {} | Self::Cycle { .. } | Self::Disable {} | Self::ClearFault { .. })
    }

    /// The task to the drive. `keeps_enabled`: a drive that has torque keeps it afterwards.
    ///
    /// # Errors
    /// A number cannot be one.
    pub fn task(&self, target: &TargetDrive, keeps_enabled: bool) -> Result<Task, Failure> {
        let value = |number| value(target, number);
        let moved = |kind, profile: &AskedProfile| {
            Ok(Task::Move { kind, profile: profile.of(target)?, keeps_enabled })
        };
        Ok(match self {
            Self::Info {} => Task::Info,
            Self::Cycle { write_us } => cycle(*write_us)?,
            Self::Enable {} => Task::Enable { hold_ns: None, keeps_enabled: true },
            Self::Disable {} => Task::Disable,
            Self::ClearFault { is_confirmed } => Task::ClearFault { is_confirmed: *is_confirmed },
            Self::Absolute { to, profile } => {
                return moved(MoveKind::Absolute { to: value(*to), is_immediate: false }, profile);
            }
            Self::Relative { by, profile } => return moved(MoveKind::Relative(value(*by)), profile),
            Self::Reciprocate { to, times, dwell, profile } => {
                let kind = MoveKind::Reciprocate {
                    to: value(*to),
                    times: times.map(|times| times.max(1)),
                    dwell_ns: nanoseconds(*dwell)?,
                };
                return moved(kind, profile);
            }
            Self::Continuous { is_forward, profile } => {
                return moved(MoveKind::Continuous { is_forward: *is_forward, duration_ns: None }, profile);
            }
            Self::Velocity { value: velocity, profile } => Task::Velocity {
                velocity: value(*velocity),
                profile: profile.of(target)?,
                duration_ns: None,
                keeps_enabled,
            },
            Self::Torque { value: torque, max_velocity } => Task::Torque {
                torque: value(*torque),
                velocity_limit: max_velocity.map(|velocity| magnitude(target, velocity)).transpose()?,
                duration_ns: None,
            },
            Self::Home { method } => Task::Home { method: *method, within_ns: HOMING_NS, is_forced: false },
        })
    }
}

impl AskedProfile {
    fn of(&self, target: &TargetDrive) -> Result<MotionProfile, Failure> {
        let read = |value: Option<f64>| value.map(|value| magnitude(target, value)).transpose();
        let acceleration = read(self.acceleration)?;
        Ok(MotionProfile { velocity: read(self.velocity)?, acceleration, deceleration: acceleration })
    }
}

fn cycle(write_us: Option<u32>) -> Result<Task, Failure> {
    let name = COMMUNICATION_CYCLE.to_owned();
    let Some(cycle_us) = write_us else {
        return Ok(Task::Read { names: vec![name], data_type: None });
    };
    if !CYCLES_US.contains(&cycle_us) {
        let longest = CYCLES_US.end();
        return Err(Failure::Unsuitable(format!("a communication cycle has at most {longest} µs")));
    }
    let value = ValueText { text: cycle_us.to_string(), is_raw: true };
    Ok(Task::Write { name, value, data_type: None })
}

/// A number as the page has it: in units, or in those of the drive.
fn value(target: &TargetDrive, number: f64) -> CommandValue {
    match target.has_units() {
        true => CommandValue::Joint(number),
        false => CommandValue::Drive(number.round() as i64),
    }
}

/// How fast, or how soon: no direction.
fn magnitude(target: &TargetDrive, number: f64) -> Result<CommandValue, Failure> {
    if number < 0.0 {
        let words = format!("{number} is below zero: a limit and a profile have no direction");
        return Err(Failure::Unsuitable(words));
    }
    Ok(value(target, number))
}

fn nanoseconds(seconds: f64) -> Result<Nanoseconds, Failure> {
    match (0.0..=LONGEST_S).contains(&seconds) {
        true => Ok((seconds * 1e9).round() as Nanoseconds),
        false => Err(Failure::Unsuitable(format!("{seconds} s: a time is 0 s to {LONGEST_S} s"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt::family;

    fn parsed(text: &str) -> Result<Ask, String> {
        serde_json::from_str(text).map_err(|error| error.to_string())
    }

    #[test]
    fn a_task_is_read_from_its_word_and_its_numbers() {
        let ask = parsed(
            r#"{"do":"task","drive":1,"task":{"kind":"absolute","to":0.5,"profile":{"velocity":0.2,"acceleration":null}}}"#,
        );
        let profile = AskedProfile { velocity: Some(0.2), acceleration: None };
        let task = AskedTask::Absolute { to: 0.5, profile };
        assert_eq!(ask, Ok(Ask::Task { drive: 1, task, held: false }));
        for wrong in [
            r#"{"do":"task","drive":1,"task":{"kind":"explode"}}"#,
            r#"{"do":"task","drive":-1,"task":{"kind":"info"}}"#,
            r#"{"do":"task","drive":1,"task":{"kind":"torque","value":1e999,"max_velocity":null}}"#,
            r#"{"do":"scan","bus":0,"from":1,"to":300}"#,
            r#"{"do":"scan","bus":0,"from":1,"to":3,"stop_motors":true}"#,
        ] {
            assert!(parsed(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_drive_that_has_torque_keeps_it_after_a_move_and_one_that_has_none_loses_it() {
        let target = TargetDrive::unconfigured(1, family::EROB_CANOPEN).unwrap();
        let task = AskedTask::Relative { by: 0.1, profile: AskedProfile::default() };
        for keeps in [true, false] {
            let task = task.task(&target, keeps).unwrap();
            assert!(matches!(task, Task::Move { keeps_enabled, .. } if keeps_enabled == keeps), "{task:?}");
        }
    }

    #[test]
    fn a_profile_a_time_and_a_number_of_frames_have_bounds() {
        let target = TargetDrive::unconfigured(1, family::EROB_CANOPEN).unwrap();
        let backwards = AskedProfile { velocity: Some(-0.1), acceleration: None };
        assert!(AskedTask::Relative { by: 0.1, profile: backwards }.task(&target, false).is_err());
        let profile = AskedProfile::default();
        let dwelling = AskedTask::Reciprocate { to: 0.1, times: Some(1), dwell: -1.0, profile };
        assert!(dwelling.task(&target, false).is_err());
        let send = |count, period_ms| Ask::Send { bus: 0, frame: String::new(), count, period_ms };
        assert!(send(0, 100).wrong().is_some() && send(2000, 100).wrong().is_some());
        assert!(send(1, 1).wrong().is_some() && send(1000, 10).wrong().is_none());
    }
}
