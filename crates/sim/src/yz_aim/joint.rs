//! The complete YZ-AIM: it receives frames and time, advances its parts, and sends frames.

mod access;
mod commands;
mod frames;
mod load_monitor;
mod loops;
mod measurement;

use takt_rt::{DriveState, Frame, Nanoseconds};

use super::alarms::{Alarms, StoppingAlarm};
use super::bit_rate::BitRateChange;
use super::defects::check_possible;
use super::device::{Level, YzAimDevice};
use super::homing::Homing;
use super::motion::YzAimMotion;
use super::objects::{OBJECTS, at};
use super::parameters::{COUNTS_PER_SECOND_PER_RPM, COUNTS_PER_TURN, YzAimParameters};
use super::process_data::{PDO_FEATURES, Transmission, report_state_first};
use crate::defect::{Defect, Unsupported};
use crate::drive::{Drive, DriveFault, Observation};
use crate::feedback_defects::{FeedbackDefects, JointDefects};
use crate::loops::ControlLoops;
use crate::mailbox::Mailbox;
use crate::motion::Actual;
use crate::network::Network;
use crate::object_dictionary::SimulatedDictionary;
use crate::pdo_engine::PdoEngine;
use crate::plant::{Gravity, Joint};
use crate::random::Random;
use crate::sdo_server::{SdoFeatures, SdoServer};
use crate::servo::Servo;
use takt_wire::quirks::PowerUpState;

/// Longest time between two advances.
const IDLE_NS: Nanoseconds = 1_000_000;
/// From an SDO request to its reply, as measured on real units: about 0.3 ms.
const SDO_LATENCY_NS: std::ops::Range<Nanoseconds> = 270_000..330_000;
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
    pub const ALL: [i64; 4] = [PROFILE_POSITION, VELOCITY, HOMING, INTERPOLATION];
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
    dictionary: SimulatedDictionary,
    network: Network,
    /// True if the next boot sends a boot-up message.
    is_boot_announced: bool,
    /// True if the heartbeat of the master has timed out.
    is_master_lost: bool,
    sdo: SdoServer,
    pdos: PdoEngine,
    transmission: Transmission,
    device: YzAimDevice,
    alarms: Alarms,
    motion: YzAimMotion,
    homing: Homing,
    servo: Servo,
    joint: Joint,
    load_monitor: LoadMonitor,
    bit_rate_change: BitRateChange,
    random: Random,
    /// The node ID in use.
    node: u8,
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
    defects: FeedbackDefects,
    joint_defects: JointDefects,
    save_ns: Nanoseconds,
    /// The time up to which the loops have run.
    stepped_ns: Nanoseconds,
    now_ns: Nanoseconds,
    wake_ns: Nanoseconds,
}

impl YzAimJoint {
    /// A servo whose supply is switched on at time 0.
    pub fn new(parameters: YzAimParameters) -> Self {
        let mut dictionary = SimulatedDictionary::of_table(&OBJECTS, parameters.node);
        dictionary.set_factory(at::NODE_ADDRESS, parameters.node.into());
        dictionary.set_factory(at::SPECIAL_FUNCTION, parameters.special_function.into());
        dictionary.set_factory(at::ACCELERATION, parameters.acceleration.into());
        dictionary.set_factory(at::TEMPERATURE, 35);
        if parameters.quirks.reports_state_first {
            report_state_first(&mut dictionary);
        }
        let random = Random::new(parameters.seed, parameters.node);
        let highest_speed = parameters.highest_speed();
        let velocity_limit = SPEED_RESERVE * highest_speed / parameters.encoder.counts_per_unit.abs();
        let joint = Joint::new(parameters.joint, parameters.initial_position).between(parameters.end_stops);
        let mut unit = Self {
            parameters,
            network: Network::starting(&dictionary, NEVER, PowerUpState::PreOperational),
            is_boot_announced: false,
            is_master_lost: false,
            sdo: SdoServer::new(random, SDO_LATENCY_NS, SdoFeatures::Expedited),
            pdos: PdoEngine::new(&dictionary, PDO_FEATURES),
            transmission: Transmission::at_rest(),
            dictionary,
            device: YzAimDevice::cold(),
            alarms: Alarms::default(),
            motion: YzAimMotion::new(highest_speed),
            homing: Homing::idle(),
            servo: Servo::new(parameters.joint.inertia, parameters.peak_torque, velocity_limit),
            joint,
            load_monitor: LoadMonitor::default(),
            bit_rate_change: BitRateChange::None,
            random,
            node: parameters.node,
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
            defects: FeedbackDefects::default(),
            joint_defects: JointDefects::default(),
            save_ns: NEVER,
            stepped_ns: 0,
            now_ns: 0,
            wake_ns: 0,
        };
        unit.power_up(0);
        unit
    }

