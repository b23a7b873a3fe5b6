//! The motions of `takt drive`, in the units and within the limits of the axis.

use std::num::NonZeroU32;

use takt_rt::Nanoseconds;

use super::module::CommandedModule;
use super::motion::{Direction, Motion, Profile};
use super::procedure::{self, End, Ended, MotionFailure, Run};
use crate::family::commission::polling;
use crate::family::commission::{CommandValue, Failure, MotionProfile, MoveKind, Report, TargetDrive};

/// Default velocity limit of torque control as a share of the axis' limit.
const PERMITTED: f64 = 0.25;
/// More acceleration than so many velocities in a second is not advised (eRunner manual, indices 88 and 89).
const ADVISED_ACCELERATION: i32 = 3;

/// `watch`
pub async fn watch<M: CommandedModule>(
    m: &M,
    s: &TargetDrive,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    m.connect(s).await?;
    let read = async || {
        let status = m.status().await.map_err(Into::into)?;
        Ok(status.reading(m.session().now_ns(), s))
    };
    polling::watch(m.session(), every_ns, duration_ns, read).await
}

/// `enable`
pub async fn enable<M: CommandedModule>(
    m: &M,
    s: &TargetDrive,
    hold_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    m.connect(s).await?;
    let duration_ns = if keeps_enabled { Some(0) } else { hold_ns };
    carry_out(m, s, Motion::Hold, duration_ns, keeps_enabled).await?;
    summary(m, s).await
}

/// `disable`
pub async fn disable<M: CommandedModule>(m: &M, s: &TargetDrive) -> Result<Report, Failure> {
    m.connect(s).await?;
    come_to_rest(m, s).await?;
    summary(m, s).await
}

/// Stops the joint if it moves, and disables the motor.
pub async fn come_to_rest<M: CommandedModule>(m: &M, s: &TargetDrive) -> Result<(), Failure> {
    procedure::come_to_rest(m).await.map_err(|failure| of_motion::<M>(s, failure))
}

/// `move`
pub async fn run_move<M: CommandedModule>(
    m: &M,
    s: &TargetDrive,
    kind: MoveKind,
    profile: MotionProfile,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    // What can be refused is refused before the first request.
    s.drive_profile(&profile)?;
    if let MoveKind::Absolute { to, .. } | MoveKind::Reciprocate { to, .. } = kind {
        s.check_position(s.position_counts(to))?;
    }
    m.connect(s).await?;
    let profile = complete(m, s, &profile).await?;
    m.session().step("plan the move");
    let here = position(m).await?;
    let motion = match kind {
        MoveKind::Absolute { to, .. } => Motion::To(counts(s, s.position_counts(to))?, profile),
        MoveKind::Relative(by) => {
            let distance = s.distance_counts(by);
            counts(s, here.saturating_add(distance))?;
            Motion::By(whole(distance)?, profile)
        }
        MoveKind::Reciprocate { to, times, dwell_ns } => {
            counts(s, here)?;
            let to = counts(s, s.position_counts(to))?;
            match times {
                Some(times) => Motion::BackAndForth { to, times, dwell_ns, profile },
                None => Motion::ReciprocatingTo { to, dwell_ns, profile },
            }
        }
        MoveKind::Continuous { is_forward, duration_ns } => {
            let direction = if is_forward == (s.scale.resolution() > 0.0) { 1 } else { -1 };
            let velocity = direction * i64::from(profile.velocity);
            s.check_direction(here, velocity)?;
            let direction = if direction > 0 { Direction::Forward } else { Direction::Backward };
            let motion = Motion::Continuous(direction, profile);
            return run(m, s, motion, velocity, duration_ns, keeps_enabled).await;
        }
    };
    let ended = carry_out(m, s, motion, None, keeps_enabled).await?;
    let from = i64::from(ended.from);
    // The target, the number of moves, and where the last one ends.
    let (target, moves, end) = match motion {
        Motion::BackAndForth { to, times, .. } => (to.into(), times.saturating_mul(2), from),
        Motion::By(distance, _) => (from + i64::from(distance), 1, from + i64::from(distance)),
        Motion::To(to, _) => (to.into(), 1, to.into()),
        _ => (from, 1, from),
    };
    let mut report = polling::move_report(s, from, target, moves, i64::from(ended.position) - end);
    report.append(summary(m, s).await?);
    Ok(report)
}

