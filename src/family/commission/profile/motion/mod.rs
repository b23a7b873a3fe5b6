//! Motion: every one is prepared, monitored and ended at standstill.

pub mod position;
pub mod torque;

use takt_rt::{Nanoseconds, OperationMode};
use takt_wire::canopen::objects::*;

use super::access::read_if_there;
use super::{enabling, reading};
use crate::family::commission::failure::Failure;
use crate::family::commission::guarded::{add_final_position, guarded};
use crate::family::commission::motion_profile::{DriveProfile, MotionProfile};
use crate::family::commission::polling;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::{CommandValue, TargetDrive};
use crate::procedure::AxisReading;

/// Interval between two readings of a moving axis.
pub const POLL_NS: Nanoseconds = 20_000_000;

/// Checks the drive, runs `work`, and disables the drive at standstill afterwards.
pub async fn with_torque(
    c: &SdoSession,
    s: &TargetDrive,
    keeps_enabled: bool,
    work: impl Future<Output = Result<Report, Failure>>,
) -> Result<Report, Failure> {
    enabling::check_ready(c, s).await?;
    let ended = guarded(c, keeps_enabled, work, enabling::shut_down(c, s), enabling::torque_off(c)).await;
    add_final_position(c, s, ended, reading::summary(c, s).await)
}

/// `enable`
pub async fn enable(
    c: &SdoSession,
    s: &TargetDrive,
    hold_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let work = async {
        let rated = begin(c, s, OperationMode::ProfilePosition, &DriveProfile::default()).await?;
        let position = enabling::enable(c, s).await?;
        if keeps_enabled {
            enabling::disarm_watchdog(c, s).await?;
        } else {
            c.step("hold");
            poll_until(c, s, rated, hold_ns, POLL_NS, |_| Ok(())).await?;
        }
        let mut report = Report::new();
        report.add(
            "held_at",
            "held at",
            s.position(position),
            s.position_quantity().show(s.position(position)),
        );
        Ok(report)
    };
    with_torque(c, s, keeps_enabled, work).await
}

/// `velocity`
pub async fn velocity(
    c: &SdoSession,
    s: &TargetDrive,
    velocity: CommandValue,
    profile: MotionProfile,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let raw = s.velocity_raw(velocity);
    s.check_velocity(raw)?;
    let profile = s.drive_profile(&MotionProfile { velocity: None, ..profile })?;
    with_torque(c, s, keeps_enabled, run_at(c, s, raw, profile, duration_ns, keeps_enabled)).await
}

/// `move continuous`
pub async fn continuous(
    c: &SdoSession,
    s: &TargetDrive,
    is_forward: bool,
    profile: MotionProfile,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let profile = s.drive_profile(&profile)?;
    let speed = profile.velocity.ok_or(Failure::Missing {
        what: "--velocity",
        why: "without a configuration nothing is known of the axis' limits",
    })?;
    let forward = s.velocity_raw(CommandValue::Joint(1.0)).signum() * if is_forward { 1 } else { -1 };
    let run = run_at(c, s, forward * speed, profile, duration_ns, keeps_enabled);
    with_torque(c, s, keeps_enabled, run).await
}

async fn run_at(
    c: &SdoSession,
    s: &TargetDrive,
    raw: i64,
    profile: DriveProfile,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    check_velocity_is_shown(s)?;
    let rated = begin(c, s, OperationMode::ProfileVelocity, &profile).await?;
    let began = enabling::enable(c, s).await?;
    s.check_direction(began, raw)?;
    c.step("run");
    c.write(&TARGET_VELOCITY, raw).await?;
    let mut fastest = 0.0_f64;
    poll_until(c, s, rated, duration_ns, POLL_NS, |reading| {
        fastest = if reading.velocity.abs() > fastest.abs() { reading.velocity } else { fastest };
        s.check_stopping_distance(reading, None)
    })
    .await?;
    c.step("ramp to standstill");
    c.write(&TARGET_VELOCITY, 0).await?;
    let deceleration = match profile.deceleration {
        Some(deceleration) => deceleration,
        None => read_if_there(c, s, &PROFILE_DECELERATION).await?.unwrap_or(1),
    };
    enabling::wait_for_standstill(c, s, s.stopping_ns(raw, deceleration.max(1))).await?;
    if keeps_enabled {
        enabling::disarm_watchdog(c, s).await?;
    }
    let ended = c.read(&POSITION_ACTUAL_VALUE).await?;
    Ok(polling::run_report(s, raw, fastest, began, ended))
}

/// A motion without a target is stopped before a limit only if the drive shows its velocity.
fn check_velocity_is_shown(s: &TargetDrive) -> Result<(), Failure> {
    if s.has(VELOCITY_ACTUAL_VALUE.address) {
        return Ok(());
    }
    Err(Failure::Unsupported {
        what: "this drive does not show its velocity (606C)".to_owned(),
        instead: "move it to a position, which its own profile limits".to_owned(),
    })
}

/// Prepares the drive and reads its rated torque.
async fn begin(
    c: &SdoSession,
    s: &TargetDrive,
    mode: OperationMode,
    profile: &DriveProfile,
) -> Result<Option<f64>, Failure> {
    enabling::prepare(c, s, mode, profile).await?;
    reading::rated_torque(c, s).await
}

/// Polls an enabled axis for a time.
async fn poll_until(
    c: &SdoSession,
    s: &TargetDrive,
    rated: Option<f64>,
    duration_ns: Option<Nanoseconds>,
    every_ns: Nanoseconds,
    check: impl FnMut(&AxisReading) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let read = async || reading::read_enabled(c, s, rated).await;
    polling::poll_until(c, every_ns, duration_ns, read, check).await
}
