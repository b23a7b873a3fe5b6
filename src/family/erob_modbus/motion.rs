//! The motions of a drive: absolute, relative, reciprocating, continuous, by velocity and by torque (eRob Modbus-RTU manual,
//! chapter 5).
//!
//! Every motion ends with the motor at rest and disabled, whether it arrives, is interrupted, or fails.

use std::fmt;
use std::num::NonZeroU32;

use takt_rt::Nanoseconds;

use super::drive::{AccessError, ErobDrive, MotionStatus, ReachedStatus, Status};
use super::fault_code::FaultCode;
use super::registers;
use crate::modbus::exception::ExceptionCode;
use crate::procedure::AxisReading;

/// From one reading of a moving joint to the next.
const READING_NS: Nanoseconds = 50_000_000;
/// From enabling to the start of a motion, and to a set-point.
const ENABLED_NS: Nanoseconds = 500_000_000;
/// A drive may be busy so long after power-on (the vendor's other manuals; this one says nothing of it).
const POWER_UP_NS: Nanoseconds = 8_000_000_000;
/// From one attempt to enable to the next, while the drive starts.
const AGAIN_NS: Nanoseconds = 500_000_000;
/// A motion may take so much longer than its profile.
const PATIENCE_NS: Nanoseconds = 5_000_000_000;
/// A joint slower than this stands: counts/s. The readings of a joint at rest are not quite 0.
const STANDING: i32 = 300;

/// The profile of position and velocity control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Profile {
    /// counts/s, not negative
    pub velocity: i32,
    /// counts/s²
    pub acceleration: u32,
    /// counts/s²
    pub deceleration: u32,
}

/// A motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// None: the motor holds the joint where it is, until it is interrupted.
    Hold,
    /// To a position: counts.
    To(i32, Profile),
    /// By a distance: counts.
    By(i32, Profile),
    /// To a position and back, again and again, until it is interrupted.
    Reciprocating {
        /// counts
        target: i32,
        /// How long it stays at each end: times of 0.05 ms.
        dwell: u32,
        /// The profile.
        profile: Profile,
    },
    /// At the velocity of the profile, in a direction, until it is interrupted.
    Continuous(Direction, Profile),
    /// At a velocity by velocity control, until it is interrupted: counts/s. That of the profile is not used.
    Velocity(i32, Profile),
    /// With a current, until it is interrupted.
    Torque {
        /// mA
        current: i32,
        /// counts/s. In the manual this is 0, and the joint moves: so 0 may be no limit, and is not taken.
        velocity_limit: NonZeroU32,
    },
}

/// The direction of a continuous motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Towards higher counts.
    Forward,
    /// Towards lower counts.
    Backward,
}

/// A motion, and when it ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// The motion.
    pub motion: Motion,
    /// How long a motion lasts that does not end by itself; `None`: until it is interrupted.
    pub duration_ns: Option<Nanoseconds>,
    /// Whether the motor stays enabled at the end.
    pub keeps_enabled: bool,
}

impl From<Motion> for Run {
    /// A motion to its own end, or until it is interrupted.
    fn from(motion: Motion) -> Self {
        Self { motion, duration_ns: None, keeps_enabled: false }
    }
}

/// How a motion has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ended {
    /// Why.
    pub end: End,
    /// Where the joint is at rest: counts.
    pub position: i32,
}

/// Why a motion has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// It has arrived.
    Arrived,
    /// Its time was over, and it was stopped.
    TimeOver,
    /// It was interrupted, and stopped.
    Interrupted,
}

/// Why a motion has failed. The motor is disabled, as far as it can be told to.
#[derive(Clone, Debug, PartialEq)]
pub enum MotionFailure {
    /// A register could not be read or written.
    Access(AccessError),
    /// The drive shows a fault.
    Drive(FaultCode),
    /// The drive has taken the command to enable, and its motor is off.
    NotEnabled,
    /// The motion lasts longer than its profile allows.
    TooLong {
        /// Where the joint is: counts.
        position: i32,
    },
    /// The joint did not come to rest.
    NotStopped {
        /// Its velocity: counts/s.
        velocity: i32,
    },
}

impl From<AccessError> for MotionFailure {
    fn from(error: AccessError) -> Self {
        Self::Access(error)
    }
}

impl std::error::Error for MotionFailure {}

