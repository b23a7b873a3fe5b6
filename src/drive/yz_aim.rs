//! YZ-AIM integrated servos, CANopen edition (manual v1.62; what real units add to it): the steps that bring one up,
//! start it and leave it, and what its alarms mean.
//!
//! Its PDOs are fixed, it shows no mode of operation, it has no emergency object, and objects that it does not know get
//! no answer at all.

use takt_rt::{Nanoseconds, controlword};

use super::bring_up::BringUpTiming;
use super::step::{Action, Check, Fact, ReadBack, Source, Step, When};
use super::step_list::{List, rounded_up, turns, watched_heartbeat};
use crate::canopen::emcy::ErrorCode;
use crate::canopen::nmt::{NmtCommand, NmtState};
use crate::canopen::object::{DataType, Object};
use crate::canopen::objects::{self, PdoDirection, PdoParameters};
use crate::config::{Axis, Config, Control};

/// Between two controlwords on the way to operation enabled: a cold drive passes over what comes faster.
pub const CONTROLWORD_SPACING_NS: Nanoseconds = 20_000_000;
/// The one period of interpolated position (manual, 5.10.3).
pub const INTERPOLATION_PERIOD_NS: Nanoseconds = 2_000_000;
/// The highest speed that 6081 and 60FF take, in r/min.
pub const HIGHEST_SPEED_RPM: f64 = 3000.0;
/// From this value on 6083 makes no ramp: the drive follows what it is given (4.3).
const NO_RAMP: i64 = 60_000;
/// Special function 2619: interpolation over CANopen.
const INTERPOLATION: i64 = 7;
/// Bits 0 and 1 of the statusword follow the controlword: switched on.
const NOT_STARTED: Check = Check::Masked { value: 0, mask: 0x03 };

const ALARM_CODE: Object = Object::new(0x260E, 0, DataType::U16, "alarm code");
const SPECIAL_FUNCTION: Object = Object::new(0x2619, 0, DataType::U16, "special function");
const ACCELERATION: Object = Object::new(0x6083, 0, DataType::U32, "acceleration");

/// Alarms of object 260E that are known by name (IIb.3).
pub fn alarm_words(code: ErrorCode) -> Option<&'static str> {
    Some(match code.0 {
        0x10 => "battery power lost, multi-turn position lost",
        0x12 => "blocked rotor",
        0x14 => "loss of speed (stall)",
        0x15 => "over-voltage, above 52 V",
        0x20 => "communication lost (heartbeat of the master)",
        _ => return None,
    })
}

/// What clears an alarm.
pub fn alarm_advice(code: ErrorCode) -> Option<&'static str> {
    Some(match code.0 {
        0x10 => "set the multi-turn zero again: takt drive CONFIG AXIS zero",
        0x12 | 0x14 => "free the joint, then reset the fault: takt drive CONFIG AXIS clear-fault",
        0x15 => {
            "fit a brake resistor if regeneration causes it; power-cycle the drive if a fault reset does not clear it"
        }
        0x20 => "it clears when the master's heartbeat returns",
        _ => return None,
    })
}

