//! Profile position mode. Each target (607A) uses the handshake of controlword bit 4 and statusword bit 12.

use takt_rt::{Nanoseconds, OperationMode, controlword, statusword};
use takt_wire::canopen::objects::*;

use super::super::access::read_if_there;
use super::super::objects::POSITION_WINDOW;
use super::{POLL_NS, begin, with_torque};
use crate::family::commission::failure::Failure;
use crate::family::commission::motion_profile::{DriveProfile, MotionProfile};
use crate::family::commission::polling;
use crate::family::commission::profile::{enabling, reading};
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::commission::task::MoveKind;

/// Longest time until the drive acknowledges a set-point (statusword bit 12).
const ACKNOWLEDGE_NS: Nanoseconds = 1_000_000_000;

/// `move absolute`, `move relative`, `move reciprocate`
pub async fn run(
    c: &SdoSession,
    s: &TargetDrive,
    kind: MoveKind,
    profile: MotionProfile,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let profile = s.drive_profile(&profile)?;
    polling::check_target(c, s, kind).await?;
    let is_immediate = matches!(kind, MoveKind::Absolute { is_immediate: true, .. });
    let work = async {
        let rated = begin(c, s, OperationMode::ProfilePosition, &profile).await?;
        let profile = complete(c, s, profile).await?;
        c.step("plan the move");
        let here = c.read(&POSITION_ACTUAL_VALUE).await?;
        let (target, stops, dwell_ns) = match kind {
            MoveKind::Absolute { to, .. } => (s.position_counts(to), 1, 0),
            MoveKind::Relative(by) => (here.saturating_add(s.distance_counts(by)), 1, 0),
            MoveKind::Reciprocate { to, times, dwell_ns } => (s.position_counts(to), ends(times), dwell_ns),
            MoveKind::Continuous { .. } => {
                return Err(Failure::Unsuitable("a continuous move has no target".to_owned()));
            }
        };
        s.check_position(target)?;
        let mut at = enabling::enable(c, s).await?;
        for stop in 0..stops {
            let next = if stop % 2 == 0 { target } else { here };
            set_point(c, next, is_immediate).await?;
            arrive(c, s, rated, &profile, at, next).await?;
            at = next;
            c.pause(dwell_ns).await?;
        }
        if keeps_enabled {
            enabling::disarm_watchdog(c, s).await?;
        }
        let reached = c.read(&POSITION_ACTUAL_VALUE).await?;
        Ok(polling::move_report(s, here, target, stops, reached - at))
    };
    with_torque(c, s, keeps_enabled, work).await
}

/// So many ends a reciprocating move has; without a number of repetitions it goes on until it is interrupted.
fn ends(times: Option<u32>) -> u32 {
    times.map_or(u32::MAX, |times| times.saturating_mul(2))
}

/// Reads from the drive what the profile leaves open.
async fn complete(c: &SdoSession, s: &TargetDrive, profile: DriveProfile) -> Result<DriveProfile, Failure> {
    let velocity = match profile.velocity {
        Some(velocity) => velocity,
        None => s.velocity_raw_of_profile(c.read(&PROFILE_VELOCITY).await?),
    };
    if velocity <= 0 {
        return Err(Failure::Missing { what: "--velocity", why: "the drive's profile velocity (6081) is 0" });
    }
    let acceleration = match (profile.acceleration, profile.deceleration) {
        (Some(acceleration), Some(deceleration)) => acceleration.min(deceleration),
        _ => {
            let acceleration = c.read(&PROFILE_ACCELERATION).await?;
            acceleration.min(read_if_there(c, s, &PROFILE_DECELERATION).await?.unwrap_or(acceleration))
        }
    };
    Ok(DriveProfile { velocity: Some(velocity), acceleration: Some(acceleration.max(1)), ..profile })
}

async fn set_point(c: &SdoSession, target: i64, is_immediate: bool) -> Result<(), Failure> {
    c.step("set-point");
    c.write(&TARGET_POSITION, target).await?;
    let is_acknowledged = |word: i64| word as u16 & statusword::BIT_12 != 0;
    let word = controlword::ENABLE_OPERATION;
    let change = if is_immediate { controlword::BIT_5 } else { 0 };
    c.write(&CONTROLWORD, (word | controlword::BIT_4 | change).into()).await?;
    c.wait_for(&STATUSWORD, "the acknowledgement of the set-point", ACKNOWLEDGE_NS, is_acknowledged).await?;
    c.write(&CONTROLWORD, word.into()).await?;
    let what = "the end of the acknowledgement";
    c.wait_for(&STATUSWORD, what, ACKNOWLEDGE_NS, |word| !is_acknowledged(word)).await.map(|_| ())
}

async fn arrive(
    c: &SdoSession,
    s: &TargetDrive,
    rated: Option<f64>,
    profile: &DriveProfile,
    from: i64,
    to: i64,
) -> Result<(), Failure> {
    c.step("move");
    let (velocity, acceleration) = (profile.velocity.unwrap_or(1), profile.acceleration.unwrap_or(1));
    let within_ns = s.longest_ns(to - from, velocity, acceleration);
    // The drive says when it is there (bit 10); its window (6067) may be wider than a degree.
    let near = read_if_there(c, s, &POSITION_WINDOW).await?.unwrap_or(0).max(s.near_counts());
    let began_ns = c.now_ns();
    loop {
        let reading = reading::read_enabled(c, s, rated).await?;
        let is_near = (reading.position_counts - to).abs() <= near;
        if reading.status_bits() & statusword::TARGET_REACHED != 0 && is_near {
            return Ok(());
        }
        let waited_ns = c.now_ns().saturating_sub(began_ns);
        if waited_ns >= within_ns {
            let (object, last) = (POSITION_ACTUAL_VALUE, reading.position_counts);
            return Err(Failure::NotInTime { object, what: "the target", last, waited_ns });
        }
        c.pause(POLL_NS).await?;
    }
}
