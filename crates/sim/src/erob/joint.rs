//! The complete eRob: it receives frames and time, advances its parts, and sends frames.

mod device;
mod loops;

use takt_rt::{DriveState, Frame, Nanoseconds, OperationMode, statusword};
use takt_wire::quirks::PowerUpState;

use super::ErobParameters;
use super::device::{Change, ErobDevice};
use super::motion::ErobMotion;
use super::objects::{OBJECTS, at, is_measured};
use crate::canopen_node::{CanopenDevice, CanopenNode, NodeDelays, NodeServices};
use crate::defect::{Defect, Unsupported};
use crate::drive::{Drive, DriveFault, Observation};
use crate::errors::DeviceError;
use crate::feedback_defects::JointDefects;
use crate::loops::ControlLoops;
use crate::mailbox::Mailbox;
use crate::motion::Actual;
use crate::object_dictionary::SimulatedDictionary;
use crate::pdo_engine::PdoFeatures;
use crate::plant::{Gravity, Joint};
use crate::random::Random;
use crate::sdo_server::{SdoFeatures, SdoServer};
use crate::servo::Servo;

/// Rated torque for one ampere, from the ratings of the 80H120I (31 N·m at 6.3 A).
const TORQUE_PER_AMPERE: f64 = 31.0 / 6.3;
/// From a new value of 6060 until the drive is in that mode and 6061 shows it: a step of its loops, and less than an SDO exchange. In
/// the manual's sequences the next SDO reads the new mode.
const MODE_CHANGE_NS: Nanoseconds = 250_000;
/// From an SDO request to its reply, as measured on real units.
const SDO_LATENCY_NS: std::ops::Range<Nanoseconds> = 300_000..1_000_000;
/// It ignores the event timers of its RPDOs.
const PDO_FEATURES: PdoFeatures = PdoFeatures { is_measured, watches_rpdos: false };
/// Time from "save" until it takes effect: the manual requires a wait of 3 s before the supply is cut.
const SAVE_NS: Nanoseconds = 3_000_000_000;

/// A mode that the drive is about to be in.
#[derive(Clone, Copy, Debug)]
struct ComingMode {
    number: i8,
    due_ns: Nanoseconds,
}

/// A simulated eRob joint module with CANopen firmware.
#[derive(Clone, Debug)]
pub struct ErobJoint {
    parameters: ErobParameters,
    canopen: CanopenNode,
    device: ErobDevice,
    motion: ErobMotion,
    servo: Servo,
    joint: Joint,
    /// The motion that the encoder measures, since the last step of the loops.
    actual: Actual,
    /// One count, without its sign: rad (m). One per mille of the rated torque: N·m (N).
    units: (f64, f64),
    torque: f64,
    /// Offset added to the encoder's counts, because the turn count was lost.
    counts_offset: i32,
    has_battery_fault: bool,
    /// A fault injected since the last advance.
    injected: Option<DriveFault>,
    defects: JointDefects,
    coming_mode: Option<ComingMode>,
    /// Bits 10 to 13 of the statusword, as the mode has set them in the last step.
    mode_bits: u16,
    /// 607A before the last RPDO.
    target_before: i64,
    /// The time up to which the loops have run.
    stepped_ns: Nanoseconds,
    now_ns: Nanoseconds,
}