impl fmt::Display for MotionFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Access(error) => error.fmt(f),
            Self::Drive(code) => code.fmt(f),
            Self::NotEnabled => {
                write!(
                    f,
                    "the drive was told to enable its motor, which is off: see its safety inputs and its supply"
                )
            }
            Self::TooLong { position } => {
                write!(
                    f,
                    "the joint has not arrived in the time that its profile allows; it is at {position} counts"
                )
            }
            Self::NotStopped { velocity } => {
                write!(f, "the joint was told to stop and still moves at {velocity} counts/s")
            }
        }
    }
}

type Moving<T> = Result<T, MotionFailure>;

/// Carries out a motion: prepares it, enables the motor, starts, watches the joint, stops it, and disables the motor.
///
/// An interruption of the session stops the joint with the profile deceleration; a second one disables the motor at once.
///
/// # Errors
/// See [`MotionFailure`].
pub async fn carry_out(drive: &ErobDrive, run: impl Into<Run>) -> Moving<Ended> {
    let run = run.into();
    let session = drive.session();
    let outcome = whole(drive, run).await;
    if outcome.is_err() {
        session.keep_failing_step();
    }
    let stays = matches!(outcome, Ok(End::Arrived | End::TimeOver)) && run.keeps_enabled;
    let disabled = if stays {
        session.note("the joint stays enabled");
        Ok(())
    } else {
        session.step("disable");
        drive.write(&registers::MOTOR_ENABLE, 0).await
    };
    let cleared = match run.motion {
        // What is left there would make the next absolute move a relative one.
        Motion::By(..) => drive.write(&registers::RELATIVE_POSITION, 0).await,
        _ => Ok(()),
    };
    let end = outcome?;
    disabled?;
    cleared?;
    Ok(Ended { end, position: drive.read(&registers::ACTUAL_POSITION).await? as i32 })
}

async fn whole(drive: &ErobDrive, run: Run) -> Moving<End> {
    let motion = run.motion;
    let session = drive.session();
    session.step("read the fault code");
    check(drive.fault().await?)?;
    session.step("disable");
    drive.write(&registers::MOTOR_ENABLE, 0).await?;
    prepare(drive, motion).await?;
    if session.is_interrupted() {
        return Ok(End::Interrupted);
    }
    session.step("enable");
    enable(drive).await?;
    check(drive.wait(ENABLED_NS).await?)?;
    if session.is_interrupted() {
        return Ok(End::Interrupted);
    }
    let status = drive.status().await?;
    if status.reached == ReachedStatus::MotorOff {
        return Err(MotionFailure::NotEnabled);
    }
    let from = status.position;
    let distance = start(drive, motion, from).await?;
    session.step("move");
    let end = watch(drive, run, from, distance).await?;
    if end != End::Arrived {
        session.ignore_interruptions();
        stop(drive, motion, from).await?;
    }
    Ok(end)
}

fn check(fault: Option<FaultCode>) -> Moving<()> {
    fault.map_or(Ok(()), |code| Err(MotionFailure::Drive(code)))
}

/// Writes what must be written before the motor is enabled.
async fn prepare(drive: &ErobDrive, motion: Motion) -> Moving<()> {
    /// Register 0x0040.
    const TORQUE: i64 = 1;
    const VELOCITY: i64 = 2;
    const POSITION: i64 = 3;
    let session = drive.session();
    session.step("set the operation mode");
    let (mode, profile) = match motion {
        Motion::Torque { .. } => (TORQUE, None),
        Motion::Velocity(_, profile) => (VELOCITY, Some(profile)),
        Motion::To(_, profile)
        | Motion::By(_, profile)
        | Motion::Reciprocating { profile, .. }
        | Motion::Continuous(_, profile) => (POSITION, Some(profile)),
        Motion::Hold => (POSITION, None),
    };
    drive.write(&registers::OPERATION_MODE, mode).await?;
    drive.write(&registers::CONTROL_SOURCE, 0).await?;
    let motion_mode = match motion {
        Motion::Continuous(..) => Some(0),
        Motion::To(..) | Motion::By(..) => Some(1),
        Motion::Reciprocating { .. } => Some(2),
        Motion::Hold | Motion::Velocity(..) | Motion::Torque { .. } => None,
    };
    if let Some(motion_mode) = motion_mode {
        drive.write(&registers::MOTION_MODE, motion_mode).await?;
    }
    session.step("set the profile");
    if let Some(profile) = profile {
        drive.write(&registers::PROFILE_ACCELERATION, profile.acceleration.into()).await?;
        drive.write(&registers::PROFILE_DECELERATION, profile.deceleration.into()).await?;
    }
    match motion {
        Motion::Hold => {}
        Motion::Velocity(..) => drive.write(&registers::TARGET_VELOCITY, 0).await?,
        Motion::Torque { velocity_limit, .. } => {
            drive.write(&registers::TORQUE_VELOCITY_LIMIT, velocity_limit.get().into()).await?;
            drive.write(&registers::TARGET_CURRENT, 0).await?;
        }
        Motion::To(_, Profile { velocity, .. })
        | Motion::By(_, Profile { velocity, .. })
        | Motion::Reciprocating { profile: Profile { velocity, .. }, .. }
        | Motion::Continuous(_, Profile { velocity, .. }) => {
            let is_backward = matches!(motion, Motion::Continuous(Direction::Backward, _));
            let velocity = i64::from(velocity);
            let signed = if is_backward { -velocity } else { velocity };
            drive.write(&registers::PROFILE_VELOCITY, signed).await?;
        }
    }
    match motion {
        // A relative target that is not 0 makes the move a relative one.
        Motion::To(..) => drive.write(&registers::RELATIVE_POSITION, 0).await?,
        Motion::Reciprocating { dwell, .. } => {
            drive.write(&registers::RELATIVE_POSITION, 0).await?;
            drive.write(&registers::DWELL_TIME, dwell.into()).await?;
        }
        Motion::Hold
        | Motion::By(..)
        | Motion::Continuous(..)
        | Motion::Velocity(..)
        | Motion::Torque { .. } => {}
    }
    Ok(())
}

