//! YZ-AIM integrated servos, CANopen edition (manual v1.62, and field experience): the steps of bring-up, start and
//! shutdown.
//!
//! The PDO mapping is fixed. The drive has no mode display (6061) and no emergency messages, and it does not answer SDO
//! requests for unknown objects.

use takt_rt::controlword;

use super::bring_up::BringUpTiming;
use super::step::{Action, Check, Condition, Fact, ProcedureStep, ReadBack, ValueSource};
use super::step_list::{StepList, rounded_up, turns, watched_heartbeat};
use crate::canopen::nmt::{NmtCommand, NmtState};
use crate::canopen::object::{DataType, Object};
use crate::canopen::objects::{self, PdoDirection, PdoParameters};
use crate::config::{Axis, Config};
use crate::family::yz_aim::{HIGHEST_SPEED_RPM, answers_sync};

/// At this value of 6083 and above the drive uses no ramp (4.3).
pub const NO_RAMP: i64 = 60_000;
/// Below this speed the drive counts as standing: 1 r/min, in the 0.1 r/min of object 606C by SDO (A27).
pub const STANDSTILL: i64 = 10;
/// Special function 2619: interpolation over CANopen.
const INTERPOLATION: i64 = 7;
/// Statusword bits 0 and 1 (switched on) are clear.
const NOT_STARTED: Check = Check::Masked { value: 0, mask: 0x03 };

const ALARM_CODE: Object = Object::new(0x260E, 0, DataType::U16, "alarm code");
const SPECIAL_FUNCTION: Object = Object::new(0x2619, 0, DataType::U16, "special function");
const ACCELERATION: Object = Object::new(0x6083, 0, DataType::U32, "acceleration");

/// From any state to pre-operational, configured, without torque.
pub fn configure(config: &Config, axis: &Axis, timing: &BringUpTiming) -> Vec<ProcedureStep> {
    let mut list = StepList::new(
        "restart of its communication",
        "check that the drive is powered, the wiring and the termination of the bus, its bit rate, and its node ID",
    );
    list.nmt(
        NmtCommand::ResetCommunication,
        Some(NmtState::BootUp),
        timing.boot_up_timeout_ns,
        timing.reset_repeat_ns,
    );
    list.identity(axis);
    come_to_rest(&mut list, axis, timing);
    list.configuration_file(axis);
    process_data(&mut list, axis);
    motion(&mut list, axis);
    target_at_actual_position(&mut list, axis);
    list.begin("heartbeat", "choose heartbeat times that this drive accepts");
    list.write_and_read_back(objects::PRODUCER_HEARTBEAT_TIME, own_heartbeat_ms(axis));
    list.write_and_read_back(objects::CONSUMER_HEARTBEAT_TIME, watched_heartbeat(config));
    list.steps
}

/// From configured to operational.
pub fn start(axis: &Axis, timing: &BringUpTiming) -> Vec<ProcedureStep> {
    let mut list = StepList::new("start", "check that no other master commands this node");
    list.nmt_reported(NmtCommand::Start, NmtState::Operational, axis, timing);
    list.read(objects::STATUSWORD, Check::Any, Fact::Statusword);
    list.read(ALARM_CODE, Check::Any, Fact::ErrorCode);
    list.read(objects::POSITION_ACTUAL_VALUE, Check::Any, Fact::Position);
    list.steps
}

/// From operational to pre-operational, without torque, heartbeat watchdog off.
pub fn shut_down(axis: &Axis, timing: &BringUpTiming) -> Vec<ProcedureStep> {
    let mut list = StepList::new("shut down", "power-cycle the drive before the next run");
    list.wake_up(NmtCommand::EnterPreOperational);
    list.nmt_reported(NmtCommand::EnterPreOperational, NmtState::PreOperational, axis, timing);
    come_to_rest(&mut list, axis, timing);
    list.begin("end of heartbeats", "expect alarm 20 of the drive; it clears at the next bring-up");
    list.write_and_read_back(objects::CONSUMER_HEARTBEAT_TIME, 0);
    list.steps
}

