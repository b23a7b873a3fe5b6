//! A motion from the first look to the disabled motor, whichever protocol carries the commands.
//!
//! Every motion ends with the motor at rest and disabled, whether it arrives, is interrupted, or fails. It stays enabled at rest only
//! where that is asked for, and nothing has failed.

use std::fmt;

use takt_rt::Nanoseconds;

use super::module::{CommandedModule, MotionStatus, ReachedStatus, Status};
use super::motion::{Motion, OperatingMode, Profile, Stop};
use super::{AGAIN_NS, ENABLED_FROM_NS, ENABLING_NS};
use crate::family::commission::{Failure, TargetDrive};
use crate::procedure::AxisReading;

/// From one reading of a moving joint to the next.
const READING_NS: Nanoseconds = 50_000_000;
/// From one request to the next in a wait: four in the shortest communication time-out that is advised.
const SIGN_OF_LIFE_NS: Nanoseconds = 50_000_000;
/// A motion may take so much longer than its profile.
const PATIENCE_NS: Nanoseconds = 5_000_000_000;
/// In torque control the module holds the velocity limit. Beyond this share of it the joint is stopped from here.
const BEYOND_LIMIT: f64 = 1.25;

/// A motion, and when it ends.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// The motion.
    pub motion: Motion,
    /// How long a motion lasts that does not end by itself; `None`: until it is interrupted.
    pub duration_ns: Option<Nanoseconds>,
    /// True if the motor stays enabled at the end.
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
pub enum MotionFailure<E> {
    /// A request has failed.
    Request(E),
    /// The module shows a fault.
    Drive {
        /// Its code.
        code: u16,
    },
    /// The module has taken the command to enable, and its motor is off.
    NotEnabled,
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

impl<E> From<E> for MotionFailure<E> {
    fn from(error: E) -> Self {
        Self::Request(error)
    }
}

impl<E: fmt::Debug + fmt::Display> std::error::Error for MotionFailure<E> {}

impl<E: fmt::Display> fmt::Display for MotionFailure<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Request(error) => error.fmt(f),
            Self::Drive { code } => write!(f, "the drive shows fault 0x{code:04X}"),
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
            Self::Limit(failure) => failure.fmt(f),
        }
    }
}

type Moving<T, M> = Result<T, MotionFailure<<M as CommandedModule>::Error>>;

/// Carries out a motion: prepares it, enables the motor, starts, watches the joint, stops it, and disables the motor.
///
/// An interruption of the session stops the joint with the profile deceleration; a second one disables the motor at once.
///
/// # Errors
/// See [`MotionFailure`].
pub async fn carry_out<M: CommandedModule>(module: &M, run: Run<'_>) -> Moving<Ended, M> {
    let session = module.session();
    let mut fastest = 0.0;
    let outcome = whole(module, run, &mut fastest).await;
    if outcome.is_err() {
        session.keep_failing_step();
    }
    session.ignore_interruptions();
    let stays = matches!(outcome, Ok((End::Arrived | End::TimeOver, _))) && run.keeps_enabled;
    if stays {
        session.note("the axis stays enabled");
    } else {
        session.step("disable");
        if let Err(error) = module.set_enabled(false).await {
            session.note(format!("the axis may still be moving: {error}; use the emergency stop"));
            outcome?;
            return Err(MotionFailure::Request(error));
        }
    }
    let cleared = match run.motion {
        // What is left there would make the next absolute move a relative one.
        Motion::By(..) => module.write(&M::RELATIVE_POSITION, 0).await,
        _ => Ok(()),
    };
    let (end, from) = outcome?;
    cleared?;
    Ok(Ended { end, from, position: module.status().await?.position, fastest })
}

async fn whole<M: CommandedModule>(module: &M, run: Run<'_>, fastest: &mut f64) -> Moving<(End, i32), M> {
    let session = module.session();
    session.step("read the fault");
    check_fault(module).await?;
    come_to_rest(module).await?;
    session.step("prepare the motion");
    module.prepare(run.motion).await?;
    let from = module.status().await?.position;
    if session.is_interrupted() {
        return Ok((End::Interrupted, from));
    }
    session.step("enable");
    enable(module).await?;
    if let Some(remark) = module.remark().await? {
        session.note(remark);
    }
    wait(module, ENABLING_NS).await?;
    if module.status().await?.reached == ReachedStatus::MotorOff {
        return Err(MotionFailure::NotEnabled);
    }
    let stops = match run.motion {
        Motion::BackAndForth { to, times, dwell_ns, profile } => {
            Stops { first: Motion::To(to, profile), back: Motion::To(from, profile), times, dwell_ns }
        }
        motion => Stops { first: motion, back: motion, times: 0, dwell_ns: 0 },
    };
    let end = stops.visit(module, run, fastest).await?;
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
    async fn visit<M: CommandedModule>(&self, module: &M, run: Run<'_>, fastest: &mut f64) -> Moving<End, M> {
        for number in 0..self.times.saturating_mul(2).max(1) {
            let motion = if number % 2 == 0 { self.first } else { self.back };
            let end = one(module, Run { motion, ..run }, fastest).await?;
            if end != End::Arrived {
                return Ok(end);
            }
            if self.dwell_ns > 0 {
                wait(module, self.dwell_ns).await?;
            }
        }
        Ok(End::Arrived)
    }
}

