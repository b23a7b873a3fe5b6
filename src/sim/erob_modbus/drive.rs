//! The complete module: it receives requests and time, moves its joint, and replies.

use takt_rt::{DriveState, Frame, Nanoseconds};

use super::registers::{
    BIT_RATE, COMMUNICATION_TIMEOUT, FIFTY_MICROSECONDS, MOTION_MODE, OPERATION_MODE, POSITION_ERROR,
    REACHED_TIME, REACHED_WINDOW, RELATIVE_POSITION, SLAVE_ADDRESS, Settings, TARGET_CURRENT,
    TARGET_POSITION, TARGET_VELOCITY, TORQUE_VELOCITY_LIMIT,
};
use crate::modbus::exception::ExceptionCode;
use crate::modbus::frame::{ReceivedRequest, RegisterRange, Request, Values, reply_frame};
use crate::sim::defect::{Defect, Unsupported};
use crate::sim::drive::{Drive, DriveFault, NodeState, Observation};
use crate::sim::mailbox::Mailbox;
use crate::sim::motion::Generator;
use crate::sim::plant::{Encoder, Gravity, Joint, JointParameters};
use crate::sim::profile_motions::Motion;
use crate::sim::servo::Servo;

/// The period of the drive's loops.
const STEP_NS: Nanoseconds = 250_000;
const STEP_S: f64 = STEP_NS as f64 * 1e-9;
/// The time that saving takes.
const SAVE_NS: Nanoseconds = 3_000_000_000;
/// From enabling until a motion can start: until then a start is taken and does nothing.
const ENABLING_NS: Nanoseconds = 500_000_000;
/// An emergency stop takes less than 50 ms.
const EMERGENCY_STOP_S: f64 = 0.04;
/// A joint slower than this does not move: counts/s.
const STANDING: f64 = 200.0;
/// By how much the torque twists the joint between its encoders: counts for one N·m. Not published; of the size of a strain wave gear,
/// about 40,000 N·m/rad.
const TWIST: f64 = 2.0;

/// What a simulated module is made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErobModbusParameters {
    /// The address of the slave, 1 to 247.
    pub address: u8,
    /// The code of its bit rate: register 0x0001.
    pub bit_rate_code: u16,
    /// The mechanics.
    pub joint: JointParameters,
    /// The encoder at the output.
    pub encoder: Encoder,
    /// Counts of a turn of the output.
    pub counts_per_turn: f64,
    /// Where the joint is at first: rad.
    pub initial_position: f64,
    /// Peak torque: N·m.
    pub peak_torque: f64,
    /// Torque for one ampere: N·m/A.
    pub torque_per_ampere: f64,
    /// The highest velocity of the motor: rad/s.
    pub highest_velocity: f64,
    /// From power-on until it can be enabled: 8 s by the vendor's other manuals.
    pub ready_ns: Nanoseconds,
    /// From a request to its reply. Not published.
    pub reply_ns: Nanoseconds,
    /// Whether it has a battery that keeps the count of turns.
    pub has_battery: bool,
    /// Whether it has a torque sensor.
    pub has_torque_sensor: bool,
}

/// Whether the motor has power.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Power {
    Off,
    On {
        motion: Motion,
        since_ns: Nanoseconds,
        /// Since when the joint is within the window of its target.
        settled_ns: Nanoseconds,
    },
    /// Off, by a fault.
    Fault(u16),
}

/// What is wrong with a module on purpose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ModbusDriveFault {
    /// It detects a fault with this code, and cuts the power of its motor.
    Code(u16),
    /// Its battery is empty: fault 0x730F, which does not clear.
    Battery,
    /// It does not reply, from now on or not any more.
    Silent(bool),
    /// Its joint is blocked, from now on or not any more.
    BlockedJoint(bool),
    /// Its brake does not open, from now on or not any more.
    StuckBrake(bool),
    /// Its encoder jumps: counts.
    EncoderJump(i32),
    /// It loses the power of its motor without a fault, as by a safety input.
    TorqueOff,
}

/// Faults that last.
#[derive(Clone, Copy, Debug, Default)]
struct Lasting {
    is_silent: bool,
    is_blocked: bool,
    is_brake_stuck: bool,
}

