//! Reads position, velocity, torque and faults.

use takt_rt::{DriveState, Nanoseconds};
use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::canopen::objects::*;

use super::access::read_if_there;
use super::objects::{TORQUE_ACTUAL_VALUE, error_history};
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::polling;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::procedure::AxisReading;

/// The rated torque in N·m: that of the drive (6076), or else that of the configuration. `None` when neither tells.
pub async fn rated_torque(c: &SdoSession, s: &TargetDrive) -> Result<Option<f64>, Failure> {
    let rated = read_if_there(c, s, &MOTOR_RATED_TORQUE).await?;
    Ok(rated.filter(|rated| *rated > 0).map(|rated| rated as f64 / 1000.0).or(s.rated_torque))
}

/// Converts per mille of the rated torque to a torque.
pub fn torque(s: &TargetDrive, rated: Option<f64>, per_mille: i64) -> Option<f64> {
    let scale = s.scale.with_rated_torque(rated?).ok()?;
    Some(scale.torque_from_per_mille(i32::try_from(per_mille).ok()?))
}

/// Reads position (6064), velocity (606C), torque (6077) and statusword (6041). The velocity is not a number where the
/// drive does not report it.
pub async fn read(c: &SdoSession, s: &TargetDrive, rated: Option<f64>) -> Result<AxisReading, Failure> {
    let counts = c.read(&POSITION_ACTUAL_VALUE).await?;
    let velocity = read_if_there(c, s, &VELOCITY_ACTUAL_VALUE).await?;
    let per_mille = read_if_there(c, s, &TORQUE_ACTUAL_VALUE).await?;
    let temperature = match s.temperature() {
        Some(object) => c.read_optional(&object).await?,
        None => None,
    };
    let word = c.read(&STATUSWORD).await? as u16;
    Ok(AxisReading {
        at_ns: c.now_ns(),
        position: s.position(counts),
        position_counts: counts,
        velocity: velocity.map_or(f64::NAN, |velocity| s.velocity(velocity as f64)),
        torque: per_mille.and_then(|per_mille| torque(s, rated, per_mille)),
        current_a: None,
        temperature_c: temperature.map(|degrees| degrees as f64),
        statusword: Some(word),
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
    match DriveState::decode(reading.status_bits()) {
        DriveState::OperationEnabled => Ok(reading),
        DriveState::Fault | DriveState::FaultReactionActive => Err(fault(c, s).await?),
        _ => Err(Failure::Disabled { statusword: reading.status_bits() }),
    }
}

/// The current fault as a failure.
pub async fn fault(c: &SdoSession, s: &TargetDrive) -> Result<Failure, Failure> {
    let code = error_code(c, s).await?.0;
    Ok(Failure::Faulted { what: s.error_words(code), advice: Some(s.error_cure(code)) })
}

/// The error code (603F); where it is absent or zero, that of the last emergency message, or the newest of the history (1003).
pub async fn error_code(c: &SdoSession, s: &TargetDrive) -> Result<ErrorCode, Failure> {
    let known = |code: i64| Some(ErrorCode(code as u16)).filter(|code| *code != ErrorCode::NONE);
    if let Some(code) = read_if_there(c, s, &ERROR_CODE).await?.and_then(known) {
        return Ok(code);
    }
    if let Some(emergency) = c.emergency().filter(|emergency| emergency.code != ErrorCode::NONE) {
        return Ok(emergency.code);
    }
    if s.has(ERROR_CODE.address) {
        return Ok(ErrorCode::NONE);
    }
    // Some drives have no entry at all while their history is empty.
    let newest = read_if_there(c, s, &error_history(1)).await;
    Ok(newest.ok().flatten().and_then(known).unwrap_or(ErrorCode::NONE))
}

/// `watch`
pub async fn watch(
    c: &SdoSession,
    s: &TargetDrive,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    contact::connect(c, s).await?;
    let rated = rated_torque(c, s).await?;
    polling::watch(c, every_ns, duration_ns, async || read(c, s, rated).await).await
}

/// Final position and state.
pub async fn summary(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    Ok(polling::summary(s, &read(c, s, None).await?))
}
