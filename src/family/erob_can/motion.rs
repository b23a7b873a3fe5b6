//! The motions of a drive: absolute, relative, reciprocating, continuous, by velocity and by torque (eRunner manual 7.4 and
//! chapter 4).
//!
//! Every motion ends with the motor at rest and disabled, whether it arrives, is interrupted, or fails. It stays enabled at rest
//! only where that is asked for, and nothing has failed.

use std::fmt;

use takt_rt::Nanoseconds;

use super::facts::ENABLED_FROM_NS;
use super::reading::{self, STANDING};
use crate::erob_can::client::{RequestError, RequestFailure};
use crate::erob_can::entries::{self, Entry};
use crate::family::commission::{Failure, TargetDrive};
use crate::family::erob_can::session::ErobCanSession;
use crate::procedure::AxisReading;

/// From one reading of a moving joint to the next.
const READING_NS: Nanoseconds = 50_000_000;
/// From enabling to the start of a motion, and to a set-point (eRob Modbus-RTU manual; this manual says nothing of it).
const ENABLED_NS: Nanoseconds = 500_000_000;
/// From one attempt to enable to the next, while the drive starts.
const AGAIN_NS: Nanoseconds = 500_000_000;
/// A motion may take so much longer than its profile.
const PATIENCE_NS: Nanoseconds = 5_000_000_000;
/// In torque control the drive holds the velocity limit. Beyond this share of it the joint is stopped from here.
const BEYOND_LIMIT: f64 = 1.25;

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
    /// None: the joint is held where it is.
    Hold,
    /// To a position: counts.
    To(i32, Profile),
    /// By a distance: counts.
    By(i32, Profile),
    /// To a position and back, so many times, one absolute move after the other.
    BackAndForth {
        /// counts
        to: i32,
        /// How often.
        times: u32,
        /// The time at each end.
        dwell_ns: Nanoseconds,
        /// The profile of each move.
        profile: Profile,
    },
    /// To a position and back by the drive itself, again and again.
    ReciprocatingTo {
        /// counts
        to: i32,
        /// The time at each end.
        dwell_ns: Nanoseconds,
        /// The profile.
        profile: Profile,
    },
    /// At the velocity of the profile, in a direction.
    Continuous(Direction, Profile),
    /// At a velocity by velocity control: counts/s. That of the profile is not used.
    Velocity(i32, Profile),
    /// With a current.
    Torque {
        /// mA
        current: i32,
        /// counts/s that the joint never exceeds
        velocity_limit: i32,
    },
}

impl Motion {
    const fn profile(self) -> Option<Profile> {
        match self {
            Self::To(_, profile)
            | Self::By(_, profile)
            | Self::BackAndForth { profile, .. }
            | Self::ReciprocatingTo { profile, .. }
            | Self::Continuous(_, profile)
            | Self::Velocity(_, profile) => Some(profile),
            Self::Hold | Self::Torque { .. } => None,
        }
    }

    /// Whether the drive has a target for it, which was compared with the limits of the axis beforehand.
    const fn has_target(self) -> bool {
        matches!(
            self,
            Self::Hold
                | Self::To(..)
                | Self::By(..)
                | Self::BackAndForth { .. }
                | Self::ReciprocatingTo { .. }
        )
    }
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
pub enum OperatingMode {
    /// The set-point is a current: mA.
    Torque = 1,
    /// The set-point is a velocity: counts/s.
    Velocity = 2,
    /// Moves, and motion without end.
    Position = 3,
}

/// A motion, and when it ends.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// The motion.
    pub motion: Motion,
    /// How long a motion lasts that does not end by itself; `None`: until it is interrupted.
    pub duration_ns: Option<Nanoseconds>,
    /// Whether the motor stays enabled at the end.
    pub keeps_enabled: bool,
    /// The drive: units and limits of its axis.
    pub target: &'a TargetDrive,
}

