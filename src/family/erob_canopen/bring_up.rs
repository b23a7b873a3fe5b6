//! Bring-up, start and shutdown of a ZeroErr eRob with CANopen firmware (eRunner manual 1.7, chapter 5, and field
//! experience).

use takt_rt::{CommandSlot, Nanoseconds, controlword};
use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::canopen::nmt::{NmtCommand, NmtState};
use takt_wire::canopen::object::{DataType, Object};
use takt_wire::canopen::objects::*;

use crate::config::{Axis, Control, PdoMapping};
use crate::family::bring_up::axis_units::{counts, interpolation_time, rounded_up};
use crate::family::bring_up::configuration_file::write_unless_in_file;
use crate::family::bring_up::{AxisSession, Check, ProcessData, RESTART_STEP, StepResult};
use crate::family::bring_up::{
    actual_position, configuration_file, heartbeat, identity, pdo_mapping, planner,
};

/// Number of RPDOs, and of TPDOs.
const PDO_COUNT: u8 = 4;
/// INTEGER32 on this drive; the standard has UNSIGNED32.
const FOLLOWING_ERROR_WINDOW: Object = Object::new(0x6065, 0, DataType::I32, "following error window");

/// From any state to pre-operational, configured, without torque.
pub(super) async fn configure(c: &AxisSession<'_>) -> StepResult {
    c.step(
        RESTART_STEP,
        "check that the drive is powered (it needs 8 s), the wiring and the termination of the bus, its bit rate \
         (1 Mbit/s), and its node ID",
    );
    c.restart_communication().await?;
    identity::compare(c, identity::PROFILE_CIA402).await?;
    identity::read_texts(c).await?;
    supported_modes(c).await?;
    come_to_rest(c).await?;
    configuration_file::write(c).await?;
    synchronisation(c).await?;
    process_data(c).await?;
    mode(c).await?;
    ratings(c).await?;
    limits(c).await?;
    planner::check(c).await?;
    target_at_actual_position(c).await?;
    heartbeats(c).await
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
    heartbeat::end_watch(c, "expect a communication fault of the drive; the next bring-up clears it").await?;
    c.write_and_read_back(PRODUCER_HEARTBEAT_TIME, 0).await
}

async fn read_state(c: &AxisSession<'_>) -> StepResult {
    c.read(STATUSWORD, Check::Any, |facts, value| facts.statusword = value as u16).await?;
    c.read(ERROR_CODE, Check::Any, |facts, value| facts.error_code = ErrorCode(value as u16)).await
}

async fn supported_modes(c: &AxisSession<'_>) -> StepResult {
    c.step(
        "supported modes",
        "choose another control mode for this axis, or load firmware that has this one",
    );
    for control in c.axis.controls() {
        // Some units support mode 7 without declaring it in 6502 (eRunner manual, figure 5-38); 6061 will show it.
        let expected = match control {
            Control::Interpolated => Check::Any,
            control => Check::Supports(control.operation_mode()),
        };
        c.read(SUPPORTED_DRIVE_MODES, expected, |facts, value| facts.supported_modes = value as u32).await?;
    }
    Ok(())
}

/// Stops and disables the drive. A communication reset ends neither its torque nor its motion.
async fn come_to_rest(c: &AxisSession<'_>) -> StepResult {
    c.step(
        "standstill without torque",
        "the drive holds or moves its axis and does not respond: use the emergency stop, then power-cycle it",
    );
    read_state(c).await?;
    if c.facts().state().has_torque() {
        stop_motion(c).await?;
    }
    // Bit 7 stays low, so that a later fault reset is a rising edge.
    c.write(CONTROLWORD, controlword::DISABLE_VOLTAGE.into()).await?;
    let within_ns = c.timing.confirm_timeout_ns;
    c.wait_for(STATUSWORD, Check::NoTorque, within_ns, |facts, value| facts.statusword = value as u16).await
}

/// Stops by a quick stop, with the deceleration of the axis.
async fn stop_motion(c: &AxisSession<'_>) -> StepResult {
    let limits = &c.axis.limits;
    write_unless_in_file(c, QUICK_STOP_DECELERATION, counts(c.axis, limits.deceleration)).await?;
    c.write(CONTROLWORD, controlword::QUICK_STOP.into()).await?;
    let stopping_ns = (limits.velocity / limits.deceleration * 1e9) as Nanoseconds;
    let within_ns = c.timing.confirm_timeout_ns.saturating_add(stopping_ns);
    // The brake may engage below a tenth of the highest speed; a hundredth leaves a wide margin.
    let standstill = Check::Standstill(counts(c.axis, limits.velocity) / 100);
    c.wait_for(VELOCITY_ACTUAL_VALUE, standstill, within_ns, |_, _| ()).await
}

async fn synchronisation(c: &AxisSession<'_>) -> StepResult {
    c.step("SYNC", "choose a cycle period that this drive accepts");
    let period_ns = c.config.bus_cycle(c.axis.bus).period_ns;
    // Bit 30 would make the drive the SYNC producer.
    c.write_and_read_back(SYNC_COB_ID, 0x80).await?;
    c.write_and_read_back(COMMUNICATION_CYCLE_PERIOD, rounded_up(period_ns, 1_000)).await?;
    if let Some((mantissa, exponent)) = interpolation_time(period_ns) {
        c.write_optional(INTERPOLATION_TIME_PERIOD, mantissa).await?;
        c.write_optional(INTERPOLATION_TIME_INDEX, exponent).await?;
    }
    Ok(())
}

