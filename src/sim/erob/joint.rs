//! The whole drive: frames and time come in, the parts do their work, frames go out.

use takt_rt::cia402::{OperationMode, State};
use takt_rt::frame::{Frame, FrameKind, Id};
use takt_rt::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

use super::ErobParameters;
use super::device::{Change, Device};
use super::dictionary::{AbortCode, Dictionary, at};
use super::errors::{Error, Errors};
use super::motion::{Actual, Demand, Motion};
use super::network::{Network, Reset};
use super::objects::OBJECTS;
use super::process_data::{self, ProcessData, Received};
use super::sdo::{self, SdoServer};
use super::servo::Servo;
use crate::sim::drive::{Drive, DriveFault, NmtState, Observation};
use crate::sim::mailbox::Mailbox;
use crate::sim::plant::Joint;
use crate::sim::random::Random;

/// The control loops and the plant run at 8 kHz.
const STEP_NS: Nanoseconds = 125_000;
/// From the arrival of SYNC to the TPDO in the controller.
const TPDO_LATENCY_NS: Nanoseconds = 20_000;
/// "save" is in effect this long after it was accepted (erob-can, section 1).
const SAVE_NS: Nanoseconds = 3_000_000_000;
/// What must be written to 1010:1.
const SAVE_SIGNATURE: u32 = u32::from_le_bytes(*b"save");
/// Without anything to do the drive looks up this often.
const IDLE_NS: Nanoseconds = 1_000_000;
/// Counts of the motor encoder for one of the output encoder.
const MOTOR_ENCODER_RATIO: f64 = 100.0;
/// Rated torque for one ampere, from the ratings of the 80H120I (31 N·m at 6.3 A).
const TORQUE_PER_AMPERE: f64 = 31.0 / 6.3;
const NEVER: Nanoseconds = Nanoseconds::MAX;

/// A simulated eRob joint module with CANopen firmware.
#[derive(Clone, Debug)]
pub struct ErobJoint {
    parameters: ErobParameters,
    dictionary: Dictionary,
    network: Network,
    sdo: SdoServer,
    process_data: ProcessData,
    errors: Errors,
    device: Device,
    motion: Motion,
    servo: Servo,
    joint: Joint,
    torque: f64,
    /// What is added to the encoder's counts, because turns were lost.
    counts_offset: i32,
    has_battery_fault: bool,
    has_pdo_error: bool,
    /// What broke since the last look.
    injected: Option<DriveFault>,
    save_ns: Nanoseconds,
    /// How far the loops have come.
    stepped_ns: Nanoseconds,
    now_ns: Nanoseconds,
    wake_ns: Nanoseconds,
}

impl ErobJoint {
    /// A module whose supply comes on at time 0.
    pub fn new(parameters: ErobParameters) -> Self {
        let mut dictionary = Dictionary::new(parameters.node);
        dictionary.set_factory(at::RATED_TORQUE, (1000.0 * parameters.rated_torque).round() as u32);
        let rated_current_ma = 1000.0 * parameters.rated_torque / TORQUE_PER_AMPERE;
        dictionary.set_factory(at::RATED_CURRENT, rated_current_ma.round() as u32);
        dictionary.set_factory(at::TEMPERATURE, 35);
        let mut random = Random::new(parameters.seed, parameters.node);
        let has_warning = random.next() & 1 == 1;
        let velocity_limit = parameters.highest_velocity;
        let counts_per_second = parameters.encoder.counts_per_second(velocity_limit).abs();
        let mut module = Self {
            parameters,
            dictionary,
            network: Network::starting(parameters.node, parameters.power_up_ns),
            sdo: SdoServer::new(random, parameters.is_upload_segmented),
            process_data: ProcessData::default(),
            errors: Errors::default(),
            device: Device::starting(has_warning),
            motion: Motion::new(counts_per_second),
            servo: Servo::new(parameters.joint.inertia, parameters.peak_torque, velocity_limit),
            joint: Joint::new(parameters.joint, parameters.initial_position),
            torque: 0.0,
            counts_offset: 0,
            has_battery_fault: false,
            has_pdo_error: false,
            injected: None,
            save_ns: NEVER,
            stepped_ns: 0,
            now_ns: 0,
            wake_ns: 0,
        };
        module.process_data.compile(&module.dictionary);
        if !parameters.has_battery {
            module.lose_turns();
        }
        module
    }

    /// The joint, to look at.
    pub fn joint(&self) -> &Joint {
        &self.joint
    }

