//! ZeroErr eRob with CANopen firmware (eRunner manual 1.7, chapter 5, and field experience): the steps of bring-up,
//! start and shutdown.

use takt_rt::{CommandSlot, Nanoseconds, controlword};

use super::bring_up::BringUpTiming;
use super::process_data::{PdoPlan, ProcessData, pdo_id};
use super::step::{Action, Check, Condition, Fact, ProcedureStep, ReadBack, TextFact, ValueSource};
use super::step_list::{StepList, counts, rounded_up, watched_heartbeat};
use crate::canopen::nmt::{NmtCommand, NmtState};
use crate::canopen::object::{DataType, Object};
use crate::canopen::objects::{self, PDO_INVALID, PdoDirection, PdoParameters, error_behaviour};
use crate::config::{Axis, Config, Control, PdoMapping};

/// Number of RPDOs, and of TPDOs.
const PDO_COUNT: u8 = 4;
/// INTEGER32 on this drive; the standard has UNSIGNED32.
const FOLLOWING_ERROR_WINDOW: Object = Object::new(0x6065, 0, DataType::I32, "following error window");

/// From any state to pre-operational, configured, without torque.
pub fn configure(config: &Config, axis: &Axis, timing: &BringUpTiming) -> Vec<ProcedureStep> {
    let mut list = StepList::new(
        "restart of its communication",
        "check that the drive is powered (it needs 8 s), the wiring and the termination of the bus, its bit rate \
         (1 Mbit/s), and its node ID",
    );
    list.nmt(
        NmtCommand::ResetCommunication,
        Some(NmtState::BootUp),
        timing.boot_up_timeout_ns,
        timing.reset_repeat_ns,
    );
    identity(&mut list, axis);
    come_to_rest(&mut list, axis, timing);
    list.configuration_file(axis);
    synchronisation(&mut list, config.bus_cycle(axis.bus).period_ns);
    match axis.mapping {
        PdoMapping::Written => process_data(&mut list, axis),
        PdoMapping::AsStored => list.reported_process_data(),
    }
    mode(&mut list, axis, timing);
    ratings(&mut list, axis);
    limits(&mut list, axis);
    target_at_actual_position(&mut list);
    heartbeats(&mut list, config, axis);
    list.steps
}

/// From configured to operational.
pub fn start(axis: &Axis, timing: &BringUpTiming) -> Vec<ProcedureStep> {
    let mut list = StepList::new("start", "check that no other master commands this node");
    list.nmt_reported(NmtCommand::Start, NmtState::Operational, axis, timing);
    list.read(objects::STATUSWORD, Check::Any, Fact::Statusword);
    list.read(objects::ERROR_CODE, Check::Any, Fact::ErrorCode);
    list.read(objects::POSITION_ACTUAL_VALUE, Check::Any, Fact::Position);
    list.steps
}

/// From operational to pre-operational, without torque, heartbeat watchdog off.
pub fn shut_down(axis: &Axis, timing: &BringUpTiming) -> Vec<ProcedureStep> {
    let mut list = StepList::new("shut down", "power-cycle the drive before the next run");
    list.wake_up(NmtCommand::EnterPreOperational);
    list.nmt_reported(NmtCommand::EnterPreOperational, NmtState::PreOperational, axis, timing);
    come_to_rest(&mut list, axis, timing);
    list.begin("end of heartbeats", "expect a communication fault of the drive; the next bring-up clears it");
    list.write_and_read_back(objects::CONSUMER_HEARTBEAT_TIME, 0);
    list.write_and_read_back(objects::PRODUCER_HEARTBEAT_TIME, 0);
    list.steps
}

fn identity(list: &mut StepList, axis: &Axis) {
    list.identity(axis);
    for (object, keep) in [
        (objects::DEVICE_NAME, TextFact::DeviceName),
        (objects::HARDWARE_VERSION, TextFact::HardwareVersion),
        (objects::SOFTWARE_VERSION, TextFact::SoftwareVersion),
    ] {
        list.push(Action::ReadText { object, keep });
    }
    list.begin(
        "supported modes",
        "choose another control mode for this axis, or load firmware that has this one",
    );
    for control in axis.controls() {
        // Some units support mode 7 without declaring it in 6502 (eRunner manual, figure 5-38); 6061 will show it.
        let check = match control {
            Control::Interpolated => Check::Any,
            control => Check::Supports(control.operation_mode()),
        };
        list.read(objects::SUPPORTED_DRIVE_MODES, check, Fact::SupportedModes);
    }
}

