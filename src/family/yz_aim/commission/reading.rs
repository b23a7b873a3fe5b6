//! Reads position, velocity, current and alarms of a YZ-AIM.

use takt_rt::Nanoseconds;
use takt_wire::canopen::objects::*;

use super::objects::{ALARM, CURRENT, TEMPERATURE, VELOCITY};
use super::words;
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::polling;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::yz_aim::Alarm;
use crate::procedure::AxisReading;

/// The scale of 606C by SDO: 0.1 r/min by the object table, although the manual's example of TPDO3 contradicts it.
pub const TENTHS: f64 = 0.1;

/// Reads position, velocity, current and statusword.
pub async fn read(c: &SdoSession, s: &TargetDrive) -> Result<AxisReading, Failure> {
    let counts = c.read(&POSITION_ACTUAL_VALUE).await?;
    let velocity = c.read(&VELOCITY).await?;
    let current = c.read(&CURRENT).await?;
    let word = c.read(&STATUSWORD).await? as u16;
    Ok(AxisReading {
        at_ns: c.now_ns(),
        position: s.position(counts),
        position_counts: counts,
        velocity: s.velocity(velocity as f64 * TENTHS),
        torque: None,
        current_a: Some(current as f64 / 2000.0),
        temperature_c: None,
        statusword: Some(word),
        state: words::state(word),
    })
}

/// As [`read`], and checks that the axis is enabled and has no alarm.
pub async fn read_enabled(c: &SdoSession, s: &TargetDrive) -> Result<AxisReading, Failure> {
    let reading = read(c, s).await?;
    c.show(reading);
    if reading.status_bits() & words::ALARM != 0 {
        return Err(faulted(alarm(c).await?));
    }
    if words::is_enabled(reading.status_bits()) {
        return Ok(reading);
    }
    Err(Failure::Disabled { statusword: reading.status_bits() })
}

/// Reads the alarm, object 260E.
pub async fn alarm(c: &SdoSession) -> Result<Alarm, Failure> {
    Ok(Alarm::of(c.read(&ALARM).await? as u16))
}

/// The failure for an alarm.
pub fn faulted(alarm: Alarm) -> Failure {
    Failure::Faulted { what: alarm.words(), advice: alarm.advice() }
}

/// `watch`, with the temperature.
pub async fn watch(
    c: &SdoSession,
    s: &TargetDrive,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    contact::connect(c, s).await?;
    let read_all = async || {
        let reading = read(c, s).await?;
        let temperature = c.read_optional(&TEMPERATURE).await?;
        Ok(AxisReading { temperature_c: temperature.map(|degrees| degrees as f64), ..reading })
    };
    polling::watch(c, every_ns, duration_ns, read_all).await
}

/// Final position and state.
pub async fn summary(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    Ok(polling::summary(s, &read(c, s).await?))
}