/// A simulated module.
#[derive(Clone, Debug)]
pub struct ErobModbusDrive {
    parameters: ErobModbusParameters,
    /// What it listens to: new values count after the next power-on.
    address: u8,
    bit_rate_code: u16,
    settings: Settings,
    power: Power,
    servo: Servo,
    joint: Joint,
    torque: f64,
    /// The demand of velocity control.
    velocity_demand: Generator,
    /// The demand of velocity control goes to 0 at this rate: counts/s².
    emergency_rate: Option<f64>,
    /// What is added to the encoder's counts since the count of turns was lost.
    counts_offset: i32,
    has_battery_alarm: bool,
    lasting: Lasting,
    reply: Option<(Nanoseconds, Vec<u8>)>,
    /// When the master was heard last; `None` before the first request.
    heard_ns: Option<Nanoseconds>,
    ready_ns: Nanoseconds,
    saving_until_ns: Option<Nanoseconds>,
    stepped_ns: Nanoseconds,
}

impl ErobModbusDrive {
    /// A module whose supply is switched on at time 0.
    pub fn new(parameters: ErobModbusParameters) -> Self {
        let ErobModbusParameters { address, bit_rate_code, joint, peak_torque, highest_velocity, .. } =
            parameters;
        let mut drive = Self {
            address,
            bit_rate_code,
            settings: Settings::new(address, bit_rate_code),
            power: Power::Off,
            servo: Servo::new(joint.inertia, peak_torque, highest_velocity),
            joint: Joint::new(joint, parameters.initial_position),
            torque: 0.0,
            velocity_demand: Generator::default(),
            emergency_rate: None,
            counts_offset: 0,
            has_battery_alarm: false,
            lasting: Lasting::default(),
            reply: None,
            heard_ns: None,
            ready_ns: parameters.ready_ns,
            saving_until_ns: None,
            stepped_ns: 0,
            parameters,
        };
        if !parameters.has_battery {
            drive.lose_turns();
        }
        drive
    }

    /// The bit rate that it listens to: bit/s.
    pub const fn bit_rate(&self) -> u32 {
        match self.bit_rate_code {
            1 => 9_600,
            2 => 19_200,
            3 => 38_400,
            _ => 115_200,
        }
    }

    /// The position of the joint: counts.
    pub fn counts(&self) -> i32 {
        self.parameters.encoder.counts(self.joint.position()).wrapping_add(self.counts_offset)
    }

    /// The velocity of the joint: counts/s.
    pub fn velocity(&self) -> f64 {
        self.parameters.encoder.counts_per_second(self.joint.velocity())
    }

    /// Whether the motor has power.
    pub const fn is_enabled(&self) -> bool {
        matches!(self.power, Power::On { .. })
    }

    /// Whether the brake is engaged.
    pub const fn is_braked(&self) -> bool {
        !self.is_enabled() || self.lasting.is_brake_stuck
    }

    /// The fault that it shows; 0 for none.
    pub const fn fault(&self) -> u16 {
        if let Power::Fault(code) = self.power { code } else { 0 }
    }

    /// Makes something wrong.
    pub fn inject(&mut self, fault: ModbusDriveFault) {
        match fault {
            ModbusDriveFault::Code(code) => self.fail(code),
            ModbusDriveFault::Battery => {
                self.has_battery_alarm = true;
                self.fail(0x730F);
            }
            ModbusDriveFault::Silent(is_present) => self.lasting.is_silent = is_present,
            ModbusDriveFault::BlockedJoint(is_present) => self.lasting.is_blocked = is_present,
            ModbusDriveFault::StuckBrake(is_present) => self.lasting.is_brake_stuck = is_present,
            ModbusDriveFault::EncoderJump(counts) => {
                self.counts_offset = self.counts_offset.wrapping_add(counts)
            }
            ModbusDriveFault::TorqueOff => self.power = Power::Off,
        }
    }