async fn process_data(c: &AxisSession<'_>) -> StepResult {
    match c.axis.mapping {
        PdoMapping::Written => {
            let ProcessData { commands, feedback, .. } = ProcessData::of(c.axis, c.config);
            pdo_mapping::write(c, PdoDirection::Receive, &commands, PDO_COUNT).await?;
            pdo_mapping::write(c, PdoDirection::Transmit, &feedback, PDO_COUNT).await
        }
        PdoMapping::AsStored => pdo_mapping::take_reported(c).await,
    }
}

async fn mode(c: &AxisSession<'_>) -> StepResult {
    let advice = match c.axis.control {
        Control::Interpolated => {
            "this firmware has no interpolated position mode (object 6502 does not declare it, and 6061 does not show \
             it): set mode = \"csp\" for this axis"
        }
        _ => "choose another control mode for this axis; clear the drive's fault if it has one",
    };
    c.step("mode of operation", advice);
    let mode = c.axis.control.operation_mode() as i64;
    c.write(MODES_OF_OPERATION, mode).await?;
    let within_ns = c.timing.confirm_timeout_ns;
    c.wait_for(MODES_OF_OPERATION_DISPLAY, Check::Equals(mode), within_ns, |_, _| ()).await
}

async fn ratings(c: &AxisSession<'_>) -> StepResult {
    c.step(
        "ratings",
        "torque cannot be commanded without the drive's rated torque: choose another control mode",
    );
    let is_torque_sent = has_target(c.axis, CommandSlot::TargetTorque) || c.axis.feed_forward.has_torque();
    let torque = if is_torque_sent { Check::Positive } else { Check::Any };
    let thousandths = |value: i64| (value > 0).then_some(value as f64 / 1000.0);
    c.read(MOTOR_RATED_CURRENT, Check::Any, |facts, value| facts.rated_current_a = thousandths(value))
        .await?;
    c.read(MOTOR_RATED_TORQUE, torque, |facts, value| facts.rated_torque = thousandths(value)).await?;
    c.read_optional(MAX_TORQUE, |facts, value| facts.max_torque_per_mille = Some(value as u16)).await?;
    let option = QUICK_STOP_OPTION_CODE;
    c.read_optional(option, |facts, value| facts.quick_stop_option_code = Some(value as i16)).await?;
    Ok(())
}

/// Returns `true` if a mode of the axis has this target.
fn has_target(axis: &Axis, target: CommandSlot) -> bool {
    axis.controls().any(|control| control.target_slot() == target)
}

/// Sets the drive's limits beyond those of the controller, which acts first. Sets the drive's profile to the axis'
/// limits, because the defaults are very slow (6081 = 10000 count/s); the cyclic modes use it too. What the axis'
/// configuration file has for them holds instead.
async fn limits(c: &AxisSession<'_>) -> StepResult {
    c.step("limits", "choose limits for this axis that its drive accepts");
    let (axis, limits) = (c.axis, &c.axis.limits);
    let has_position = has_target(axis, CommandSlot::TargetPosition);
    if has_position {
        // In profile position mode the drive follows its own profile, so its following error is not limited here.
        let error = if axis.control.is_profile() { f64::INFINITY } else { 2.0 * axis.following_error.limit };
        write_unless_in_file(c, FOLLOWING_ERROR_WINDOW, counts(axis, error).min(i32::MAX.into())).await?;
        write_unless_in_file(c, PROFILE_VELOCITY, counts(axis, limits.velocity)).await?;
    }
    if has_position || has_target(axis, CommandSlot::TargetVelocity) {
        write_unless_in_file(c, PROFILE_ACCELERATION, counts(axis, limits.acceleration)).await?;
        write_unless_in_file(c, PROFILE_DECELERATION, counts(axis, limits.deceleration)).await?;
    }
    write_unless_in_file(c, QUICK_STOP_DECELERATION, counts(axis, limits.deceleration)).await
}

async fn target_at_actual_position(c: &AxisSession<'_>) -> StepResult {
    c.step("target at the actual position", "clear the drive's fault, and check its software limits (607D)");
    actual_position::make_target(c).await?;
    c.write_and_read_back(TARGET_VELOCITY, 0).await?;
    c.write_and_read_back(TARGET_TORQUE, 0).await?;
    for offset in [POSITION_OFFSET, VELOCITY_OFFSET, TORQUE_OFFSET] {
        c.write_optional(offset, 0).await?;
    }
    Ok(())
}

async fn heartbeats(c: &AxisSession<'_>) -> StepResult {
    heartbeat::produce(c).await?;
    if c.config.master.heartbeat_ns.is_some() {
        // CiA 402 names only the entry into NMT stopped as a reason to abort motion, and this drive has no object 6007
        // for another reaction. The reset of the next bring-up leaves NMT stopped.
        c.write_and_read_back(COMMUNICATION_ERROR_BEHAVIOUR, error_behaviour::STOPPED.into()).await?;
    }
    heartbeat::watch_master(c).await
}