/// Enables the motor. A drive that was just switched on is given the time that it needs.
async fn enable(drive: &ErobDrive) -> Moving<()> {
    let session = drive.session();
    let end_ns = session.now_ns().saturating_add(POWER_UP_NS);
    let mut is_told = false;
    loop {
        let Err(error) = drive.write(&registers::MOTOR_ENABLE, 1).await else { return Ok(()) };
        let is_starting = error.is_refusal(ExceptionCode::BUSY);
        if !is_starting || session.now_ns() >= end_ns || session.is_interrupted() {
            check(drive.fault().await?)?;
            return Err(error.into());
        }
        if !is_told {
            session.note("the drive is busy, as it is for some seconds after power-on");
            is_told = true;
        }
        check(drive.wait(AGAIN_NS).await?)?;
    }
}

/// Starts the motion. Returns the distance that it has before it in counts, if it ends by itself.
async fn start(drive: &ErobDrive, motion: Motion, here: i32) -> Moving<Option<i64>> {
    drive.session().step("start");
    let way = match motion {
        Motion::Hold => return Ok(None),
        Motion::Velocity(velocity, _) => {
            drive.write(&registers::TARGET_VELOCITY, velocity.into()).await?;
            return Ok(None);
        }
        Motion::Torque { current, .. } => {
            drive.write(&registers::TARGET_CURRENT, current.into()).await?;
            return Ok(None);
        }
        Motion::Continuous(..) => None,
        Motion::To(target, _) => {
            drive.write(&registers::TARGET_POSITION, target.into()).await?;
            Some(i64::from(target) - i64::from(here))
        }
        Motion::By(distance, _) => Some(distance.into()),
        Motion::Reciprocating { target, .. } => {
            drive.write(&registers::TARGET_POSITION, target.into()).await?;
            None
        }
    };
    if way == Some(0) {
        return Ok(way);
    }
    if let Motion::By(distance, _) = motion {
        drive.write(&registers::RELATIVE_POSITION, distance.into()).await?;
    }
    drive.write(&registers::START_MOTION, 1).await?;
    Ok(way)
}

/// Watches the joint until it arrives or the session is interrupted.
async fn watch(drive: &ErobDrive, run: Run, from: i32, distance: Option<i64>) -> Moving<End> {
    let motion = run.motion;
    let session = drive.session();
    let began_ns = session.now_ns();
    let longest_ns = distance.map(|distance| longest_ns(motion, distance));
    loop {
        if session.is_interrupted() {
            return Ok(End::Interrupted);
        }
        let status = read(drive).await?;
        if let Some(longest_ns) = longest_ns {
            let is_resting = distance == Some(0)
                || status.reached == ReachedStatus::Reached
                    && status.motion == MotionStatus::Stopped
                    && status.velocity.saturating_abs() <= STANDING;
            if is_resting {
                return Ok(End::Arrived);
            }
            if session.now_ns().saturating_sub(began_ns) > longest_ns {
                stop(drive, motion, from).await?;
                return Err(MotionFailure::TooLong { position: status.position });
            }
        } else if run.duration_ns.is_some_and(|duration_ns| session.now_ns() - began_ns >= duration_ns) {
            return Ok(End::TimeOver);
        }
        session.sleep(READING_NS).await;
    }
}

