//! The complete YZ-AIM: it receives frames and time, advances its parts, and sends frames.

mod commands;
mod load_monitor;
mod loops;
mod measurement;

use takt_rt::{DriveState, Frame, Nanoseconds};

use super::alarms::{Alarms, StoppingAlarm};
use super::bit_rate::BitRateChange;
use super::defects::check_possible;
use super::device::{Level, YzAimDevice};
use super::motion::YzAimMotion;
use super::parameters::{COUNTS_PER_SECOND_PER_RPM, COUNTS_PER_TURN, YzAimParameters};
use super::places::Places;
use crate::cia402::dictionary_by;
use crate::cia402::homing::Homing;
use crate::cia402::node::{CanopenDevice, CanopenNode};
use crate::cia402::services::NodeServices;
use crate::defect::{Defect, Unsupported};
use crate::drive::{Drive, DriveFault, Observation};
use crate::feedback_defects::{JointDefects, ShownObjects};
use crate::loops::ControlLoops;
use crate::mailbox::Mailbox;
use crate::motion::Actual;
use crate::plant::{Gravity, Joint};
use crate::random::Random;
use crate::servo::Servo;
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::quirks::PowerUpState;

/// Factor by which the loops may exceed the highest speed to catch up.
const SPEED_RESERVE: f64 = 1.1;
/// Standstill threshold: r/min.
const STANDSTILL_RPM: f64 = 1.0;
const NEVER: Nanoseconds = Nanoseconds::MAX;

/// The modes of operation in 6060h.
mod mode {
    use takt_rt::OperationMode;

    pub const PROFILE_POSITION: i64 = OperationMode::ProfilePosition as i64;
    pub const VELOCITY: i64 = OperationMode::ProfileVelocity as i64;
    pub const HOMING: i64 = OperationMode::Homing as i64;
    pub const INTERPOLATION: i64 = OperationMode::InterpolatedPosition as i64;
}

/// How long each overload has lasted.
#[derive(Clone, Copy, Debug, Default)]
struct LoadMonitor {
    blocked_s: f64,
    at_current_limit_s: f64,
    behind_s: f64,
}

/// A simulated YZ-AIM integrated servo with CANopen.
#[derive(Clone, Debug)]
pub struct YzAimJoint {
    parameters: YzAimParameters,
    canopen: CanopenNode,
    places: Places,
    /// True if the heartbeat of the master has timed out.
    is_master_lost: bool,
    device: YzAimDevice,
    alarms: Alarms,
    motion: YzAimMotion,
    homing: Homing,
    /// How long the homing has run.
    homing_s: f64,
    servo: Servo,
    joint: Joint,
    load_monitor: LoadMonitor,
    bit_rate_change: BitRateChange,
    random: Random,
    /// The mode that has taken effect.
    last_mode: i64,
    /// The bit rate in use, and the one after the next power-up.
    bit_rate: u32,
    next_bit_rate: u32,
    /// The special function in use: the value that was stored at power-up.
    special_function: i64,
    torque: f64,
    /// Offset added to the encoder's counts.
    counts_offset: i32,
    /// True if the first target after enabling is still to come; it will be ignored.
    ignores_target: bool,
    /// The speed of a move after power-up: counts/s.
    power_up_speed: Option<f64>,
    has_started: bool,
    is_starting_cold: bool,
    was_energised: bool,
    /// True if 260Ah = 60006 has been written.
    is_zero_armed: bool,
    injected: Option<DriveFault>,
    joint_defects: JointDefects,
    /// The time up to which the loops have run.
    stepped_ns: Nanoseconds,
    now_ns: Nanoseconds,
}

impl YzAimJoint {
    /// A servo whose supply is switched on at time 0.
    pub fn new(parameters: YzAimParameters) -> Self {
        let mut dictionary = dictionary_by(&parameters.sheet, parameters.node, &parameters.device);
        let places = Places::of(&dictionary, 0);
        for (place, value) in [
            (places.node_address, parameters.node.into()),
            (places.special_function, parameters.special_function.into()),
            (places.acceleration, parameters.acceleration.into()),
        ] {
            if let Some(place) = place {
                dictionary.set_factory(place, value);
            }
        }
        let random = Random::new(parameters.seed, parameters.node);
        let highest_speed = parameters.highest_speed();
        let velocity_limit = SPEED_RESERVE * highest_speed / parameters.encoder.counts_per_unit.abs();
        let joint = Joint::new(parameters.joint, parameters.initial_position).between(parameters.end_stops);
        let (power_up_ns, feedback_ns) = (parameters.power_up_ns, parameters.feedback_delay_ns);
        let quirks = parameters.device.clone();
        let mut unit = Self {
            canopen: CanopenNode::new(parameters.node, dictionary, quirks, random, power_up_ns, feedback_ns),
            places,
            is_master_lost: false,
            device: YzAimDevice::cold(),
            alarms: Alarms::default(),
            motion: YzAimMotion::new(highest_speed),
            homing: Homing::idle(),
            homing_s: 0.0,
            servo: Servo::new(parameters.joint.inertia, parameters.peak_torque, velocity_limit),
            joint,
            load_monitor: LoadMonitor::default(),
            bit_rate_change: BitRateChange::None,
            random,
            last_mode: 0,
            bit_rate: parameters.bit_rate,
            next_bit_rate: parameters.bit_rate,
            special_function: 0,
            torque: 0.0,
            counts_offset: 0,
            ignores_target: false,
            power_up_speed: None,
            has_started: false,
            is_starting_cold: false,
            was_energised: false,
            is_zero_armed: false,
            injected: None,
            joint_defects: JointDefects::default(),
            stepped_ns: 0,
            now_ns: 0,
            parameters,
        };
        unit.power_up(0);
        unit
    }

