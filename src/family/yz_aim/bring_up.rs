//! Bring-up, start and shutdown of a YZ-AIM integrated servo, CANopen edition (manual v1.62, and field experience).

use takt_rt::controlword;
use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::canopen::nmt::{NmtCommand, NmtState};
use takt_wire::canopen::object::{DataType, Object};
use takt_wire::canopen::objects::*;

use super::{HIGHEST_SPEED_RPM, NO_RAMP, STANDSTILL, answers_sync};
use crate::config::Axis;
use crate::family::bring_up::axis_units::turns;
use crate::family::bring_up::{AxisSession, Check, RESTART_STEP, StepResult};
use crate::family::bring_up::{actual_position, configuration_file, heartbeat, identity, pdo_mapping};

/// Special function 2619: interpolation over CANopen.
const INTERPOLATION: i64 = 7;
/// Statusword bits 0 and 1 (switched on) are clear.
const NOT_STARTED: Check = Check::Masked { value: 0, mask: 0x03 };

const ALARM_CODE: Object = Object::new(0x260E, 0, DataType::U16, "alarm code");
const SPECIAL_FUNCTION: Object = Object::new(0x2619, 0, DataType::U16, "special function");
const ACCELERATION: Object = Object::new(0x6083, 0, DataType::U32, "acceleration");

/// From any state to pre-operational, configured, without torque.
pub(super) async fn configure(c: &AxisSession<'_>) -> StepResult {
    c.step(
        RESTART_STEP,
        "check that the drive is powered, the wiring and the termination of the bus, its bit rate, and its node ID",
    );
    c.restart_communication().await?;
    identity::compare(c, identity::PROFILE_CIA402).await?;
    come_to_rest(c).await?;
    configuration_file::write(c).await?;
    process_data(c).await?;
    motion(c).await?;
    target_at_actual_position(c).await?;
    heartbeat::produce(c).await?;
    heartbeat::watch_master(c).await
}

/// From configured to operational.
pub(super) async fn start(c: &AxisSession<'_>) -> StepResult {
    c.step("start", "check that no other master commands this node");
    c.command(NmtCommand::Start, NmtState::Operational).await?;
    read_state(c).await?;
    actual_position::read(c).await
}

/// From operational to pre-operational, without torque, heartbeat watchdog off.
pub(super) async fn shut_down(c: &AxisSession<'_>) -> StepResult {
    c.step("shut down", "power-cycle the drive before the next run");
    c.wake_up(NmtCommand::EnterPreOperational).await?;
    c.command(NmtCommand::EnterPreOperational, NmtState::PreOperational).await?;
    come_to_rest(c).await?;
    heartbeat::end_watch(c, "expect alarm 20 of the drive; it clears at the next bring-up").await
}

async fn read_state(c: &AxisSession<'_>) -> StepResult {
    c.read(STATUSWORD, Check::Any, |facts, value| facts.statusword = value as u16).await?;
    c.read(ALARM_CODE, Check::Any, |facts, value| facts.error_code = ErrorCode(value as u16)).await
}

/// Stops and disables the drive, which may still be enabled or moving.
async fn come_to_rest(c: &AxisSession<'_>) -> StepResult {
    c.step(
        "standstill without torque",
        "the drive holds or moves its axis and does not respond: use the emergency stop, then power-cycle it",
    );
    let within_ns = c.timing.confirm_timeout_ns;
    read_state(c).await?;
    if c.facts().state().has_torque() {
        // Halt (controlword bit 8) stops with the drive's own deceleration and keeps the shaft locked.
        c.write(CONTROLWORD, (controlword::ENABLE_OPERATION | controlword::HALT).into()).await?;
        c.wait_for(VELOCITY_ACTUAL_VALUE, Check::Standstill(STANDSTILL), within_ns, |_, _| ()).await?;
    }
    c.write(CONTROLWORD, controlword::DISABLE_VOLTAGE.into()).await?;
    // Homing runs without a controlword; only another mode ends it.
    c.write(MODES_OF_OPERATION, c.axis.control.operation_mode() as i64).await?;
    c.wait_for(STATUSWORD, NOT_STARTED, within_ns, |facts, value| facts.statusword = value as u16).await
}

/// Reads the fixed mapping from the drive, because it differs between firmware editions. Only the transmission of the
/// TPDOs can be chosen.
async fn process_data(c: &AxisSession<'_>) -> StepResult {
    c.step("TPDO transmission", "let the drive answer SYNC: answers_sync = true");
    let transmit = |number| PdoParameters::of(PdoDirection::Transmit, number);
    let answers: i64 = if answers_sync(c.axis) { 1 } else { 255 };
    c.write_and_read_back(transmit(2).transmission_type(), answers).await?;
    c.write_optional(transmit(1).event_timer(), 0).await?;
    c.write_optional(transmit(3).event_timer(), 0).await?;
    pdo_mapping::take_reported(c).await
}

async fn motion(c: &AxisSession<'_>) -> StepResult {
    let is_interpolated = !c.axis.control.is_profile();
    if is_interpolated {
        c.step(
            "special function",
            "interpolation must have been stored in the drive: takt drive CONFIG AXIS write 2619 7, then save, then \
             power-cycle it",
        );
        c.read(SPECIAL_FUNCTION, Check::Equals(INTERPOLATION), |_, _| ()).await?;
    }
    c.step("limits", "choose limits for this axis that its drive accepts");
    c.write(PROFILE_VELOCITY, speed_rpm(c.axis)).await?;
    c.write_and_read_back(ACCELERATION, if is_interpolated { NO_RAMP } else { ramp(c.axis) }).await
}

/// The velocity limit in r/min of the motor, limited to the drive's range.
fn speed_rpm(axis: &Axis) -> i64 {
    (turns(axis, axis.limits.velocity) * 60.0).ceil().clamp(1.0, HIGHEST_SPEED_RPM) as i64
}

/// The drive has one ramp for both directions, in (r/min)/s.
fn ramp(axis: &Axis) -> i64 {
    let slower = axis.limits.acceleration.min(axis.limits.deceleration);
    ((turns(axis, slower) * 60.0).round() as i64).clamp(1, NO_RAMP - 1)
}

/// No object shows the mode, so it is sent again with each controlword.
async fn target_at_actual_position(c: &AxisSession<'_>) -> StepResult {
    c.step("target at the actual position", "clear the drive's alarm");
    c.write(TARGET_VELOCITY, 0).await?;
    actual_position::make_target(c).await?;
    c.write(MODES_OF_OPERATION, c.axis.control.operation_mode() as i64).await
}
