//! Clears an alarm in the way that the manual gives for it (IIb.3, 5.11.2). The targets are reset first: after a loss
//! of communication the drive resumes its motion as soon as the heartbeat returns.

use takt_rt::Nanoseconds;
use takt_wire::canopen::nmt::{ErrorControl, NmtState};
use takt_wire::canopen::objects::*;

use super::enabling::statusword;
use super::objects::*;
use super::words::{self, control};
use super::{reading, storing};
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::yz_aim::{Alarm, Clearing};

/// Time until the drive has processed a controlword.
const CONTROL_NS: Nanoseconds = 20_000_000;
/// Longest time until an alarm is cleared.
const CLEARING_NS: Nanoseconds = 500_000_000;
/// Above this voltage (V) the over-voltage alarm returns at once.
const HIGHEST_VOLTAGE: f64 = 52.0;
/// Node ID for the heartbeat when 1016:01 names none.
const MASTER: u8 = 127;

/// `clear-fault`
pub async fn clear(c: &SdoSession, s: &TargetDrive, is_confirmed: bool) -> Result<Report, Failure> {
    contact::connect_family(c, s).await?;
    c.step("alarm");
    let alarm = reading::alarm(c).await?;
    let has_alarm = statusword(c).await? & words::ALARM != 0 || alarm != Alarm::None;
    let mut report = Report::new();
    if !has_alarm {
        report.add("fault", "alarm", serde_json::Value::Null, "none, nothing to clear");
        report.append(reading::summary(c, s).await?);
        return Ok(report);
    }
    report.add("fault", "alarm", alarm.code(), alarm.to_string());
    if alarm.clearing() == Clearing::Zero && !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "the multi-turn position is lost; clearing this alarm makes the present position the \
                          multi-turn zero",
            option: "--yes",
        });
    }
    withdraw(c).await?;
    match alarm.clearing() {
        Clearing::Zero => report.append(storing::set_zero(c).await?),
        Clearing::Heartbeat => heartbeat(c).await?,
        Clearing::Reset => reset(c, alarm).await?,
    }
    c.step("verification");
    if !is_gone(c).await? {
        let alarm = reading::alarm(c).await?;
        return Err(Failure::FaultPersists { what: alarm.words(), advice: alarm.advice() });
    }
    report.add("cleared", "cleared", true, "yes");
    report.append(reading::summary(c, s).await?);
    Ok(report)
}

/// Sets the targets so that nothing moves when the alarm ends: velocity 0, disabled, target position at the actual one.
async fn withdraw(c: &SdoSession) -> Result<(), Failure> {
    c.step("reset the targets");
    c.write(&TARGET_VELOCITY, 0).await?;
    c.write(&CONTROLWORD, 0).await?;
    let position = c.read(&POSITION_ACTUAL_VALUE).await?;
    c.write(&TARGET_POSITION, position).await
}

async fn reset(c: &SdoSession, alarm: Alarm) -> Result<(), Failure> {
    if alarm == Alarm::OverVoltage {
        let voltage = c.read(&VOLTAGE).await? as f64 / 327.0;
        if voltage > HIGHEST_VOLTAGE {
            let voltage = format!("{voltage:.1}");
            let what = crate::words!("{alarm}, the supply is at {voltage} V", alarm = alarm.words(), voltage);
            return Err(Failure::FaultPersists { what, advice: alarm.advice() });
        }
    }
    c.step("fault reset");
    c.write(&CONTROLWORD, control::RESET).await?;
    c.pause(CONTROL_NS).await?;
    c.write(&CONTROLWORD, 0).await?;
    if !is_gone(c).await? {
        c.step("drive output enable");
        c.write(&OUTPUT_ENABLE, 1).await?;
    }
    Ok(())
}

/// Sends the heartbeat that the drive waits for, then turns its heartbeat watchdog off: no more heartbeats will follow.
async fn heartbeat(c: &SdoSession) -> Result<(), Failure> {
    c.step("heartbeat");
    let watched = c.read(&CONSUMER_HEARTBEAT_TIME).await?;
    let node = u8::try_from(watched >> 16 & 0x7F).unwrap_or(MASTER);
    let node = if node == 0 { MASTER } else { node };
    c.send(ErrorControl { node, state: NmtState::Operational }.frame());
    c.pause(CONTROL_NS).await?;
    c.write(&CONSUMER_HEARTBEAT_TIME, 0).await?;
    c.send(ErrorControl { node, state: NmtState::Operational }.frame());
    c.note(format!(
        "the drive does not monitor its master any more (1016:01 = 0, it was 0x{watched:08X}) until a master sets it, or it \
         is reset: do not store that"
    ));
    Ok(())
}

async fn is_gone(c: &SdoSession) -> Result<bool, Failure> {
    match c.wait_for(&ALARM, "no alarm", CLEARING_NS, |code| code == 0).await {
        Ok(_) => Ok(statusword(c).await? & words::ALARM == 0),
        Err(Failure::NotInTime { .. }) => Ok(false),
        Err(failure) => Err(failure),
    }
}