    /// The bit rate in use: bit/s. At another bit rate than its bus, it neither receives nor sends.
    pub fn bit_rate(&self) -> u32 {
        self.bit_rate
    }

    fn number(&self, place: Option<usize>) -> i64 {
        self.canopen.dictionary.number_at(place).unwrap_or(0)
    }

    fn real(&self, place: Option<usize>) -> f64 {
        self.number(place) as f64
    }

    fn has_battery(&self) -> bool {
        !self.canopen.quirks.simulated.lacks_battery
    }

    fn is_on_bus(&self) -> bool {
        self.bit_rate == self.parameters.bit_rate
    }

    fn direction(&self) -> f64 {
        1f64.copysign(self.parameters.encoder.counts_per_unit)
    }

    fn encoder_counts(&self) -> i32 {
        self.parameters.encoder.counts(self.joint.position())
    }

    fn counts(&self) -> i32 {
        self.encoder_counts().wrapping_add(self.counts_offset)
    }

    fn actual(&self) -> Actual {
        let velocity = self.parameters.encoder.counts_per_second(self.joint.velocity());
        Actual { position: self.counts().into(), velocity }
    }

    fn velocity_rpm(&self) -> f64 {
        self.actual().velocity / COUNTS_PER_SECOND_PER_RPM
    }

    fn is_at_rest(&self) -> bool {
        self.velocity_rpm().abs() < STANDSTILL_RPM
    }

    fn mode(&self) -> i64 {
        self.number(self.places.operation_mode)
    }

    fn is_in_mode(&self, mode: i64) -> bool {
        self.mode() == mode && self.device.level() == Level::Enabled
    }

    /// Returns `true` if a target takes effect at every SYNC: 2619h = 7 was stored at power-up.
    fn interpolates(&self) -> bool {
        self.is_in_mode(mode::INTERPOLATION) && self.special_function == mode::INTERPOLATION
    }

    /// Returns `true` if the motor is energised. It holds its shaft after power-up, and homing needs no controlword.
    fn is_energised(&self) -> bool {
        let is_commanded = matches!(self.device.level(), Level::Cold | Level::Enabled)
            || self.mode() == mode::HOMING && self.homing.is_begun();
        self.has_started
            && is_commanded
            && self.number(self.places.output_enable) == 1
            && !self.alarms.is_stopped()
    }

    /// The alarm code in 260Eh.
    fn alarm_code(&self) -> u16 {
        self.alarms.code(self.is_master_lost)
    }

    /// Returns `true` if heartbeat and statusword report an alarm.
    fn shows_alarm(&self) -> bool {
        self.alarms.is_stopped()
            || self.is_master_lost
            || self.alarms.has_lost_battery && self.parameters.quirks.shows_battery_alarm
    }

    /// Sets the count of the current position.
    fn set_counts(&mut self, counts: i32) {
        let before = self.counts();
        self.counts_offset = counts.wrapping_sub(self.encoder_counts());
        self.motion.shift(f64::from(counts) - f64::from(before));
    }

    /// Raises an alarm that stops the motor: the output is off until it is cleared.
    fn fail(&mut self, now_ns: Nanoseconds, alarm: StoppingAlarm) {
        self.alarms.raise(now_ns, alarm);
        self.canopen.dictionary.set_at(self.places.output_enable, 0);
    }

    /// Powers up.
    fn power_up(&mut self, now_ns: Nanoseconds) {
        self.alarms = self.alarms.after_power_up();
        let CanopenNode { id, dictionary, .. } = &mut self.canopen;
        let saved = |place: Option<usize>| place.map_or(0, |place| dictionary.saved(place));
        self.special_function = saved(self.places.special_function);
        let node = saved(self.places.node_address) as u8;
        if node != *id {
            *id = node;
            dictionary.set_node(&self.parameters.sheet, node);
        }
        self.bit_rate = self.next_bit_rate;
        if !self.has_battery() || self.alarms.has_lost_battery {
            let counts = self.encoder_counts();
            self.counts_offset = counts.rem_euclid(COUNTS_PER_TURN as i32).wrapping_sub(counts);
        }
        self.restart(now_ns);
        self.canopen.is_boot_silent = self.canopen.quirks.simulated.is_power_up_silent;
        self.canopen.network.set_power_up(self.canopen.quirks.power_up);
        self.is_starting_cold = true;
    }
}