/// `velocity`
pub async fn velocity<M: CommandedModule>(
    m: &M,
    s: &TargetDrive,
    velocity: CommandValue,
    profile: MotionProfile,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let raw = s.velocity_raw(velocity);
    s.check_velocity(raw)?;
    let set_point = whole(raw)?;
    s.drive_profile(&profile)?;
    m.connect(s).await?;
    s.check_direction(position(m).await?, raw)?;
    let profile = MotionProfile { velocity: Some(CommandValue::Drive(raw.abs().max(1))), ..profile };
    let motion = Motion::Velocity(set_point, complete(m, s, &profile).await?);
    run(m, s, motion, raw, duration_ns, keeps_enabled).await
}

/// `torque`: a current, because the module takes no other measure.
pub async fn torque<M: CommandedModule>(
    m: &M,
    s: &TargetDrive,
    torque: CommandValue,
    velocity_limit: Option<CommandValue>,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    let permitted = s.limits.map(|limits| CommandValue::Joint(PERMITTED * limits.velocity));
    let limit = velocity_limit.or(permitted).map(|limit| s.velocity_raw(limit)).ok_or(Failure::Missing {
        what: "--max-velocity",
        why: "without a configuration the axis has no known limits",
    })?;
    s.check_velocity(limit)?;
    let velocity_limit = NonZeroU32::new(whole(limit.abs())?.unsigned_abs()).ok_or(Failure::Missing {
        what: "--max-velocity",
        why: "without a limit the joint turns as fast as the current makes it",
    })?;
    if let CommandValue::Joint(torque) = torque {
        s.check_torque(torque)?;
        if s.rated_torque.is_none() {
            return Err(Failure::Missing {
                what: "the rated torque of the axis ([axis.joint] rated_torque)",
                why: "the drive takes a current, and does not tell its torque; with `--raw` the value is a current in mA",
            });
        }
    }
    m.connect(s).await?;
    let continuous = m.read(&M::CONTINUOUS_CURRENT).await.map_err(Into::into)?;
    let peak = m.read(&M::PEAK_CURRENT).await.map_err(Into::into)?;
    let current = match torque {
        CommandValue::Drive(current) => current,
        CommandValue::Joint(torque) => {
            let share = torque / s.rated_torque.unwrap_or(f64::INFINITY);
            (share * continuous as f64 * s.scale.resolution().signum()).round() as i64
        }
    };
    if current.saturating_abs() > peak {
        return Err(Failure::Unsuitable(format!(
            "{current} mA is more than the drive's peak current, {peak} mA"
        )));
    }
    let current = whole(current)?;
    let ended = carry_out(m, s, Motion::Torque { current, velocity_limit }, duration_ns, false).await?;
    let way = s.position(ended.position.into()) - s.position(ended.from.into());
    let mut report = Report::new();
    report.add("current_ma", "current", current, format!("{} A", f64::from(current) / 1000.0));
    if let Some(rated) = s.rated_torque.filter(|_| continuous > 0) {
        let real = f64::from(current) / continuous as f64 * rated * s.scale.resolution().signum();
        report.add("torque", "about", real, s.effort_quantity().show(real));
    }
    let fastest = ended.fastest;
    report.add("highest_velocity", "highest velocity", fastest, s.velocity_quantity().show(fastest));
    report.add("travelled", "travelled", way, s.position_quantity().show(way));
    report.append(summary(m, s).await?);
    Ok(report)
}

/// Where the joint is, and what the module does, after a task.
pub async fn summary<M: CommandedModule>(m: &M, s: &TargetDrive) -> Result<Report, Failure> {
    let status = m.status().await.map_err(Into::into)?;
    Ok(polling::summary(s, &status.reading(m.session().now_ns(), s)))
}

/// Settings that need it are made at standstill without torque.
pub async fn check_standstill<M: CommandedModule>(m: &M) -> Result<(), Failure> {
    m.session().step("state");
    if m.status().await.map_err(Into::into)?.is_off() { Ok(()) } else { Err(Failure::Enabled) }
}

