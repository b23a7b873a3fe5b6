//! The motions of `takt drive`, in the units and within the limits of the axis.

use takt_rt::Nanoseconds;

use super::super::failure::of_motion;
use super::super::motion::{self, Direction, End, Ended, Motion, Profile, Run};
use super::super::reading;
use super::connect;
use crate::erob_can::entries;
use crate::family::commission::polling;
use crate::family::commission::{CommandValue, Failure, MotionProfile, MoveKind, Report, TargetDrive};
use crate::family::erob_can::session::ErobCanSession;

/// Default velocity limit of torque control as a share of the axis' limit.
const PERMITTED: f64 = 0.25;
/// More acceleration than so many velocities in a second is not advised (eRunner manual, indices 88 and 89).
const ADVISED_ACCELERATION: i32 = 3;

/// `enable`
pub async fn enable(
    c: &ErobCanSession,
    s: &TargetDrive,
    hold_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    connect(c, s).await?;
    let duration_ns = if keeps_enabled { Some(0) } else { hold_ns };
    carry_out(c, s, Motion::Hold, duration_ns, keeps_enabled).await?;
    summary(c, s).await
}

/// `disable`
pub async fn disable(c: &ErobCanSession, s: &TargetDrive) -> Result<Report, Failure> {
    connect(c, s).await?;
    motion::come_to_rest(c).await.map_err(|failure| of_motion(s, failure))?;
    summary(c, s).await
}

/// `move`
pub async fn run_move(
    c: &ErobCanSession,
    s: &TargetDrive,
    kind: MoveKind,
    profile: MotionProfile,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    // What can be refused is refused before the first frame.
    s.drive_profile(&profile)?;
    if let MoveKind::Absolute { to, .. } | MoveKind::Reciprocate { to, .. } = kind {
        s.check_position(s.position_counts(to))?;
    }
    connect(c, s).await?;
    let profile = complete(c, s, &profile).await?;
    c.step("plan the move");
    let here = i64::from(c.read(&entries::ACTUAL_POSITION).await?);
    let motion = match kind {
        MoveKind::Absolute { to, .. } => Motion::To(counts(s, s.position_counts(to))?, profile),
        MoveKind::Relative(by) => {
            let distance = s.distance_counts(by);
            counts(s, here.saturating_add(distance))?;
            Motion::By(distance as i32, profile)
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
            s.check_direction(here, direction * i64::from(profile.velocity))?;
            let motion = Motion::Continuous(
                if direction > 0 { Direction::Forward } else { Direction::Backward },
                profile,
            );
            return run(c, s, motion, direction * i64::from(profile.velocity), duration_ns, keeps_enabled)
                .await;
        }
    };
    let ended = carry_out(c, s, motion, None, keeps_enabled).await?;
    let from = i64::from(ended.from);
    // The target, the number of moves, and where the last one ends.
    let (target, moves, end) = match motion {
        Motion::BackAndForth { to, times, .. } => (to.into(), times.saturating_mul(2), from),
        Motion::By(distance, _) => (from + i64::from(distance), 1, from + i64::from(distance)),
        Motion::To(to, _) => (to.into(), 1, to.into()),
        _ => (from, 1, from),
    };
    let mut report = polling::move_report(s, from, target, moves, i64::from(ended.position) - end);
    report.append(summary(c, s).await?);
    Ok(report)
}

/// `velocity`
pub async fn velocity(
    c: &ErobCanSession,
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
    connect(c, s).await?;
    let here = c.read(&entries::ACTUAL_POSITION).await?;
    s.check_direction(here.into(), raw)?;
    let profile = MotionProfile { velocity: Some(CommandValue::Drive(raw.abs().max(1))), ..profile };
    let motion = Motion::Velocity(set_point, complete(c, s, &profile).await?);
    run(c, s, motion, raw, duration_ns, keeps_enabled).await
}

