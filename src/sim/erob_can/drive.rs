//! The complete module: it receives frames and time, moves its joint, and replies.

use takt_rt::{DriveState, Frame, Nanoseconds};

use super::settings::{
    CAN_ADDRESS, MOTION_MODE, OPERATING_MODE, POSITION_ERROR, POSITIONED_THRESHOLD, POSITIONED_TIME,
    RELATIVE_POSITION, SET_POINT, Settings, TARGET_POSITION, TORQUE_VELOCITY_LIMIT, Writable,
};
use crate::erob_can::error_code::ErrorCode;
use crate::erob_can::frame::{ReceivedRequest, Reply, reply_id};
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
/// A joint slower than this does not move: counts/s.
const STANDING: f64 = 200.0;

/// By how much the torque twists the joint between its encoders: counts for one N·m. Not published; of the size of a strain wave gear,
/// about 40,000 N·m/rad.
const TWIST: f64 = 2.0;

/// What a simulated module is made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErobCanParameters {
    /// Node ID, 1 to 64.
    pub node: u8,
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
    /// From power-on until it can be enabled: 8 s by the manual.
    pub ready_ns: Nanoseconds,
    /// From a request to its reply: up to 1 ms by the manual's captures.
    pub reply_ns: Nanoseconds,
    /// Whether it has a battery that keeps the count of turns.
    pub has_battery: bool,
    /// Whether it controls a brake.
    pub has_brake: bool,
    /// How it ends a reply that tells of an error.
    pub error_form: ErrorForm,
    /// Whether 0x0204 may be written while the motor is enabled, as a program of the vendor expects.
    pub has_free_velocity_limit: bool,
}

/// How a module ends a reply with an error code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ErrorForm {
    /// With 3E, as the manual prints it.
    #[default]
    Printed,
    /// With 80, as programs of the vendor expect it.
    #[cfg_attr(not(feature = "internals"), expect(dead_code, reason = "the tests alone choose it"))]
    Observed,
}

/// Whether the motor has power.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Power {
    Off,
    On {
        motion: Motion,
        settled_ns: Nanoseconds,
    },
    /// Off, by an error.
    Fault(u16),
}

/// Defects that last.
#[derive(Clone, Copy, Debug, Default)]
struct Defects {
    is_blocked: bool,
    is_brake_stuck: bool,
    is_silent: bool,
}

/// A simulated module.
#[derive(Clone, Debug)]
pub struct ErobCanDrive {
    parameters: ErobCanParameters,
    /// The node ID that it listens to: a new one counts after the next power-on.
    node: u8,
    settings: Settings,
    power: Power,
    servo: Servo,
    joint: Joint,
    torque: f64,
    /// The demand of velocity control.
    velocity_demand: Generator,
    /// What is added to the encoder's counts since the count of turns was lost.
    counts_offset: i32,
    has_battery_alarm: bool,
    /// By the command 0x014F, until the motor is enabled or disabled.
    is_brake_released: bool,
    defects: Defects,
    reply: Option<(Nanoseconds, Frame)>,
    ready_ns: Nanoseconds,
    saving_until_ns: Option<Nanoseconds>,
    stepped_ns: Nanoseconds,
}

