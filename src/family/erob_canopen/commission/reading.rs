//! Reads position, velocity, torque and faults of an eRob.

use takt_rt::{DriveState, Nanoseconds};

use super::objects::TORQUE_ACTUAL_VALUE;
use crate::canopen::emcy::ErrorCode;
use crate::canopen::objects::*;
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::polling;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::erob_canopen::{FACTS, error_text};
use crate::family::error_cure;
use crate::procedure::AxisReading;

/// The rated torque (6076) in N·m; `None` when the drive does not report it.
pub async fn rated_torque(c: &SdoSession) -> Result<Option<f64>, Failure> {
    let rated = c.read_optional(&MOTOR_RATED_TORQUE).await?;
    Ok(rated.filter(|rated| *rated > 0).map(|rated| rated as f64 / 1000.0))
}

/// Converts per mille of the rated torque to a torque.
pub fn torque(s: &TargetDrive, rated: Option<f64>, per_mille: i64) -> Option<f64> {
    let scale = s.scale.with_rated_torque(rated?).ok()?;
    Some(scale.torque_from_per_mille(i32::try_from(per_mille).ok()?))
}

/// Reads position (6064), velocity (606C), torque (6077) and statusword (6041).
pub async fn read(c: &SdoSession, s: &TargetDrive, rated: Option<f64>) -> Result<AxisReading, Failure> {
    let counts = c.read(&POSITION_ACTUAL_VALUE).await?;
    let velocity = c.read(&VELOCITY_ACTUAL_VALUE).await?;
    let per_mille = c.read(&TORQUE_ACTUAL_VALUE).await?;
    let word = c.read(&STATUSWORD).await? as u16;
    Ok(AxisReading {
        at_ns: c.now_ns(),
        position: s.position(counts),
        position_counts: counts,
        velocity: s.velocity(velocity as f64),
        torque: torque(s, rated, per_mille),
        current_a: None,
        statusword: word,
        state: DriveState::decode(word).name(),
    })
}

/// As [`read`], and checks that the axis is still enabled.
pub async fn read_enabled(
    c: &SdoSession,
    s: &TargetDrive,
    rated: Option<f64>,
) -> Result<AxisReading, Failure> {
    let reading = read(c, s, rated).await?;
    c.show(reading);
    match DriveState::decode(reading.statusword) {
        DriveState::OperationEnabled => Ok(reading),
        DriveState::Fault | DriveState::FaultReactionActive => Err(fault(c).await?),
        _ => Err(Failure::Disabled { statusword: reading.statusword }),
    }
}

/// The current fault as a failure.
pub async fn fault(c: &SdoSession) -> Result<Failure, Failure> {
    let code = error_code(c).await?;
    Ok(Failure::Faulted { what: error_text(code), advice: Some(cure(code)) })
}

/// The error code (603F); when it is zero, the code of the last emergency message.
pub async fn error_code(c: &SdoSession) -> Result<ErrorCode, Failure> {
    let code = ErrorCode(c.read(&ERROR_CODE).await? as u16);
    Ok(if code == ErrorCode::NONE { c.emergency().map_or(code, |emergency| emergency.code) } else { code })
}

/// The cure of an error.
pub fn cure(code: ErrorCode) -> &'static str {
    error_cure(Some(FACTS.word), code.0)
}

/// `watch`
pub async fn watch(
    c: &SdoSession,
    s: &TargetDrive,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    contact::connect(c, s).await?;
    let rated = rated_torque(c).await?;
    polling::watch(c, every_ns, duration_ns, async || read(c, s, rated).await).await
}

/// Final position and state.
pub async fn summary(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    Ok(polling::summary(s, &read(c, s, None).await?))
}
