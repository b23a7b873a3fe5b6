//! Bring-up, start and shutdown of a CiA 402 drive by its data sheet.
//!
//! Nothing is demanded that a drive may lack: each object is used if the data sheet has it and lets it be written, and skipped
//! otherwise. `takt check` says what safety is lost by that: see [`remarks`](super::remarks).

use takt_rt::{CommandSlot, Nanoseconds, controlword};
use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::canopen::nmt::{NmtCommand, NmtState};
use takt_wire::canopen::object::{DataType, Object};
use takt_wire::canopen::objects::*;

use super::device::Device;
use crate::config::{PdoMapping, Supervision};
use crate::family::bring_up::axis_units::{
    acceleration_units, counts, interpolation_time, profile_velocity_units, rounded_up, velocity_units,
};
use crate::family::bring_up::configuration_file::{self, write_unless_in_file};
use crate::family::bring_up::{
    AxisFacts, AxisSession, Check, ProcessData, RESTART_STEP, StepResult, actual_position, heartbeat,
    identity, pdo_mapping, planner,
};
use crate::family::{DataSheet, stops_by_itself_after};

const FOLLOWING_ERROR_WINDOW: Object = Object::new(0x6065, 0, DataType::U32, "following error window");
const ABORT_CONNECTION_OPTION: Object = Object::new(0x6007, 0, DataType::I16, "abort connection option code");
const SYNC_COUNTER_OVERFLOW: Object = Object::new(0x1019, 0, DataType::U8, "synchronous counter overflow");
/// Object 6007: the drive reacts as to a fault.
const FAULT_SIGNAL: i64 = 1;
/// How long a drive may move on after a quick stop, if it cannot show its velocity.
const UNSEEN_STANDSTILL_NS: Nanoseconds = 500_000_000;

/// A bring-up of a drive that has this data sheet.
pub struct Sheet<'a> {
    pub c: &'a AxisSession<'a>,
    pub device: &'a Device,
}