    /// The value of an object by its bits, as an SDO upload would give it; for tests and tools.
    pub fn object(&mut self, index: u16, subindex: u8) -> Result<u32, AbortCode> {
        self.measure();
        Dictionary::for_reading(index, subindex).map(|at| self.dictionary.get(at))
    }

    fn direction(&self) -> f64 {
        1f64.copysign(self.parameters.encoder.counts_per_unit)
    }

    fn counts(&self) -> i32 {
        self.parameters.encoder.counts(self.joint.position()).wrapping_add(self.counts_offset)
    }

    fn actual(&self) -> Actual {
        let velocity = self.parameters.encoder.counts_per_second(self.joint.velocity());
        Actual { position: self.counts().into(), velocity }
    }

    /// The mode in force, as 6061 shows it.
    fn mode(&self) -> Option<OperationMode> {
        OperationMode::from_number(self.dictionary.signed(at::OPERATION_MODE_DISPLAY) as i8)
    }

    // ---- time -----------------------------------------------------------------------------------------------

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
        self.evaluate(self.stepped_ns);
        let is_driven = self.device.state().has_torque();
        if is_driven {
            self.drive(duration_s);
        } else {
            self.torque = 0.0;
        }
        self.joint.step(duration_s, self.torque * self.direction(), !is_driven);
        let actual = self.actual();
        if is_driven {
            self.check_following_error(actual);
        } else {
            self.motion.follow(actual);
        }
        let word = self.device.controlword();
        let bits = self.motion.status_bits(actual, word, &self.dictionary, duration_s);
        self.dictionary.set(at::STATUSWORD, self.device.statusword(bits).into());
    }

    /// Set-point, loops, torque of one step.
    fn drive(&mut self, duration_s: f64) {
        let actual = self.actual();
        let velocity = self.joint.velocity() * self.direction();
        let demand = match self.device.stop() {
            Some(stop) => {
                let (demand, is_at_rest) = self.motion.step_stop(stop.deceleration, duration_s);
                if is_at_rest && velocity.abs() < 0.01 * self.parameters.highest_velocity {
                    self.device.stopped();
                }
                demand
            }
            None => self.motion.step(self.device.controlword(), actual, &self.dictionary, duration_s),
        };
        let unit = 1.0 / self.parameters.encoder.counts_per_unit.abs();
        let per_mille = self.parameters.rated_torque / 1000.0;
        self.torque = match demand {
            Demand::Position { position, velocity: forward, torque } => {
                let error = (position - actual.position) * unit;
                self.servo.position(error, forward * unit, velocity, torque * per_mille, duration_s)
            }
            Demand::Velocity { velocity: wanted, torque } => {
                self.servo.velocity(wanted * unit, velocity, torque * per_mille, duration_s)
            }
            Demand::Torque(torque) => self.servo.torque(torque * per_mille, velocity),
        };
        if !self.device.state().has_torque() {
            self.torque = 0.0;
        }
    }

    fn check_following_error(&mut self, actual: Actual) {
        let window = self.dictionary.signed_real(at::FOLLOWING_ERROR_WINDOW);
        let error = self.motion.position() - actual.position;
        let is_watched = window >= 0.0 && self.motion.follows_position() && self.device.stop().is_none();
        if is_watched && error.abs() > window {
            self.fail(Error::PositionLost);
        }
    }

    // ---- state ----------------------------------------------------------------------------------------------

    /// Lets the state machine and the profile handshake see the present controlword.
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
        if self.device.state() == State::OperationEnabled {
            self.motion.evaluate(self.device.controlword(), previous, &self.dictionary);
        }
    }

    /// A fault: error code, emergency message, reaction.
    fn fail(&mut self, error: Error) {
        self.dictionary.set(at::ERROR_CODE, error.code().into());
        self.errors.raise(error, &mut self.dictionary);
        self.device.fault(error.cuts_power(), &self.dictionary);
        if self.device.stop().is_some() {
            self.motion.begin_stop(self.actual());
        } else {
            self.torque = 0.0;
        }
    }

    /// Brings measured quantities into the dictionary.
    fn measure(&mut self) {
        let actual = self.actual();
        let per_mille = 1000.0 * self.torque / self.parameters.rated_torque;
        let motor = (self.joint.position() * self.parameters.encoder.counts_per_unit * MOTOR_ENCODER_RATIO)
            .round_ties_even();
        let difference = self.motion.position() - actual.position;
        let counts = self.counts();
        let statusword = self.statusword();
        let dictionary = &mut self.dictionary;
        dictionary.set(at::POSITION, counts as u32);
        dictionary.set_real(at::VELOCITY, actual.velocity);
        dictionary.set_real(at::TORQUE, per_mille);
        dictionary.set_real(at::CURRENT, per_mille);
        dictionary.set_real(at::TORQUE_ESTIMATE, 1000.0 * self.torque);
        dictionary.set(at::MOTOR_ENCODER, motor as i64 as u32);
        dictionary.set_real(at::POSITION_DEMAND, self.motion.position());
        dictionary.set_real(at::VELOCITY_DEMAND, self.motion.velocity());
        dictionary.set_real(at::TORQUE_DEMAND, per_mille);
        dictionary.set_real(at::FOLLOWING_ERROR, difference);
        dictionary.set(at::STATUSWORD, statusword.into());
    }

    fn statusword(&self) -> u16 {
        // Bits 10 to 13 are those of the last step; the state may have changed since.
        let bits = self.dictionary.get(at::STATUSWORD) as u16 & 0x3C00;
        self.device.statusword(bits)
    }

    /// What a start leaves of the drive: everything but the joint and the store.
    fn start(&mut self, now_ns: Nanoseconds) {
        self.dictionary.restore(0..=u16::MAX);
        if !self.parameters.has_battery {
            self.lose_turns();
        }
        let Self { parameters, dictionary, .. } = self;
        self.network = Network::starting(parameters.node, now_ns + parameters.power_up_ns);
        self.sdo.reset();
        self.errors.reset();
        self.process_data.compile(dictionary);
        self.device = self.device.restarted();
        self.servo.reset();
        self.torque = 0.0;
        self.has_pdo_error = false;
        self.save_ns = NEVER;
    }

    /// The multi-turn count becomes 0.
    fn lose_turns(&mut self) {
        let turn = self.parameters.counts_per_turn.max(1.0) as i64;
        let single = i64::from(self.counts()).rem_euclid(turn);
        self.counts_offset = self.counts_offset.wrapping_add((single - i64::from(self.counts())) as i32);
    }

    // ---- frames ---------------------------------------------------------------------------------------------

    fn take(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        if frame.id().is_extended() || frame.is_fd() {
            return;
        }
        if frame.kind() == FrameKind::Remote {
            return self.take_remote(now_ns, frame, mailbox);
        }
        let node = u32::from(self.parameters.node);
        let id = frame.id().value();
        match id {
            0x000 => self.take_nmt(now_ns, frame.payload()),
            0x701..=0x77F => self.network.heard(now_ns, (id & 0x7F) as u8, &self.dictionary),
            _ if id == 0x600 + node => {
                if self.network.has_services()
                    && let Ok(request) = frame.payload().try_into()
                {
                    self.take_request(now_ns, request);
                }
            }
            _ if self.network.state() != NmtState::Operational => {}
            _ if id == self.dictionary.get(at::SYNC_ID) & 0x7FF => self.take_sync(now_ns),
            _ => self.take_pdo(now_ns, frame),
        }
    }

    fn take_remote(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        if frame.id() == Id::canopen(0x700, self.parameters.node) {
            if let Some(byte) = self.network.guarded(now_ns, &self.dictionary) {
                mailbox.push(Frame::of(frame.id(), [byte]));
            }
        } else if self.network.state() == NmtState::Operational {
            self.measure();
            if let Some(answer) = self.process_data.requested(frame.id(), &self.dictionary) {
                mailbox.put(answer);
            }
        }
    }

    fn take_nmt(&mut self, now_ns: Nanoseconds, payload: &[u8]) {
        let &[command, node] = payload else { return };
        if node != 0 && node != self.parameters.node || self.network.state() == NmtState::Initialising {
            return;
        }
        match self.network.command(now_ns, command) {
            Some(Reset::Node) => self.start(now_ns),
            Some(Reset::Communication) => {
                // The error register and history tell of the drive, not of the communication.
                self.dictionary.restore(0x1005..=0x1FFF);
                self.process_data.compile(&self.dictionary);
            }
            None => {}
        }
        self.rest();
    }

    /// Stops what the NMT state no longer allows.
    fn rest(&mut self) {
        if self.network.state() != NmtState::Operational {
            self.process_data.rest();
        }
        if !self.network.has_services() {
            self.sdo.reset();
        }
    }

    fn take_sync(&mut self, now_ns: Nanoseconds) {
        self.lock_loops(now_ns);
        self.process_data.apply_latched(&mut self.dictionary, write_field);
        self.follow_mode();
        self.evaluate(now_ns);
        self.motion.latch(&self.dictionary);
        self.measure();
        self.process_data.sample(now_ns, TPDO_LATENCY_NS, &self.dictionary);
    }

    fn take_pdo(&mut self, now_ns: Nanoseconds, frame: &Frame) {
        let target = self.dictionary.get(at::TARGET_POSITION);
        match self.process_data.receive(frame, &mut self.dictionary, write_field) {
            Received::NotMine => {}
            Received::TooShort => {
                // One message for a row of them.
                if !self.has_pdo_error {
                    self.has_pdo_error = true;
                    self.errors.raise(Error::PdoLength, &mut self.dictionary);
                }
            }
            Received::Latched => self.clear_pdo_error(),
            Received::Applied => {
                self.clear_pdo_error();
                self.follow_mode();
                self.evaluate(now_ns);
                if self.dictionary.get(at::TARGET_POSITION) != target {
                    self.motion.latch(&self.dictionary);
                }
            }
        }
    }

    fn clear_pdo_error(&mut self) {
        if self.has_pdo_error && !self.device.state().is_faulted() {
            self.has_pdo_error = false;
            self.errors.clear(&mut self.dictionary);
        }
    }

    fn take_request(&mut self, now_ns: Nanoseconds, request: [u8; 8]) {
        // The server is taken out for the time of the call, since it works on the rest of the drive.
        let mut server = self.sdo.clone();
        server.request(now_ns, request, &mut Objects { module: self, now_ns });
        self.sdo = server;
    }

    /// 6061 follows 6060 in a drive that is not enabled, if the unit has the mode.
    fn follow_mode(&mut self) {
        if self.device.state().has_torque() {
            return;
        }
        let number = self.dictionary.signed(at::OPERATION_MODE) as i8;
        let supported = self.dictionary.get(at::SUPPORTED_MODES);
        let is_supported = OperationMode::from_number(number).is_some_and(|mode| {
            supported & mode.supported_bit() != 0
                || mode == OperationMode::InterpolatedPosition && self.parameters.has_interpolated_position
        });
        if is_supported {
            self.dictionary.set(at::OPERATION_MODE_DISPLAY, number as u8 as u32);
        }
    }

    /// Sends what is due.
    fn send_due(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        let node = self.parameters.node;
        if self.network.boots(now_ns, &self.dictionary) {
            self.device.started();
            if self.has_battery_fault {
                self.fail(Error::Fault(DriveFault::MultiTurnBattery));
            }
            mailbox.push(Frame::of(Id::canopen(0x700, node), [0]));
        }
        if let Some(byte) = self.network.heartbeat(now_ns, &self.dictionary) {
            mailbox.push(Frame::of(Id::canopen(0x700, node), [byte]));
        }
        if self.network.has_services() {
            if let Some(answer) = self.sdo.answer(now_ns) {
                mailbox.push(Frame::of(Id::canopen(0x580, node), answer));
            }
            while let Some(message) = self.errors.next() {
                mailbox.push(Frame::of(Id::canopen(0x080, node), message));
            }
        }
        if self.network.state() == NmtState::Operational {
            self.measure();
            self.process_data.sample_events(now_ns, &self.dictionary);
            while let Some(frame) = self.process_data.next(now_ns) {
                mailbox.put(frame);
            }
        }
    }

    fn schedule(&mut self, now_ns: Nanoseconds) {
        let has_message = self.errors.is_pending() && self.network.has_services();
        let due_ns = [
            now_ns + IDLE_NS,
            self.network.due_ns(),
            self.sdo.due_ns().unwrap_or(NEVER),
            self.process_data.due_ns(),
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
        self.take(now_ns, frame, mailbox);
        self.schedule(now_ns);
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        if let Some(fault) = self.injected.take() {
            self.has_battery_fault |= fault == DriveFault::MultiTurnBattery;
            self.fail(Error::Fault(fault));
        }
        if self.network.loses_master(now_ns, &self.dictionary) {
            self.fail(Error::MasterLost);
            self.rest();
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

    fn observe(&self) -> Observation {
        Observation {
            position: self.joint.position(),
            velocity: self.joint.velocity(),
            torque: self.torque * self.direction(),
            position_counts: self.counts(),
            state: self.device.state(),
            statusword: self.statusword(),
            error_code: self.dictionary.get(at::ERROR_CODE) as u16,
            operation_mode: self.dictionary.signed(at::OPERATION_MODE_DISPLAY) as i8,
            nmt: self.network.state(),
            is_braked: !self.device.state().has_torque(),
        }
    }

    fn inject(&mut self, fault: DriveFault) {
        self.injected = Some(fault);
        self.wake_ns = self.now_ns + 1;
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_loops(now_ns);
        mailbox.clear();
        self.start(now_ns);
        self.schedule(now_ns);
    }

    fn set_load_torque(&mut self, torque: f64) {
        self.joint.set_load_torque(torque);
    }
}

/// How an RPDO writes an entry: an enabled drive keeps its mode, and values out of range are left.
fn write_field(dictionary: &mut Dictionary, at: usize, value: u32) {
    let is_enabled = State::decode(dictionary.get(at::STATUSWORD) as u16).has_torque();
    if at == at::OPERATION_MODE && is_enabled {
        return;
    }
    if check_range(at, value).is_ok() {
        dictionary.set(at, value);
    }
}

/// Values that an entry never takes.
fn check_range(at: usize, value: u32) -> Result<(), AbortCode> {
    let is_in_range = match at {
        at::ERROR_HISTORY => value == 0,
        // Bit 30: the drive cannot produce SYNC. Bit 29: it has no 29-bit identifiers.
        at::SYNC_ID => value & 0x6000_0000 == 0 && value & 0x7FF != 0,
        at::CONSUMER_HEARTBEAT => value >> 16 <= 127,
        at::ERROR_BEHAVIOUR => value <= 2,
        at::OPERATION_MODE => value <= 10,
        at::TORQUE_OFFSET => (-3000..=3000).contains(&i32::from(value as u16 as i16)),
        _ => true,
    };
    if is_in_range { Ok(()) } else { Err(AbortCode::Value) }
}

/// The dictionary as the SDO server reaches it, with everything that a write sets in motion.
struct Objects<'a> {
    module: &'a mut ErobJoint,
    now_ns: Nanoseconds,
}

impl sdo::Access for Objects<'_> {
    fn read(&mut self, index: u16, subindex: u8) -> Result<([u8; 4], usize), AbortCode> {
        let at = Dictionary::for_reading(index, subindex)?;
        let history = self.module.dictionary.get(at::ERROR_HISTORY);
        if OBJECTS[at].index == 0x1003 && u32::from(subindex) > history {
            return Err(AbortCode::NoData);
        }
        self.module.measure();
        Ok((self.module.dictionary.get(at).to_le_bytes(), OBJECTS[at].data_type.bytes()))
    }

    fn check_write(&self, index: u16, subindex: u8) -> Result<usize, AbortCode> {
        let at = Dictionary::for_writing(index, subindex)?;
        if at == at::OPERATION_MODE && self.module.device.state().has_torque() {
            return Err(AbortCode::DeviceState);
        }
        Ok(OBJECTS[at].data_type.bytes())
    }

    fn write(&mut self, index: u16, subindex: u8, value: [u8; 4]) -> Result<(), AbortCode> {
        let at = Dictionary::for_writing(index, subindex)?;
        let size = OBJECTS[at].data_type.bytes();
        let value = u32::from_le_bytes(value) & (u32::MAX >> (32 - 8 * size));
        check_range(at, value)?;
        let Self { module, now_ns } = self;
        match index {
            0x1010 => {
                if value != SAVE_SIGNATURE {
                    return Err(AbortCode::CannotStore);
                }
                module.save_ns = *now_ns + SAVE_NS;
                return Ok(());
            }
            0x1400..=0x1403 | 0x1600..=0x1603 | 0x1800..=0x1803 | 0x1A00..=0x1A03 => {
                process_data::check_parameter(&module.dictionary, at, value)?;
            }
            _ => {}
        }
        module.dictionary.set(at, value);
        module.written(at, *now_ns);
        Ok(())
    }
}

impl ErobJoint {
    /// What follows from a new value of an entry.
    fn written(&mut self, at: usize, now_ns: Nanoseconds) {
        match at {
            at::CONTROLWORD => self.evaluate(now_ns),
            at::TARGET_POSITION => self.motion.latch(&self.dictionary),
            at::OPERATION_MODE => self.follow_mode(),
            at::PRODUCER_HEARTBEAT => self.network.schedule_heartbeat(now_ns, &self.dictionary),
            at::CONSUMER_HEARTBEAT => self.network.forget_master(),
            at::BATTERY_RESET if self.dictionary.get(at) == 1 => {
                self.has_battery_fault = false;
                self.lose_turns();
            }
            _ if matches!(OBJECTS[at].index, 0x1400..=0x1A03) => self.process_data.compile(&self.dictionary),
            _ => {}
        }
    }
}
