//! Torque on and torque off, and everything that must be right before a YZ-AIM moves.

use takt_rt::Nanoseconds;

use super::alarm::Alarm;
use super::objects::{ACCELERATION, VELOCITY};
use super::reading::{self, TENTHS};
use super::words::{self, control};
use crate::canopen::nmt::NmtCommand;
use crate::canopen::objects::*;
use crate::commission::contact;
use crate::commission::conversation::Conversation;
use crate::commission::failure::Failure;
use crate::commission::pace::Profile;
use crate::commission::report::Report;
use crate::commission::subject::Subject;

/// A cold drive ignores controlwords that follow each other sooner.
const CONTROL_NS: Nanoseconds = 20_000_000;
/// After NMT start, as working code waits.
const NMT_PAUSE_NS: Nanoseconds = 100_000_000;
/// The statusword follows the controlword within this.
const STATE_NS: Nanoseconds = 1_000_000_000;
/// After a ramp to standstill, before the torque goes.
const REST_NS: Nanoseconds = 200_000_000;
/// A ramp may take so much longer than it should.
const RAMP_NS: Nanoseconds = 2_000_000_000;
/// A halt, which may not be obeyed at all.
const HALT_NS: Nanoseconds = 300_000_000;
/// Slower than this (r/min) is standstill.
const STANDING_RPM: f64 = 1.0;
/// From here on 6083 is no ramp: the drive stops as fast as it can.
const NO_RAMP: i64 = 60_000;
/// The node under which the drive is watched over.
const MASTER: u8 = 127;
/// Between two heartbeats, and after how long without any the drive stops by itself.
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

/// The statusword.
pub async fn statusword(c: &Conversation) -> Result<u16, Failure> {
    Ok(c.read(&STATUSWORD).await? as u16)
}

/// Refuses a drive with torque.
pub async fn refuse_enabled(c: &Conversation) -> Result<(), Failure> {
    c.step("state");
    if words::is_enabled(statusword(c).await?) { Err(Failure::Enabled) } else { Ok(()) }
}

/// The right drive, without an alarm.
pub async fn greet(c: &Conversation, s: &Subject) -> Result<(), Failure> {
    contact::reach_family(c, s).await?;
    c.step("alarm check");
    let alarm = reading::alarm(c).await?;
    let has_alarm = statusword(c).await? & words::ALARM != 0;
    if has_alarm || alarm != Alarm::None { Err(reading::faulted(alarm)) } else { Ok(()) }
}

/// The drive at rest, in this mode, with this profile, and stopping by itself when takt falls silent.
pub async fn prepare(c: &Conversation, s: &Subject, mode: i64, profile: &Profile) -> Result<(), Failure> {
    // An axis that is enabled already is stopped and not let go: a loaded one would fall.
    if words::is_enabled(statusword(c).await?) {
        stop(c).await?;
    }
    c.step("NMT start");
    c.command(NmtCommand::Start);
    c.pause(NMT_PAUSE_NS).await?;
    if s.node == MASTER {
        c.note("node 127 cannot be watched over: should this program die, the drive goes on");
    } else {
        c.step("heartbeat");
        c.beat(MASTER, Some(HEARTBEAT_NS));
        c.write(&CONSUMER_HEARTBEAT_TIME, i64::from(MASTER) << 16 | HEARTBEAT_TIMEOUT_MS).await?;
    }
    c.step("targets that move nothing");
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

/// Torque on, with every target where the axis is. An axis that is enabled already is not let go.
pub async fn enable(c: &Conversation, s: &Subject) -> Result<i64, Failure> {
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

/// From any motion to rest without torque.
pub async fn come_to_rest(c: &Conversation) -> Result<(), Failure> {
    let rested = stop(c).await;
    if rested == Err(Failure::Interrupted) {
        return rested;
    }
    torque_off(c).await?;
    rested
}

/// From any motion to rest: the velocity ramps down, other modes halt. A drive that has never been enabled homes all the
/// same and may take no notice of a halt: position mode ends its homing.
async fn stop(c: &Conversation) -> Result<(), Failure> {
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

/// Waits for the end of a ramp: v/a and `patience_ns` at most, and 200 ms after it.
async fn standstill(c: &Conversation, patience_ns: Nanoseconds) -> Result<(), Failure> {
    let velocity = (c.read(&VELOCITY).await? as f64 * TENTHS).abs();
    let acceleration = c.read(&ACCELERATION).await?.clamp(1, NO_RAMP);
    let ramp_ns = (velocity / acceleration as f64 * 1e9) as Nanoseconds;
    let is_standing = |velocity: i64| (velocity as f64 * TENTHS).abs() <= STANDING_RPM;
    c.wait_for(&VELOCITY, "standstill", ramp_ns.saturating_add(patience_ns), is_standing).await?;
    c.pause(REST_NS).await
}

/// Waits for the end of a ramp that was commanded.
pub async fn ramp_down(c: &Conversation) -> Result<(), Failure> {
    standstill(c, RAMP_NS).await
}

/// Torque off at once.
pub async fn torque_off(c: &Conversation) -> Result<(), Failure> {
    c.step("disable");
    for word in [control::SWITCH_ON, control::SHUTDOWN] {
        c.write(&CONTROLWORD, word).await?;
        c.pause(CONTROL_NS).await?;
    }
    let is_off = |word: i64| !words::is_enabled(word as u16);
    c.wait_for(&STATUSWORD, "not enabled", STATE_NS, is_off).await.map(|_| ())
}

/// What a motion is ended with: rest, no torque, and the watch over the master as the drive had it: armed by the next
/// heartbeat.
pub async fn leave(c: &Conversation, watch: i64) -> Result<(), Failure> {
    come_to_rest(c).await?;
    c.step("farewell");
    c.write(&MODES_OF_OPERATION, mode::POSITION).await?;
    release(c, watch).await
}

/// Ends the watch, and sets it up again for whoever comes next.
pub async fn release(c: &Conversation, watch: i64) -> Result<(), Failure> {
    c.write(&CONSUMER_HEARTBEAT_TIME, 0).await?;
    c.beat(MASTER, None);
    c.write(&CONSUMER_HEARTBEAT_TIME, watch).await
}

/// `disable`
pub async fn disable(c: &Conversation, s: &Subject) -> Result<Report, Failure> {
    contact::reach_family(c, s).await?;
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
