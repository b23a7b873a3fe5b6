//! The complete eRob: it receives frames and time, advances its parts, and sends frames.

mod access;
mod frames;
mod loops;

use takt_rt::{DriveState, Frame, Nanoseconds, OperationMode};

use super::ErobParameters;
use super::device::{Change, ErobDevice};
use super::motion::{ErobActual, ErobMotion};
use super::objects::{OBJECTS, at, is_measured};
use crate::config::PowerUpState;
use crate::sim::defect::{Defect, Unsupported};
use crate::sim::drive::{Drive, DriveFault, Observation};
use crate::sim::errors::{DeviceError, Errors};
use crate::sim::feedback_defects::{FeedbackDefects, JointDefects, ShownObjects};
use crate::sim::mailbox::Mailbox;
use crate::sim::network::Network;
use crate::sim::object_dictionary::SimulatedDictionary;
use crate::sim::pdo_engine::{PdoEngine, PdoFeatures};
use crate::sim::plant::{Gravity, Joint};
use crate::sim::random::Random;
use crate::sim::sdo_server::{SdoFeatures, SdoServer};
use crate::sim::servo::Servo;

/// Longest time between two advances.
const IDLE_NS: Nanoseconds = 1_000_000;
/// Counts of the motor encoder for one of the output encoder.
const MOTOR_ENCODER_RATIO: f64 = 100.0;
/// Rated torque for one ampere, from the ratings of the 80H120I (31 N·m at 6.3 A).
const TORQUE_PER_AMPERE: f64 = 31.0 / 6.3;
/// From a new value of 6060 until the drive is in that mode and 6061 shows it: two steps of its loops, and less than an SDO exchange. In
/// the manual's sequences the next SDO reads the new mode.
const MODE_CHANGE_NS: Nanoseconds = 250_000;
/// From an SDO request to its reply, as measured on real units.
const SDO_LATENCY_NS: std::ops::Range<Nanoseconds> = 300_000..1_000_000;
/// It ignores the event timers of its RPDOs.
const PDO_FEATURES: PdoFeatures = PdoFeatures { is_measured, watches_rpdos: false };
/// The objects that a defect can change: the motor encoder takes the place of the position.
const SHOWN: ShownObjects = ShownObjects {
    statusword: Some(at::STATUSWORD),
    mode_display: Some(at::OPERATION_MODE_DISPLAY),
    position: Some(at::POSITION),
    instead_of_position: Some(at::MOTOR_ENCODER),
};
const NEVER: Nanoseconds = Nanoseconds::MAX;

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
    dictionary: SimulatedDictionary,
    network: Network,
    sdo: SdoServer,
    pdos: PdoEngine,
    errors: Errors,
    device: ErobDevice,
    motion: ErobMotion,
    servo: Servo,
    joint: Joint,
    torque: f64,
    /// Offset added to the encoder's counts, because the turn count was lost.
    counts_offset: i32,
    has_battery_fault: bool,
    has_pdo_error: bool,
    /// A fault injected since the last advance.
    injected: Option<DriveFault>,
    defects: FeedbackDefects,
    joint_defects: JointDefects,
    coming_mode: Option<ComingMode>,
    save_ns: Nanoseconds,
    /// The time up to which the loops have run.
    stepped_ns: Nanoseconds,
    now_ns: Nanoseconds,
    wake_ns: Nanoseconds,
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
        let has_warning = random.next() & 1 == 1;
        let velocity_limit = parameters.highest_velocity;
        let counts_per_second = parameters.encoder.counts_per_second(velocity_limit).abs();
        let sdo_features = SdoFeatures::Segmented { is_upload_segmented: parameters.is_upload_segmented };
        let mut module = Self {
            parameters,
            network: Network::starting(&dictionary, parameters.power_up_ns, PowerUpState::PreOperational),
            sdo: SdoServer::new(random, SDO_LATENCY_NS, sdo_features),
            pdos: PdoEngine::new(&dictionary, PDO_FEATURES),
            errors: Errors::new(&dictionary),
            dictionary,
            device: ErobDevice::starting(has_warning),
            motion: ErobMotion::new(counts_per_second),
            servo: Servo::new(parameters.joint.inertia, parameters.peak_torque, velocity_limit),
            joint: Joint::new(parameters.joint, parameters.initial_position),
            torque: 0.0,
            counts_offset: 0,
            has_battery_fault: false,
            has_pdo_error: false,
            injected: None,
            defects: FeedbackDefects::default(),
            joint_defects: JointDefects::default(),
            coming_mode: None,
            save_ns: NEVER,
            stepped_ns: 0,
            now_ns: 0,
            wake_ns: 0,
        };
        if !parameters.has_battery {
            module.lose_turns();
        }
        module
    }

    fn is_braked(&self) -> bool {
        !self.device.state().has_torque() || self.joint_defects.is_brake_stuck
    }

    fn direction(&self) -> f64 {
        1f64.copysign(self.parameters.encoder.counts_per_unit)
    }

    fn counts(&self) -> i32 {
        self.parameters.encoder.counts(self.joint.position()).wrapping_add(self.counts_offset)
    }

    fn actual(&self) -> ErobActual {
        let velocity = self.parameters.encoder.counts_per_second(self.joint.velocity());
        ErobActual { position: self.counts().into(), velocity }
    }

    /// The current mode of operation, as in 6061.
    fn mode(&self) -> Option<OperationMode> {
        OperationMode::from_number(self.dictionary.number(at::OPERATION_MODE_DISPLAY) as i8)
    }

    /// Evaluates the controlword in the state machine and in the profile position handshake.
    fn evaluate(&mut self, now_ns: Nanoseconds) {
        let previous = self.device.controlword();
        let had_stop = self.device.stop().is_some();
        match self.device.evaluate(now_ns, &self.dictionary, !self.has_battery_fault) {
            Change::Enabled => {
                self.servo.reset();
                let (mode, actual) = (self.mode(), self.actual());
                self.motion.engage(mode, actual, &self.dictionary);
            }
            Change::FaultReset => {
                self.dictionary.set(at::ERROR_CODE, 0);
                self.errors.clear(&mut self.dictionary);
            }
            Change::None => {}
        }
        if !had_stop && self.device.stop().is_some() {
            self.motion.begin_stop(self.actual());
        }
        if self.device.state() == DriveState::OperationEnabled {
            self.motion.evaluate(self.device.controlword(), previous, &self.dictionary);
        }
    }

    /// 6061 follows 6060 while the drive has no torque, if the unit has the mode. The manual asks to disable before every change, and does
    /// not say what becomes of a change before that: here it waits until the torque is gone. An SDO is refused, a PDO cannot be.
    fn follow_mode(&mut self) {
        let number = self.dictionary.number(at::OPERATION_MODE) as i8;
        let supported = self.dictionary.number(at::SUPPORTED_MODES) as u32;
        let is_supported = OperationMode::from_number(number).is_some_and(|mode| {
            supported & mode.supported_bit() != 0
                || mode == OperationMode::InterpolatedPosition && self.parameters.has_interpolated_position
        });
        let is_shown = self.dictionary.number(at::OPERATION_MODE_DISPLAY) as i8 == number;
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
            self.dictionary.set(at::OPERATION_MODE_DISPLAY, number.into());
        }
    }

    /// Enters a fault: error code, emergency message, fault reaction.
    fn fail(&mut self, error: DeviceError) {
        self.dictionary.set(at::ERROR_CODE, error.code().into());
        self.errors.raise(error, &mut self.dictionary);
        self.device.fault(error.cuts_power(), &self.dictionary);
        if self.device.stop().is_some() {
            self.motion.begin_stop(self.actual());
        } else {
            self.torque = 0.0;
        }
    }

    /// Writes the measured values to the dictionary.
    fn measure(&mut self) {
        let actual = self.actual();
        let per_mille = 1000.0 * self.torque / self.parameters.rated_torque;
        let motor = (self.joint.position() * self.parameters.encoder.counts_per_unit * MOTOR_ENCODER_RATIO)
            .round_ties_even();
        let difference = self.motion.position() - actual.position;
        let counts = self.counts();
        let statusword = self.statusword();
        let dictionary = &mut self.dictionary;
        dictionary.set(at::POSITION, counts.into());
        dictionary.set_real(at::VELOCITY, actual.velocity);
        dictionary.set_real(at::TORQUE, per_mille);
        dictionary.set_real(at::CURRENT, per_mille);
        dictionary.set_real(at::TORQUE_ESTIMATE, 1000.0 * self.torque);
        dictionary.set(at::MOTOR_ENCODER, motor as i64);
        dictionary.set_real(at::POSITION_DEMAND, self.motion.position());
        dictionary.set_real(at::VELOCITY_DEMAND, self.motion.velocity());
        dictionary.set_real(at::TORQUE_DEMAND, per_mille);
        dictionary.set_real(at::FOLLOWING_ERROR, difference);
        dictionary.set(at::STATUSWORD, statusword.into());
    }

    /// Writes the measured values to the dictionary with the effect of the defects, and lets the PDOs take their
    /// objects.
    fn report<T>(&mut self, take: impl FnOnce(&mut PdoEngine, &SimulatedDictionary) -> T) -> T {
        self.measure();
        let truth = self.defects.falsify(SHOWN, &mut self.dictionary);
        let taken = take(&mut self.pdos, &self.dictionary);
        truth.restore(&mut self.dictionary);
        taken
    }

    fn statusword(&self) -> u16 {
        // Bits 10 to 13 are those of the last step; the state may have changed since.
        let bits = self.dictionary.number(at::STATUSWORD) as u16 & 0x3C00;
        self.device.statusword(bits)
    }

    /// Restarts everything except the joint and the saved parameters.
    fn start(&mut self, now_ns: Nanoseconds) {
        self.dictionary.restore(0..=u16::MAX);
        if !self.parameters.has_battery {
            self.lose_turns();
        }
        self.network.restart(now_ns + self.parameters.power_up_ns);
        self.sdo.reset();
        self.errors.reset();
        self.pdos.compile(&self.dictionary);
        self.device = self.device.restarted();
        self.servo.reset();
        self.torque = 0.0;
        self.has_pdo_error = false;
        self.coming_mode = None;
        self.save_ns = NEVER;
    }

    /// Sets the turn count to 0.
    fn lose_turns(&mut self) {
        let turn = self.parameters.counts_per_turn.max(1.0) as i64;
        let single = i64::from(self.counts()).rem_euclid(turn);
        self.counts_offset = self.counts_offset.wrapping_add((single - i64::from(self.counts())) as i32);
    }

    fn schedule(&mut self, now_ns: Nanoseconds) {
        let has_message = self.errors.is_pending() && self.network.has_services();
        let due_ns = [
            now_ns + IDLE_NS,
            self.network.due_ns(),
            self.sdo.due_ns().unwrap_or(NEVER),
            self.pdos.due_ns(),
            self.save_ns,
            if has_message { now_ns } else { NEVER },
        ];
        self.wake_ns = due_ns.into_iter().min().unwrap_or(NEVER).max(now_ns + 1);
    }
}