/// `torque`
pub async fn torque(
    c: &ErobCanSession,
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
    let limit = whole(limit.abs())?;
    if let CommandValue::Joint(torque) = torque {
        s.check_torque(torque)?;
        if s.rated_torque.is_none() {
            return Err(Failure::Missing {
                what: "the rated torque of the axis ([axis.joint] rated_torque)",
                why: "the drive takes a current, and does not tell its torque; with `--raw` the value is a current in mA",
            });
        }
    }
    connect(c, s).await?;
    let continuous = c.read(&entries::CONTINUOUS_CURRENT).await?;
    let peak = c.read(&entries::PEAK_CURRENT).await?;
    let current = match torque {
        CommandValue::Drive(current) => current,
        CommandValue::Joint(torque) => {
            let share = torque / s.rated_torque.unwrap_or(f64::INFINITY);
            (share * f64::from(continuous) * s.scale.resolution().signum()).round() as i64
        }
    };
    let current = whole(current)?;
    if current.saturating_abs() > peak {
        return Err(Failure::Unsuitable(format!(
            "{current} mA is more than the drive's peak current, {peak} mA"
        )));
    }
    let ended =
        carry_out(c, s, Motion::Torque { current, velocity_limit: limit }, duration_ns, false).await?;
    let way = s.position(ended.position.into()) - s.position(ended.from.into());
    let mut report = Report::new();
    report.add("current_ma", "current", current, format!("{} A", f64::from(current) / 1000.0));
    if let Some(rated) = s.rated_torque.filter(|_| continuous > 0) {
        let real = f64::from(current) / f64::from(continuous) * rated * s.scale.resolution().signum();
        report.add("torque", "about", real, s.effort_quantity().show(real));
    }
    let fastest = ended.fastest;
    report.add("highest_velocity", "highest velocity", fastest, s.velocity_quantity().show(fastest));
    report.add("travelled", "travelled", way, s.position_quantity().show(way));
    report.append(summary(c, s).await?);
    Ok(report)
}

/// A motion without a target, at this velocity in counts/s.
async fn run(
    c: &ErobCanSession,
    s: &TargetDrive,
    motion: Motion,
    velocity: i64,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let ended = carry_out(c, s, motion, duration_ns, keeps_enabled).await?;
    let (from, to) = (ended.from.into(), ended.position.into());
    let mut report = polling::run_report(s, velocity, ended.fastest, from, to);
    report.append(summary(c, s).await?);
    Ok(report)
}

async fn carry_out(
    c: &ErobCanSession,
    s: &TargetDrive,
    motion: Motion,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Ended, Failure> {
    let outcome = motion::carry_out(c, Run { motion, duration_ns, keeps_enabled, target: s }).await;
    match outcome {
        Ok(ended) if ended.end == End::Interrupted => {
            note_position(c, s, ended.position.into());
            Err(Failure::Interrupted)
        }
        Ok(ended) => Ok(ended),
        Err(failure) => {
            if let Ok(position) = c.read(&entries::ACTUAL_POSITION).await {
                note_position(c, s, position.into());
            }
            Err(of_motion(s, failure))
        }
    }
}

fn note_position(c: &ErobCanSession, s: &TargetDrive, counts: i64) {
    c.note(format!("the axis is at {}", s.position_quantity().show(s.position(counts))));
}

async fn summary(c: &ErobCanSession, s: &TargetDrive) -> Result<Report, Failure> {
    Ok(polling::summary(s, &reading::read_with_state(c, s).await?))
}

/// The profile in the units of the drive. What neither the user nor the limits say is that of the drive.
async fn complete(c: &ErobCanSession, s: &TargetDrive, profile: &MotionProfile) -> Result<Profile, Failure> {
    let given = s.drive_profile(profile)?;
    c.step("profile");
    let of_drive = async |given: Option<i64>, entry| match given {
        Some(value) => whole(value),
        None => Ok(c.read(entry).await?.saturating_abs()),
    };
    let profile = Profile {
        velocity: of_drive(given.velocity, &entries::PROFILE_VELOCITY).await?,
        acceleration: of_drive(given.acceleration, &entries::PROFILE_ACCELERATION).await?,
        deceleration: of_drive(given.deceleration, &entries::PROFILE_DECELERATION).await?,
    };
    if profile.velocity == 0 {
        return Err(Failure::Missing { what: "--velocity", why: "the drive's profile velocity (008A) is 0" });
    }
    if profile.acceleration == 0 || profile.deceleration == 0 {
        return Err(Failure::Missing {
            what: "--acceleration and --deceleration",
            why: "those of the drive (0088 and 0089) are 0",
        });
    }
    let advised = profile.velocity.saturating_mul(ADVISED_ACCELERATION);
    if profile.acceleration.max(profile.deceleration) > advised {
        let shown = s.acceleration_quantity().show(s.acceleration(advised.into()));
        c.note(format!(
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
