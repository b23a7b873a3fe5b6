//! Torque on and torque off, and everything that must be right before an eRob moves.

use takt_rt::{DriveState, Nanoseconds, OperationMode, controlword};

use super::reading;
use super::state::modes_words;
use crate::canopen::nmt::NmtCommand;
use crate::canopen::objects::*;
use crate::commission::contact;
use crate::commission::conversation::Conversation;
use crate::commission::failure::Failure;
use crate::commission::pace::Profile;
use crate::commission::report::Report;
use crate::commission::subject::{Amount, Subject};
use crate::drive::mode_words;

/// A state of the drive follows its controlword within this; the brake takes part of it.
const STATE_NS: Nanoseconds = 2_000_000_000;
/// The node under which the drive is watched over.
const MASTER: u8 = 127;
/// Between two heartbeats, and after how long without any the drive stops by itself.
const HEARTBEAT_NS: Nanoseconds = 100_000_000;
const HEARTBEAT_TIMEOUT_MS: i64 = 500;
/// A drive that answers `start` needs no time for it; this leaves some.
const NMT_PAUSE_NS: Nanoseconds = 20_000_000;

/// The state of the drive.
pub async fn state(c: &Conversation) -> Result<DriveState, Failure> {
    Ok(DriveState::decode(c.read(&STATUSWORD).await? as u16))
}

/// The right drive, without a fault.
pub async fn greet(c: &Conversation, s: &Subject) -> Result<(), Failure> {
    contact::reach_family(c, s).await?;
    c.step("fault check");
    if state(c).await?.is_faulted() { Err(reading::fault(c).await?) } else { Ok(()) }
}

/// The drive without torque, in this mode, and stopping by itself when takt falls silent.
pub async fn prepare(
    c: &Conversation,
    s: &Subject,
    mode: OperationMode,
    profile: &Profile,
) -> Result<(), Failure> {
    come_to_rest(c, s).await?;
    c.step("supported modes");
    let supported = c.read(&SUPPORTED_DRIVE_MODES).await? as u32;
    if supported & mode.supported_bit() == 0 {
        return Err(Failure::Unsupported {
            what: format!("this drive has no {} mode", mode_words(mode)),
            instead: format!("6502 names {}", modes_words(supported)),
        });
    }
    c.step("NMT start");
    c.command(NmtCommand::Start);
    c.pause(NMT_PAUSE_NS).await?;
    watch_over(c, s).await?;
    c.step("mode of operation");
    c.write(&MODES_OF_OPERATION, mode as i64).await?;
    c.wait_for(&MODES_OF_OPERATION_DISPLAY, "the mode", STATE_NS, |value| value == mode as i64).await?;
    c.step("profile");
    for (object, value) in [
        (PROFILE_VELOCITY, profile.velocity),
        (PROFILE_ACCELERATION, profile.acceleration),
        (PROFILE_DECELERATION, profile.deceleration),
        (QUICK_STOP_DECELERATION, s.stopping_deceleration()),
    ] {
        if let Some(value) = value {
            c.write(&object, value).await?;
        }
    }
    Ok(())
}

/// The drive enters NMT stopped, and with that stops its motion, when the heartbeat of this program ceases.
async fn watch_over(c: &Conversation, s: &Subject) -> Result<(), Failure> {
    if s.node == MASTER {
        c.note("node 127 cannot be watched over: should this program die, the drive goes on");
        return Ok(());
    }
    c.step("heartbeat");
    c.beat(MASTER, Some(HEARTBEAT_NS));
    c.write(&COMMUNICATION_ERROR_BEHAVIOUR, error_behaviour::STOPPED.into()).await?;
    c.write(&CONSUMER_HEARTBEAT_TIME, i64::from(MASTER) << 16 | HEARTBEAT_TIMEOUT_MS).await
}