/// Stops and disables the drive. A communication reset ends neither its torque nor its motion.
fn come_to_rest(list: &mut StepList, axis: &Axis, timing: &BringUpTiming) {
    list.begin(
        "standstill without torque",
        "the drive holds or moves its axis and does not respond: use the emergency stop, then power-cycle it",
    );
    list.read(objects::STATUSWORD, Check::Any, Fact::Statusword);
    list.read(objects::ERROR_CODE, Check::Any, Fact::ErrorCode);
    list.condition = Condition::HasTorque;
    let deceleration = counts(axis, axis.limits.deceleration);
    list.write_unless_in_file(axis, objects::QUICK_STOP_DECELERATION, deceleration);
    list.write(objects::CONTROLWORD, controlword::QUICK_STOP.into());
    let stopping_ns = (axis.limits.velocity / axis.limits.deceleration * 1e9) as Nanoseconds;
    list.push(Action::Await {
        object: objects::VELOCITY_ACTUAL_VALUE,
        // The brake may engage below a tenth of the highest speed; a hundredth leaves a wide margin.
        check: Check::AtMost(counts(axis, axis.limits.velocity) / 100),
        keep: None,
        within_ns: timing.confirm_timeout_ns.saturating_add(stopping_ns),
    });
    list.condition = Condition::Always;
    // Bit 7 stays low, so that a later fault reset is a rising edge.
    list.write(objects::CONTROLWORD, controlword::DISABLE_VOLTAGE.into());
    list.push(Action::Await {
        object: objects::STATUSWORD,
        check: Check::NoTorque,
        keep: Some(Fact::Statusword),
        within_ns: timing.confirm_timeout_ns,
    });
}

fn synchronisation(list: &mut StepList, period_ns: Nanoseconds) {
    list.begin("SYNC", "choose a cycle period that this drive accepts");
    // Bit 30 would make the drive the SYNC producer.
    list.write_and_read_back(objects::SYNC_COB_ID, 0x80);
    list.write_and_read_back(objects::COMMUNICATION_CYCLE_PERIOD, rounded_up(period_ns, 1_000));
    if let Some((mantissa, exponent)) = interpolation_time(period_ns) {
        list.write_optional(objects::INTERPOLATION_TIME_PERIOD, mantissa);
        list.write_optional(objects::INTERPOLATION_TIME_INDEX, exponent);
    }
}

/// The period in the form of object 60C2: `mantissa · 10^exponent` seconds with a mantissa of one byte, if possible in
/// whole milliseconds. `None` if there is no such form: the drive then keeps its value.
fn interpolation_time(period_ns: Nanoseconds) -> Option<(i64, i64)> {
    let (mut mantissa, mut exponent) = (period_ns, -9);
    while mantissa % 10 == 0 && exponent < -3 {
        mantissa /= 10;
        exponent += 1;
    }
    Some((u8::try_from(mantissa).ok()?.into(), exponent))
}

fn process_data(list: &mut StepList, axis: &Axis) {
    let ProcessData { commands, feedback, .. } = ProcessData::of(axis);
    for (direction, plans, name) in [
        (PdoDirection::Receive, commands, "RPDO mapping"),
        (PdoDirection::Transmit, feedback, "TPDO mapping"),
    ] {
        list.begin(
            name,
            "the drive cannot carry these objects in this PDO: choose other feedback or another mode",
        );
        for number in 1..=PDO_COUNT {
            match plans.iter().find(|plan| plan.number == number) {
                Some(plan) => map(list, direction, plan),
                None => list.write_cob_id(
                    PdoParameters::of(direction, number),
                    unused_id(direction, number, axis.node),
                ),
            }
        }
    }
}

/// Writes a PDO mapping. It may only change while the PDO is invalid and the count is zero (CiA 301, 7.5.2.36).
fn map(list: &mut StepList, direction: PdoDirection, plan: &PdoPlan) {
    let parameters = PdoParameters::of(direction, plan.number);
    list.write_cob_id(parameters, plan.id.value() | PDO_INVALID);
    list.write_and_read_back(parameters.transmission_type(), plan.transmission_type.into());
    if direction == PdoDirection::Transmit {
        list.write_optional(parameters.inhibit_time(), 0);
    }
    list.write_optional(parameters.event_timer(), 0);
    list.write(parameters.mapped_count(), 0);
    for (position, object) in (1..).zip(&plan.objects) {
        list.write_and_read_back(parameters.mapped_object(position), object.parameter().into());
    }
    list.write_and_read_back(parameters.mapped_count(), plan.objects.len() as i64);
    list.write_cob_id(parameters, plan.id.value());
}

/// The COB-ID of the pre-defined connection set with bit 31 (invalid) set.
fn unused_id(direction: PdoDirection, number: u8, node: u8) -> u32 {
    PDO_INVALID | pdo_id(direction, number, node).value()
}

fn mode(list: &mut StepList, axis: &Axis, timing: &BringUpTiming) {
    let advice = match axis.control {
        Control::Interpolated => {
            "this firmware has no interpolated position mode (object 6502 does not declare it, and 6061 does not show \
             it): set mode = \"csp\" for this axis"
        }
        _ => "choose another control mode for this axis; clear the drive's fault if it has one",
    };
    list.begin("mode of operation", advice);
    let mode = axis.control.operation_mode() as i64;
    list.write(objects::MODES_OF_OPERATION, mode);
    list.push(Action::Await {
        object: objects::MODES_OF_OPERATION_DISPLAY,
        check: Check::Equals(mode),
        keep: None,
        within_ns: timing.confirm_timeout_ns,
    });
}