/// How a motion has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ended {
    /// Why.
    pub end: End,
    /// Where the joint was before: counts.
    pub from: i32,
    /// Where the joint is at rest: counts.
    pub position: i32,
    /// The highest velocity that was read: rad/s (m/s).
    pub fastest: f64,
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
    /// A request has failed.
    Request(RequestError),
    /// The drive shows an error: index 001F.
    Drive {
        /// The error code.
        code: i32,
    },
    /// The motion lasts longer than its profile allows. It was stopped.
    TooLong {
        /// Where the joint is: counts.
        position: i32,
    },
    /// The joint did not come to rest.
    NotStopped {
        /// Its velocity: counts/s.
        velocity: i32,
    },
    /// The joint has come to a limit of its axis. It was stopped.
    Limit(Failure),
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
            Self::Drive { code } => write!(f, "the drive shows error 0x{code:04X}"),
            Self::TooLong { position } => {
                write!(
                    f,
                    "the joint has not arrived in the time that its profile allows; it is at {position} counts"
                )
            }
            Self::NotStopped { velocity } => {
                write!(f, "the joint was told to stop and still moves at {velocity} counts/s")
            }
            Self::Limit(failure) => failure.fmt(f),
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
pub async fn carry_out(session: &ErobCanSession, run: Run<'_>) -> Moving<Ended> {
    let mut fastest = 0.0;
    let outcome = whole(session, run, &mut fastest).await;
    if outcome.is_err() {
        session.keep_failing_step();
    }
    session.ignore_interruptions();
    let stays = matches!(outcome, Ok((End::Arrived | End::TimeOver, _))) && run.keeps_enabled;
    if stays {
        session.note("the axis stays enabled");
    } else {
        session.step("disable");
        if let Err(error) = session.write(&entries::MOTOR_ENABLE, 0).await {
            session.note(format!("the axis may still be moving: {error}; use the emergency stop"));
            outcome?;
            return Err(error.into());
        }
    }
    let (end, from) = outcome?;
    Ok(Ended { end, from, position: session.read(&entries::ACTUAL_POSITION).await?, fastest })
}

async fn whole(session: &ErobCanSession, run: Run<'_>, fastest: &mut f64) -> Moving<(End, i32)> {
    session.step("read the error code");
    check_error(session).await?;
    come_to_rest(session).await?;
    prepare(session, run.motion).await?;
    let from = session.read(&entries::ACTUAL_POSITION).await?;
    if session.is_interrupted() {
        return Ok((End::Interrupted, from));
    }
    session.step("enable");
    enable(session).await?;
    session.note(
        "this protocol has no watchdog: if this program ends unexpectedly, the drive goes on with what it does",
    );
    session.pause(ENABLED_NS).await;
    let stops = match run.motion {
        Motion::BackAndForth { to, times, dwell_ns, profile } => {
            Stops { first: Motion::To(to, profile), back: Motion::To(from, profile), times, dwell_ns }
        }
        motion => Stops { first: motion, back: motion, times: 0, dwell_ns: 0 },
    };
    let end = stops.visit(session, run, fastest).await?;
    Ok((end, from))
}

/// The moves of which a motion consists: one, or so many times one there and one back.
struct Stops {
    first: Motion,
    back: Motion,
    times: u32,
    dwell_ns: Nanoseconds,
}

impl Stops {
    async fn visit(&self, session: &ErobCanSession, run: Run<'_>, fastest: &mut f64) -> Moving<End> {
        for number in 0..self.times.saturating_mul(2).max(1) {
            let motion = if number % 2 == 0 { self.first } else { self.back };
            let end = one(session, Run { motion, ..run }, fastest).await?;
            if end != End::Arrived {
                return Ok(end);
            }
            session.pause(self.dwell_ns).await;
        }
        Ok(End::Arrived)
    }
}

/// One motion of an enabled motor, to its end at standstill.
async fn one(session: &ErobCanSession, run: Run<'_>, fastest: &mut f64) -> Moving<End> {
    if session.is_interrupted() {
        session.ignore_interruptions();
        return Ok(End::Interrupted);
    }
    let distance = start(session, run.motion).await?;
    session.step("move");
    let watched = watch(session, run, distance, fastest).await;
    match &watched {
        Ok(End::Arrived) | Err(MotionFailure::Request(_) | MotionFailure::Drive { .. }) => {}
        Ok(End::TimeOver | End::Interrupted) | Err(_) => {
            if !matches!(watched, Ok(End::TimeOver)) {
                session.keep_failing_step();
            }
            session.ignore_interruptions();
            stop(session, run.motion).await?;
        }
    }
    watched
}

