//! Enabling and disabling an eRob, with the checks before motion.

use takt_rt::{DriveState, Nanoseconds, OperationMode, controlword};

use super::reading;
use super::state::modes_words;
use crate::canopen::nmt::NmtCommand;
use crate::canopen::objects::*;
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::motion_profile::DriveProfile;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::{CommandValue, TargetDrive};

/// Longest time for a CiA 402 state change after a controlword; releasing the brake takes part of it.
const STATE_NS: Nanoseconds = 2_000_000_000;
/// Node ID of this program's heartbeat, which the drive consumes.
const MASTER: u8 = 127;
/// Heartbeat period and the drive's heartbeat timeout (object 1016:01).
const HEARTBEAT_NS: Nanoseconds = 100_000_000;
const HEARTBEAT_TIMEOUT_MS: i64 = 500;
/// Wait after NMT start; the drive changes state at once.
const NMT_PAUSE_NS: Nanoseconds = 20_000_000;

/// Reads the CiA 402 state.
pub async fn state(c: &SdoSession) -> Result<DriveState, Failure> {
    Ok(DriveState::decode(c.read(&STATUSWORD).await? as u16))
}

/// Checks the vendor ID and that the drive has no fault.
pub async fn check_ready(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
    contact::connect_family(c, s).await?;
    c.step("fault check");
    if state(c).await?.is_faulted() { Err(reading::fault(c).await?) } else { Ok(()) }
}

/// Disables the drive, sets the mode and the profile, and arms the drive's heartbeat watchdog.
pub async fn prepare(
    c: &SdoSession,
    s: &TargetDrive,
    mode: OperationMode,
    profile: &DriveProfile,
) -> Result<(), Failure> {
    come_to_rest(c, s).await?;
    c.step("supported modes");
    let supported = c.read(&SUPPORTED_DRIVE_MODES).await? as u32;
    if supported & mode.supported_bit() == 0 {
        return Err(Failure::Unsupported {
            what: format!("this drive has no {} mode", mode.name()),
            instead: format!("6502 names {}", modes_words(supported)),
        });
    }
    c.step("NMT start");
    c.command(NmtCommand::Start);
    c.pause(NMT_PAUSE_NS).await?;
    arm_watchdog(c, s).await?;
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

/// Arms the heartbeat watchdog (1016:01, 1029:01): without this program's heartbeat the drive enters NMT stopped, which
/// stops its motion.
async fn arm_watchdog(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
    if s.node == MASTER {
        c.note("node 127 cannot use the heartbeat watchdog: if this program ends unexpectedly, the drive keeps moving");
        return Ok(());
    }
    c.step("heartbeat");
    c.set_heartbeat(MASTER, Some(HEARTBEAT_NS));
    c.write(&COMMUNICATION_ERROR_BEHAVIOUR, error_behaviour::STOPPED.into()).await?;
    c.write(&CONSUMER_HEARTBEAT_TIME, i64::from(MASTER) << 16 | HEARTBEAT_TIMEOUT_MS).await
}

/// Enables the drive with every target at the actual value.
pub async fn enable(c: &SdoSession, s: &TargetDrive) -> Result<i64, Failure> {
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

/// Stops any motion by quick stop, then disables. Does nothing to a drive without torque.
pub async fn come_to_rest(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
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
    let standstill_threshold = standstill_threshold(s);
    c.wait_for(&VELOCITY_ACTUAL_VALUE, "standstill", within_ns, |velocity| {
        velocity.abs() <= standstill_threshold
    })
    .await?;
    torque_off(c).await
}

/// Disables at once (controlword: disable voltage). Bit 7 stays low, so that a later fault reset is a rising edge.
pub async fn torque_off(c: &SdoSession) -> Result<(), Failure> {
    c.step("disable");
    c.write(&CONTROLWORD, controlword::DISABLE_VOLTAGE.into()).await?;
    let has_none = |word: i64| !DriveState::decode(word as u16).has_torque();
    c.wait_for(&STATUSWORD, "a state without torque", STATE_NS, has_none).await.map(|_| ())
}

/// Ends a motion: standstill, torque off, heartbeat watchdog off, NMT pre-operational.
pub async fn shut_down(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
    come_to_rest(c, s).await?;
    c.step("shut down");
    c.write(&CONSUMER_HEARTBEAT_TIME, 0).await?;
    c.set_heartbeat(MASTER, None);
    c.command(NmtCommand::EnterPreOperational);
    Ok(())
}

/// Standstill threshold in drive units, a hundredth of the velocity limit. Below it the brake may engage.
fn standstill_threshold(s: &TargetDrive) -> i64 {
    let limit = s.limits.map(|limits| s.velocity_raw(CommandValue::Joint(limits.velocity)).abs() / 100);
    limit.unwrap_or((s.counts_per_turn / 360.0) as i64)
}

/// `disable`
pub async fn disable(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    contact::connect_family(c, s).await?;
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
