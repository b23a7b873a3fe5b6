//! The whole drive: frames and time come in, the parts do their work, frames go out.

mod access;
mod commands;
mod frames;
mod measurement;
mod watch;

use takt_rt::cia402::State;
use takt_rt::frame::Frame;
use takt_rt::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

use super::alarms::{Alarms, StoppingAlarm};
use super::bit_rate::BitRateChange;
use super::device::{Device, Level};
use super::dictionary::Dictionary;
use super::homing::{Homing, Input};
use super::motion::{Actual, Motion, Order};
use super::network::Network;
use super::objects::at;
use super::parameters::{COUNTS_PER_SECOND_PER_RPM, COUNTS_PER_TURN, YzAimParameters};
use super::process_data::ProcessData;
use super::sdo::SdoServer;
use crate::sim::drive::{Drive, DriveFault, NmtState, Observation};
use crate::sim::mailbox::Mailbox;
use crate::sim::plant::Joint;
use crate::sim::random::Random;
use crate::sim::servo::Servo;
use watch::Watch;

/// The control loops and the plant run at 8 kHz.
const STEP_NS: Nanoseconds = 125_000;
/// Without anything to do the drive looks up this often.
const IDLE_NS: Nanoseconds = 1_000_000;
/// What the loops may add to the highest speed to catch up.
const SPEED_RESERVE: f64 = 1.1;
/// 6083h from here on: no ramp (manual IV.1).
const NO_RAMP: i64 = 60_000;
/// Slower than this the motor stands: r/min.
const STANDSTILL_RPM: f64 = 1.0;
const NEVER: Nanoseconds = Nanoseconds::MAX;

/// The modes of operation in 6060h.
mod mode {
    pub const PROFILE_POSITION: i64 = 1;
    pub const VELOCITY: i64 = 3;
    pub const HOMING: i64 = 6;
    pub const INTERPOLATION: i64 = 7;
}

/// A simulated YZ-AIM integrated servo with CANopen.
#[derive(Clone, Debug)]
pub struct YzAimJoint {
    parameters: YzAimParameters,
    dictionary: Dictionary,
    network: Network,
    sdo: SdoServer,
    process_data: ProcessData,
    device: Device,
    alarms: Alarms,
    motion: Motion,
    homing: Homing,
    servo: Servo,
    joint: Joint,
    watch: Watch,
    bit_rate_change: BitRateChange,
    random: Random,
    /// The node number in force.
    node: u8,
    /// The bit rate in force, and the one from the next power-up on.
    bit_rate: u32,
    next_bit_rate: u32,
    /// The special function in force: what was stored when the supply came on.
    special_function: i64,
    torque: f64,
    /// What is added to the encoder's counts.
    counts_offset: i32,
    /// Whether the first target after enabling is still to come, and to be ignored.
    ignores_target: bool,
    /// The speed of a move that the drive makes by itself after power-up: counts/s.
    power_up_speed: Option<f64>,
    has_started: bool,
    is_starting_cold: bool,
    was_energised: bool,
    /// 260Ah = 60006 has been written.
    is_zero_armed: bool,
    injected: Option<DriveFault>,
    save_ns: Nanoseconds,
    /// How far the loops have come.
    stepped_ns: Nanoseconds,
    now_ns: Nanoseconds,
    wake_ns: Nanoseconds,
}

impl YzAimJoint {
    /// A servo whose supply comes on at time 0.
    pub fn new(parameters: YzAimParameters) -> Self {
        let mut dictionary = Dictionary::new(parameters.node);
        dictionary.set_factory(at::SPECIAL_FUNCTION, parameters.special_function.into());
        dictionary.set_factory(at::ACCELERATION, parameters.acceleration.into());
        dictionary.set_factory(at::TEMPERATURE, 35);
        let random = Random::new(parameters.seed, parameters.node);
        let highest_speed = parameters.highest_speed();
        let velocity_limit = SPEED_RESERVE * highest_speed / parameters.encoder.counts_per_unit.abs();
        let joint = Joint::new(parameters.joint, parameters.initial_position).between(parameters.end_stops);
        let mut unit = Self {
            parameters,
            dictionary,
            network: Network::starting(NEVER, NmtState::PreOperational, false),
            sdo: SdoServer::new(random),
            process_data: ProcessData::at_rest(),
            device: Device::cold(),
            alarms: Alarms::default(),
            motion: Motion::new(highest_speed),
            homing: Homing::idle(),
            servo: Servo::new(parameters.joint.inertia, parameters.peak_torque, velocity_limit),
            joint,
            watch: Watch::default(),
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
            save_ns: NEVER,
            stepped_ns: 0,
            now_ns: 0,
            wake_ns: 0,
        };
        unit.power_up(0);
        unit
    }

