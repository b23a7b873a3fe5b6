//! Where an eRob is and how it fares.

use takt_rt::{DriveState, Nanoseconds};

use super::objects::TORQUE_ACTUAL_VALUE;
use super::state::{error_words, state_words};
use crate::canopen::emcy::ErrorCode;
use crate::canopen::objects::*;
use crate::commission::contact;
use crate::commission::conversation::Conversation;
use crate::commission::event::Reading;
use crate::commission::failure::Failure;
use crate::commission::looking;
use crate::commission::report::Report;
use crate::commission::subject::Subject;
use crate::drive::erob_canopen::MULTI_TURN_BATTERY;

/// What the drive calls rated torque, in N·m; `None` when it does not tell.
pub async fn rated_torque(c: &Conversation) -> Result<Option<f64>, Failure> {
    let rated = c.read_optional(&MOTOR_RATED_TORQUE).await?;
    Ok(rated.filter(|rated| *rated > 0).map(|rated| rated as f64 / 1000.0))
}

/// Torque of per mille of the rated one.
pub fn torque(s: &Subject, rated: Option<f64>, per_mille: i64) -> Option<f64> {
    let scale = s.scale.with_rated_torque(rated?).ok()?;
    Some(scale.torque_from_per_mille(i32::try_from(per_mille).ok()?))
}

/// Reads position, velocity, torque and statusword.
pub async fn read(c: &Conversation, s: &Subject, rated: Option<f64>) -> Result<Reading, Failure> {
    let counts = c.read(&POSITION_ACTUAL_VALUE).await?;
    let velocity = c.read(&VELOCITY_ACTUAL_VALUE).await?;
    let per_mille = c.read(&TORQUE_ACTUAL_VALUE).await?;
    let word = c.read(&STATUSWORD).await? as u16;
    Ok(Reading {
        at_ns: c.now_ns(),
        position: s.position(counts),
        position_counts: counts,
        velocity: s.velocity(velocity as f64),
        torque: torque(s, rated, per_mille),
        current_a: None,
        statusword: word,
        state: state_words(DriveState::decode(word)),
    })
}

/// As [`read`], of an axis that moves: it must be enabled.
pub async fn read_enabled(c: &Conversation, s: &Subject, rated: Option<f64>) -> Result<Reading, Failure> {
    let reading = read(c, s, rated).await?;
    c.show(reading);
    match DriveState::decode(reading.statusword) {
        DriveState::OperationEnabled => Ok(reading),
        DriveState::Fault | DriveState::FaultReactionActive => Err(fault(c).await?),
        _ => Err(Failure::Disabled { statusword: reading.statusword }),
    }
}

/// The fault that the drive is in.
pub async fn fault(c: &Conversation) -> Result<Failure, Failure> {
    let code = error_code(c).await?;
    Ok(Failure::Faulted { what: in_words(code), advice: advice(code) })
}

/// Object 603F, or when that is zero the code of the last emergency.
pub async fn error_code(c: &Conversation) -> Result<ErrorCode, Failure> {
    let code = ErrorCode(c.read(&ERROR_CODE).await? as u16);
    Ok(if code == ErrorCode::NONE { c.emergency().map_or(code, |emergency| emergency.code) } else { code })
}

/// An error code with its meaning.
pub fn in_words(code: ErrorCode) -> String {
    format!("0x{:04X} ({})", code.0, error_words(code.0))
}

/// What to do about an error.
pub fn advice(code: ErrorCode) -> Option<&'static str> {
    (code == MULTI_TURN_BATTERY).then_some(
        "replace the battery, then use `clear-fault --yes`: it clears the count of turns too, so that the joint's zero \
         must be set again",
    )
}

/// `watch`
pub async fn watch(
    c: &Conversation,
    s: &Subject,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    contact::reach(c, s).await?;
    let rated = rated_torque(c).await?;
    looking::watch(c, every_ns, duration_ns, async || read(c, s, rated).await).await
}

/// Position and state in the end.
pub async fn summary(c: &Conversation, s: &Subject) -> Result<Report, Failure> {
    Ok(looking::summary(s, &read(c, s, None).await?))
}