impl Drive for ErobJoint {
    fn node(&self) -> u8 {
        self.parameters.node
    }

    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        self.receive_frame(now_ns, frame, mailbox);
        self.schedule(now_ns);
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        if let Some(fault) = self.injected.take() {
            self.has_battery_fault |= fault == DriveFault::MultiTurnBattery;
            self.fail(DeviceError::Fault(fault));
        }
        if self.network.has_lost_master(now_ns) {
            self.network.follow_error_behaviour(&self.dictionary);
            self.fail(DeviceError::MasterLost);
            self.stop_services();
        }
        if now_ns >= self.save_ns {
            self.save_ns = NEVER;
            self.dictionary.save();
        }
        self.send_due(now_ns, mailbox);
        self.schedule(now_ns);
    }

    fn wake_ns(&self) -> Nanoseconds {
        self.wake_ns
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
            error_code: self.dictionary.number(at::ERROR_CODE) as u16,
            operation_mode: self.dictionary.number(at::OPERATION_MODE_DISPLAY) as i8,
            nmt: self.network.state(),
            is_braked: self.is_braked(),
        }
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        self.injected = Some(fault);
        self.wake_ns = self.now_ns + 1;
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_loops(now_ns);
        mailbox.clear();
        self.start(now_ns);
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
        self.defects.set(defect, is_present);
        self.joint_defects.set(defect, is_present);
        match defect {
            Defect::EncoderJump { distance } if is_present => {
                let counts = (distance * self.parameters.encoder.counts_per_unit).round() as i64 as i32;
                self.counts_offset = self.counts_offset.wrapping_add(counts);
            }
            Defect::Alarm { code } if is_present => self.fail(DeviceError::Alarm(code)),
            Defect::Emergency { code } if is_present => {
                self.errors.raise(DeviceError::Alarm(code), &mut self.dictionary);
            }
            Defect::TorqueOff if is_present => {
                self.device.lose_torque();
                self.torque = 0.0;
            }
            _ => {}
        }
        self.wake_ns = self.now_ns + 1;
        Ok(())
    }
}