/// One motion of an enabled motor, to its end at standstill.
async fn one<M: CommandedModule>(module: &M, run: Run<'_>, fastest: &mut f64) -> Moving<End, M> {
    let session = module.session();
    if session.is_interrupted() {
        session.ignore_interruptions();
        return Ok(End::Interrupted);
    }
    session.step("start");
    let from = module.status().await?.position;
    let way = run.motion.way(from);
    if way != Some(0) {
        module.start(run.motion).await?;
    }
    session.step("move");
    let watched = watch(module, run, way, fastest).await;
    match &watched {
        Ok(End::Arrived) | Err(MotionFailure::Request(_) | MotionFailure::Drive { .. }) => {}
        Ok(End::TimeOver | End::Interrupted) | Err(_) => {
            if !matches!(watched, Ok(End::TimeOver)) {
                session.keep_failing_step();
            }
            session.ignore_interruptions();
            stop(module, run.motion, from).await?;
        }
    }
    watched
}

/// Stops the joint if it moves, and disables the motor.
///
/// # Errors
/// A request has failed, or the joint does not come to rest.
pub async fn come_to_rest<M: CommandedModule>(module: &M) -> Moving<(), M> {
    let session = module.session();
    let status = module.status().await?;
    if !status.stands() {
        session.step("stop");
        let mode = module.read(&M::OPERATING_MODE).await?;
        let deceleration = module.read(&M::PROFILE_DECELERATION).await?;
        let stop = match mode {
            mode if mode == OperatingMode::Torque as i64 => Stop::Torque,
            mode if mode == OperatingMode::Velocity as i64 => Stop::Velocity,
            _ => Stop::Move,
        };
        module.stop(stop).await?;
        let deceleration = i32::try_from(deceleration).unwrap_or(i32::MAX);
        wait_for_standstill(module, ramp_ns(status.velocity, deceleration), Status::stands).await?;
    }
    session.step("disable");
    module.set_enabled(false).await?;
    Ok(())
}

/// Enables the motor. A module that was just switched on is given the time that it needs.
async fn enable<M: CommandedModule>(module: &M) -> Moving<(), M> {
    let session = module.session();
    let end_ns = session.now_ns().saturating_add(ENABLED_FROM_NS);
    let mut is_told = false;
    loop {
        let Err(error) = module.set_enabled(true).await else { return Ok(()) };
        if !M::is_starting(&error) || session.now_ns() >= end_ns || session.is_interrupted() {
            check_fault(module).await?;
            return Err(MotionFailure::Request(error));
        }
        if !is_told {
            session.note("the drive cannot be enabled yet: it takes 8 s after power-on");
            is_told = true;
        }
        wait(module, AGAIN_NS).await?;
    }
}

/// Waits for a time, in which the module hears its master: silence may end in a fault. It ends early when the session is interrupted.
async fn wait<M: CommandedModule>(module: &M, duration_ns: Nanoseconds) -> Moving<(), M> {
    let session = module.session();
    let end_ns = session.now_ns().saturating_add(duration_ns);
    loop {
        check_fault(module).await?;
        let left_ns = end_ns.saturating_sub(session.now_ns());
        if left_ns == 0 || session.is_interrupted() {
            return Ok(());
        }
        session.pause(left_ns.min(SIGN_OF_LIFE_NS)).await;
    }
}

