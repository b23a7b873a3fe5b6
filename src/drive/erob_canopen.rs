//! ZeroErr eRob joints with CANopen firmware (eRunner manual 1.7, chapter 5; what real units add to it): the steps that
//! bring one up, start it and leave it, and what its own error codes mean.

use takt_rt::{CommandSlot, Frame, Id, Nanoseconds, controlword};

use super::axis_run::OtherProtocol;
use super::bring_up::BringUpTiming;
use super::process_data::{PdoPlan, ProcessData, pdo_id};
use super::step::{Action, Check, Fact, ReadBack, Source, Step, TextFact, When};
use super::step_list::{List, counts, rounded_up, watched_heartbeat};
use crate::canopen::emcy::ErrorCode;
use crate::canopen::nmt::{NmtCommand, NmtState};
use crate::canopen::object::{DataType, Object};
use crate::canopen::objects::{self, PDO_INVALID, PdoDirection, PdoParameters, error_behaviour};
use crate::config::{Axis, Config, Control, PdoMapping};

/// The fault of a joint whose multi-turn battery is empty or was disconnected.
pub const MULTI_TURN_BATTERY: ErrorCode = ErrorCode(0x730F);

/// RPDOs and TPDOs that the drive has, each.
const PDO_COUNT: u8 = 4;
/// The joint calls this INTEGER32, where the standard says UNSIGNED32.
const FOLLOWING_ERROR_WINDOW: Object = Object::new(0x6065, 0, DataType::I32, "following error window");

/// What an error code means on this drive, where that is more than the standards say.
pub fn error_words(code: ErrorCode) -> &'static str {
    if code == MULTI_TURN_BATTERY { "battery voltage of the multi-turn encoder low" } else { code.words() }
}

/// What to do about an error code, where more than a fault reset is needed.
pub fn error_advice(code: ErrorCode) -> Option<&'static str> {
    (code == MULTI_TURN_BATTERY).then_some(
        "replace the battery, then write 1 to object 2242: this clears the fault, which no fault reset does, and the \
         count of turns with it, so that the joint's zero must be set again",
    )
}

/// The vendor's own protocol, which firmware without CANopen speaks: reading the position (0x0002) harms nobody. From
/// node 64 up its identifiers are those of other nodes' SDO.
pub(super) fn other_protocol(node: u8) -> Option<OtherProtocol> {
    let name = "vendor's custom CAN protocol";
    let id = |base: u32| Id::base(base + u32::from(node)).ok();
    let (question, answer) = (id(0x640)?, id(0x5C0)?);
    (1..=63).contains(&node).then(|| OtherProtocol {
        name,
        question: Frame::of(question, [0x00, 0x02]),
        answer,
    })
}

