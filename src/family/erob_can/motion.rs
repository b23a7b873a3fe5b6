//! The motions of a drive: absolute, relative, reciprocating, continuous, by velocity and by torque (eRunner manual 7.4 and
//! chapter 4).
//!
//! Every motion ends with the motor at rest and disabled, whether it arrives, is interrupted, or fails.

use std::fmt;

use takt_rt::Nanoseconds;

use crate::erob_can::client::{RequestError, RequestFailure};
use crate::erob_can::entries::{self, Entry};
use crate::procedure::{AxisReading, ErobCanSession};

/// From one reading of a moving joint to the next.
const READING_NS: Nanoseconds = 50_000_000;
/// From enabling to the start of a motion, and to a set-point (eRob Modbus-RTU manual; this manual says nothing of it).
const ENABLED_NS: Nanoseconds = 500_000_000;
/// A drive can be enabled so long after power-on (cure of the errors 001F and 0056).
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
    /// counts/s²; at most three times the velocity is advised
    pub acceleration: i32,
    /// counts/s²; at most three times the velocity is advised
    pub deceleration: i32,
}

/// A motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// To a position: counts.
    To(i32, Profile),
    /// By a distance: counts.
    By(i32, Profile),
    /// To a position and back, again and again, until it is interrupted: counts.
    ReciprocatingTo(i32, Profile),
    /// By a distance and back, again and again, until it is interrupted: counts.
    ReciprocatingBy(i32, Profile),
    /// At the velocity of the profile, in a direction, until it is interrupted.
    Continuous(Direction, Profile),
    /// At a velocity by velocity control, until it is interrupted: counts/s. That of the profile is not used.
    Velocity(i32, Profile),
    /// With a current, until it is interrupted.
    Torque {
        /// mA
        current: i32,
        /// counts/s that the joint never exceeds
        velocity_limit: i32,
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

/// Operating mode, object 004E.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
enum OperatingMode {
    Torque = 1,
    Velocity = 2,
    Position = 3,
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
    /// It was interrupted, and stopped.
    Interrupted,
}

/// Why a motion has failed. The motor is disabled, as far as it can be told to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionFailure {
    /// A request has failed.
    Request(RequestError),
    /// The drive shows an error: index 001F.
    Drive {
        /// The error code.
        code: i32,
    },
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

impl From<RequestError> for MotionFailure {
    fn from(error: RequestError) -> Self {
        Self::Request(error)
    }
}

impl std::error::Error for MotionFailure {}

impl fmt::Display for MotionFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Request(error) => error.fmt(f),
            Self::Drive { code } => write!(
                f,
                "the drive shows error 0x{code:04X} (appendix 2 of the eRob user manual); disable it, mend the cause, and \
                 switch the power off and on if the error stays"
            ),
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
pub async fn carry_out(session: &ErobCanSession, motion: Motion) -> Moving<Ended> {
    let outcome = run(session, motion).await;
    if outcome.is_err() {
        session.keep_failing_step();
    }
    session.step("disable");
    let disabled = session.write(&entries::MOTOR_ENABLE, 0).await;
    let end = outcome?;
    disabled?;
    Ok(Ended { end, position: session.read(&entries::ACTUAL_POSITION).await? })
}

async fn run(session: &ErobCanSession, motion: Motion) -> Moving<End> {
    session.step("read the error code");
    check_error(session).await?;
    session.step("disable");
    session.write(&entries::MOTOR_ENABLE, 0).await?;
    prepare(session, motion).await?;
    if session.is_interrupted() {
        return Ok(End::Interrupted);
    }
    session.step("enable");
    enable(session).await?;
    session.sleep(ENABLED_NS).await;
    let distance = start(session, motion).await?;
    session.step("move");
    let end = watch(session, motion, distance).await?;
    if end == End::Interrupted {
        session.ignore_interruptions();
        stop(session, motion).await?;
    }
    Ok(end)
}

/// Writes what must be written before the motor is enabled.
async fn prepare(session: &ErobCanSession, motion: Motion) -> Moving<()> {
    session.step("set the operating mode");
    let (mode, profile) = match motion {
        Motion::Torque { .. } => (OperatingMode::Torque, None),
        Motion::Velocity(_, profile) => (OperatingMode::Velocity, Some(profile)),
        Motion::To(_, profile)
        | Motion::By(_, profile)
        | Motion::ReciprocatingTo(_, profile)
        | Motion::ReciprocatingBy(_, profile)
        | Motion::Continuous(_, profile) => (OperatingMode::Position, Some(profile)),
    };
    set(session, &entries::OPERATING_MODE, mode as i32).await?;
    if mode != OperatingMode::Position {
        session.write(&entries::CONTROL_SOURCE, 0).await?;
        session.write(&entries::ANALOGUE_TYPE, 0).await?;
        // The motor turns at once when it is enabled, if this is not 0.
        session.write(&entries::SET_POINT, 0).await?;
    }
    session.step("set the profile");
    if let Some(profile) = profile {
        session.write(&entries::PROFILE_ACCELERATION, profile.acceleration).await?;
        session.write(&entries::PROFILE_DECELERATION, profile.deceleration).await?;
    }
    match motion {
        Motion::Continuous(Direction::Backward, profile) => {
            session.write(&entries::PROFILE_VELOCITY, profile.velocity.saturating_neg()).await?;
        }
        // It is locked while the motor is enabled.
        Motion::Torque { velocity_limit, .. } => {
            set(session, &entries::TORQUE_VELOCITY_LIMIT, velocity_limit).await?;
        }
        Motion::Velocity(..) => {}
        _ => {
            if let Some(profile) = profile {
                session.write(&entries::PROFILE_VELOCITY, profile.velocity).await?;
            }
        }
    }
    let motion_mode = match motion {
        Motion::Continuous(..) => 0,
        Motion::To(..) | Motion::By(..) => 1,
        Motion::ReciprocatingTo(..) | Motion::ReciprocatingBy(..) => 2,
        Motion::Velocity(..) | Motion::Torque { .. } => return Ok(()),
    };
    session.write(&entries::MOTION_MODE, motion_mode).await?;
    Ok(())
}

/// Writes a setting if it is another one: some are locked at times, and a write may wear out a memory.
async fn set(session: &ErobCanSession, entry: &Entry, value: i32) -> Moving<()> {
    if session.read(entry).await? != value {
        session.write(entry, value).await?;
    }
    Ok(())
}

/// Enables the motor. A drive that was just switched on is given the time that it needs.
async fn enable(session: &ErobCanSession) -> Moving<()> {
    let end_ns = session.now_ns().saturating_add(POWER_UP_NS);
    let mut is_told = false;
    loop {
        let Err(error) = session.write(&entries::MOTOR_ENABLE, 1).await else { return Ok(()) };
        let is_starting =
            matches!(error.failure, RequestFailure::Refused(Some(code)) if code.is_of_power_up());
        if !is_starting || session.now_ns() >= end_ns || session.is_interrupted() {
            check_error(session).await?;
            return Err(error.into());
        }
        if !is_told {
            session.note("the drive has just been switched on: it can be enabled 8 s after that");
            is_told = true;
        }
        session.sleep(AGAIN_NS).await;
    }
}

/// Starts the motion. Returns the distance that it has before it in counts, if it ends by itself.
async fn start(session: &ErobCanSession, motion: Motion) -> Moving<Option<i64>> {
    session.step("start");
    let here = i64::from(session.read(&entries::ACTUAL_POSITION).await?);
    let (distance, way) = match motion {
        Motion::Velocity(velocity, _) => {
            session.write(&entries::SET_POINT, velocity).await?;
            return Ok(None);
        }
        Motion::Torque { current, .. } => {
            session.write(&entries::SET_POINT, current).await?;
            return Ok(None);
        }
        Motion::Continuous(..) => (None, None),
        Motion::To(target, _) => (Some(0), Some(i64::from(target) - here)),
        Motion::By(distance, _) => (Some(distance), Some(distance.into())),
        Motion::ReciprocatingTo(..) => (Some(0), None),
        Motion::ReciprocatingBy(distance, _) => (Some(distance), None),
    };
    if way == Some(0) {
        return Ok(way);
    }
    if let Some(distance) = distance {
        // 0 makes the move an absolute one.
        session.write(&entries::RELATIVE_POSITION, distance).await?;
    }
    if let Motion::To(target, _) | Motion::ReciprocatingTo(target, _) = motion {
        session.write(&entries::TARGET_POSITION, target).await?;
    }
    session.command(&entries::START_MOTION).await?;
    Ok(way)
}

/// Watches the joint until it arrives or the session is interrupted.
async fn watch(session: &ErobCanSession, motion: Motion, distance: Option<i64>) -> Moving<End> {
    let began_ns = session.now_ns();
    let longest_ns = distance.map(|distance| longest_ns(motion, distance));
    loop {
        if session.is_interrupted() {
            return Ok(End::Interrupted);
        }
        let position = session.read(&entries::ACTUAL_POSITION).await?;
        let velocity = session.read(&entries::ACTUAL_VELOCITY).await?;
        let current_ma = session.read(&entries::MOTOR_CURRENT).await?;
        session.show(reading(session.now_ns(), position, velocity, current_ma));
        check_error(session).await?;
        if let Some(longest_ns) = longest_ns {
            let is_resting = distance == Some(0)
                || session.read(&entries::RUNNING_STATE).await? == 0 && velocity.saturating_abs() <= STANDING;
            if is_resting {
                return Ok(End::Arrived);
            }
            if session.now_ns().saturating_sub(began_ns) > longest_ns {
                stop(session, motion).await?;
                return Err(MotionFailure::TooLong { position });
            }
        }
        session.sleep(READING_NS).await;
    }
}

/// The longest time of a motion over a distance by its profile: ramps up and down, and the way at its velocity.
fn longest_ns(motion: Motion, distance: i64) -> Nanoseconds {
    let (Motion::To(_, profile) | Motion::By(_, profile)) = motion else { return Nanoseconds::MAX };
    let positive = |value: i32| f64::from(value.max(1));
    let velocity = positive(profile.velocity);
    let ramps_s = velocity / positive(profile.acceleration) + velocity / positive(profile.deceleration);
    let way_s = distance.unsigned_abs() as f64 / velocity;
    // A float that is too large becomes the largest integer.
    PATIENCE_NS.saturating_add((1e9 * (2.0 * way_s + ramps_s)) as Nanoseconds)
}

/// Stops the joint, and waits until it stands. A further interruption ends the wait.
async fn stop(session: &ErobCanSession, motion: Motion) -> Moving<()> {
    session.step("stop");
    match motion {
        Motion::Velocity(..) | Motion::Torque { .. } => session.write(&entries::SET_POINT, 0).await?,
        _ => session.command(&entries::STOP_MOTION).await?,
    }
    let end_ns = session.now_ns().saturating_add(stopping_ns(motion));
    loop {
        let velocity = session.read(&entries::ACTUAL_VELOCITY).await?;
        if velocity.saturating_abs() <= STANDING || session.is_interrupted() {
            return Ok(());
        }
        if session.now_ns() >= end_ns {
            return Err(MotionFailure::NotStopped { velocity });
        }
        session.sleep(READING_NS).await;
    }
}

/// The longest time that a stop takes.
fn stopping_ns(motion: Motion) -> Nanoseconds {
    let (velocity, deceleration) = match motion {
        Motion::Velocity(velocity, profile) => (velocity.saturating_abs(), profile.deceleration),
        // Friction alone stops it.
        Motion::Torque { .. } => return PATIENCE_NS,
        Motion::To(_, profile)
        | Motion::By(_, profile)
        | Motion::ReciprocatingTo(_, profile)
        | Motion::ReciprocatingBy(_, profile)
        | Motion::Continuous(_, profile) => (profile.velocity, profile.deceleration),
    };
    let ramp_s = f64::from(velocity) / f64::from(deceleration.max(1));
    PATIENCE_NS.saturating_add((1e9 * ramp_s) as Nanoseconds)
}

async fn check_error(session: &ErobCanSession) -> Moving<()> {
    match session.read(&entries::ERROR_CODE).await? {
        0 => Ok(()),
        code => Err(MotionFailure::Drive { code }),
    }
}

fn reading(at_ns: Nanoseconds, position: i32, velocity: i32, current_ma: i32) -> AxisReading {
    /// Counts of a turn of the output (eRunner manual: a single-turn model counts 0 to 524287).
    const COUNTS_PER_RADIAN: f64 = 524_288.0 / std::f64::consts::TAU;
    AxisReading {
        at_ns,
        position: f64::from(position) / COUNTS_PER_RADIAN,
        position_counts: position.into(),
        velocity: f64::from(velocity) / COUNTS_PER_RADIAN,
        torque: None,
        current_a: Some(f64::from(current_ma) / 1000.0),
        statusword: 0,
        state: "enabled",
    }
}