impl Sheet<'_> {
    /// From any state to pre-operational, configured, without torque.
    pub async fn configure(&self) -> StepResult {
        let c = self.c;
        let if_silent = "check that the drive is powered, the wiring and the termination of the bus, its bit rate, and its node ID";
        c.step(RESTART_STEP, self.device.quirks.if_silent.unwrap_or(if_silent));
        if c.is_first_of_node() {
            c.restart_communication().await?;
        }
        identity::compare(c, self.profile()).await?;
        identity::read_texts(c).await?;
        self.supported_modes().await?;
        self.come_to_rest().await?;
        configuration_file::write(c).await?;
        self.synchronisation().await?;
        self.process_data().await?;
        self.mode().await?;
        self.ratings().await?;
        self.limits().await?;
        planner::check(c).await?;
        self.target_at_actual_position().await?;
        if c.is_last_of_node() {
            self.heartbeats().await?;
        }
        Ok(())
    }

    /// The profile of a drive whose device type the configuration leaves open. Some drives leave it out of object 1000.
    fn profile(&self) -> Check {
        let by_sheet = self.device.number(DEVICE_TYPE.address).unwrap_or(0);
        if identity::PROFILE_CIA402.passes(by_sheet) { identity::PROFILE_CIA402 } else { Check::Any }
    }

    /// A unit with other firmware may lack a mode that the data sheet has.
    async fn supported_modes(&self) -> StepResult {
        let c = self.c;
        c.step(
            "supported modes",
            "choose another control mode for this axis, or load firmware that has this one",
        );
        let by_sheet =
            self.device.number(SUPPORTED_DRIVE_MODES.address).filter(|_| self.device.quirks.modes.is_none());
        for control in c.axis.controls() {
            let supports = Check::Supports(control.operation_mode());
            let expected =
                if by_sheet.is_some_and(|bits| supports.passes(bits)) { supports } else { Check::Any };
            if self.device.has(&SUPPORTED_DRIVE_MODES) {
                c.read(SUPPORTED_DRIVE_MODES, expected, |facts, value| facts.supported_modes = value as u32)
                    .await?;
            }
        }
        Ok(())
    }

    /// From configured to operational.
    pub async fn start(&self) -> StepResult {
        let c = self.c;
        c.step("start", "check that no other master commands this node");
        if c.is_first_of_node() {
            c.command(NmtCommand::Start, NmtState::Operational).await?;
        }
        self.read_state().await?;
        actual_position::read(c).await
    }

    /// From operational to pre-operational, without torque, heartbeat watchdog off.
    pub async fn shut_down(&self) -> StepResult {
        let c = self.c;
        c.step("shut down", "power-cycle the drive before the next run");
        if c.is_first_of_node() {
            c.wake_up(NmtCommand::EnterPreOperational).await?;
            c.command(NmtCommand::EnterPreOperational, NmtState::PreOperational).await?;
        }
        self.come_to_rest().await?;
        // Until the last axis is at rest, the node watches the controller.
        if !c.is_last_of_node() {
            return Ok(());
        }
        if self.device.is_writable(CONSUMER_HEARTBEAT_TIME.address) {
            heartbeat::end_watch(c, "expect a communication fault of the drive; the next bring-up clears it")
                .await?;
        }
        // The drive watches for the requests from the first one on, and goes on with it as with heartbeats.
        if let (Supervision::Guarding { .. }, false) = (c.axis.supervision(&c.config.master), c.has_failed())
        {
            self.set(GUARD_TIME, 0).await?;
            self.set(LIFE_TIME_FACTOR, 0).await?;
        }
        // SYNC ends with the run: a node that watches for it by this period would report 0x8100 (CiA 301, 7.5.2.6).
        if self.device.is_writable(COMMUNICATION_CYCLE_PERIOD.address) {
            c.write(COMMUNICATION_CYCLE_PERIOD, 0).await?;
        }
        self.set(PRODUCER_HEARTBEAT_TIME, 0).await
    }

    /// Writes a number and reads it back, if the drive has the object and lets it be written.
    async fn set(&self, object: Object, value: i64) -> StepResult {
        if self.device.is_writable(object.address) {
            self.c.write_and_read_back(object, value).await
        } else {
            self.c.note_absent(object.address);
            Ok(())
        }
    }

    async fn read_state(&self) -> StepResult {
        let c = self.c;
        c.read(STATUSWORD, Check::Any, |facts, value| facts.statusword = value as u16).await?;
        if self.device.has(&ERROR_CODE) {
            c.read(ERROR_CODE, Check::Any, |facts, value| facts.error_code = ErrorCode(value as u16)).await?;
        }
        Ok(())
    }

    /// Stops and disables the drive. A communication reset ends neither its torque nor its motion.
    async fn come_to_rest(&self) -> StepResult {
        let c = self.c;
        c.step(
            "standstill without torque",
            "the drive holds or moves its axis and does not respond: use the emergency stop, then power-cycle it",
        );
        self.read_state().await?;
        if c.facts().state().has_torque() {
            self.stop_motion().await?;
        }
        // Bit 7 stays low, so that a later fault reset is a rising edge.
        c.write(CONTROLWORD, controlword::DISABLE_VOLTAGE.into()).await?;
        let within_ns = c.timing.confirm_timeout_ns;
        c.wait_for(STATUSWORD, Check::NoTorque, within_ns, |facts, value| facts.statusword = value as u16)
            .await
    }

    /// Stops by a quick stop, with the deceleration of the axis.
    async fn stop_motion(&self) -> StepResult {
        let (c, limits) = (self.c, &self.c.axis.limits);
        if self.device.is_writable(QUICK_STOP_DECELERATION.address) {
            let deceleration = acceleration_units(c.axis, limits.deceleration);
            write_unless_in_file(c, QUICK_STOP_DECELERATION, deceleration).await?;
        }
        c.write(CONTROLWORD, controlword::QUICK_STOP.into()).await?;
        let stopping_ns = (limits.velocity / limits.deceleration * 1e9) as Nanoseconds;
        if !self.device.has(&VELOCITY_ACTUAL_VALUE) {
            c.pause(stopping_ns.saturating_add(UNSEEN_STANDSTILL_NS)).await;
            return Ok(());
        }
        let within_ns = c.timing.confirm_timeout_ns.saturating_add(stopping_ns);
        let standstill = Check::Standstill((velocity_units(c.axis, limits.velocity) / 100).max(1));
        c.wait_for(VELOCITY_ACTUAL_VALUE, standstill, within_ns, |_, _| ()).await
    }

    async fn synchronisation(&self) -> StepResult {
        let c = self.c;
        c.step("SYNC", "choose a cycle period that this drive accepts");
        let period_ns = c.config.bus_cycle(c.axis.bus).period_ns;
        if c.is_first_of_node() {
            // Bit 30 would make the drive the SYNC producer. Where the object is constant, it is 80h already.
            self.set(SYNC_COB_ID, 0x80).await?;
            self.end_sync_counter().await?;
            self.set(COMMUNICATION_CYCLE_PERIOD, rounded_up(period_ns, 1_000)).await?;
        }
        if let Some((mantissa, exponent)) = interpolation_time(period_ns) {
            self.set(INTERPOLATION_TIME_PERIOD, mantissa).await?;
            self.set(INTERPOLATION_TIME_INDEX, exponent).await?;
        }
        Ok(())
    }

    /// The SYNC of takt has no counter. It may only be changed while 1006 is 0 (CiA 301, 7.5.2.22).
    async fn end_sync_counter(&self) -> StepResult {
        let c = self.c;
        let mut overflow = 0;
        if self.device.has(&SYNC_COUNTER_OVERFLOW) {
            c.read_optional(SYNC_COUNTER_OVERFLOW, |_, value| overflow = value).await?;
        }
        if overflow == 0 {
            return Ok(());
        }
        self.set(COMMUNICATION_CYCLE_PERIOD, 0).await?;
        c.write_and_read_back(SYNC_COUNTER_OVERFLOW, 0).await
    }

    async fn process_data(&self) -> StepResult {
        let c = self.c;
        if c.is_first_of_node() {
            self.switch_other_axes_off().await?;
        }
        match c.axis.mapping {
            PdoMapping::Written => {
                let ProcessData { commands, feedback, .. } = ProcessData::of(c.axis, c.config);
                let slots = |direction| self.device.pdo_slots(direction);
                pdo_mapping::write(c, PdoDirection::Receive, &commands, slots(PdoDirection::Receive)).await?;
                pdo_mapping::write(c, PdoDirection::Transmit, &feedback, slots(PdoDirection::Transmit)).await
            }
            PdoMapping::AsStored => {
                // Where its mapping can be changed, the user has stored it as it is to be.
                if c.axis.drive.has_fixed_process_data {
                    pdo_mapping::adapt_communication(c, |object| self.device.is_writable(object)).await?;
                }
                pdo_mapping::take_reported(c).await
            }
        }
    }

    /// Switches the PDOs off of the axes of the node that the configuration does not have.
    async fn switch_other_axes_off(&self) -> StepResult {
        for node_axis in (1..=self.device.axes()).filter(|node_axis| !self.c.has_node_axis(*node_axis)) {
            let Ok(other) = self.device.clone().of_axis(node_axis) else { continue };
            for direction in [PdoDirection::Receive, PdoDirection::Transmit] {
                let count = other.pdo_slots(direction);
                pdo_mapping::switch_all_off(self.c, direction, node_axis, count).await?;
            }
        }
        Ok(())
    }

    async fn mode(&self) -> StepResult {
        let c = self.c;
        let mode = c.axis.control.operation_mode();
        let advice = match self.device.quirks.undeclared_modes.contains(&mode) {
            true => {
                "not every firmware of this drive has this mode (object 6502 need not declare it; 6061 shows it): choose \
                 another mode for this axis, such as mode = \"csp\""
            }
            false => "choose another control mode for this axis; clear the drive's fault if it has one",
        };
        c.step("mode of operation", advice);
        let mode = mode as i64;
        c.write(MODES_OF_OPERATION, mode).await?;
        if !self.device.has(&MODES_OF_OPERATION_DISPLAY) {
            return Ok(());
        }
        let within_ns = c.timing.confirm_timeout_ns;
        c.wait_for(MODES_OF_OPERATION_DISPLAY, Check::Equals(mode), within_ns, |_, _| ()).await
    }

    async fn ratings(&self) -> StepResult {
        let c = self.c;
        c.step(
            "ratings",
            "torque cannot be commanded without the drive's rated torque: say it in the configuration, [axis.joint] rated_torque, or \
             choose another control mode",
        );
        let thousandths = |value: i64| (value > 0).then_some(value as f64 / 1000.0);
        c.read_optional(MOTOR_RATED_CURRENT, |facts, value| facts.rated_current_a = thousandths(value))
            .await?;
        let is_torque_sent = self.has_target(CommandSlot::TargetTorque) || c.axis.feed_forward.has_torque();
        if is_torque_sent && c.axis.joint.rated_torque.is_none() && self.device.has(&MOTOR_RATED_TORQUE) {
            let keep = |facts: &mut AxisFacts, value| facts.rated_torque = thousandths(value);
            c.read(MOTOR_RATED_TORQUE, Check::Positive, keep).await?;
        } else {
            c.read_optional(MOTOR_RATED_TORQUE, |facts, value| facts.rated_torque = thousandths(value))
                .await?;
        }
        c.read_optional(MAX_TORQUE, |facts, value| facts.max_torque_per_mille = Some(value as u16)).await?;
        let option = QUICK_STOP_OPTION_CODE;
        c.read_optional(option, |facts, value| facts.quick_stop_option_code = Some(value as i16)).await?;
        Ok(())
    }

    /// Returns `true` if a mode of the axis has this target.
    fn has_target(&self, target: CommandSlot) -> bool {
        self.c.axis.controls().any(|control| control.target_slot() == target)
    }

    /// Sets the drive's limits beyond those of the controller, which acts first, and its profile to the axis' limits. What the
    /// axis' configuration file has for them holds instead.
    async fn limits(&self) -> StepResult {
        let c = self.c;
        c.step("limits", "choose limits for this axis that its drive accepts");
        let (axis, limits) = (c.axis, &c.axis.limits);
        if self.has_target(CommandSlot::TargetPosition) {
            // In profile position mode the drive follows its own profile, so its following error is not limited here.
            let error =
                if axis.control.is_profile() { f64::INFINITY } else { 2.0 * axis.following_error.limit };
            let window = counts(axis, error);
            // All ones, which is no window, would be -1 in an object with a sign.
            let window = match DataSheet::data_type(self.device, FOLLOWING_ERROR_WINDOW.address) {
                Some(DataType::I32) => window.min(i32::MAX.into()),
                _ => window,
            };
            self.limit(FOLLOWING_ERROR_WINDOW, window).await?;
            self.limit(PROFILE_VELOCITY, profile_velocity_units(axis, limits.velocity)).await?;
        }
        for (object, acceleration) in [
            (PROFILE_ACCELERATION, limits.acceleration),
            (PROFILE_DECELERATION, limits.deceleration),
            (QUICK_STOP_DECELERATION, limits.deceleration),
        ] {
            self.limit(object, acceleration_units(axis, acceleration)).await?;
        }
        Ok(())
    }

    async fn limit(&self, object: Object, value: i64) -> StepResult {
        if self.device.is_writable(object.address) {
            write_unless_in_file(self.c, object, value).await?;
        }
        Ok(())
    }

    /// Enabling with an old target would make the axis jump.
    async fn target_at_actual_position(&self) -> StepResult {
        let c = self.c;
        c.step(
            "target at the actual position",
            "clear the drive's fault, and check its software limits (607D)",
        );
        if self.device.is_writable(TARGET_POSITION.address) {
            actual_position::make_target(c).await?;
        } else {
            actual_position::read(c).await?;
        }
        for target in [TARGET_VELOCITY, TARGET_TORQUE, POSITION_OFFSET, VELOCITY_OFFSET, TORQUE_OFFSET] {
            self.set(target, 0).await?;
        }
        Ok(())
    }

    async fn heartbeats(&self) -> StepResult {
        let c = self.c;
        let supervision = c.axis.supervision(&c.config.master);
        if self.device.is_writable(PRODUCER_HEARTBEAT_TIME.address) {
            heartbeat::produce(c).await?;
        }
        if let Supervision::Guarding { guard_time_ns, life_time_factor } = supervision {
            c.step("node guarding", "choose a heartbeat time that this drive accepts as guard time");
            self.set(GUARD_TIME, rounded_up(guard_time_ns, 1_000_000)).await?;
            self.set(LIFE_TIME_FACTOR, life_time_factor.into()).await?;
        }
        if stops_by_itself_after(c.axis, c.config).is_ok() {
            self.set(COMMUNICATION_ERROR_BEHAVIOUR, error_behaviour::STOPPED.into()).await?;
            self.set(ABORT_CONNECTION_OPTION, FAULT_SIGNAL).await?;
        }
        if self.device.is_writable(CONSUMER_HEARTBEAT_TIME.address) {
            heartbeat::watch_master(c).await?;
        }
        Ok(())
    }
}