/// Torque on, with every target where the axis is.
pub async fn enable(c: &Conversation, s: &Subject) -> Result<i64, Failure> {
    c.step("target at the actual position");
    let position = c.read(&POSITION_ACTUAL_VALUE).await?;
    c.write(&TARGET_POSITION, position).await?;
    c.write(&TARGET_VELOCITY, 0).await?;
    c.write(&TARGET_TORQUE, 0).await?;
    c.step("enable");
    for (word, wanted, what) in [
        (controlword::SHUTDOWN, DriveState::ReadyToSwitchOn, "ready to switch on"),
        (controlword::SWITCH_ON, DriveState::SwitchedOn, "switched on"),
        (controlword::ENABLE_OPERATION, DriveState::OperationEnabled, "operation enabled"),
    ] {
        c.write(&CONTROLWORD, word.into()).await?;
        c.wait_for(&STATUSWORD, what, STATE_NS, |value| {
            let state = DriveState::decode(value as u16);
            state == wanted || state.is_faulted()
        })
        .await?;
        if state(c).await?.is_faulted() {
            return Err(reading::fault(c).await?);
        }
    }
    let moved = c.read(&POSITION_ACTUAL_VALUE).await?.saturating_sub(position);
    let permitted = (s.counts_per_turn / 360.0) as i64;
    if moved.abs() > permitted { Err(Failure::Jumped { counts: moved }) } else { Ok(position) }
}

/// From any motion to rest without torque. Does nothing to a drive that has no torque.
pub async fn come_to_rest(c: &Conversation, s: &Subject) -> Result<(), Failure> {
    if !state(c).await?.has_torque() {
        return Ok(());
    }
    c.step("stop in control");
    let deceleration = match s.stopping_deceleration() {
        Some(deceleration) => {
            c.write(&QUICK_STOP_DECELERATION, deceleration).await?;
            deceleration
        }
        None => c.read(&QUICK_STOP_DECELERATION).await?,
    };
    let velocity = c.read(&VELOCITY_ACTUAL_VALUE).await?;
    c.write(&CONTROLWORD, controlword::QUICK_STOP.into()).await?;
    let within_ns = s.stopping_ns(velocity, deceleration.max(1));
    let crawl = crawl(s);
    c.wait_for(&VELOCITY_ACTUAL_VALUE, "standstill", within_ns, |velocity| velocity.abs() <= crawl).await?;
    torque_off(c).await
}

/// Torque off at once. Also leaves bit 7 low, so that a later fault reset is a rising edge.
pub async fn torque_off(c: &Conversation) -> Result<(), Failure> {
    c.step("disable");
    c.write(&CONTROLWORD, controlword::DISABLE_VOLTAGE.into()).await?;
    let has_none = |word: i64| !DriveState::decode(word as u16).has_torque();
    c.wait_for(&STATUSWORD, "a state without torque", STATE_NS, has_none).await.map(|_| ())
}

/// What a motion is ended with: rest, no torque, nobody watching.
pub async fn leave(c: &Conversation, s: &Subject) -> Result<(), Failure> {
    come_to_rest(c, s).await?;
    c.step("farewell");
    c.write(&CONSUMER_HEARTBEAT_TIME, 0).await?;
    c.beat(MASTER, None);
    c.command(NmtCommand::EnterPreOperational);
    Ok(())
}

/// Slower than this (drive units) the brake may engage: a hundredth of the highest velocity.
fn crawl(s: &Subject) -> i64 {
    let limit = s.limits.map(|limits| s.velocity_raw(Amount::Joint(limits.velocity)).abs() / 100);
    limit.unwrap_or((s.counts_per_turn / 360.0) as i64)
}

/// `disable`
pub async fn disable(c: &Conversation, s: &Subject) -> Result<Report, Failure> {
    contact::reach_family(c, s).await?;
    c.step("state");
    let had_torque = state(c).await?.has_torque();
    come_to_rest(c, s).await?;
    if !had_torque {
        torque_off(c).await?;
    }
    let mut report = Report::new();
    let words = if had_torque { "enabled" } else { "not enabled" };
    report.add("was_enabled", "before", had_torque, words);
    report.append(reading::summary(c, s).await?);
    Ok(report)
}
