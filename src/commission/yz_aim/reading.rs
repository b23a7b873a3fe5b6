//! Where a YZ-AIM is and how it fares.

use takt_rt::Nanoseconds;

use super::alarm::Alarm;
use super::objects::{ALARM, CURRENT, VELOCITY};
use super::words;
use crate::canopen::objects::*;
use crate::commission::contact;
use crate::commission::conversation::Conversation;
use crate::commission::event::Reading;
use crate::commission::failure::Failure;
use crate::commission::looking;
use crate::commission::report::Report;
use crate::commission::subject::Subject;

/// The scale of 606C by SDO: 0.1 r/min (object table; the only example of TPDO3 contradicts it there).
pub const TENTHS: f64 = 0.1;

/// Reads position, velocity, current and statusword.
pub async fn read(c: &Conversation, s: &Subject) -> Result<Reading, Failure> {
    let counts = c.read(&POSITION_ACTUAL_VALUE).await?;
    let velocity = c.read(&VELOCITY).await?;
    let current = c.read(&CURRENT).await?;
    let word = c.read(&STATUSWORD).await? as u16;
    Ok(Reading {
        at_ns: c.now_ns(),
        position: s.position(counts),
        position_counts: counts,
        velocity: s.velocity(velocity as f64 * TENTHS),
        torque: None,
        current_a: Some(current as f64 / 2000.0),
        statusword: word,
        state: words::state(word),
    })
}

/// As [`read`], of an axis that moves: it must be enabled and without an alarm.
pub async fn read_enabled(c: &Conversation, s: &Subject) -> Result<Reading, Failure> {
    let reading = read(c, s).await?;
    c.show(reading);
    if reading.statusword & words::ALARM != 0 {
        return Err(faulted(alarm(c).await?));
    }
    if words::is_enabled(reading.statusword) {
        return Ok(reading);
    }
    Err(Failure::Disabled { statusword: reading.statusword })
}

/// Object 260E.
pub async fn alarm(c: &Conversation) -> Result<Alarm, Failure> {
    Ok(Alarm::of(c.read(&ALARM).await? as u16))
}

/// The failure that an alarm is.
pub fn faulted(alarm: Alarm) -> Failure {
    Failure::Faulted { what: format!("alarm {alarm}"), advice: alarm.advice() }
}

/// `watch`
pub async fn watch(
    c: &Conversation,
    s: &Subject,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    contact::reach(c, s).await?;
    looking::watch(c, every_ns, duration_ns, async || read(c, s).await).await
}

/// Position and state in the end.
pub async fn summary(c: &Conversation, s: &Subject) -> Result<Report, Failure> {
    Ok(looking::summary(s, &read(c, s).await?))
}