    /// The bit rate at which it listens and speaks: bit/s. At another one than its bus has it is deaf and mute.
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
        self.dictionary.get(at::OPERATION_MODE)
    }

    fn is_in_mode(&self, mode: i64) -> bool {
        self.mode() == mode && self.device.level() == Level::Enabled
    }

    /// Whether targets are taken at every SYNC: 2619h was stored as 7 before the supply came on.
    fn interpolates(&self) -> bool {
        self.is_in_mode(mode::INTERPOLATION) && self.special_function == mode::INTERPOLATION
    }

    /// Whether the motor stage works. A cold drive holds its shaft; homing wants no controlword.
    fn is_energised(&self) -> bool {
        let is_commanded = matches!(self.device.level(), Level::Cold | Level::Enabled)
            || self.mode() == mode::HOMING && self.homing.is_begun();
        self.has_started
            && is_commanded
            && self.dictionary.get(at::OUTPUT_ENABLE) == 1
            && !self.alarms.is_stopped()
    }

    /// The alarm code in 260Eh.
    fn alarm_code(&self) -> u16 {
        self.alarms.code(self.network.is_master_lost())
    }

    /// Whether heartbeat and statusword show an alarm.
    fn shows_alarm(&self) -> bool {
        self.alarms.is_stopped()
            || self.network.is_master_lost()
            || self.alarms.has_lost_battery && self.parameters.quirks.shows_battery_alarm
    }

    /// Runs the loops on their grid up to `now_ns`.
    fn run_loops(&mut self, now_ns: Nanoseconds) {
        while self.stepped_ns + STEP_NS <= now_ns {
            self.step(STEP_NS);
        }
    }

    /// Runs the loops up to exactly `now_ns` and starts their grid anew there: the lock to SYNC.
    fn lock_loops(&mut self, now_ns: Nanoseconds) {
        self.run_loops(now_ns);
        if now_ns > self.stepped_ns {
            self.step(now_ns - self.stepped_ns);
        }
    }

    fn step(&mut self, duration_ns: Nanoseconds) {
        let duration_s = duration_ns as f64 / NANOSECONDS_PER_SECOND as f64;
        self.stepped_ns += duration_ns;
        let is_energised = self.is_energised();
        if is_energised && !self.was_energised {
            self.engage();
        }
        self.was_energised = is_energised;
        if is_energised {
            self.step_homing(duration_s);
            self.drive(duration_s);
        } else {
            self.homing.fail();
            self.torque = 0.0;
        }
        self.joint.step(duration_s, self.torque * self.direction(), false);
        if is_energised {
            self.watch(duration_s);
        } else {
            self.motion.engage(self.actual());
        }
    }

    /// Torque comes on, or another order begins: everything starts where the joint is.
    fn engage(&mut self) {
        if !self.was_energised {
            self.servo.reset();
            self.watch = Watch::default();
        }
        self.motion.engage(self.actual());
    }

    fn order(&self) -> Order {
        if self.network.is_master_lost() || self.device.is_halted() {
            return Order::Stop;
        }
        if let Some(speed) = self.homing.speed() {
            return Order::Velocity(speed * self.parameters.homing.speed_rpm * COUNTS_PER_SECOND_PER_RPM);
        }
        let profile_speed = self.dictionary.real(at::PROFILE_VELOCITY) * COUNTS_PER_SECOND_PER_RPM;
        match (self.device.level(), self.mode()) {
            (Level::Cold, _) => Order::Profile(self.power_up_speed.unwrap_or(profile_speed)),
            (Level::Enabled, mode::PROFILE_POSITION) => Order::Profile(profile_speed),
            (Level::Enabled, mode::VELOCITY) => {
                Order::Velocity(self.dictionary.real(at::TARGET_VELOCITY) * COUNTS_PER_SECOND_PER_RPM)
            }
            (Level::Enabled, _) if self.interpolates() => Order::Interpolate,
            _ => Order::Stop,
        }
    }

    /// The ramp of the drive: counts/s².
    fn acceleration(&self) -> f64 {
        match self.dictionary.get(at::ACCELERATION) {
            NO_RAMP.. => f64::INFINITY,
            // A ramp of none at all would never stop the motor.
            slope => slope.max(1) as f64 * COUNTS_PER_SECOND_PER_RPM,
        }
    }

    /// Order, loops, torque of one step.
    fn drive(&mut self, duration_s: f64) {
        let actual = self.actual();
        let demand = self.motion.step(self.order(), self.acceleration(), actual, duration_s);
        let unit = 1.0 / self.parameters.encoder.counts_per_unit.abs();
        let velocity = self.joint.velocity() * self.direction();
        self.servo.set_torque_limit(self.torque_limit());
        self.torque = match demand.position {
            Some(position) => {
                let error = (position - actual.position) * unit;
                self.servo.position(error, demand.velocity * unit, velocity, 0.0, duration_s)
            }
            None => self.servo.velocity(demand.velocity * unit, velocity, 0.0, duration_s),
        };
    }

    fn step_homing(&mut self, duration_s: f64) {
        if !self.homing.is_running() {
            return;
        }
        let is_closed = match self.homing.input() {
            Some(Input::Dir) => self.parameters.switches.dir(self.joint.position()),
            Some(Input::Pu) => self.parameters.switches.pu(self.joint.position()),
            None => false,
        };
        let (velocity, is_at_rest) = (self.actual().velocity, self.is_at_rest());
        if self.homing.step(is_closed, velocity, is_at_rest, duration_s) {
            self.set_counts(0);
        }
        let gives_up_ns = self.parameters.homing.gives_up_ns.unwrap_or(NEVER);
        if self.homing.elapsed_s() * NANOSECONDS_PER_SECOND as f64 > gives_up_ns as f64 {
            self.homing.fail();
        }
    }

    /// Lets the present position be this count.
    fn set_counts(&mut self, counts: i32) {
        let before = self.counts();
        self.counts_offset = counts.wrapping_sub(self.encoder_counts());
        self.motion.shift(f64::from(counts) - f64::from(before));
    }

    /// An alarm that stops the motor: the output goes off until the alarm is cleared.
    fn fail(&mut self, now_ns: Nanoseconds, alarm: StoppingAlarm) {
        self.alarms.raise(now_ns, alarm);
        self.dictionary.set(at::OUTPUT_ENABLE, 0);
    }

    /// The supply comes on.
    fn power_up(&mut self, now_ns: Nanoseconds) {
        self.alarms = self.alarms.after_power_up();
        self.node = self.dictionary.stored(at::NODE_ADDRESS) as u8;
        self.dictionary.address(self.node);
        self.bit_rate = self.next_bit_rate;
        self.special_function = self.dictionary.stored(at::SPECIAL_FUNCTION);
        if !self.parameters.has_battery || self.alarms.has_lost_battery {
            let counts = self.encoder_counts();
            self.counts_offset = counts.rem_euclid(COUNTS_PER_TURN as i32).wrapping_sub(counts);
        }
        let state =
            if self.parameters.starts_operational { NmtState::Operational } else { NmtState::PreOperational };
        self.start(now_ns, state, self.parameters.quirks.announces_power_up);
        self.is_starting_cold = true;
    }

    /// What power-up and "reset node" have in common: what was stored is back, and the drive is cold.
    fn start(&mut self, now_ns: Nanoseconds, state: NmtState, is_announced: bool) {
        self.dictionary.restore(0..=u16::MAX);
        if self.dictionary.get(at::GEAR_NUMERATOR) == 0 {
            self.dictionary.set(at::MODBUS_ENABLE, 1);
        }
        if self.alarms.is_stopped() {
            self.dictionary.set(at::OUTPUT_ENABLE, 0);
        }
        self.network = Network::starting(now_ns + self.parameters.power_up_ns, state, is_announced);
        self.sdo.reset();
        self.process_data = ProcessData::at_rest();
        self.device = Device::cold();
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
            self.process_data.due_ns(),
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
            self.take(now_ns, frame);
        }
        self.schedule(now_ns);
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        if let Some(fault) = self.injected.take() {
            self.break_down(now_ns, fault);
        }
        self.network.watch_master(now_ns);
        if now_ns >= self.save_ns {
            self.save_ns = NEVER;
            self.dictionary.store();
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
        let is_stopped = self.alarms.is_stopped() || self.network.is_master_lost();
        Observation {
            position: self.joint.position(),
            velocity: self.joint.velocity(),
            torque: self.torque * self.direction(),
            position_counts: self.counts(),
            state: if is_stopped { State::Fault } else { self.device.level().state() },
            statusword: self.statusword(),
            error_code: self.alarm_code(),
            operation_mode: self.mode() as i8,
            nmt: self.network.state(),
            is_braked: false,
        }
    }

    fn inject(&mut self, fault: DriveFault) {
        self.injected = Some(fault);
        self.wake_ns = self.now_ns + 1;
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_loops(now_ns);
        mailbox.clear();
        self.power_up(now_ns);
        self.schedule(now_ns);
    }

    fn set_load_torque(&mut self, torque: f64) {
        self.joint.set_load_torque(torque);
    }
}