impl CanopenDevice for YzAimJoint {
    fn canopen(&mut self) -> &mut CanopenNode {
        &mut self.canopen
    }

    fn measure(&mut self) {
        self.measure_all();
    }

    fn measure_for_pdos(&mut self) {
        self.measure_all();
        self.measure_velocity_of_pdo();
    }

    /// No TPDO has a mode, and their mapping is fixed.
    fn shown(&self) -> ShownObjects {
        let Places { statusword, position, .. } = self.places;
        ShownObjects { statusword, mode_display: None, position, instead_of_position: None }
    }

    fn is_faulted(&self) -> bool {
        self.shows_alarm()
    }

    /// After power-up and "reset node" the motor is energised.
    fn started(&mut self, _now_ns: Nanoseconds) {
        self.has_started = true;
        if std::mem::take(&mut self.is_starting_cold) {
            self.move_after_power_up();
        }
    }

    /// Stored values are restored, and the drive is not enabled.
    fn restart(&mut self, now_ns: Nanoseconds) {
        self.canopen.restart(now_ns);
        self.canopen.network.set_power_up(PowerUpState::PreOperational);
        if self.number(self.places.gear_numerator) == 0 {
            self.canopen.dictionary.set_at(self.places.modbus_enable, 1);
        }
        if self.alarms.is_stopped() {
            self.canopen.dictionary.set_at(self.places.output_enable, 0);
        }
        self.is_master_lost = false;
        self.device = YzAimDevice::cold();
        self.homing = Homing::idle();
        self.last_mode = self.mode();
        self.bit_rate_change = BitRateChange::None;
        self.has_started = false;
        self.was_energised = false;
        self.is_starting_cold = false;
        self.power_up_speed = None;
        self.is_zero_armed = false;
        self.ignores_target = false;
    }

    fn reset_communication(&mut self) {
        self.canopen.network.set_power_up(PowerUpState::PreOperational);
        self.is_master_lost = false;
    }

    fn lose_master(&mut self) {
        self.is_master_lost = true;
    }

    /// A heartbeat after a loss ends the alarm.
    fn hear_master(&mut self) {
        self.is_master_lost = false;
    }

    fn written(&mut self, address: ObjectAddress, now_ns: Nanoseconds) {
        self.apply_written(address, now_ns);
    }

    fn rpdo_applied(&mut self, now_ns: Nanoseconds, number: usize, is_by_sync: bool) {
        self.apply_rpdo(now_ns, number, is_by_sync);
    }
}

impl Drive for YzAimJoint {
    fn node(&self) -> u8 {
        self.canopen.id
    }

    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        if self.canopen.passes_by(now_ns, frame) {
            return;
        }
        self.run_loops(now_ns);
        if self.is_on_bus() {
            self.receive_frame(now_ns, frame, mailbox);
        }
        self.canopen.schedule(now_ns);
    }

    /// At a wrong bit rate nothing is sent.
    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        if let Some(fault) = self.injected.take() {
            self.apply_fault(now_ns, fault);
        }
        self.advance_node(now_ns, mailbox);
        if !self.is_on_bus() {
            mailbox.clear();
        }
        self.canopen.schedule(now_ns);
    }

    fn wake_ns(&self) -> Nanoseconds {
        self.canopen.wake_ns()
    }

    fn observe(&mut self, now_ns: Nanoseconds) -> Observation {
        self.run_loops(now_ns);
        let is_stopped = self.alarms.is_stopped() || self.is_master_lost;
        Observation {
            position: self.joint.position(),
            velocity: self.joint.velocity(),
            torque: self.torque * self.direction(),
            position_counts: self.counts(),
            state: if is_stopped { DriveState::Fault } else { self.device.level().state() },
            statusword: self.statusword(),
            error_code: self.alarm_code(),
            operation_mode: self.mode() as i8,
            nmt: self.canopen.network.state(),
            is_braked: false,
        }
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        self.injected = Some(fault);
        self.canopen.wake_after(self.now_ns);
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_loops(now_ns);
        mailbox.clear();
        self.power_up(now_ns);
        self.canopen.schedule(now_ns);
    }

    fn set_gravity(&mut self, gravity: Gravity) {
        self.joint.set_gravity(gravity);
    }

    fn set_load_torque(&mut self, torque: f64) {
        self.joint.set_load_torque(torque);
    }

    fn inject_defect(
        &mut self,
        now_ns: Nanoseconds,
        defect: Defect,
        is_present: bool,
    ) -> Result<(), Unsupported> {
        self.run_loops(now_ns);
        check_possible(defect)?;
        self.canopen.defects.set(defect, is_present);
        self.joint_defects.set(defect, is_present);
        match defect {
            Defect::EncoderJump { distance } if is_present => {
                let counts = (distance * self.parameters.encoder.counts_per_unit).round() as i64 as i32;
                self.counts_offset = self.counts_offset.wrapping_add(counts);
            }
            Defect::Alarm { code } if is_present => self.raise(now_ns, code)?,
            _ => {}
        }
        self.canopen.wake_after(self.now_ns);
        Ok(())
    }
}