/// From any state to pre-operational, configured and without torque.
pub(super) fn configure(config: &Config, axis: &Axis, timing: &BringUpTiming) -> Vec<Step> {
    let mut list = List::new(
        "restart of its communication",
        "check that the drive is powered (it needs 8 s), the wiring and the termination of the bus, its bit rate \
         (1 Mbit/s), and its node number",
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

/// From there to operational.
pub(super) fn start(axis: &Axis, timing: &BringUpTiming) -> Vec<Step> {
    let mut list = List::new("start", "check that no other master commands this node");
    list.nmt_reported(NmtCommand::Start, NmtState::Operational, axis, timing);
    list.read(objects::STATUSWORD, Check::Any, Fact::Statusword);
    list.read(objects::ERROR_CODE, Check::Any, Fact::ErrorCode);
    list.read(objects::POSITION_ACTUAL_VALUE, Check::Any, Fact::Position);
    list.steps
}

/// From operational to pre-operational, without torque, not minding the master's silence.
pub(super) fn leave(axis: &Axis, timing: &BringUpTiming) -> Vec<Step> {
    let mut list = List::new("farewell", "power-cycle the drive before the next run");
    list.reach(NmtCommand::EnterPreOperational);
    list.nmt_reported(NmtCommand::EnterPreOperational, NmtState::PreOperational, axis, timing);
    come_to_rest(&mut list, axis, timing);
    list.about("end of heartbeats", "expect a communication fault of the drive; the next bring-up clears it");
    list.write_and_read_back(objects::CONSUMER_HEARTBEAT_TIME, 0);
    list.write_and_read_back(objects::PRODUCER_HEARTBEAT_TIME, 0);
    list.steps
}

fn identity(list: &mut List, axis: &Axis) {
    list.identity(axis);
    for (object, keep) in [
        (objects::DEVICE_NAME, TextFact::DeviceName),
        (objects::HARDWARE_VERSION, TextFact::HardwareVersion),
        (objects::SOFTWARE_VERSION, TextFact::SoftwareVersion),
    ] {
        list.push(Action::ReadText { object, keep });
    }
    list.about(
        "supported modes",
        "choose another control mode for this axis, or load firmware that has this one",
    );
    // Some units follow mode 7 although they do not announce it (eRunner manual, figure 5-38): 6061 will tell.
    let check = match axis.control {
        Control::Interpolated => Check::Any,
        control => Check::Supports(control.operation_mode()),
    };
    list.read(objects::SUPPORTED_DRIVE_MODES, check, Fact::SupportedModes);
}

/// A drive may have been left enabled, even moving: its communication is new, its motion is not.
fn come_to_rest(list: &mut List, axis: &Axis, timing: &BringUpTiming) {
    list.about(
        "standstill without torque",
        "the drive holds or moves its axis and does not obey: use the emergency stop, then power-cycle it",
    );
    list.read(objects::STATUSWORD, Check::Any, Fact::Statusword);
    list.read(objects::ERROR_CODE, Check::Any, Fact::ErrorCode);
    list.when = When::HasTorque;
    let deceleration = counts(axis, axis.limits.deceleration);
    list.write_optional(objects::QUICK_STOP_DECELERATION, deceleration);
    list.write(objects::CONTROLWORD, controlword::QUICK_STOP.into());
    let stopping_ns = (axis.limits.velocity / axis.limits.deceleration * 1e9) as Nanoseconds;
    list.push(Action::Await {
        object: objects::VELOCITY_ACTUAL_VALUE,
        // The brake may engage below a tenth of the highest speed; this leaves a wide margin.
        check: Check::AtMost(counts(axis, axis.limits.velocity) / 100),
        keep: None,
        within_ns: timing.confirm_timeout_ns.saturating_add(stopping_ns),
    });
    list.when = When::Always;
    // Also leaves bit 7 low, so that a later fault reset is a rising edge.
    list.write(objects::CONTROLWORD, controlword::DISABLE_VOLTAGE.into());
    list.push(Action::Await {
        object: objects::STATUSWORD,
        check: Check::NoTorque,
        keep: Some(Fact::Statusword),
        within_ns: timing.confirm_timeout_ns,
    });
}

fn synchronisation(list: &mut List, period_ns: Nanoseconds) {
    list.about("SYNC", "choose a cycle period that this drive accepts");
    // Bit 30 would make the drive the producer.
    list.write_and_read_back(objects::SYNC_COB_ID, 0x80);
    list.write_and_read_back(objects::COMMUNICATION_CYCLE_PERIOD, rounded_up(period_ns, 1_000));
    if let Some((mantissa, exponent)) = interpolation_time(period_ns) {
        list.write_optional(objects::INTERPOLATION_TIME_PERIOD, mantissa);
        list.write_optional(objects::INTERPOLATION_TIME_INDEX, exponent);
    }
}

/// A period as object 60C2 says it, `mantissa · 10^exponent` seconds with a mantissa of one byte; in whole milliseconds
/// where it can be. `None` for a period that has no such form: the drive then keeps what it has.
fn interpolation_time(period_ns: Nanoseconds) -> Option<(i64, i64)> {
    let (mut mantissa, mut exponent) = (period_ns, -9);
    while mantissa % 10 == 0 && exponent < -3 {
        mantissa /= 10;
        exponent += 1;
    }
    Some((u8::try_from(mantissa).ok()?.into(), exponent))
}

fn process_data(list: &mut List, axis: &Axis) {
    let ProcessData { commands, feedback, .. } = ProcessData::of(axis);
    for (direction, plans, name) in [
        (PdoDirection::Receive, commands, "RPDO mapping"),
        (PdoDirection::Transmit, feedback, "TPDO mapping"),
    ] {
        list.about(
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

/// A mapping may only be changed while its PDO is invalid and its count is zero (CiA 301, 7.5.2.36).
fn map(list: &mut List, direction: PdoDirection, plan: &PdoPlan) {
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

/// The identifier of the pre-defined connection set, marked invalid.
fn unused_id(direction: PdoDirection, number: u8, node: u8) -> u32 {
    PDO_INVALID | pdo_id(direction, number, node).value()
}

fn mode(list: &mut List, axis: &Axis, timing: &BringUpTiming) {
    let advice = match axis.control {
        Control::Interpolated => {
            "this firmware has no interpolated position (object 6502 does not announce it, and the drive does not \
             follow): set mode = \"csp\" for this axis"
        }
        _ => "choose another control mode for this axis; clear the drive's fault if it has one",
    };
    list.about("mode of operation", advice);
    let mode = axis.control.operation_mode() as i64;
    list.write(objects::MODES_OF_OPERATION, mode);
    list.push(Action::Await {
        object: objects::MODES_OF_OPERATION_DISPLAY,
        check: Check::Equals(mode),
        keep: None,
        within_ns: timing.confirm_timeout_ns,
    });
}

fn ratings(list: &mut List, axis: &Axis) {
    list.about(
        "ratings",
        "torque cannot be commanded without the drive's rated torque: choose another control mode",
    );
    let is_torque_sent = axis.control.target_slot() == CommandSlot::TargetTorque;
    let torque = if is_torque_sent { Check::Positive } else { Check::Any };
    list.read(objects::MOTOR_RATED_CURRENT, Check::Any, Fact::RatedCurrent);
    list.read(objects::MOTOR_RATED_TORQUE, torque, Fact::RatedTorque);
    list.read_optional(objects::MAX_TORQUE, Fact::MaxTorque);
    list.read_optional(objects::QUICK_STOP_OPTION_CODE, Fact::QuickStopOptionCode);
}

/// The drive's own limits are set beyond those of the controller, which acts first; the drive's profile is set to the
/// axis' limits, as the vendor's tool does in the cyclic modes too: the defaults are a crawl (6081 = 10000 count/s).
fn limits(list: &mut List, axis: &Axis) {
    list.about("limits", "choose limits for this axis that its drive accepts");
    let limits = &axis.limits;
    let target = axis.control.target_slot();
    if target == CommandSlot::TargetPosition {
        // In profile position the drive follows its own profile, whose lag is not ours to judge.
        let error = if axis.control.is_profile() { f64::INFINITY } else { 2.0 * axis.following_error.limit };
        list.write_optional(FOLLOWING_ERROR_WINDOW, counts(axis, error).min(i32::MAX.into()));
        list.write_optional(objects::PROFILE_VELOCITY, counts(axis, limits.velocity));
    }
    if target != CommandSlot::TargetTorque {
        list.write_optional(objects::PROFILE_ACCELERATION, counts(axis, limits.acceleration));
        list.write_optional(objects::PROFILE_DECELERATION, counts(axis, limits.deceleration));
    }
    list.write_optional(objects::QUICK_STOP_DECELERATION, counts(axis, limits.deceleration));
}

/// Enabling with a stale target makes the axis jump.
fn target_at_actual_position(list: &mut List) {
    list.about(
        "target at the actual position",
        "clear the drive's fault, and check its software limits (607D)",
    );
    list.read(objects::POSITION_ACTUAL_VALUE, Check::Any, Fact::Position);
    list.push(Action::Write {
        object: objects::TARGET_POSITION,
        value: Source::ActualPosition,
        read_back: ReadBack::EXACT,
        is_optional: false,
    });
    list.write_and_read_back(objects::TARGET_VELOCITY, 0);
    list.write_and_read_back(objects::TARGET_TORQUE, 0);
    for offset in [objects::POSITION_OFFSET, objects::VELOCITY_OFFSET, objects::TORQUE_OFFSET] {
        list.write_optional(offset, 0);
    }
}

/// Without these a drive does nothing when its master dies.
fn heartbeats(list: &mut List, config: &Config, axis: &Axis) {
    list.about("heartbeat", "choose heartbeat times that this drive accepts");
    let own_ms = axis.heartbeat_ns.map_or(0, |period_ns| rounded_up(period_ns, 1_000_000));
    list.write_and_read_back(objects::PRODUCER_HEARTBEAT_TIME, own_ms);
    if config.master.heartbeat_ns.is_some() {
        // Stopped is the one state whose entry CiA 402 names as a reason to abort motion; this drive has no 6007 that
        // would choose another reaction. The next bring-up's reset leads out of it.
        let behaviour = objects::COMMUNICATION_ERROR_BEHAVIOUR;
        list.write_and_read_back(behaviour, error_behaviour::STOPPED.into());
    }
    list.write_and_read_back(objects::CONSUMER_HEARTBEAT_TIME, watched_heartbeat(config));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_are_written_as_a_mantissa_of_one_byte_and_a_power_of_ten() {
        assert_eq!(interpolation_time(1_000_000), Some((1, -3)));
        assert_eq!(interpolation_time(2_000_000), Some((2, -3)));
        assert_eq!(interpolation_time(20_000_000), Some((20, -3)));
        assert_eq!(interpolation_time(500_000), Some((5, -4)));
        assert_eq!(interpolation_time(1_250_000), Some((125, -5)));
        assert_eq!(interpolation_time(1_234_567), None);
    }

    #[test]
    fn the_question_in_the_vendors_protocol_reads_the_position_and_spares_other_nodes() {
        let question = other_protocol(2).unwrap();
        assert_eq!(format!("{:?}", question.question), "642#0002");
        assert_eq!(question.answer.value(), 0x5C2);
        assert_eq!(other_protocol(64), None);
    }

    #[test]
    fn an_unused_pdo_keeps_its_identifier_and_is_invalid() {
        assert_eq!(unused_id(PdoDirection::Receive, 4, 2), 0x8000_0502);
        assert_eq!(unused_id(PdoDirection::Transmit, 2, 2), 0x8000_0282);
    }

    #[test]
    fn the_battery_fault_is_known_by_name() {
        assert_eq!(error_words(MULTI_TURN_BATTERY), "battery voltage of the multi-turn encoder low");
        assert_eq!(error_words(ErrorCode(0x8611)), "following error");
        assert!(error_advice(MULTI_TURN_BATTERY).is_some_and(|advice| advice.contains("2242")));
        assert_eq!(error_advice(ErrorCode(0x8611)), None);
    }
}