/// From any state to pre-operational, configured and without torque.
pub(super) fn configure(config: &Config, axis: &Axis, timing: &BringUpTiming) -> Vec<Step> {
    let mut list = List::new(
        "restart of its communication",
        "check that the drive is powered, the wiring and the termination of the bus, its bit rate, and its node number",
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
    list.about("heartbeat", "choose heartbeat times that this drive accepts");
    list.write_and_read_back(objects::PRODUCER_HEARTBEAT_TIME, own_heartbeat_ms(axis));
    list.write_and_read_back(objects::CONSUMER_HEARTBEAT_TIME, watched_heartbeat(config));
    list.steps
}

/// From there to operational.
pub(super) fn start(axis: &Axis, timing: &BringUpTiming) -> Vec<Step> {
    let mut list = List::new("start", "check that no other master commands this node");
    list.nmt_reported(NmtCommand::Start, NmtState::Operational, axis, timing);
    list.read(objects::STATUSWORD, Check::Any, Fact::Statusword);
    list.read(ALARM_CODE, Check::Any, Fact::ErrorCode);
    list.read(objects::POSITION_ACTUAL_VALUE, Check::Any, Fact::Position);
    list.steps
}

/// From operational to pre-operational, without torque, not minding the master's silence.
pub(super) fn leave(axis: &Axis, timing: &BringUpTiming) -> Vec<Step> {
    let mut list = List::new("farewell", "power-cycle the drive before the next run");
    list.reach(NmtCommand::EnterPreOperational);
    list.nmt_reported(NmtCommand::EnterPreOperational, NmtState::PreOperational, axis, timing);
    come_to_rest(&mut list, axis, timing);
    list.about("end of heartbeats", "expect alarm 20 of the drive; it clears at the next bring-up");
    list.write_and_read_back(objects::CONSUMER_HEARTBEAT_TIME, 0);
    list.steps
}

/// A drive may have been left enabled, even moving.
fn come_to_rest(list: &mut List, axis: &Axis, timing: &BringUpTiming) {
    list.about(
        "standstill without torque",
        "the drive holds or moves its axis and does not obey: use the emergency stop, then power-cycle it",
    );
    list.read(objects::STATUSWORD, Check::Any, Fact::Statusword);
    list.read(ALARM_CODE, Check::Any, Fact::ErrorCode);
    list.when = When::HasTorque;
    // Its halt stops by the drive's own means and keeps the shaft locked; there is no deceleration to choose.
    list.write(objects::CONTROLWORD, (controlword::ENABLE_OPERATION | controlword::HALT).into());
    list.push(Action::Await {
        object: objects::VELOCITY_ACTUAL_VALUE,
        // In units of 0.1 r/min by SDO.
        check: Check::AtMost(100),
        keep: None,
        within_ns: timing.confirm_timeout_ns,
    });
    list.when = When::Always;
    list.write(objects::CONTROLWORD, controlword::DISABLE_VOLTAGE.into());
    // Homing needs no controlword: only another mode ends it.
    list.write(objects::MODES_OF_OPERATION, axis.control.operation_mode() as i64);
    list.push(Action::Await {
        object: objects::STATUSWORD,
        check: NOT_STARTED,
        keep: Some(Fact::Statusword),
        within_ns: timing.confirm_timeout_ns,
    });
}

/// The mapping is fixed, but not in every edition of the firmware the same: what the drive tells of it counts. What can
/// be chosen is when the drive reports unasked.
fn process_data(list: &mut List, axis: &Axis) {
    list.about("reports", "let the drive answer SYNC: answers_sync = true");
    let transmit = |number| PdoParameters::of(PdoDirection::Transmit, number);
    let answers: i64 = if answers_sync(axis) { 1 } else { 255 };
    list.write_and_read_back(transmit(2).transmission_type(), answers);
    list.write_optional(transmit(1).event_timer(), 0);
    list.write_optional(transmit(3).event_timer(), 0);
    list.reported_process_data();
}

fn motion(list: &mut List, axis: &Axis) {
    let is_interpolated = !axis.control.is_profile();
    if is_interpolated {
        list.about(
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
    list.about("limits", "choose limits for this axis that its drive accepts");
    list.write(objects::PROFILE_VELOCITY, speed_rpm(axis));
    list.write_and_read_back(ACCELERATION, if is_interpolated { NO_RAMP } else { ramp(axis) });
}

/// The highest speed of the axis in r/min of the motor, as far as the drive goes.
fn speed_rpm(axis: &Axis) -> i64 {
    (turns(axis, axis.limits.velocity) * 60.0).ceil().clamp(1.0, HIGHEST_SPEED_RPM) as i64
}

/// The drive has one ramp for both, in (r/min)/s.
fn ramp(axis: &Axis) -> i64 {
    let slower = axis.limits.acceleration.min(axis.limits.deceleration);
    ((turns(axis, slower) * 60.0).round() as i64).clamp(1, NO_RAMP - 1)
}

/// Enabling with a stale target makes the axis jump. The mode is sent again with each controlword; there is no object
/// that would show it.
fn target_at_actual_position(list: &mut List, axis: &Axis) {
    list.about("target at the actual position", "clear the drive's alarm");
    list.write(objects::TARGET_VELOCITY, 0);
    list.read(objects::POSITION_ACTUAL_VALUE, Check::Any, Fact::Position);
    list.push(Action::Write {
        object: objects::TARGET_POSITION,
        value: Source::ActualPosition,
        read_back: ReadBack::EXACT,
        is_optional: false,
    });
    list.write(objects::MODES_OF_OPERATION, axis.control.operation_mode() as i64);
}

/// Off where none is configured: feedback in every cycle shows that the drive lives, and its alarms.
fn own_heartbeat_ms(axis: &Axis) -> i64 {
    axis.heartbeat_ns.map_or(0, |period_ns| rounded_up(period_ns, 1_000_000))
}

/// Whether the drive reports when it is sent a set-point, and only then: TPDO 1, which answers a target in profile position,
/// may come unasked as well (manual, 5.08.3).
pub fn answers_set_points(axis: &Axis) -> bool {
    !answers_sync(axis) && axis.control == Control::Interpolated
}

/// Whether the drive reports at SYNC. In profile velocity it must: its answer to a command shows no statusword.
pub fn answers_sync(axis: &Axis) -> bool {
    axis.answers_sync || axis.control == Control::ProfileVelocity
}

/// Whether a mode can be commanded.
pub fn has_mode(control: &Control) -> bool {
    matches!(control, Control::Interpolated | Control::ProfilePosition | Control::ProfileVelocity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_alarm_of_the_manual_has_a_name_and_a_way_out() {
        for code in [0x10, 0x12, 0x14, 0x15, 0x20].map(ErrorCode) {
            assert!(alarm_words(code).is_some() && alarm_advice(code).is_some(), "{code:?}");
        }
        assert_eq!(alarm_words(ErrorCode(0x11)), None);
    }
}
