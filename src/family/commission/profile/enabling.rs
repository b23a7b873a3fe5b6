//! Enabling and disabling, with the checks before motion.

use takt_rt::{DriveState, Nanoseconds, OperationMode, controlword};
use takt_wire::canopen::nmt::NmtCommand;
use takt_wire::canopen::objects::*;

use super::access::{read_if_there, write_if_writable};
use super::objects::ABORT_CONNECTION_OPTION;
use super::reading;
use super::words::modes_words;
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
/// Value of object 6007: the drive reacts as to a fault.
const FAULT_SIGNAL: i64 = 1;
/// How long a drive may move on after a quick stop, if it does not show its velocity.
const UNSEEN_STANDSTILL_NS: Nanoseconds = 500_000_000;
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
    if state(c).await?.is_faulted() { Err(reading::fault(c, s).await?) } else { Ok(()) }
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
    let supported = read_if_there(c, s, &SUPPORTED_DRIVE_MODES).await?.unwrap_or(0) as u32;
    if supported & mode.supported_bit() == 0 && !s.adds_mode(mode) {
        return Err(Failure::Unsupported {
            what: format!("this drive has no {} mode", mode.name()),
            instead: match supported {
                0 => "its data sheet tells which modes it has".to_owned(),
                _ => format!("6502 names {}", modes_words(supported)),
            },
        });
    }
    c.step("NMT start");
    c.command(NmtCommand::Start);
    c.pause(NMT_PAUSE_NS).await?;
    arm_watchdog(c, s).await?;
    c.step("mode of operation");
    c.write(&MODES_OF_OPERATION, mode as i64).await?;
    if s.has(MODES_OF_OPERATION_DISPLAY.address) {
        let is_shown = |value| value == mode as i64;
        c.wait_for(&MODES_OF_OPERATION_DISPLAY, "the mode", STATE_NS, is_shown).await?;
    }
    c.step("profile");
    for (object, value) in [
        (PROFILE_VELOCITY, profile.velocity.map(|velocity| s.profile_velocity_raw(velocity))),
        (PROFILE_ACCELERATION, profile.acceleration),
        (PROFILE_DECELERATION, profile.deceleration),
        (QUICK_STOP_DECELERATION, s.stopping_deceleration()),
    ] {
        if let Some(value) = value {
            write_if_writable(c, s, &object, value).await?;
        }
    }
    Ok(())
}

/// Arms the heartbeat watchdog (1016:01, 1029:01, 6007): without this program's heartbeat the drive enters NMT stopped and
/// reacts as to a fault, which stops its motion.
async fn arm_watchdog(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
    if s.node == MASTER {
        c.note("node 127 cannot use the heartbeat watchdog: if this program ends unexpectedly, the drive keeps moving");
        return Ok(());
    }
    if !s.is_writable(CONSUMER_HEARTBEAT_TIME.address) {
        c.note(
            "this drive has no heartbeat watchdog (1016): if this program ends unexpectedly, the drive keeps moving",
        );
        return Ok(());
    }
    c.step("heartbeat");
    c.set_heartbeat(MASTER, Some(HEARTBEAT_NS));
    write_if_writable(c, s, &COMMUNICATION_ERROR_BEHAVIOUR, error_behaviour::STOPPED.into()).await?;
    write_if_writable(c, s, &ABORT_CONNECTION_OPTION, FAULT_SIGNAL).await?;
    c.write(&CONSUMER_HEARTBEAT_TIME, i64::from(MASTER) << 16 | HEARTBEAT_TIMEOUT_MS).await
}

/// Enables the drive with every target at the actual value.
pub async fn enable(c: &SdoSession, s: &TargetDrive) -> Result<i64, Failure> {
    c.step("target at the actual position");
    let position = c.read(&POSITION_ACTUAL_VALUE).await?;
    for (target, value) in [(TARGET_POSITION, position), (TARGET_VELOCITY, 0), (TARGET_TORQUE, 0)] {
        write_if_writable(c, s, &target, value).await?;
    }
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
            return Err(reading::fault(c, s).await?);
        }
    }
    let moved = c.read(&POSITION_ACTUAL_VALUE).await?.saturating_sub(position);
    if moved.abs() > s.near_counts() { Err(Failure::Jumped { counts: moved }) } else { Ok(position) }
}

/// Stops any motion by quick stop, then disables. Does nothing to a drive without torque.
pub async fn come_to_rest(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
    if !state(c).await?.has_torque() {
        return Ok(());
    }
    c.step("stop in control");
    let deceleration = match s.stopping_deceleration() {
        Some(deceleration) => {
            write_if_writable(c, s, &QUICK_STOP_DECELERATION, deceleration).await?;
            deceleration
        }
        None => read_if_there(c, s, &QUICK_STOP_DECELERATION).await?.unwrap_or(1),
    };
    let velocity = read_if_there(c, s, &VELOCITY_ACTUAL_VALUE).await?;
    c.write(&CONTROLWORD, controlword::QUICK_STOP.into()).await?;
    match velocity {
        Some(velocity) => {
            let within_ns = s.stopping_ns(velocity, deceleration.max(1));
            wait_for_standstill(c, s, within_ns).await?;
        }
        None => c.pause(UNSEEN_STANDSTILL_NS).await?,
    }
    torque_off(c).await
}

/// Waits until the velocity (606C) is almost zero.
pub async fn wait_for_standstill(
    c: &SdoSession,
    s: &TargetDrive,
    within_ns: Nanoseconds,
) -> Result<(), Failure> {
    let threshold = standstill_threshold(s);
    let is_slow = |velocity: i64| velocity.abs() <= threshold;
    c.wait_for(&VELOCITY_ACTUAL_VALUE, "standstill", within_ns, is_slow).await.map(|_| ())
}

/// Leaves the drive enabled without a watchdog, because the heartbeat ends with this program.
pub async fn disarm_watchdog(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
    write_if_writable(c, s, &CONSUMER_HEARTBEAT_TIME, 0).await.map(|_| ())
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
    disarm_watchdog(c, s).await?;
    c.set_heartbeat(MASTER, None);
    c.command(NmtCommand::EnterPreOperational);
    Ok(())
}

/// Standstill threshold in drive units: a hundredth of the velocity limit, or else a degree of a turn per second. Below it
/// the brake may engage.
fn standstill_threshold(s: &TargetDrive) -> i64 {
    let units = |velocity: f64| s.velocity_raw(CommandValue::Joint(velocity)).abs();
    let threshold = match s.limits {
        Some(limits) => units(limits.velocity) / 100,
        None => units(s.near_counts() as f64 / s.scale.resolution()),
    };
    threshold.max(1)
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