    /// Cuts the supply and restores it at once: the drive starts with its saved parameters.
    pub fn power_cycle(&mut self, now_ns: Nanoseconds) {
        self.run_until(now_ns);
        self.settings.restore();
        self.address = u8::try_from(self.settings.get(SLAVE_ADDRESS)).unwrap_or(self.address);
        self.bit_rate_code = self.settings.get(BIT_RATE) as u16;
        self.power = Power::Off;
        (self.torque, self.reply, self.saving_until_ns, self.heard_ns) = (0.0, None, None, None);
        self.ready_ns = now_ns.saturating_add(self.parameters.ready_ns);
        if !self.parameters.has_battery {
            self.lose_turns();
        }
    }

    /// Leaves the position within one turn.
    fn lose_turns(&mut self) {
        let counts = f64::from(self.counts());
        let within = counts.rem_euclid(self.parameters.counts_per_turn);
        self.counts_offset = self.counts_offset.wrapping_add((within - counts) as i32);
    }

    fn fail(&mut self, code: u16) {
        self.power = Power::Fault(code);
        self.torque = 0.0;
    }

    /// Takes a request whose last byte has come. Those of other slaves are ignored.
    pub fn receive(&mut self, now_ns: Nanoseconds, frame: &[u8]) {
        self.run_until(now_ns);
        let Some(ReceivedRequest { address, request }) = ReceivedRequest::decode(frame) else { return };
        let is_for_all = address == 0;
        if !is_for_all && address != self.address {
            return;
        }
        self.heard_ns = Some(now_ns);
        let outcome = match request {
            Ok(Request::Read(range)) if !is_for_all => self.read(range),
            Ok(Request::Read(_)) => return,
            Ok(Request::WriteOne { register, value }) => self.write(now_ns, register, &[value]),
            Ok(Request::WriteSeveral(write)) => self.write(now_ns, write.start(), write.values()),
            Err(code) => Err(code),
        };
        let outcome = outcome.as_ref().map(Values::as_slice).map_err(|code| *code);
        if let Some(reply) = reply_frame(frame, outcome).filter(|_| !self.lasting.is_silent) {
            self.reply = Some((now_ns.saturating_add(self.parameters.reply_ns), reply));
        }
    }

    /// Advances to a time. Returns a reply whose first byte is due by then, and when that is.
    pub fn reply_by(&mut self, now_ns: Nanoseconds) -> Option<(Nanoseconds, Vec<u8>)> {
        self.run_until(now_ns);
        self.reply.take_if(|(due_ns, _)| *due_ns <= now_ns)
    }

    fn read(&self, range: RegisterRange) -> Result<Values, ExceptionCode> {
        let addresses = range.start()..=range.start() + (range.count() - 1);
        addresses.map(|address| self.shown(address).ok_or(ExceptionCode::ILLEGAL_ADDRESS)).collect()
    }

    fn write(&mut self, now_ns: Nanoseconds, start: u16, words: &[u16]) -> Result<Values, ExceptionCode> {
        match (start, words) {
            (0x00F0..=0x00F4 | 0x00F6 | 0x00F7 | 0x00F9, [value]) => self.command(now_ns, start, *value)?,
            _ => {
                let is_enabled = self.is_enabled();
                self.settings.write(start, words, is_enabled)?;
            }
        }
        Ok(Values::new())
    }

    fn command(&mut self, now_ns: Nanoseconds, register: u16, value: u16) -> Result<(), ExceptionCode> {
        match (register, value) {
            (0x00F0, 0) => {
                if self.is_enabled() {
                    self.power = Power::Off;
                    self.torque = 0.0;
                }
            }
            (0x00F0, 1) => self.enable(now_ns)?,
            (0x00F0, _) | (0x00F6, 0) => return Err(ExceptionCode::ILLEGAL_VALUE),
            (0x00F1, _) => self.start(now_ns)?,
            (0x00F2, _) => self.stop(self.settings.profile().deceleration),
            (0x00F3, _) => {
                let rate = (self.velocity().abs() / EMERGENCY_STOP_S).max(1e6);
                self.stop(rate);
                self.emergency_rate = Some(rate);
            }
            (0x00F4, _) => {
                if let Power::On { motion, .. } = &mut self.power {
                    motion.end_reciprocation();
                }
            }
            (0x00F6, _) => {
                if matches!(self.power, Power::Fault(_)) && !self.has_battery_alarm {
                    self.power = Power::Off;
                }
            }
            (0x00F7, _) => self.saving_until_ns = Some(now_ns.saturating_add(SAVE_NS)),
            _ => self.reset_encoder(),
        }
        Ok(())
    }