/// A motion without a target, at this velocity in counts/s.
async fn run<M: CommandedModule>(
    m: &M,
    s: &TargetDrive,
    motion: Motion,
    velocity: i64,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let ended = carry_out(m, s, motion, duration_ns, keeps_enabled).await?;
    let (from, to) = (ended.from.into(), ended.position.into());
    let mut report = polling::run_report(s, velocity, ended.fastest, from, to);
    report.append(summary(m, s).await?);
    Ok(report)
}

async fn carry_out<M: CommandedModule>(
    m: &M,
    s: &TargetDrive,
    motion: Motion,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Ended, Failure> {
    let outcome = procedure::carry_out(m, Run { motion, duration_ns, keeps_enabled, target: s }).await;
    match outcome {
        Ok(ended) if ended.end == End::Interrupted => {
            note_position(m, s, ended.position.into());
            Err(Failure::Interrupted)
        }
        Ok(ended) => Ok(ended),
        Err(failure) => {
            if let Ok(position) = position(m).await {
                note_position(m, s, position);
            }
            Err(of_motion::<M>(s, failure))
        }
    }
}

async fn position<M: CommandedModule>(m: &M) -> Result<i64, Failure> {
    Ok(m.status().await.map_err(Into::into)?.position.into())
}

fn note_position<M: CommandedModule>(m: &M, s: &TargetDrive, counts: i64) {
    m.session().note(format!("the axis is at {}", s.position_quantity().show(s.position(counts))));
}

/// The profile in the units of the drive. What neither the user nor the limits say is that of the drive.
async fn complete<M: CommandedModule>(
    m: &M,
    s: &TargetDrive,
    profile: &MotionProfile,
) -> Result<Profile, Failure> {
    let given = s.drive_profile(profile)?;
    m.session().step("profile");
    let of_drive = async |given: Option<i64>, parameter: M::Parameter| {
        let value = match given {
            Some(value) => value,
            None => m.read(&parameter).await.map_err(Into::into)?.saturating_abs(),
        };
        whole(value)
    };
    let profile = Profile {
        velocity: of_drive(given.velocity, M::PROFILE_VELOCITY).await?,
        acceleration: of_drive(given.acceleration, M::PROFILE_ACCELERATION).await?,
        deceleration: of_drive(given.deceleration, M::PROFILE_DECELERATION).await?,
    };
    if profile.velocity == 0 {
        return Err(Failure::Missing { what: "--velocity", why: "the profile velocity of the drive is 0" });
    }
    if profile.acceleration == 0 || profile.deceleration == 0 {
        return Err(Failure::Missing {
            what: "--acceleration and --deceleration",
            why: "those of the drive are 0",
        });
    }
    let advised = profile.velocity.saturating_mul(ADVISED_ACCELERATION);
    if profile.acceleration.max(profile.deceleration) > advised {
        let shown = s.acceleration_quantity().show(s.acceleration(advised.into()));
        m.session().note(format!(
            "the manual advises an acceleration of at most three times the velocity in a second, here {shown}"
        ));
    }
    Ok(profile)
}

/// A position within the limits of the axis.
fn counts(s: &TargetDrive, position: i64) -> Result<i32, Failure> {
    s.check_position(position)?;
    whole(position)
}

fn whole(value: i64) -> Result<i32, Failure> {
    i32::try_from(value).map_err(|_| Failure::Unsuitable(format!("{value} does not fit the drive's 32 bits")))
}

/// The failure of a motion, with what helps.
fn of_motion<M: CommandedModule>(s: &TargetDrive, failure: MotionFailure<M::Error>) -> Failure {
    let what = failure.to_string();
    match failure {
        MotionFailure::Request(error) => error.into(),
        MotionFailure::Drive { code } => {
            Failure::Faulted { what: s.error_words(code), advice: Some(s.error_cure(code)) }
        }
        MotionFailure::NotEnabled => Failure::Request { what, cure: None },
        MotionFailure::TooLong { .. } => Failure::Request {
            what,
            cure: Some("check whether something blocks the joint, and the profile in the drive"),
        },
        MotionFailure::NotStopped { .. } => Failure::Request { what, cure: Some(M::EMERGENCY) },
        MotionFailure::Limit(failure) => failure,
    }
}