impl ErobCanDrive {
    /// A module whose supply is switched on at time 0.
    pub fn new(parameters: ErobCanParameters) -> Self {
        let ErobCanParameters { node, joint, peak_torque, highest_velocity, .. } = parameters;
        let mut drive = Self {
            node,
            settings: Settings::new(node, parameters.has_free_velocity_limit),
            power: Power::Off,
            servo: Servo::new(joint.inertia, peak_torque, highest_velocity),
            joint: Joint::new(joint, parameters.initial_position),
            torque: 0.0,
            velocity_demand: Generator::default(),
            counts_offset: 0,
            has_battery_alarm: false,
            is_brake_released: false,
            defects: Defects::default(),
            reply: None,
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

    fn counts(&self) -> i32 {
        self.parameters.encoder.counts(self.joint.position()).wrapping_add(self.counts_offset)
    }

    fn velocity_counts(&self) -> f64 {
        self.parameters.encoder.counts_per_second(self.joint.velocity())
    }

    /// Leaves the position within one turn.
    fn lose_turns(&mut self) {
        let counts = f64::from(self.counts());
        let within = counts.rem_euclid(self.parameters.counts_per_turn);
        self.counts_offset = self.counts_offset.wrapping_add((within - counts) as i32);
    }

    fn is_enabled(&self) -> bool {
        matches!(self.power, Power::On { .. })
    }

    fn is_braked(&self) -> bool {
        !(self.is_enabled() || self.is_brake_released) || self.defects.is_brake_stuck
    }

    fn is_moving(&self) -> bool {
        let is_led = matches!(self.power, Power::On { motion, .. } if motion.is_moving());
        is_led || self.velocity_counts().abs() > STANDING
    }

    fn is_position_controlled(&self) -> bool {
        !matches!(self.settings.value(OPERATING_MODE), Some(1 | 2))
    }

    fn fail(&mut self, code: u16) {
        self.power = Power::Fault(code);
        self.torque = 0.0;
    }

    /// Carries out a request.
    fn carry_out(&mut self, now_ns: Nanoseconds, request: &ReceivedRequest) -> Reply {
        let outcome = match (request.address.index, request.address.sub_index, request.value) {
            (0x0083, None, None) => self.start(),
            (0x0084, None, None) => self.stop(),
            (0x00E8, None, None) => {
                self.saving_until_ns = Some(now_ns.saturating_add(SAVE_NS));
                Ok(())
            }
            (0x014F, None, None) if self.parameters.has_brake => {
                self.is_brake_released = true;
                Ok(())
            }
            (0x014F, None, None) => Err(Some(ErrorCode::NO_BRAKE)),
            (0x0083 | 0x0084 | 0x00E8 | 0x014F, None, Some(_)) => Err(Some(ErrorCode::ARGUMENT_NOT_TAKEN)),
            (0x0100 | 0x0114, None, None) => Err(Some(ErrorCode::ARGUMENT_MISSING)),
            (0x0100, None, Some(value)) => self.set_enabled(now_ns, value),
            (0x0114, None, Some(1)) => {
                self.reset_encoder();
                Ok(())
            }
            (index, sub, None) => {
                return self.shown(index, sub).map_or(Reply::Failed(None), Reply::Value);
            }
            (index, None, Some(value)) => self.write(index, value),
            _ => Err(None),
        };
        match outcome {
            Ok(()) => Reply::Done,
            Err(code) => Reply::Failed(code),
        }
    }

    fn start(&mut self) -> Result<(), Option<ErrorCode>> {
        let mode = self.settings.value(MOTION_MODE);
        let (target, distance) = (self.settings.get(TARGET_POSITION), self.settings.get(RELATIVE_POSITION));
        let is_position_controlled = self.is_position_controlled();
        let Power::On { motion, .. } = &mut self.power else { return Err(Some(ErrorCode::DISABLED)) };
        if !is_position_controlled {
            return Err(Some(ErrorCode::NO_MOTION_MODE));
        }
        // A relative position that is not 0 makes the move a relative one.
        let target = if distance == 0.0 { target } else { motion.position() + distance };
        match mode {
            Some(0) => motion.run(),
            Some(1) => motion.move_to(target),
            Some(2) => motion.reciprocate_to(target),
            _ => return Err(Some(ErrorCode::NO_MOTION_MODE)),
        }
        Ok(())
    }

    fn stop(&mut self) -> Result<(), Option<ErrorCode>> {
        if let Power::On { motion, .. } = &mut self.power {
            motion.stop_with(self.settings.profile().deceleration);
        }
        Ok(())
    }

    fn set_enabled(&mut self, now_ns: Nanoseconds, value: i32) -> Result<(), Option<ErrorCode>> {
        self.is_brake_released = false;
        match (value, self.power) {
            (0, power) => {
                // A fault whose cause is gone ends with the command to disable.
                let is_lasting = matches!(power, Power::Fault(_)) && self.has_battery_alarm;
                self.power = if is_lasting { power } else { Power::Off };
                self.torque = 0.0;
                Ok(())
            }
            (1, Power::On { .. }) => Ok(()),
            (1, Power::Fault(_)) => Err(None),
            (1, Power::Off) if now_ns < self.ready_ns => Err(Some(ErrorCode::NO_COMMUTATION)),
            (1, Power::Off) => {
                self.servo.reset();
                self.velocity_demand.velocity = self.velocity_counts();
                self.power =
                    Power::On { motion: Motion::resting_at(self.counts().into()), settled_ns: now_ns };
                Ok(())
            }
            _ => Err(None),
        }
    }

    fn reset_encoder(&mut self) {
        self.has_battery_alarm = false;
        if matches!(self.power, Power::Fault(_)) {
            self.power = Power::Off;
        }
        self.lose_turns();
        if let Power::On { motion, .. } = &mut self.power {
            *motion = Motion::resting_at(
                self.parameters.encoder.counts(self.joint.position()).wrapping_add(self.counts_offset).into(),
            );
        }
    }

    fn write(&mut self, index: u16, value: i32) -> Result<(), Option<ErrorCode>> {
        match self.settings.writable(index) {
            None => return Err(None),
            Some(Writable::Disabled) if self.is_enabled() => return Err(Some(ErrorCode::ENABLED)),
            Some(Writable::AtRest) if self.is_moving() => return Err(Some(ErrorCode::MOVING)),
            Some(Writable::Always | Writable::AtRest | Writable::Disabled) => {}
        }
        self.settings.set(index, value);
        Ok(())
    }

    /// What a read brings.
    fn shown(&self, index: u16, sub_index: Option<u16>) -> Option<i32> {
        let milliamperes = 1000.0 * self.torque / self.parameters.torque_per_ampere;
        Some(match (index, sub_index) {
            (0x0001, Some(3)) => 1005,
            (0x0001, Some(4)) => 520_212_171,
            (0x0002, None) => self.counts(),
            (0x0005, Some(1)) => self.velocity_counts().round() as i32,
            (0x0008, None) => milliamperes.round() as i32,
            (0x0009 | 0x000A | 0x00FE, None) => (milliamperes / 3.0).round() as i32,
            (0x000D..=0x000F, None) => {
                if self.is_enabled() {
                    24_000
                } else {
                    0
                }
            }
            (0x001F, None) => match self.power {
                Power::Fault(code) => code.into(),
                Power::Off | Power::On { .. } => 0,
            },
            (0x0020, None) => self.running_state(),
            (0x0022 | 0x0023, None) => 0,
            (0x0024, None) => 48_000,
            (0x0026, None) => 35,
            (0x0033, None) => 6_300,
            (0x0034, None) => 12_600,
            (0x0035, None) => 1_000,
            (0x0044, None) => 1_000_000,
            (0x009C, None) => self.counts().wrapping_mul(100),
            (0x009F, None) => f64::from(self.counts()).rem_euclid(self.parameters.counts_per_turn) as i32,
            (0x010C, None) => self.target_state(),
            // The difference of the two encoders; in no table of the manual (a program of the vendor reads it).
            (0x0119, None) => (self.torque * TWIST).round() as i32,
            // A module without a torque sensor.
            (0x020D, None) => return None,
            (0x0232, Some(1)) => i32::from(self.node) + 1_000,
            (0x0232, Some(2)) => 0x0002_4000,
            (0x0232, Some(5)) => 0x0122_0212,
            (0x0232, Some(6)) => 1,
            (0x0232, Some(7)) => 1,
            (0x0232, Some(8)) => 0x005D_3B12,
            (index, None) => return self.settings.value(index),
            _ => return None,
        })
    }

    /// 0x0020.
    fn running_state(&self) -> i32 {
        match self.power {
            Power::On { motion, .. } if motion.is_stopping_reciprocation() => 3,
            _ if self.is_moving() => 1,
            _ => 0,
        }
    }

    /// 0x010C.
    fn target_state(&self) -> i32 {
        match self.power {
            Power::Off | Power::Fault(_) => 0,
            Power::On { motion, .. } if motion.is_moving() => 2,
            Power::On { motion, .. } if !motion.is_target_reached() => 1,
            Power::On { settled_ns, .. } => {
                let needed_ns = self.settings.get(POSITIONED_TIME).max(0.0) * 1e6;
                if self.stepped_ns.saturating_sub(settled_ns) as f64 >= needed_ns { 4 } else { 3 }
            }
        }
    }

    /// One step of the loops.
    fn step(&mut self) {
        self.stepped_ns += STEP_NS;
        let (counts, velocity) = (f64::from(self.counts()), self.joint.velocity());
        let per_unit = self.parameters.encoder.counts_per_unit;
        self.torque = match (self.power, self.settings.value(OPERATING_MODE)) {
            (Power::Off | Power::Fault(_), _) => 0.0,
            (Power::On { .. }, Some(1)) => self.step_torque(velocity, per_unit),
            (Power::On { .. }, Some(2)) => self.step_velocity(velocity, per_unit),
            (Power::On { motion, settled_ns }, _) => {
                self.step_position(motion, settled_ns, counts, velocity, per_unit)
            }
        };
        if self.defects.is_blocked {
            self.joint.halt();
        }
        let is_braked = self.is_braked() || self.defects.is_blocked;
        self.joint.step(STEP_S, self.torque, is_braked);
    }

    fn step_torque(&mut self, velocity: f64, per_unit: f64) -> f64 {
        let direction = 1f64.copysign(per_unit);
        let demand = direction * 1e-3 * self.settings.get(SET_POINT) * self.parameters.torque_per_ampere;
        let limit = self.settings.get(TORQUE_VELOCITY_LIMIT).abs() / per_unit.abs();
        self.servo.torque_within(demand, velocity, limit)
    }

    fn step_velocity(&mut self, velocity: f64, per_unit: f64) -> f64 {
        let profile = self.settings.profile();
        let (faster, slower) = (profile.acceleration, profile.deceleration);
        self.velocity_demand.ramp_between(self.settings.get(SET_POINT), faster, slower, STEP_S);
        self.servo.velocity(self.velocity_demand.velocity / per_unit, velocity, 0.0, STEP_S)
    }

    fn step_position(
        &mut self,
        motion: Motion,
        settled_ns: Nanoseconds,
        counts: f64,
        velocity: f64,
        per_unit: f64,
    ) -> f64 {
        let mut motion = motion;
        motion.step(self.stepped_ns, &self.settings.profile(), STEP_S);
        let error = motion.position() - counts;
        if error.abs() > self.settings.get(POSITION_ERROR) {
            self.fail(0x8611);
            return 0.0;
        }
        let is_within = error.abs() < self.settings.get(POSITIONED_THRESHOLD) && !motion.is_moving();
        let settled_ns = if is_within { settled_ns } else { self.stepped_ns };
        self.power = Power::On { motion, settled_ns };
        self.servo.position(error / per_unit, motion.velocity() / per_unit, velocity, 0.0, STEP_S)
    }

    /// The reply as this module ends it.
    fn reply_frame(&self, reply: Reply) -> Frame {
        match (reply, self.parameters.error_form) {
            (Reply::Failed(Some(ErrorCode(code))), ErrorForm::Observed) => {
                let [high, low] = code.to_be_bytes();
                Frame::of(reply_id(self.node), [high, low, 0x80])
            }
            _ => reply.frame(self.node),
        }
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

impl Drive for ErobCanDrive {
    fn node(&self) -> u8 {
        self.node
    }

    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, _: &mut Mailbox) {
        let request = ReceivedRequest::decode(frame).filter(|request| request.node == self.node);
        // What a module does with a second request before its reply is not published. Here it is lost: a master that does not wait
        // notices.
        let (Some(request), None) = (request, self.reply) else { return };
        self.run_until(now_ns);
        let reply = self.carry_out(now_ns, &request);
        if !self.defects.is_silent {
            self.reply =
                Some((now_ns.saturating_add(self.parameters.reply_ns.max(1)), self.reply_frame(reply)));
        }
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_until(now_ns);
        if let Some((due_ns, frame)) = self.reply
            && due_ns <= now_ns
        {
            mailbox.push(frame);
            self.reply = None;
        }
    }

    fn wake_ns(&self) -> Nanoseconds {
        let step_ns = self.stepped_ns + STEP_NS;
        self.reply.map_or(step_ns, |(due_ns, _)| due_ns.min(step_ns))
    }

    fn observe(&mut self, now_ns: Nanoseconds) -> Observation {
        self.run_until(now_ns);
        let (state, error_code) = match self.power {
            Power::Off => (DriveState::SwitchOnDisabled, 0),
            Power::On { .. } => (DriveState::OperationEnabled, 0),
            Power::Fault(code) => (DriveState::Fault, code),
        };
        Observation {
            position: self.joint.position(),
            velocity: self.joint.velocity(),
            torque: self.torque,
            position_counts: self.counts(),
            state,
            statusword: 0,
            error_code,
            operation_mode: self.settings.value(OPERATING_MODE).unwrap_or(0) as i8,
            nmt: NodeState::Operational,
            is_braked: self.is_braked(),
        }
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        self.has_battery_alarm |= fault == DriveFault::MultiTurnBattery;
        self.fail(match fault {
            DriveFault::OverCurrent => 0x2310,
            DriveFault::OverVoltage => 0x3210,
            DriveFault::UnderVoltage => 0x3220,
            DriveFault::OverTemperature => 0x4310,
            DriveFault::Encoder => 0x7305,
            DriveFault::MultiTurnBattery => 0x730F,
            DriveFault::BlockedRotor => 0x7121,
            DriveFault::Stall => 0x8400,
        });
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_until(now_ns);
        mailbox.clear();
        self.settings.restore();
        self.node =
            self.settings.value(CAN_ADDRESS).and_then(|node| u8::try_from(node).ok()).unwrap_or(self.node);
        self.power = Power::Off;
        self.is_brake_released = false;
        (self.torque, self.reply, self.saving_until_ns) = (0.0, None, None);
        self.ready_ns = now_ns.saturating_add(self.parameters.ready_ns);
        if !self.parameters.has_battery {
            self.lose_turns();
        }
    }

    fn set_gravity(&mut self, gravity: Gravity) {
        self.joint.set_gravity(gravity);
    }

    fn set_load_torque(&mut self, torque: f64) {
        self.joint.set_load_torque(torque);
    }

    fn inject_defect(&mut self, _: Nanoseconds, defect: Defect, is_present: bool) -> Result<(), Unsupported> {
        let defects = &mut self.defects;
        match defect {
            Defect::BlockedJoint => defects.is_blocked = is_present,
            Defect::StuckBrake => defects.is_brake_stuck = is_present,
            Defect::SilentSdoServer => defects.is_silent = is_present,
            Defect::Alarm { code } => self.fail(code),
            Defect::TorqueOff => self.power = Power::Off,
            Defect::EncoderJump { distance } => {
                let counts = (distance * self.parameters.encoder.counts_per_unit).round() as i32;
                self.counts_offset = self.counts_offset.wrapping_add(counts);
            }
            Defect::OtherObjectMapped
            | Defect::ShortFeedback
            | Defect::Statusword { .. }
            | Defect::OperationModeDisplay { .. }
            | Defect::Emergency { .. } => {
                let reason = "an eRob with its own protocol has no process data and no emergency messages";
                return Err(Unsupported { defect, reason });
            }
        }
        Ok(())
    }
}