impl ErobJoint {
    /// A module whose supply is switched on at time 0.
    pub fn new(parameters: ErobParameters) -> Self {
        let mut dictionary = SimulatedDictionary::of_table(&OBJECTS, parameters.node);
        dictionary.set_factory(at::RATED_TORQUE, (1000.0 * parameters.rated_torque).round() as i64);
        let rated_current_ma = 1000.0 * parameters.rated_torque / TORQUE_PER_AMPERE;
        dictionary.set_factory(at::RATED_CURRENT, rated_current_ma.round() as i64);
        dictionary.set_factory(at::TEMPERATURE, 35);
        let mut random = Random::new(parameters.seed, parameters.node);
        let has_warning = random.next_u64() & 1 == 1;
        let velocity_limit = parameters.highest_velocity;
        let counts_per_second = parameters.encoder.counts_per_second(velocity_limit).abs();
        let sdo_features = SdoFeatures::Segmented { is_upload_segmented: parameters.is_upload_segmented };
        let sdo = SdoServer::new(random, SDO_LATENCY_NS, sdo_features);
        let delays = NodeDelays {
            power_up_ns: parameters.power_up_ns,
            feedback_ns: parameters.feedback_delay_ns,
            save_ns: SAVE_NS,
            first_pdo_ns: 0,
        };
        let power_up = PowerUpState::PreOperational;
        let mut module = Self {
            parameters,
            canopen: CanopenNode::new(parameters.node, dictionary, power_up, sdo, PDO_FEATURES, delays),
            device: ErobDevice::starting(has_warning),
            motion: ErobMotion::new(counts_per_second),
            servo: Servo::new(parameters.joint.inertia, parameters.peak_torque, velocity_limit),
            joint: Joint::new(parameters.joint, parameters.initial_position),
            actual: Actual { position: 0.0, velocity: 0.0 },
            units: (1.0 / parameters.encoder.counts_per_unit.abs(), parameters.rated_torque / 1000.0),
            torque: 0.0,
            counts_offset: 0,
            has_battery_fault: false,
            injected: None,
            defects: JointDefects::default(),
            coming_mode: None,
            mode_bits: statusword::BIT_12,
            target_before: 0,
            stepped_ns: 0,
            now_ns: 0,
        };
        if !parameters.has_battery {
            module.lose_turns();
        }
        module.read_encoder();
        module
    }

    fn is_braked(&self) -> bool {
        !self.device.state().has_torque() || self.defects.is_brake_stuck
    }

    fn direction(&self) -> f64 {
        1f64.copysign(self.parameters.encoder.counts_per_unit)
    }

    fn counts(&self) -> i32 {
        self.parameters.encoder.counts(self.joint.position()).wrapping_add(self.counts_offset)
    }

    /// Measures the motion, after the joint has moved or its counts have another offset.
    fn read_encoder(&mut self) {
        let velocity = self.parameters.encoder.counts_per_second(self.joint.velocity());
        self.actual = Actual { position: self.counts().into(), velocity };
    }

    /// The current mode of operation, as in 6061.
    fn mode(&self) -> Option<OperationMode> {
        OperationMode::from_number(self.canopen.dictionary.number(at::OPERATION_MODE_DISPLAY) as i8)
    }

    /// Evaluates the controlword in the state machine and in the profile position handshake.
    fn evaluate(&mut self, now_ns: Nanoseconds) {
        let previous = self.device.controlword();
        let had_stop = self.device.stop().is_some();
        match self.device.evaluate(now_ns, &self.canopen.dictionary, !self.has_battery_fault) {
            Change::Enabled => {
                self.servo.reset();
                self.motion.engage(self.mode(), self.actual, &self.canopen.dictionary);
            }
            Change::FaultReset => {
                self.canopen.dictionary.set(at::ERROR_CODE, 0);
                self.canopen.errors.clear(&mut self.canopen.dictionary);
            }
            Change::None => {}
        }
        if !had_stop && self.device.stop().is_some() {
            self.motion.begin_stop(self.actual);
        }
        if self.device.state() == DriveState::OperationEnabled {
            self.motion.evaluate(self.device.controlword(), previous, &self.canopen.dictionary);
        }
    }

    /// 6061 follows 6060 while the drive has no torque, if the unit has the mode. The manual asks to disable before every change, and does
    /// not say what becomes of a change before that: here it waits until the torque is gone. An SDO is refused, a PDO cannot be.
    fn follow_mode(&mut self) {
        let number = self.canopen.dictionary.number(at::OPERATION_MODE) as i8;
        let supported = self.canopen.dictionary.number(at::SUPPORTED_MODES) as u32;
        let is_supported = OperationMode::from_number(number).is_some_and(|mode| {
            supported & mode.supported_bit() != 0
                || mode == OperationMode::InterpolatedPosition && self.parameters.has_interpolated_position
        });
        let is_shown = self.canopen.dictionary.number(at::OPERATION_MODE_DISPLAY) as i8 == number;
        self.coming_mode = match self.coming_mode {
            _ if !is_supported || is_shown || self.device.state().has_torque() => None,
            Some(coming) if coming.number == number => Some(coming),
            _ => Some(ComingMode { number, due_ns: self.now_ns.max(self.stepped_ns) + MODE_CHANGE_NS }),
        };
    }

