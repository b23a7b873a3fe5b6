//! Enabling and disabling a YZ-AIM, with the checks before motion.

use takt_rt::Nanoseconds;
use takt_wire::canopen::nmt::NmtCommand;
use takt_wire::canopen::objects::*;

use super::objects::{ACCELERATION, VELOCITY};
use super::reading::{self, TENTHS};
use super::words::{self, control};
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::motion_profile::DriveProfile;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::yz_aim::Alarm;
use crate::family::yz_aim::{NO_RAMP, STANDSTILL};

/// Pause between controlwords; a drive that has just booted ignores controlwords that follow sooner.
const CONTROL_NS: Nanoseconds = 20_000_000;
/// Pause after NMT start, as in field-tested code.
const NMT_PAUSE_NS: Nanoseconds = 100_000_000;
/// Longest time until the statusword follows the controlword.
const STATE_NS: Nanoseconds = 1_000_000_000;
/// Pause after a ramp to standstill, before the torque goes off.
const REST_NS: Nanoseconds = 200_000_000;
/// Tolerance of a ramp's duration.
const RAMP_NS: Nanoseconds = 2_000_000_000;
/// Time given to a halt, which the drive may ignore.
const HALT_NS: Nanoseconds = 300_000_000;
/// Node ID of this program's heartbeat, which the drive consumes.
const MASTER: u8 = 127;
/// Heartbeat period and the drive's heartbeat timeout (object 1016:01).
const HEARTBEAT_NS: Nanoseconds = 100_000_000;
const HEARTBEAT_TIMEOUT_MS: i64 = 500;

/// Modes of operation.
pub mod mode {
    /// Position.
    pub const POSITION: i64 = 1;
    /// Velocity.
    pub const VELOCITY: i64 = 3;
    /// Homing.
    pub const HOMING: i64 = 6;
}

/// Reads the statusword.
pub async fn statusword(c: &SdoSession) -> Result<u16, Failure> {
    Ok(c.read(&STATUSWORD).await? as u16)
}

/// Refuses a drive that is enabled.
pub async fn refuse_enabled(c: &SdoSession) -> Result<(), Failure> {
    c.step("state");
    if words::is_enabled(statusword(c).await?) { Err(Failure::Enabled) } else { Ok(()) }
}

/// Checks the vendor ID and that the drive has no alarm.
pub async fn check_ready(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
    contact::connect_family(c, s).await?;
    c.step("alarm check");
    let alarm = reading::alarm(c).await?;
    let has_alarm = statusword(c).await? & words::ALARM != 0;
    if has_alarm || alarm != Alarm::None { Err(reading::faulted(alarm)) } else { Ok(()) }
}

/// Stops the drive, sets the mode and the profile, and arms the drive's heartbeat watchdog.
pub async fn prepare(
    c: &SdoSession,
    s: &TargetDrive,
    mode: i64,
    profile: &DriveProfile,
) -> Result<(), Failure> {
    // An enabled axis is stopped but stays enabled, because a loaded axis would fall.
    if words::is_enabled(statusword(c).await?) {
        stop(c).await?;
    }
    c.step("NMT start");
    c.command(NmtCommand::Start);
    c.pause(NMT_PAUSE_NS).await?;
    if s.node == MASTER {
        c.note("node 127 cannot use the heartbeat watchdog: if this program ends unexpectedly, the drive keeps moving");
    } else {
        c.step("heartbeat");
        c.set_heartbeat(MASTER, Some(HEARTBEAT_NS));
        c.write(&CONSUMER_HEARTBEAT_TIME, i64::from(MASTER) << 16 | HEARTBEAT_TIMEOUT_MS).await?;
    }
    c.step("targets at the actual position");
    c.write(&TARGET_VELOCITY, 0).await?;
    let position = c.read(&POSITION_ACTUAL_VALUE).await?;
    c.write(&TARGET_POSITION, position).await?;
    c.step("mode of operation");
    c.write(&MODES_OF_OPERATION, mode).await?;
    c.step("profile");
    if let Some(velocity) = profile.velocity {
        c.write(&PROFILE_VELOCITY, velocity).await?;
    }
    if let Some(acceleration) = profile.acceleration {
        c.write(&ACCELERATION, acceleration.min(NO_RAMP - 1)).await?;
    }
    Ok(())
}