    fn enable(&mut self, now_ns: Nanoseconds) -> Result<(), ExceptionCode> {
        match self.power {
            Power::On { .. } => Ok(()),
            Power::Fault(_) => Err(ExceptionCode::DEVICE_FAILURE),
            Power::Off if now_ns < self.ready_ns => Err(ExceptionCode::BUSY),
            Power::Off => {
                self.servo.reset();
                self.velocity_demand.velocity = self.velocity();
                self.emergency_rate = None;
                let motion = Motion::resting_at(self.counts().into());
                self.power = Power::On { motion, since_ns: now_ns, settled_ns: now_ns };
                Ok(())
            }
        }
    }

    fn start(&mut self, now_ns: Nanoseconds) -> Result<(), ExceptionCode> {
        let mode = self.settings.get(MOTION_MODE);
        let is_position_controlled = self.settings.get(OPERATION_MODE) == 3;
        let (target, distance) = (self.settings.get(TARGET_POSITION), self.settings.get(RELATIVE_POSITION));
        let Power::On { motion, since_ns, .. } = &mut self.power else {
            return Err(ExceptionCode::DEVICE_FAILURE);
        };
        if !is_position_controlled {
            return Err(ExceptionCode::DEVICE_FAILURE);
        }
        if now_ns.saturating_sub(*since_ns) < ENABLING_NS {
            return Ok(());
        }
        // A relative target that is not 0 makes the move a relative one.
        let target = if distance == 0 { target as f64 } else { motion.position() + distance as f64 };
        match mode {
            0 => motion.run(),
            1 => motion.move_to(target),
            _ => motion.reciprocate_to(target),
        }
        Ok(())
    }

    fn stop(&mut self, deceleration: f64) {
        let Power::On { motion, .. } = &mut self.power else { return };
        match self.settings.get(OPERATION_MODE) {
            // It stops, and also disables.
            1 => {
                self.settings.set(TARGET_CURRENT, 0);
                self.power = Power::Off;
                self.torque = 0.0;
            }
            2 => self.settings.set(TARGET_VELOCITY, 0),
            _ => motion.stop_with(deceleration),
        }
    }

    fn reset_encoder(&mut self) {
        self.has_battery_alarm = false;
        if matches!(self.power, Power::Fault(0x730F)) {
            self.power = Power::Off;
        }
        self.lose_turns();
        let here = self.counts();
        if let Power::On { motion, .. } = &mut self.power {
            *motion = Motion::resting_at(here.into());
        }
    }

    /// What a read of an address brings.
    fn shown(&self, address: u16) -> Option<u16> {
        let milliamperes = (1000.0 * self.torque / self.parameters.torque_per_ampere).round() as i32;
        let (motion, demand) = match self.power {
            Power::On { motion, .. } => (Some(motion), motion.position().round() as i32),
            Power::Off | Power::Fault(_) => (None, self.counts()),
        };
        let demanded_velocity = match self.settings.get(OPERATION_MODE) {
            2 => self.velocity_demand.velocity,
            _ => motion.map_or(0.0, |motion| motion.velocity()),
        }
        .round() as i32;
        let velocity = self.velocity().round() as i32;
        // The first register of two, and the number in them.
        let (start, number) = match address {
            0x0060 => return Some(self.fault()),
            0x0061 => return Some(self.motion_status()),
            0x0063 => return Some(self.reached_status()),
            0x0064 | 0x0065 => (0x0064, demand),
            0x0066 | 0x0067 => (0x0066, self.counts()),
            0x0068 | 0x0069 => (0x0068, demand.wrapping_sub(self.counts())),
            0x006C | 0x006D => (0x006C, demanded_velocity),
            0x006E | 0x006F => (0x006E, velocity),
            0x0070 | 0x0071 => (0x0070, demanded_velocity.wrapping_sub(velocity)),
            0x0072..=0x0075 => (address & !1, milliamperes),
            0x0076 | 0x0077 => (0x0076, 48_000),
            0x0078 => return Some(35),
            0x007B | 0x007C if self.parameters.has_torque_sensor => {
                (0x007B, (1000.0 * self.torque).round() as i32)
            }
            0x007D | 0x007E => (0x007D, (self.torque * TWIST).round() as i32),
            _ => return self.settings.word(address),
        };
        let number = number.cast_unsigned();
        Some(if address == start { (number >> 16) as u16 } else { number as u16 })
    }