/// Stops the joint if it moves, and disables the motor.
///
/// # Errors
/// A request has failed, or the joint does not come to rest.
pub async fn come_to_rest(session: &ErobCanSession) -> Moving<()> {
    let velocity = session.read(&entries::ACTUAL_VELOCITY).await?;
    if velocity.saturating_abs() > STANDING {
        session.step("stop");
        let mode = session.read(&entries::OPERATING_MODE).await?;
        let deceleration = session.read(&entries::PROFILE_DECELERATION).await?;
        command_stop(session, mode == OperatingMode::Position as i32).await?;
        wait_for_standstill(session, ramp_ns(velocity, deceleration)).await?;
    }
    session.step("disable");
    session.write(&entries::MOTOR_ENABLE, 0).await?;
    Ok(())
}

/// Writes what must be written before the motor is enabled.
async fn prepare(session: &ErobCanSession, motion: Motion) -> Moving<()> {
    session.step("set the operating mode");
    let mode = match motion {
        Motion::Torque { .. } => OperatingMode::Torque,
        Motion::Velocity(..) => OperatingMode::Velocity,
        _ => OperatingMode::Position,
    };
    set(session, &entries::OPERATING_MODE, mode as i32).await?;
    if mode != OperatingMode::Position {
        zero_set_point(session).await?;
    }
    session.step("set the profile");
    if let Some(profile) = motion.profile() {
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
            if let Some(profile) = motion.profile() {
                session.write(&entries::PROFILE_VELOCITY, profile.velocity).await?;
            }
        }
    }
    let motion_mode = match motion {
        Motion::Continuous(..) => 0,
        Motion::To(..) | Motion::By(..) | Motion::BackAndForth { .. } => 1,
        Motion::ReciprocatingTo { dwell_ns, .. } => {
            let dwell_ms = i32::try_from(dwell_ns / 1_000_000).unwrap_or(i32::MAX);
            session.write(&entries::DWELL_TIME, dwell_ms).await?;
            2
        }
        Motion::Hold | Motion::Velocity(..) | Motion::Torque { .. } => return Ok(()),
    };
    session.write(&entries::MOTION_MODE, motion_mode).await?;
    Ok(())
}

/// Makes the set-point of velocity and torque control 0: the motor turns at once when it is enabled, if it is not.
async fn zero_set_point(session: &ErobCanSession) -> Moving<()> {
    session.write(&entries::CONTROL_SOURCE, 0).await?;
    session.write(&entries::ANALOGUE_TYPE, 0).await?;
    session.write(&entries::SET_POINT, 0).await?;
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
    let end_ns = session.now_ns().saturating_add(ENABLED_FROM_NS);
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
        session.pause(AGAIN_NS).await;
    }
}

/// Starts the motion. Returns the distance that it has before it in counts, if it ends by itself.
async fn start(session: &ErobCanSession, motion: Motion) -> Moving<Option<i64>> {
    session.step("start");
    let here = i64::from(session.read(&entries::ACTUAL_POSITION).await?);
    let (distance, way) = match motion {
        Motion::Hold => return Ok(None),
        Motion::Velocity(set_point, _) | Motion::Torque { current: set_point, .. } => {
            session.write(&entries::SET_POINT, set_point).await?;
            return Ok(None);
        }
        Motion::Continuous(..) => (None, None),
        Motion::To(target, _) | Motion::BackAndForth { to: target, .. } => {
            (Some(0), Some(i64::from(target) - here))
        }
        Motion::By(distance, _) => (Some(distance), Some(distance.into())),
        Motion::ReciprocatingTo { .. } => (Some(0), None),
    };
    if way == Some(0) {
        return Ok(way);
    }
    if let Some(distance) = distance {
        // 0 makes the move an absolute one.
        session.write(&entries::RELATIVE_POSITION, distance).await?;
    }
    if let Motion::To(to, _) | Motion::BackAndForth { to, .. } | Motion::ReciprocatingTo { to, .. } = motion {
        session.write(&entries::TARGET_POSITION, to).await?;
    }
    session.command(&entries::START_MOTION).await?;
    Ok(way)
}