    /// Takes the mode that is due.
    fn take_coming_mode(&mut self) {
        let Some(ComingMode { number, due_ns }) = self.coming_mode else { return };
        if self.device.state().has_torque() {
            self.coming_mode = None;
        } else if due_ns <= self.stepped_ns {
            self.coming_mode = None;
            self.canopen.dictionary.set(at::OPERATION_MODE_DISPLAY, number.into());
        }
    }

    /// Enters a fault: error code, emergency message, fault reaction.
    fn fail(&mut self, error: DeviceError) {
        self.canopen.dictionary.set(at::ERROR_CODE, error.code().into());
        self.canopen.errors.raise(error, &mut self.canopen.dictionary);
        self.device.fault(error.cuts_power(), &self.canopen.dictionary);
        if self.device.stop().is_some() {
            self.motion.begin_stop(self.actual);
        } else {
            self.torque = 0.0;
        }
    }

    fn statusword(&self) -> u16 {
        self.device.statusword(self.mode_bits)
    }

    /// Sets the turn count to 0.
    fn lose_turns(&mut self) {
        let turn = self.parameters.counts_per_turn.max(1.0) as i64;
        let single = i64::from(self.counts()).rem_euclid(turn);
        self.counts_offset = self.counts_offset.wrapping_add((single - i64::from(self.counts())) as i32);
        self.read_encoder();
    }
}

impl Drive for ErobJoint {
    fn node(&self) -> u8 {
        self.parameters.node
    }

    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        if self.canopen.passes_by(now_ns, frame) {
            return;
        }
        self.run_loops(now_ns);
        self.receive_frame(now_ns, frame, mailbox);
        self.canopen.schedule(now_ns);
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        if let Some(fault) = self.injected.take() {
            self.has_battery_fault |= fault == DriveFault::MultiTurnBattery;
            self.fail(DeviceError::Fault(fault));
        }
        self.advance_node(now_ns, mailbox);
        self.canopen.schedule(now_ns);
    }

    fn wake_ns(&self) -> Nanoseconds {
        self.canopen.wake_ns()
    }

    fn observe(&mut self, now_ns: Nanoseconds) -> Observation {
        self.run_loops(now_ns);
        Observation {
            position: self.joint.position(),
            velocity: self.joint.velocity(),
            torque: self.torque * self.direction(),
            position_counts: self.counts(),
            state: self.device.state(),
            statusword: self.statusword(),
            error_code: self.canopen.dictionary.number(at::ERROR_CODE) as u16,
            operation_mode: self.canopen.dictionary.number(at::OPERATION_MODE_DISPLAY) as i8,
            nmt: self.canopen.network.state(),
            is_braked: self.is_braked(),
        }
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        self.injected = Some(fault);
        self.canopen.wake_after(self.now_ns);
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_loops(now_ns);
        mailbox.clear();
        self.restart(now_ns);
        self.canopen.schedule(now_ns);
    }

    fn set_gravity(&mut self, gravity: Gravity) {
        self.run_loops(self.now_ns);
        self.joint.set_gravity(gravity);
    }

    fn set_load_torque(&mut self, torque: f64) {
        self.run_loops(self.now_ns);
        self.joint.set_load_torque(torque);
    }

    fn inject_defect(
        &mut self,
        now_ns: Nanoseconds,
        defect: Defect,
        is_present: bool,
    ) -> Result<(), Unsupported> {
        self.run_loops(now_ns);
        self.canopen.defects.set(defect, is_present);
        self.defects.set(defect, is_present);
        match defect {
            Defect::EncoderJump { distance } if is_present => {
                let counts = (distance * self.parameters.encoder.counts_per_unit).round() as i64 as i32;
                self.counts_offset = self.counts_offset.wrapping_add(counts);
                self.read_encoder();
            }
            Defect::Alarm { code } if is_present => self.fail(DeviceError::Alarm(code)),
            Defect::Emergency { code } if is_present => {
                self.canopen.errors.raise(DeviceError::Alarm(code), &mut self.canopen.dictionary);
            }
            Defect::Disobedience(how) => self.device.disobey(is_present.then_some(how)),
            Defect::TorqueOff if is_present => {
                self.device.lose_torque();
                self.torque = 0.0;
            }
            _ => {}
        }
        self.canopen.wake_after(self.now_ns);
        Ok(())
    }
}