    fn motion_status(&self) -> u16 {
        let is_led = match self.power {
            Power::On { motion, .. } if motion.has_ended_reciprocation() => return 3,
            Power::On { motion, .. } => motion.is_moving(),
            Power::Off | Power::Fault(_) => false,
        };
        u16::from(is_led || self.velocity().abs() > STANDING)
    }

    fn reached_status(&self) -> u16 {
        match self.power {
            Power::Off | Power::Fault(_) => 0,
            Power::On { motion, .. } if motion.is_moving() => 2,
            Power::On { motion, .. } if !motion.is_target_reached() => 1,
            Power::On { settled_ns, .. } => {
                let needed = u64::try_from(self.settings.get(REACHED_TIME)).unwrap_or(0);
                let is_reached = self.stepped_ns.saturating_sub(settled_ns) >= needed * FIFTY_MICROSECONDS;
                if is_reached { 4 } else { 3 }
            }
        }
    }

    /// One step of the loops.
    fn step(&mut self) {
        self.stepped_ns += STEP_NS;
        self.supervise_the_master();
        let (counts, velocity) = (f64::from(self.counts()), self.joint.velocity());
        let per_unit = self.parameters.encoder.counts_per_unit;
        self.torque = match (self.power, self.settings.get(OPERATION_MODE)) {
            (Power::Off | Power::Fault(_), _) => 0.0,
            (Power::On { .. }, 1) => self.step_torque(velocity, per_unit),
            (Power::On { .. }, 2) => self.step_velocity(velocity, per_unit),
            (Power::On { motion, since_ns, settled_ns }, _) => {
                self.step_position(motion, since_ns, settled_ns, counts, velocity, per_unit)
            }
        };
        if self.lasting.is_blocked {
            self.joint.halt();
        }
        let is_braked = self.is_braked() || self.lasting.is_blocked;
        self.joint.step(STEP_S, self.torque, is_braked);
    }

    /// What the motor does when the master is silent is in no manual. Here its power is cut, and the brake engages.
    fn supervise_the_master(&mut self) {
        let most_ms = u64::try_from(self.settings.get(COMMUNICATION_TIMEOUT)).unwrap_or(0);
        let Some(heard_ns) = self.heard_ns.filter(|_| most_ms > 0) else { return };
        let is_silent = self.stepped_ns.saturating_sub(heard_ns) > most_ms * 1_000_000;
        if is_silent && !matches!(self.power, Power::Fault(_)) {
            // It is armed again by the next request.
            self.heard_ns = None;
            self.fail(0x0FA2);
        }
    }

    fn step_torque(&mut self, velocity: f64, per_unit: f64) -> f64 {
        let direction = 1f64.copysign(per_unit);
        let current = 1e-3 * self.settings.get(TARGET_CURRENT) as f64;
        let demand = direction * current * self.parameters.torque_per_ampere;
        match self.settings.get(TORQUE_VELOCITY_LIMIT) {
            // As in the manual's example: the joint moves with 0.
            0 => self.servo.torque(demand, velocity),
            limit => {
                let limit = limit.unsigned_abs() as f64 / per_unit.abs();
                self.servo.torque_within(demand, velocity, limit)
            }
        }
    }

    fn step_velocity(&mut self, velocity: f64, per_unit: f64) -> f64 {
        let profile = self.settings.profile();
        let wanted = self.settings.get(TARGET_VELOCITY) as f64;
        if wanted != 0.0 {
            self.emergency_rate = None;
        }
        let slower = self.emergency_rate.unwrap_or(profile.deceleration);
        self.velocity_demand.ramp_between(wanted, profile.acceleration, slower, STEP_S);
        self.servo.velocity(self.velocity_demand.velocity / per_unit, velocity, 0.0, STEP_S)
    }