/// Enables the drive with every target at the actual value. An axis that is already enabled stays so.
pub async fn enable(c: &SdoSession, s: &TargetDrive) -> Result<i64, Failure> {
    c.step("target at the actual position");
    let position = c.read(&POSITION_ACTUAL_VALUE).await?;
    c.write(&TARGET_POSITION, position).await?;
    c.step("enable");
    if !words::is_enabled(statusword(c).await?) {
        for word in [control::SHUTDOWN, control::SWITCH_ON] {
            c.write(&CONTROLWORD, word).await?;
            c.pause(CONTROL_NS).await?;
        }
    }
    c.write(&CONTROLWORD, control::ENABLE).await?;
    c.pause(CONTROL_NS).await?;
    let is_decided = |word: i64| words::is_enabled(word as u16) || word as u16 & words::ALARM != 0;
    let word = c.wait_for(&STATUSWORD, "enabled", STATE_NS, is_decided).await? as u16;
    if word & words::ALARM != 0 {
        return Err(reading::faulted(reading::alarm(c).await?));
    }
    let moved = c.read(&POSITION_ACTUAL_VALUE).await?.saturating_sub(position);
    let permitted = (s.counts_per_turn / 36.0) as i64;
    if moved.abs() > permitted { Err(Failure::Jumped { counts: moved }) } else { Ok(position) }
}

/// Stops any motion, then disables.
pub async fn come_to_rest(c: &SdoSession) -> Result<(), Failure> {
    let rested = stop(c).await;
    if rested == Err(Failure::Interrupted) {
        return rested;
    }
    torque_off(c).await?;
    rested
}

/// Stops any motion: velocity mode ramps down, other modes halt. A drive that was never enabled can still run homing
/// and may ignore a halt; changing to position mode ends its homing.
async fn stop(c: &SdoSession) -> Result<(), Failure> {
    c.step("stop in control");
    c.write(&TARGET_VELOCITY, 0).await?;
    if c.read(&MODES_OF_OPERATION).await? == mode::VELOCITY {
        return standstill(c, RAMP_NS).await;
    }
    c.write(&CONTROLWORD, control::HALT).await?;
    match standstill(c, HALT_NS).await {
        Err(Failure::NotInTime { .. }) => {
            c.step("stop by position mode");
            c.write(&MODES_OF_OPERATION, mode::POSITION).await?;
            standstill(c, RAMP_NS).await
        }
        other => other,
    }
}

/// Waits for standstill: the ramp time v/a plus `patience_ns` at most, then 200 ms more.
async fn standstill(c: &SdoSession, patience_ns: Nanoseconds) -> Result<(), Failure> {
    let velocity = (c.read(&VELOCITY).await? as f64 * TENTHS).abs();
    let acceleration = c.read(&ACCELERATION).await?.clamp(1, NO_RAMP);
    let ramp_ns = (velocity / acceleration as f64 * 1e9) as Nanoseconds;
    let is_standing = |velocity: i64| velocity.abs() <= STANDSTILL;
    c.wait_for(&VELOCITY, "standstill", ramp_ns.saturating_add(patience_ns), is_standing).await?;
    c.pause(REST_NS).await
}

/// Waits for the end of a commanded ramp.
pub async fn ramp_down(c: &SdoSession) -> Result<(), Failure> {
    standstill(c, RAMP_NS).await
}

/// Disables at once.
pub async fn torque_off(c: &SdoSession) -> Result<(), Failure> {
    c.step("disable");
    for word in [control::SWITCH_ON, control::SHUTDOWN] {
        c.write(&CONTROLWORD, word).await?;
        c.pause(CONTROL_NS).await?;
    }
    let is_off = |word: i64| !words::is_enabled(word as u16);
    c.wait_for(&STATUSWORD, "not enabled", STATE_NS, is_off).await.map(|_| ())
}

/// Ends a motion: standstill, torque off, and the heartbeat watchdog as it was before. The next heartbeat arms it.
pub async fn shut_down(c: &SdoSession, consumer_heartbeat: i64) -> Result<(), Failure> {
    come_to_rest(c).await?;
    c.step("shut down");
    c.write(&MODES_OF_OPERATION, mode::POSITION).await?;
    restore_watchdog(c, consumer_heartbeat).await
}

/// Turns the heartbeat watchdog off, then restores the value of 1016:01 for the next master.
pub async fn restore_watchdog(c: &SdoSession, consumer_heartbeat: i64) -> Result<(), Failure> {
    c.write(&CONSUMER_HEARTBEAT_TIME, 0).await?;
    c.set_heartbeat(MASTER, None);
    c.write(&CONSUMER_HEARTBEAT_TIME, consumer_heartbeat).await
}

/// `disable`
pub async fn disable(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    contact::connect_family(c, s).await?;
    c.step("state");
    let was_enabled = words::is_enabled(statusword(c).await?);
    if was_enabled {
        come_to_rest(c).await?;
    } else {
        torque_off(c).await?;
    }
    let mut report = Report::new();
    report.add("was_enabled", "before", was_enabled, if was_enabled { "enabled" } else { "not enabled" });
    report.append(reading::summary(c, s).await?);
    Ok(report)
}