fn ratings(list: &mut StepList, axis: &Axis) {
    list.begin(
        "ratings",
        "torque cannot be commanded without the drive's rated torque: choose another control mode",
    );
    let is_torque_sent = has_target(axis, CommandSlot::TargetTorque) || axis.feed_forward.has_torque();
    let torque = if is_torque_sent { Check::Positive } else { Check::Any };
    list.read(objects::MOTOR_RATED_CURRENT, Check::Any, Fact::RatedCurrent);
    list.read(objects::MOTOR_RATED_TORQUE, torque, Fact::RatedTorque);
    list.read_optional(objects::MAX_TORQUE, Fact::MaxTorque);
    list.read_optional(objects::QUICK_STOP_OPTION_CODE, Fact::QuickStopOptionCode);
}

/// Whether a mode of the axis has this target.
fn has_target(axis: &Axis, target: CommandSlot) -> bool {
    axis.controls().any(|control| control.target_slot() == target)
}

/// Sets the drive's limits beyond those of the controller, which acts first. Sets the drive's profile to the axis'
/// limits, because the defaults are very slow (6081 = 10000 count/s); the cyclic modes use it too. What the axis' configuration
/// file has for them holds instead.
fn limits(list: &mut StepList, axis: &Axis) {
    list.begin("limits", "choose limits for this axis that its drive accepts");
    let limits = &axis.limits;
    if has_target(axis, CommandSlot::TargetPosition) {
        // In profile position mode the drive follows its own profile, so its following error is not limited here.
        let error = if axis.control.is_profile() { f64::INFINITY } else { 2.0 * axis.following_error.limit };
        list.write_unless_in_file(axis, FOLLOWING_ERROR_WINDOW, counts(axis, error).min(i32::MAX.into()));
        list.write_unless_in_file(axis, objects::PROFILE_VELOCITY, counts(axis, limits.velocity));
    }
    if has_target(axis, CommandSlot::TargetPosition) || has_target(axis, CommandSlot::TargetVelocity) {
        list.write_unless_in_file(axis, objects::PROFILE_ACCELERATION, counts(axis, limits.acceleration));
        list.write_unless_in_file(axis, objects::PROFILE_DECELERATION, counts(axis, limits.deceleration));
    }
    list.write_unless_in_file(axis, objects::QUICK_STOP_DECELERATION, counts(axis, limits.deceleration));
}

/// Sets the target to the actual position. Enabling with an old target would make the axis jump.
fn target_at_actual_position(list: &mut StepList) {
    list.begin(
        "target at the actual position",
        "clear the drive's fault, and check its software limits (607D)",
    );
    list.read(objects::POSITION_ACTUAL_VALUE, Check::Any, Fact::Position);
    list.push(Action::Write {
        object: objects::TARGET_POSITION,
        value: ValueSource::ActualPosition,
        read_back: ReadBack::EXACT,
        is_optional: false,
    });
    list.write_and_read_back(objects::TARGET_VELOCITY, 0);
    list.write_and_read_back(objects::TARGET_TORQUE, 0);
    for offset in [objects::POSITION_OFFSET, objects::VELOCITY_OFFSET, objects::TORQUE_OFFSET] {
        list.write_optional(offset, 0);
    }
}

/// Sets the heartbeats. Without them a drive does not react when the master fails.
fn heartbeats(list: &mut StepList, config: &Config, axis: &Axis) {
    list.begin("heartbeat", "choose heartbeat times that this drive accepts");
    let own_ms = axis.heartbeat_ns.map_or(0, |period_ns| rounded_up(period_ns, 1_000_000));
    list.write_and_read_back(objects::PRODUCER_HEARTBEAT_TIME, own_ms);
    if config.master.heartbeat_ns.is_some() {
        // CiA 402 names only the entry into NMT stopped as a reason to abort motion, and this drive has no object 6007
        // for another reaction. The reset of the next bring-up leaves NMT stopped.
        let behaviour = objects::COMMUNICATION_ERROR_BEHAVIOUR;
        list.write_and_read_back(behaviour, error_behaviour::STOPPED.into());
    }
    list.write_and_read_back(objects::CONSUMER_HEARTBEAT_TIME, watched_heartbeat(config));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_periods_have_a_mantissa_of_one_byte_and_a_power_of_ten() {
        assert_eq!(interpolation_time(1_000_000), Some((1, -3)));
        assert_eq!(interpolation_time(2_000_000), Some((2, -3)));
        assert_eq!(interpolation_time(20_000_000), Some((20, -3)));
        assert_eq!(interpolation_time(500_000), Some((5, -4)));
        assert_eq!(interpolation_time(1_250_000), Some((125, -5)));
        assert_eq!(interpolation_time(1_234_567), None);
    }

    #[test]
    fn an_unused_pdo_keeps_its_identifier_and_is_invalid() {
        assert_eq!(unused_id(PdoDirection::Receive, 4, 2), 0x8000_0502);
        assert_eq!(unused_id(PdoDirection::Transmit, 2, 2), 0x8000_0282);
    }
}