/// Watches the joint until it arrives, its time is over, or the session is interrupted.
async fn watch<M: CommandedModule>(
    module: &M,
    run: Run<'_>,
    way: Option<i64>,
    fastest: &mut f64,
) -> Moving<End, M> {
    let session = module.session();
    let began_ns = session.now_ns();
    let longest_ns = way.zip(run.motion.profile()).map(|(way, profile)| longest_ns(profile, way));
    loop {
        if session.is_interrupted() {
            return Ok(End::Interrupted);
        }
        let status = module.status().await?;
        let reading = status.reading(session.now_ns(), run.target);
        session.show(reading);
        *fastest = if reading.velocity.abs() > fastest.abs() { reading.velocity } else { *fastest };
        check(status)?;
        check_limits::<M>(run, &reading)?;
        let passed_ns = session.now_ns().saturating_sub(began_ns);
        if let Some(longest_ns) = longest_ns {
            if way == Some(0) || status.has_arrived() {
                return Ok(End::Arrived);
            }
            if passed_ns > longest_ns {
                return Err(MotionFailure::TooLong { position: status.position });
            }
        } else if run.duration_ns.is_some_and(|duration_ns| passed_ns >= duration_ns) {
            return Ok(End::TimeOver);
        }
        let left_ns = run.duration_ns.map_or(READING_NS, |duration_ns| duration_ns.saturating_sub(passed_ns));
        session.pause(left_ns.clamp(1, READING_NS)).await;
    }
}

/// Checks that a motion without a target can still be stopped before a limit of the axis.
fn check_limits<M: CommandedModule>(run: Run<'_>, reading: &AxisReading) -> Moving<(), M> {
    if run.motion.has_target() {
        return Ok(());
    }
    let deceleration = run.motion.profile().map(|profile| profile.deceleration.into());
    run.target.check_stopping_distance(reading, deceleration).map_err(MotionFailure::Limit)?;
    let Motion::Torque { velocity_limit, .. } = run.motion else { return Ok(()) };
    let limit = run.target.velocity(f64::from(velocity_limit.get())).abs();
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

/// Stops the joint, and waits until it stands. A further interruption ends the wait.
async fn stop<M: CommandedModule>(module: &M, motion: Motion, from: i32) -> Moving<(), M> {
    let Some(stop) = motion.stop() else { return Ok(()) };
    module.session().step("stop");
    module.stop(stop).await?;
    let is_reciprocating = stop == Stop::Reciprocation;
    // A reciprocating joint also stands at its ends, while it goes on.
    let has_ended =
        |status: &Status| status.stands() && !(is_reciprocating && status.motion == MotionStatus::Moving);
    check(wait_for_standstill(module, stopping_ns(motion, from), has_ended).await?)
}

async fn wait_for_standstill<M: CommandedModule>(
    module: &M,
    within_ns: Nanoseconds,
    has_ended: impl Fn(&Status) -> bool,
) -> Moving<Status, M> {
    let session = module.session();
    let end_ns = session.now_ns().saturating_add(within_ns);
    loop {
        let status = module.status().await?;
        if has_ended(&status) || status.fault != 0 || session.is_interrupted() {
            return Ok(status);
        }
        if session.now_ns() >= end_ns {
            return Err(MotionFailure::NotStopped { velocity: status.velocity });
        }
        session.pause(READING_NS).await;
    }
}

/// The longest time of a motion over a way by its profile: ramps up and down, and the way at its velocity.
fn longest_ns(profile: Profile, way: i64) -> Nanoseconds {
    let positive = |value: i32| f64::from(value.max(1));
    let velocity = positive(profile.velocity);
    let ramps_s = velocity / positive(profile.acceleration) + velocity / positive(profile.deceleration);
    let way_s = way.unsigned_abs() as f64 / velocity;
    // A float that is too large becomes the largest integer.
    PATIENCE_NS.saturating_add((1e9 * (2.0 * way_s + ramps_s)) as Nanoseconds)
}

/// The longest time that a stop takes, of a motion that has begun at a position.
fn stopping_ns(motion: Motion, from: i32) -> Nanoseconds {
    match motion {
        Motion::Velocity(velocity, profile) => ramp_ns(velocity, profile.deceleration),
        // It may go on to one of its ends.
        Motion::ReciprocatingTo { to, dwell_ns, profile } => {
            longest_ns(profile, i64::from(to) - i64::from(from)).saturating_add(dwell_ns)
        }
        _ => motion
            .profile()
            // In torque control friction alone stops it.
            .map_or(PATIENCE_NS, |profile| ramp_ns(profile.velocity, profile.deceleration)),
    }
}

/// The longest time of a ramp to standstill: counts/s and counts/s².
fn ramp_ns(velocity: i32, deceleration: i32) -> Nanoseconds {
    let ramp_s = f64::from(velocity.saturating_abs()) / f64::from(deceleration.max(1));
    PATIENCE_NS.saturating_add((1e9 * ramp_s) as Nanoseconds)
}

async fn check_fault<M: CommandedModule>(module: &M) -> Moving<(), M> {
    match module.read(&M::FAULT_CODE).await? {
        0 => Ok(()),
        code => Err(MotionFailure::Drive { code: code as u16 }),
    }
}

fn check<E>(status: Status) -> Result<(), MotionFailure<E>> {
    if status.fault == 0 { Ok(()) } else { Err(MotionFailure::Drive { code: status.fault }) }
}