/// Watches the joint until it arrives, its time is over, or the session is interrupted.
async fn watch(
    session: &ErobCanSession,
    run: Run<'_>,
    distance: Option<i64>,
    fastest: &mut f64,
) -> Moving<End> {
    let began_ns = session.now_ns();
    let longest_ns = distance.map(|distance| longest_ns(run.motion, distance));
    loop {
        if session.is_interrupted() {
            return Ok(End::Interrupted);
        }
        let reading = reading::read(session, run.target, "enabled").await?;
        session.show(reading);
        *fastest = if reading.velocity.abs() > fastest.abs() { reading.velocity } else { *fastest };
        check_error(session).await?;
        check_limits(run, &reading)?;
        let passed_ns = session.now_ns().saturating_sub(began_ns);
        if let Some(longest_ns) = longest_ns {
            if distance == Some(0) || has_arrived(session).await? {
                return Ok(End::Arrived);
            }
            if passed_ns > longest_ns {
                return Err(MotionFailure::TooLong {
                    position: session.read(&entries::ACTUAL_POSITION).await?,
                });
            }
        } else if run.duration_ns.is_some_and(|duration_ns| passed_ns >= duration_ns) {
            return Ok(End::TimeOver);
        }
        let left_ns = run.duration_ns.map_or(READING_NS, |duration_ns| duration_ns.saturating_sub(passed_ns));
        session.pause(left_ns.clamp(1, READING_NS)).await;
    }
}

async fn has_arrived(session: &ErobCanSession) -> Moving<bool> {
    let is_stopped = session.read(&entries::RUNNING_STATE).await? == 0;
    Ok(is_stopped && session.read(&entries::ACTUAL_VELOCITY).await?.saturating_abs() <= STANDING)
}

/// Checks that a motion without a target can still be stopped before a limit of the axis.
fn check_limits(run: Run<'_>, reading: &AxisReading) -> Moving<()> {
    if run.motion.has_target() {
        return Ok(());
    }
    let deceleration = run.motion.profile().map(|profile| profile.deceleration.into());
    run.target.check_stopping_distance(reading, deceleration).map_err(MotionFailure::Limit)?;
    let Motion::Torque { velocity_limit, .. } = run.motion else { return Ok(()) };
    let limit = run.target.velocity(f64::from(velocity_limit)).abs();
    if reading.velocity.abs() <= BEYOND_LIMIT * limit {
        return Ok(());
    }
    let quantity = run.target.velocity_quantity();
    Err(MotionFailure::Limit(Failure::AtLimit {
        quantity,
        value: reading.velocity,
        low: -limit,
        high: limit,
    }))
}

/// The longest time of a motion over a distance by its profile: ramps up and down, and the way at its velocity.
fn longest_ns(motion: Motion, distance: i64) -> Nanoseconds {
    let Some(profile) = motion.profile() else { return Nanoseconds::MAX };
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
    command_stop(session, !matches!(motion, Motion::Velocity(..) | Motion::Torque { .. })).await?;
    let within_ns = match (motion, motion.profile()) {
        (Motion::Velocity(velocity, profile), _) => ramp_ns(velocity, profile.deceleration),
        (_, Some(profile)) => ramp_ns(profile.velocity, profile.deceleration),
        // In torque control friction alone stops it.
        (_, None) => PATIENCE_NS,
    };
    wait_for_standstill(session, within_ns).await
}

/// In position control the drive has a command to stop; in the other modes the set-point 0 is one.
async fn command_stop(session: &ErobCanSession, is_position_controlled: bool) -> Moving<()> {
    if is_position_controlled {
        session.command(&entries::STOP_MOTION).await?;
    } else {
        session.write(&entries::SET_POINT, 0).await?;
    }
    Ok(())
}

async fn wait_for_standstill(session: &ErobCanSession, within_ns: Nanoseconds) -> Moving<()> {
    let end_ns = session.now_ns().saturating_add(within_ns);
    loop {
        let velocity = session.read(&entries::ACTUAL_VELOCITY).await?;
        if velocity.saturating_abs() <= STANDING || session.is_interrupted() {
            return Ok(());
        }
        if session.now_ns() >= end_ns {
            return Err(MotionFailure::NotStopped { velocity });
        }
        session.pause(READING_NS).await;
    }
}

/// The longest time of a ramp to standstill: counts/s and counts/s².
fn ramp_ns(velocity: i32, deceleration: i32) -> Nanoseconds {
    let ramp_s = f64::from(velocity.saturating_abs()) / f64::from(deceleration.max(1));
    PATIENCE_NS.saturating_add((1e9 * ramp_s) as Nanoseconds)
}

async fn check_error(session: &ErobCanSession) -> Moving<()> {
    match session.read(&entries::ERROR_CODE).await? {
        0 => Ok(()),
        code => Err(MotionFailure::Drive { code }),
    }
}