/// Stops and disables the drive, which may still be enabled or moving.
fn come_to_rest(list: &mut StepList, axis: &Axis, timing: &BringUpTiming) {
    list.begin(
        "standstill without torque",
        "the drive holds or moves its axis and does not respond: use the emergency stop, then power-cycle it",
    );
    list.read(objects::STATUSWORD, Check::Any, Fact::Statusword);
    list.read(ALARM_CODE, Check::Any, Fact::ErrorCode);
    list.condition = Condition::HasTorque;
    // Halt (controlword bit 8) stops with the drive's own deceleration and keeps the shaft locked.
    list.write(objects::CONTROLWORD, (controlword::ENABLE_OPERATION | controlword::HALT).into());
    list.push(Action::Await {
        object: objects::VELOCITY_ACTUAL_VALUE,
        check: Check::AtMost(STANDSTILL),
        keep: None,
        within_ns: timing.confirm_timeout_ns,
    });
    list.condition = Condition::Always;
    list.write(objects::CONTROLWORD, controlword::DISABLE_VOLTAGE.into());
    // Homing runs without a controlword; only another mode ends it.
    list.write(objects::MODES_OF_OPERATION, axis.control.operation_mode() as i64);
    list.push(Action::Await {
        object: objects::STATUSWORD,
        check: NOT_STARTED,
        keep: Some(Fact::Statusword),
        within_ns: timing.confirm_timeout_ns,
    });
}

/// Reads the fixed mapping from the drive, because it differs between firmware editions. Only the transmission of the
/// TPDOs can be chosen.
fn process_data(list: &mut StepList, axis: &Axis) {
    list.begin("TPDO transmission", "let the drive answer SYNC: answers_sync = true");
    let transmit = |number| PdoParameters::of(PdoDirection::Transmit, number);
    let answers: i64 = if answers_sync(axis) { 1 } else { 255 };
    list.write_and_read_back(transmit(2).transmission_type(), answers);
    list.write_optional(transmit(1).event_timer(), 0);
    list.write_optional(transmit(3).event_timer(), 0);
    list.reported_process_data();
}

fn motion(list: &mut StepList, axis: &Axis) {
    let is_interpolated = !axis.control.is_profile();
    if is_interpolated {
        list.begin(
            "special function",
            "interpolation must have been stored in the drive: takt drive CONFIG AXIS write 2619 7, then save, then \
             power-cycle it",
        );
        list.push(Action::Read {
            object: SPECIAL_FUNCTION,
            check: Check::Equals(INTERPOLATION),
            keep: None,
            is_optional: false,
        });
    }
    list.begin("limits", "choose limits for this axis that its drive accepts");
    list.write(objects::PROFILE_VELOCITY, speed_rpm(axis));
    list.write_and_read_back(ACCELERATION, if is_interpolated { NO_RAMP } else { ramp(axis) });
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

/// Sets the target to the actual position. Enabling with an old target would make the axis jump. No object shows the
/// mode, so it is sent again with each controlword.
fn target_at_actual_position(list: &mut StepList, axis: &Axis) {
    list.begin("target at the actual position", "clear the drive's alarm");
    list.write(objects::TARGET_VELOCITY, 0);
    list.read(objects::POSITION_ACTUAL_VALUE, Check::Any, Fact::Position);
    list.push(Action::Write {
        object: objects::TARGET_POSITION,
        value: ValueSource::ActualPosition,
        read_back: ReadBack::EXACT,
        is_optional: false,
    });
    list.write(objects::MODES_OF_OPERATION, axis.control.operation_mode() as i64);
}

/// The heartbeat period; 0 if none is configured, because the feedback of every cycle shows the drive's state.
fn own_heartbeat_ms(axis: &Axis) -> i64 {
    axis.heartbeat_ns.map_or(0, |period_ns| rounded_up(period_ns, 1_000_000))
}