    /// The bit rate in use: bit/s. At another bit rate than its bus, it neither receives nor sends.
    pub fn bit_rate(&self) -> u32 {
        self.bit_rate
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
        self.dictionary.number(at::OPERATION_MODE)
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
            && self.dictionary.number(at::OUTPUT_ENABLE) == 1
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
        self.dictionary.set(at::OUTPUT_ENABLE, 0);
    }

    /// Powers up.
    fn power_up(&mut self, now_ns: Nanoseconds) {
        self.alarms = self.alarms.after_power_up();
        self.node = self.dictionary.saved(at::NODE_ADDRESS) as u8;
        for (place, object) in OBJECTS.iter().enumerate().filter(|(_, object)| object.adds_node) {
            self.dictionary.set_factory(place, object.default_of(self.node));
        }
        self.bit_rate = self.next_bit_rate;
        self.special_function = self.dictionary.saved(at::SPECIAL_FUNCTION);
        if !self.parameters.has_battery || self.alarms.has_lost_battery {
            let counts = self.encoder_counts();
            self.counts_offset = counts.rem_euclid(COUNTS_PER_TURN as i32).wrapping_sub(counts);
        }
        let state = if self.parameters.starts_operational {
            PowerUpState::Operational
        } else {
            PowerUpState::PreOperational
        };
        self.start(now_ns, state, self.parameters.quirks.announces_power_up);
        self.is_starting_cold = true;
    }

    /// Common part of power-up and NMT "reset node": stored values are restored, and the drive is not enabled.
    fn start(&mut self, now_ns: Nanoseconds, state: PowerUpState, is_announced: bool) {
        self.dictionary.restore(0..=u16::MAX);
        if self.dictionary.number(at::GEAR_NUMERATOR) == 0 {
            self.dictionary.set(at::MODBUS_ENABLE, 1);
        }
        if self.alarms.is_stopped() {
            self.dictionary.set(at::OUTPUT_ENABLE, 0);
        }
        self.network.set_power_up(state);
        self.network.restart(now_ns + self.parameters.power_up_ns);
        self.is_boot_announced = is_announced;
        self.is_master_lost = false;
        self.sdo.reset();
        self.pdos.compile(&self.dictionary);
        self.transmission = Transmission::at_rest();
        self.device = YzAimDevice::cold();
        self.homing = Homing::idle();
        self.bit_rate_change = BitRateChange::None;
        self.has_started = false;
        self.was_energised = false;
        self.is_starting_cold = false;
        self.power_up_speed = None;
        self.is_zero_armed = false;
        self.ignores_target = false;
        self.save_ns = NEVER;
    }

    fn schedule(&mut self, now_ns: Nanoseconds) {
        let due_ns = [
            now_ns + IDLE_NS,
            self.network.due_ns(),
            self.sdo.due_ns().unwrap_or(NEVER),
            self.pdos.due_ns(),
            self.transmission.due_ns(),
            self.save_ns,
        ];
        self.wake_ns = due_ns.into_iter().min().unwrap_or(NEVER).max(now_ns + 1);
    }
}

impl Drive for YzAimJoint {
    fn node(&self) -> u8 {
        self.node
    }

    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, _mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        if self.is_on_bus() {
            self.receive_frame(now_ns, frame);
        }
        self.schedule(now_ns);
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        if let Some(fault) = self.injected.take() {
            self.apply_fault(now_ns, fault);
        }
        self.is_master_lost |= self.network.has_lost_master(now_ns);
        if now_ns >= self.save_ns {
            self.save_ns = NEVER;
            self.dictionary.save();
            self.dictionary.set(at::SAVE_FLAG, 2);
        }
        self.send_due(now_ns, mailbox);
        self.schedule(now_ns);
    }

    fn wake_ns(&self) -> Nanoseconds {
        self.wake_ns
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
            nmt: self.network.state(),
            is_braked: false,
        }
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        self.injected = Some(fault);
        self.wake_ns = self.now_ns + 1;
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_loops(now_ns);
        mailbox.clear();
        self.power_up(now_ns);
        self.schedule(now_ns);
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
        self.defects.set(defect, is_present);
        self.joint_defects.set(defect, is_present);
        match defect {
            Defect::EncoderJump { distance } if is_present => {
                let counts = (distance * self.parameters.encoder.counts_per_unit).round() as i64 as i32;
                self.counts_offset = self.counts_offset.wrapping_add(counts);
            }
            Defect::Alarm { code } if is_present => self.raise(now_ns, code)?,
            _ => {}
        }
        self.wake_ns = self.now_ns + 1;
        Ok(())
    }
}