/// Reads what the drive does, and shows it. A fault ends the motion.
async fn read(drive: &ErobDrive) -> Moving<Status> {
    let status = drive.status().await?;
    drive.session().show(reading(drive.session().now_ns(), status));
    check(status.fault)?;
    Ok(status)
}

/// The longest time of a motion over a distance by its profile: ramps up and down, and the way at its velocity.
fn longest_ns(motion: Motion, distance: i64) -> Nanoseconds {
    let (Motion::To(_, profile) | Motion::By(_, profile)) = motion else { return Nanoseconds::MAX };
    let velocity = f64::from(profile.velocity.max(1));
    let rate = |rate: u32| f64::from(rate.max(1));
    let ramps_s = velocity / rate(profile.acceleration) + velocity / rate(profile.deceleration);
    let way_s = distance.unsigned_abs() as f64 / velocity;
    // A float that is too large becomes the largest integer.
    PATIENCE_NS.saturating_add((1e9 * (2.0 * way_s + ramps_s)) as Nanoseconds)
}

/// Stops the joint, and waits until it stands. A further interruption ends the wait.
async fn stop(drive: &ErobDrive, motion: Motion, from: i32) -> Moving<()> {
    let session = drive.session();
    let register = match motion {
        Motion::Hold => return Ok(()),
        Motion::Velocity(..) => registers::TARGET_VELOCITY,
        Motion::Torque { .. } => registers::TARGET_CURRENT,
        Motion::Reciprocating { .. } => registers::STOP_RECIPROCATION,
        Motion::To(..) | Motion::By(..) | Motion::Continuous(..) => registers::STOP_MOTION,
    };
    session.step("stop");
    drive.write(&register, 0).await?;
    let end_ns = session.now_ns().saturating_add(stopping_ns(motion, from));
    loop {
        let status = read(drive).await?;
        // A reciprocating joint also stands at its ends, while it goes on.
        let has_ended =
            !matches!(motion, Motion::Reciprocating { .. }) || status.motion != MotionStatus::Moving;
        if has_ended && status.velocity.saturating_abs() <= STANDING || session.is_interrupted() {
            return Ok(());
        }
        if session.now_ns() >= end_ns {
            return Err(MotionFailure::NotStopped { velocity: status.velocity });
        }
        session.sleep(READING_NS).await;
    }
}

/// The longest time that a stop takes, of a motion that has begun at a position.
fn stopping_ns(motion: Motion, from: i32) -> Nanoseconds {
    let (velocity, deceleration) = match motion {
        Motion::Velocity(velocity, profile) => (velocity.saturating_abs(), profile.deceleration),
        // Friction alone stops it.
        Motion::Hold | Motion::Torque { .. } => return PATIENCE_NS,
        // It goes on to one of its ends.
        Motion::Reciprocating { target, dwell, profile } => {
            let leg = i64::from(target) - i64::from(from);
            let dwell_ns = u64::from(dwell).saturating_mul(50_000);
            return longest_ns(Motion::To(target, profile), leg).saturating_add(dwell_ns);
        }
        Motion::To(_, profile) | Motion::By(_, profile) | Motion::Continuous(_, profile) => {
            (profile.velocity, profile.deceleration)
        }
    };
    let ramp_s = f64::from(velocity) / f64::from(deceleration.max(1));
    PATIENCE_NS.saturating_add((1e9 * ramp_s) as Nanoseconds)
}

fn reading(at_ns: Nanoseconds, status: Status) -> AxisReading {
    /// Counts of a turn of the output (the vendor's other manuals; this one does not say).
    const COUNTS_PER_RADIAN: f64 = 524_288.0 / std::f64::consts::TAU;
    AxisReading {
        at_ns,
        position: f64::from(status.position) / COUNTS_PER_RADIAN,
        position_counts: status.position.into(),
        velocity: f64::from(status.velocity) / COUNTS_PER_RADIAN,
        torque: None,
        current_a: Some(f64::from(status.current_ma) / 1000.0),
        temperature_c: Some(status.temperature_c.into()),
        statusword: None,
        state: "enabled",
    }
}