    fn step_position(
        &mut self,
        mut motion: Motion,
        since_ns: Nanoseconds,
        settled_ns: Nanoseconds,
        counts: f64,
        velocity: f64,
        per_unit: f64,
    ) -> f64 {
        motion.step(self.stepped_ns, &self.settings.profile(), STEP_S);
        let error = motion.position() - counts;
        if error.abs() > self.settings.get(POSITION_ERROR) as f64 {
            self.fail(0x8611);
            return 0.0;
        }
        let window = self.settings.get(REACHED_WINDOW) as f64;
        let is_within = error.abs() < window && !motion.is_moving();
        let settled_ns = if is_within { settled_ns } else { self.stepped_ns };
        self.power = Power::On { motion, since_ns, settled_ns };
        self.servo.position(error / per_unit, motion.velocity() / per_unit, velocity, 0.0, STEP_S)
    }

    fn run_until(&mut self, now_ns: Nanoseconds) {
        while self.stepped_ns + STEP_NS <= now_ns {
            self.step();
        }
        if self.saving_until_ns.is_some_and(|until_ns| now_ns >= until_ns) {
            self.saving_until_ns = None;
            self.settings.save();
        }
    }
}

/// Its place on a simulated bus, of which it hears nothing: its joint is there, loads and faults reach it.
impl Drive for ErobModbusDrive {
    fn node(&self) -> u8 {
        self.address
    }

    fn receive(&mut self, _: Nanoseconds, _: &Frame, _: &mut Mailbox) {}

    fn advance(&mut self, now_ns: Nanoseconds, _: &mut Mailbox) {
        self.run_until(now_ns);
    }

    fn wake_ns(&self) -> Nanoseconds {
        self.stepped_ns + STEP_NS
    }

    fn observe(&mut self, now_ns: Nanoseconds) -> Observation {
        self.run_until(now_ns);
        let state = match self.power {
            Power::Off => DriveState::SwitchOnDisabled,
            Power::On { .. } => DriveState::OperationEnabled,
            Power::Fault(_) => DriveState::Fault,
        };
        Observation {
            position: self.joint.position(),
            velocity: self.joint.velocity(),
            torque: self.torque,
            position_counts: self.counts(),
            state,
            statusword: 0,
            error_code: self.fault(),
            operation_mode: self.settings.get(OPERATION_MODE) as i8,
            nmt: NodeState::Operational,
            is_braked: self.is_braked(),
        }
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        let code = match fault {
            DriveFault::OverCurrent => 0x2310,
            DriveFault::OverVoltage => 0x3210,
            DriveFault::UnderVoltage => 0x3220,
            DriveFault::OverTemperature => 0x4310,
            DriveFault::Encoder => 0x7305,
            DriveFault::MultiTurnBattery => return self.inject(ModbusDriveFault::Battery),
            DriveFault::BlockedRotor => 0x7121,
            DriveFault::Stall => 0x8400,
        };
        self.inject(ModbusDriveFault::Code(code));
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, _: &mut Mailbox) {
        Self::power_cycle(self, now_ns);
    }

    fn set_gravity(&mut self, gravity: Gravity) {
        self.joint.set_gravity(gravity);
    }

    fn set_load_torque(&mut self, torque: f64) {
        self.joint.set_load_torque(torque);
    }

    fn inject_defect(&mut self, _: Nanoseconds, defect: Defect, is_present: bool) -> Result<(), Unsupported> {
        self.inject(match defect {
            Defect::BlockedJoint => ModbusDriveFault::BlockedJoint(is_present),
            Defect::StuckBrake => ModbusDriveFault::StuckBrake(is_present),
            Defect::SilentSdoServer => ModbusDriveFault::Silent(is_present),
            Defect::Alarm { code } => ModbusDriveFault::Code(code),
            Defect::TorqueOff => ModbusDriveFault::TorqueOff,
            Defect::EncoderJump { distance } => ModbusDriveFault::EncoderJump(
                (distance * self.parameters.encoder.counts_per_unit).round() as i32,
            ),
            defect => {
                let reason = "an eRob with Modbus-RTU has no process data and no emergency messages";
                return Err(Unsupported { defect, reason });
            }
        });
        Ok(())
    }
}
