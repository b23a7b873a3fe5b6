//! Drives that are spoken to by bit fields, simulated from the description of their make: hollow-shaft motors, and every drive with a
//! description file.
//!
//! A drive takes commands and frames with a meaning of their own, and answers each with a reply, as late as its description says. It has no
//! watchdog: without commands it goes on with the last one. What it was told beside that, it forgets with its power.

mod bits;
mod current_loop;
mod registers;
mod shaft;

use std::f64::consts::TAU;

use takt_rt::{
    DriveState, FieldMode, Frame, Id, ModeCodes, Nanoseconds, OperationMode, OwnFrame, PositionReference,
    ReplyValue,
};

use super::defect::{Defect, Unsupported, shorter};
use super::drive::{Drive, DriveFault, NodeState, Observation};
use super::mailbox::Mailbox;
use super::motion::{Actual, Generator};
use super::plant::{Gravity, Joint, JointParameters};
use super::servo::{LoopFactors, Servo};
use current_loop::CurrentLoop;
use registers::RegisterServer;
pub use shaft::{Command, Reply};
use takt_wire::bit_fields::{
    BesideTargetKind, DescribedLifeCycle, DescribedScan, FieldDevice, ReplyMoment, Setting, SetupFrame,
};

/// The period of the drive's loops.
const STEP_NS: Nanoseconds = 125_000;
const STEP_S: f64 = STEP_NS as f64 * 1e-9;
/// Commands further apart are not those of a cycle.
const LONGEST_PERIOD_S: f64 = 0.1;
const TEMPERATURE: f64 = 30.0;

/// What a simulated drive is made with.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldSimulationParameters {
    /// The drive.
    pub device: FieldDevice,
    /// Its motor ID.
    pub motor_id: u8,
    /// The mechanics of the joint.
    pub joint: JointParameters,
    /// Where the joint is at first: rad (m).
    pub initial_position: f64,
    /// Peak torque at the joint: N·m (N).
    pub peak_torque: f64,
    /// The highest velocity of the joint: rad/s (m/s).
    pub highest_velocity: f64,
    /// Travel of the shaft for one unit of the joint: rad for one rad (m); negative where it turns the other way.
    pub shaft_per_joint: f64,
    /// The reported turns of the shaft where the joint is at zero.
    pub zero_turns: f64,
    /// From power-on until it answers.
    pub power_up_ns: Nanoseconds,
}

/// A frame with a meaning of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    Start,
    Stop,
    Zero,
    Clear,
    Mode(FieldMode),
}

/// Whether the motor has torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Power {
    Off,
    On,
    /// Off, by an error.
    Fault(u16),
}

/// Defects that last.
#[derive(Clone, Copy, Debug, Default)]
struct Defects {
    is_blocked: bool,
    is_short: bool,
    /// The mode that it shows in place of its own.
    shown_mode: Option<ShownMode>,
}

/// A mode in a reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ShownMode {
    /// One that the drive can have.
    Known(FieldMode),
    /// A code that is none of its modes.
    Unknown,
}

/// The number of a mode in object 6061 (CiA 402).
const fn operation_mode(mode: FieldMode) -> i8 {
    let mode = match mode {
        FieldMode::Torque => OperationMode::CyclicSynchronousTorque,
        FieldMode::Velocity => OperationMode::CyclicSynchronousVelocity,
        FieldMode::Position => OperationMode::CyclicSynchronousPosition,
    };
    mode as i8
}

impl ShownMode {
    /// By its number in object 6061.
    fn of_number(mode: i8) -> Self {
        [FieldMode::Torque, FieldMode::Velocity, FieldMode::Position]
            .into_iter()
            .find(|known| operation_mode(*known) == mode)
            .map_or(Self::Unknown, Self::Known)
    }
}

/// A simulated drive.
#[derive(Clone, Debug)]
pub struct FieldSimulation {
    parameters: FieldSimulationParameters,
    command_id: Id,
    reply_id: Id,
    orders: Vec<(OwnFrame, Order)>,
    /// The frames that set it up, and whether each has been taken. Those that carry a number need not be taken.
    setup: Vec<(SetupFrame, OwnFrame, bool)>,
    power: Power,
    mode: FieldMode,
    /// The last command. A position in it is one of the shaft, as the drive counts it.
    command: Option<Command>,
    commanded_ns: Nanoseconds,
    demand: Generator,
    servo: Servo,
    factors: LoopFactors,
    current_loop: CurrentLoop,
    joint: Joint,
    /// At the joint: N·m (N).
    torque: f64,
    /// What is taken from the position of the shaft: rad. It comes from zeroing, and from defects.
    offset: f64,
    defects: Defects,
    reply_ns: Option<Nanoseconds>,
    registers: RegisterServer,
    heartbeat_ns: Option<Nanoseconds>,
    ready_ns: Nanoseconds,
    stepped_ns: Nanoseconds,
}

impl FieldSimulation {
    /// A drive whose supply is switched on at time 0.
    pub fn new(parameters: FieldSimulationParameters) -> Self {
        let FieldSimulationParameters { device, motor_id, joint, .. } = &parameters;
        let (orders, mode) = (orders(device, *motor_id), device.description.modes.first().copied());
        let fixed = |setup: &SetupFrame| (*setup, device.fixed(&setup.frame, *motor_id), false);
        let mut drive = Self {
            command_id: device.id(&device.description.command.id, *motor_id),
            reply_id: device.reply_id(*motor_id),
            orders,
            setup: device.description.setup.iter().map(fixed).collect(),
            power: Power::Off,
            mode: mode.unwrap_or(FieldMode::Position),
            command: None,
            commanded_ns: 0,
            demand: Generator::default(),
            servo: Servo::new(joint.inertia, parameters.peak_torque, parameters.highest_velocity),
            factors: LoopFactors::PRESET,
            current_loop: CurrentLoop::default(),
            joint: Joint::new(*joint, parameters.initial_position),
            torque: 0.0,
            offset: 0.0,
            defects: Defects::default(),
            reply_ns: None,
            registers: RegisterServer::new(device),
            heartbeat_ns: None,
            ready_ns: parameters.power_up_ns,
            stepped_ns: 0,
            parameters,
        };
        drive.boot(0);
        drive
    }

    /// What the drive does when its supply is switched on.
    fn boot(&mut self, now_ns: Nanoseconds) {
        self.power = Power::Off;
        (self.command, self.torque) = (None, 0.0);
        self.registers.reset();
        self.setup.iter_mut().for_each(|(_, _, is_taken)| *is_taken = false);
        // It forgets every gain with its power.
        self.factors = LoopFactors::PRESET;
        self.servo.set_factors(self.factors);
        self.current_loop = CurrentLoop::default();
        self.ready_ns = now_ns.saturating_add(self.parameters.power_up_ns);
        self.reply_ns = match self.parameters.device.description.reply_moment {
            ReplyMoment::AfterCommand { .. } => None,
            ReplyMoment::Cyclic { period_ns } => Some(self.ready_ns.saturating_add(period_ns)),
        };
        let heartbeat = self.parameters.device.description.heartbeat;
        self.heartbeat_ns = heartbeat.map(|heartbeat| self.ready_ns.saturating_add(heartbeat.period_ns));
    }

    /// The position of the shaft as the drive counts it: rad.
    fn shaft(&self) -> f64 {
        let FieldSimulationParameters { shaft_per_joint, zero_turns, .. } = self.parameters;
        self.joint.position() * shaft_per_joint + zero_turns * TAU - self.offset
    }

    /// The position of the joint at which the drive counts this position of its shaft.
    fn joint_at(&self, shaft: f64) -> f64 {
        let FieldSimulationParameters { shaft_per_joint, zero_turns, .. } = self.parameters;
        (shaft + self.offset - zero_turns * TAU) / shaft_per_joint
    }

    fn start(&mut self) {
        if self.power == Power::Off {
            self.power = Power::On;
            self.servo.reset();
            self.rest();
        }
    }

    /// Demands the actual position.
    fn rest(&mut self) {
        let (position, velocity) = (self.joint.position(), self.joint.velocity());
        self.demand = Generator::starting(Actual { position, velocity });
    }

    fn stop(&mut self) {
        let is_cleared_by_stop = !self.orders.iter().any(|(_, order)| *order == Order::Clear);
        if self.power == Power::On || is_cleared_by_stop {
            self.power = Power::Off;
        }
        self.torque = 0.0;
    }

    fn zero(&mut self) {
        if self.power == Power::Off {
            self.offset += self.shaft();
        }
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Start => self.start(),
            Order::Stop => self.stop(),
            Order::Zero => self.zero(),
            Order::Clear if self.power != Power::On => self.power = Power::Off,
            Order::Clear => {}
            Order::Mode(mode) => self.set_mode(mode),
        }
    }

    fn set_mode(&mut self, mode: FieldMode) {
        if self.mode != mode {
            self.mode = mode;
            self.rest();
        }
    }

    fn take_command(&mut self, now_ns: Nanoseconds, payload: &[u8]) {
        let mut command = Command::read(&self.parameters.device, payload);
        if self.parameters.device.description.position_reference == PositionReference::Present {
            command.position += self.shaft();
        }
        let period_s = now_ns.saturating_sub(self.commanded_ns) as f64 * 1e-9;
        self.commanded_ns = now_ns;
        self.command = Some(command);
        if let DescribedLifeCycle::ByFields(codes) = &self.parameters.device.description.life_cycle {
            let mode = mode_of(*codes, command.mode);
            if let Some(mode) = mode {
                self.set_mode(mode);
            }
            match command.run {
                true => self.start(),
                false => self.stop(),
            }
            if command.zero {
                self.zero();
            }
        }
        let target = self.joint_at(command.position);
        self.demand.interpolate_to(target, period_s.clamp(STEP_S, LONGEST_PERIOD_S), f64::INFINITY);
    }

    /// Returns `true` if the frame sets the drive up; it is taken then.
    fn take_setup(&mut self, frame: &Frame) -> bool {
        let payload = frame.payload();
        let (mut is_taken, mut given) = (false, None);
        for (setup, own, was_taken) in &mut self.setup {
            let number = setup.number.map(|number| number.at..number.at + 4);
            let is_same = |(at, (one, other)): (usize, (&u8, &u8))| {
                one == other || number.as_ref().is_some_and(|number| number.contains(&at))
            };
            let is_it = own.id == frame.id()
                && payload.len() == own.payload.len()
                && payload.iter().zip(&own.payload).enumerate().all(is_same);
            *was_taken |= is_it;
            is_taken |= is_it;
            if let Some(number) = setup.number.filter(|_| is_it) {
                let bytes = payload.get(number.at..number.at + 4).and_then(|bytes| bytes.try_into().ok());
                given = bytes.map(|bytes| (number.setting, f64::from(f32::from_be_bytes(bytes))));
            }
        }
        if let Some((setting, factor)) = given {
            self.multiply(setting, factor);
        }
        is_taken
    }

    /// Multiplies a preset gain. A drive ignores what no gain can be.
    fn multiply(&mut self, setting: Setting, factor: f64) {
        if !(factor.is_finite() && factor >= 0.0) {
            return;
        }
        match setting {
            Setting::VelocityLoopKp => self.factors.velocity_kp = factor,
            Setting::VelocityLoopKi => self.factors.velocity_ki = factor,
            Setting::CurrentLoopKp => self.current_loop.kp = factor,
            Setting::CurrentLoopKi => self.current_loop.ki = factor,
            _ => {}
        }
        self.servo.set_factors(self.factors);
    }

    /// Returns `true` if every frame has come that the drive needs before it is spoken to as described.
    fn is_set_up(&self) -> bool {
        self.setup.iter().all(|(setup, _, is_taken)| setup.number.is_some() || *is_taken)
    }

    fn run_until(&mut self, now_ns: Nanoseconds) {
        while self.stepped_ns + STEP_NS <= now_ns {
            self.stepped_ns += STEP_NS;
            self.torque = match (self.power, self.command) {
                (Power::On, Some(command)) => {
                    let demand = self.step(&command);
                    self.current_loop.step(demand, STEP_S)
                }
                _ => {
                    self.current_loop.reset();
                    0.0
                }
            };
            match self.defects.is_blocked {
                true => self.joint.halt(),
                false => self.joint.step(STEP_S, self.torque, false),
            }
        }
    }

    /// The torque of the loops at the joint.
    fn step(&mut self, command: &Command) -> f64 {
        let FieldSimulationParameters { device, shaft_per_joint, peak_torque, .. } = &self.parameters;
        let (per_joint, peak) = (*shaft_per_joint, *peak_torque);
        if device.has_impedance() {
            let (shaft, speed) = (self.shaft(), self.joint.velocity() * per_joint);
            let spring = command.stiffness * (command.position - shaft);
            let damper = command.damping * (command.velocity - speed);
            return ((spring + damper + command.torque) * per_joint).clamp(-peak, peak);
        }
        let has_limits = device.description.beside_target == BesideTargetKind::Limits;
        let has = |value| device.description.command.field(value).is_some();
        let limit = |value, limit: f64| if has_limits && has(value) { limit.abs() } else { f64::INFINITY };
        let torque_limit = limit(takt_rt::CommandValue::Torque, command.torque * per_joint);
        let velocity_limit = limit(takt_rt::CommandValue::Velocity, command.velocity / per_joint);
        let (position, velocity) = (self.joint.position(), self.joint.velocity());
        let (forward_torque, wanted) = (command.torque * per_joint, command.velocity / per_joint);
        let forward_torque = if has_limits { 0.0 } else { forward_torque };
        match self.mode {
            FieldMode::Torque => {
                self.servo.set_torque_limit(peak);
                self.servo.torque(command.torque * per_joint, velocity)
            }
            FieldMode::Velocity => {
                self.servo.set_torque_limit(peak.min(torque_limit));
                self.servo.velocity(wanted, velocity, forward_torque, STEP_S)
            }
            FieldMode::Position => {
                self.servo.set_torque_limit(peak.min(torque_limit));
                self.demand.step_interpolation(velocity_limit, STEP_S);
                let error = self.demand.position - position;
                self.servo.position(error, self.demand.forward, velocity, forward_torque, STEP_S)
            }
        }
    }

    fn reply(&self) -> Option<Frame> {
        let FieldSimulationParameters { device, motor_id, shaft_per_joint, .. } = &self.parameters;
        let mode = match &device.description.life_cycle {
            DescribedLifeCycle::ByFields(ModeCodes { torque, velocity, position }) => {
                match self.defects.shown_mode.unwrap_or(ShownMode::Known(self.mode)) {
                    ShownMode::Known(FieldMode::Torque) => *torque,
                    ShownMode::Known(FieldMode::Velocity) => *velocity,
                    ShownMode::Known(FieldMode::Position) => *position,
                    ShownMode::Unknown => u8::MAX,
                }
            }
            DescribedLifeCycle::ByFrames(_) => 0,
        };
        let reply = Reply {
            position: self.shaft(),
            velocity: self.joint.velocity() * shaft_per_joint,
            torque: self.torque / shaft_per_joint,
            temperature: TEMPERATURE,
            mode,
            run: self.power == Power::On,
            error: match self.power {
                Power::Fault(code) => code,
                Power::Off | Power::On => 0,
            },
            state: device.description.states.map_or(0, |states| match self.power {
                Power::Off => states.stopped.into(),
                Power::On => states.running.into(),
                Power::Fault(code) => code,
            }),
            motor_id: *motor_id,
        };
        let frame = reply.frame(device, self.reply_id)?;
        let length = device.description.bytes_before_setup.filter(|_| !self.is_set_up());
        match length.and_then(|length| frame.payload().get(..length)) {
            Some(payload) => Frame::data(self.reply_id, payload).ok(),
            None => Some(if self.defects.is_short { shorter(frame) } else { frame }),
        }
    }

    /// The heartbeat that is due. Each byte of it is the lowest that the description allows.
    fn take_heartbeat(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        let due_ns = self.heartbeat_ns.filter(|due_ns| *due_ns <= now_ns)?;
        let FieldSimulationParameters { device, motor_id, .. } = &self.parameters;
        let heartbeat = device.description.heartbeat?;
        self.heartbeat_ns = Some(due_ns.saturating_add(heartbeat.period_ns));
        let bytes: Vec<u8> = match &device.description.scan {
            Some(DescribedScan::Heartbeat(scan)) => scan.bytes.iter().map(|range| *range.start()).collect(),
            Some(DescribedScan::Registers(_)) | None => vec![0; heartbeat.bytes],
        };
        Frame::data(device.id(&heartbeat.id, *motor_id), &bytes).ok()
    }

    fn shows_mode(&self) -> bool {
        self.parameters.device.description.reply.field(ReplyValue::Mode).is_some()
    }

    fn fail(&mut self, code: u16) {
        self.power = Power::Fault(code);
        self.torque = 0.0;
    }
}

fn mode_of(codes: ModeCodes, code: u8) -> Option<FieldMode> {
    let ModeCodes { torque, velocity, position } = codes;
    match code {
        _ if code == position => Some(FieldMode::Position),
        _ if code == velocity => Some(FieldMode::Velocity),
        _ if code == torque => Some(FieldMode::Torque),
        _ => None,
    }
}

/// The frames with a meaning of their own.
fn orders(device: &FieldDevice, motor_id: u8) -> Vec<(OwnFrame, Order)> {
    let DescribedLifeCycle::ByFrames(frames) = &device.description.life_cycle else { return vec![] };
    let order = |name| match name {
        "start" => Order::Start,
        "stop" => Order::Stop,
        "zero" => Order::Zero,
        "clear" => Order::Clear,
        "torque" => Order::Mode(FieldMode::Torque),
        "velocity" => Order::Mode(FieldMode::Velocity),
        _ => Order::Mode(FieldMode::Position),
    };
    frames.all().map(|(name, frame)| (device.fixed(frame, motor_id), order(name))).collect()
}

impl Drive for FieldSimulation {
    fn node(&self) -> u8 {
        self.parameters.motor_id
    }

    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, _: &mut Mailbox) {
        let answers =
            matches!(self.parameters.device.description.reply_moment, ReplyMoment::AfterCommand { .. });
        // A motor that is about to reply takes nothing else: the manual asks for 500 µs between two frames.
        let is_busy = answers && (self.reply_ns.is_some() || self.registers.due_ns().is_some());
        if now_ns < self.ready_ns || is_busy {
            return;
        }
        self.run_until(now_ns);
        let own = self.orders.iter().find(|(own, _)| own.id == frame.id() && own.payload == frame.payload());
        let own = own.map(|(_, order)| *order);
        let FieldDevice { description, .. } = &self.parameters.device;
        let is_fd = description.command.format != takt_rt::FrameFormat::Classic;
        let is_command = frame.id() == self.command_id
            && frame.payload().len() == description.command.bytes
            && frame.is_fd() == is_fd;
        let delay_ns = match description.reply_moment {
            ReplyMoment::AfterCommand { delay_ns } => Some(delay_ns.max(1)),
            ReplyMoment::Cyclic { .. } => None,
        };
        let FieldSimulationParameters { device, motor_id, .. } = &self.parameters;
        let answered_ns = now_ns.saturating_add(delay_ns.unwrap_or(1));
        if self.registers.take(frame, device, *motor_id, answered_ns) {
            return;
        }
        if let Some(order) = own {
            self.obey(order);
        } else if is_command {
            self.take_command(now_ns, frame.payload());
        } else if !self.take_setup(frame) {
            return;
        }
        if let Some(delay_ns) = delay_ns {
            self.reply_ns = Some(now_ns.saturating_add(delay_ns));
        }
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_until(now_ns);
        if let Some(due_ns) = self.reply_ns.filter(|due_ns| *due_ns <= now_ns) {
            if let Some(frame) = self.reply() {
                mailbox.push(frame);
            }
            self.reply_ns = match self.parameters.device.description.reply_moment {
                ReplyMoment::AfterCommand { .. } => None,
                ReplyMoment::Cyclic { period_ns } => Some(due_ns.saturating_add(period_ns)),
            };
        }
        for frame in [self.registers.poll(now_ns), self.take_heartbeat(now_ns)].into_iter().flatten() {
            mailbox.push(frame);
        }
    }

    fn wake_ns(&self) -> Nanoseconds {
        let step_ns = self.stepped_ns + STEP_NS;
        [self.reply_ns, self.registers.due_ns(), self.heartbeat_ns]
            .into_iter()
            .flatten()
            .fold(step_ns, Nanoseconds::min)
    }

    fn observe(&mut self, now_ns: Nanoseconds) -> Observation {
        self.run_until(now_ns);
        let (state, error_code) = match self.power {
            Power::Off => (DriveState::SwitchOnDisabled, 0),
            Power::On => (DriveState::OperationEnabled, 0),
            Power::Fault(code) => (DriveState::Fault, code),
        };
        Observation {
            position: self.joint.position(),
            velocity: self.joint.velocity(),
            torque: self.torque,
            position_counts: (self.shaft() / TAU * self.parameters.device.counts_per_turn()).round() as i64
                as i32,
            state,
            statusword: 0,
            error_code,
            operation_mode: operation_mode(self.mode),
            nmt: NodeState::Operational,
            is_braked: false,
        }
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        let (words, usual) = match fault {
            DriveFault::OverTemperature => ("hot", 1),
            DriveFault::OverCurrent => ("over-current", 2),
            DriveFault::OverVoltage => ("over-voltage", 3),
            DriveFault::UnderVoltage => ("under-voltage", 4),
            DriveFault::Encoder | DriveFault::MultiTurnBattery => ("encoder", 5),
            DriveFault::BlockedRotor | DriveFault::Stall => ("overload", 6),
        };
        // A drive without words for it has it by another code of its own.
        let errors = &self.parameters.device.description.errors;
        let own = errors.iter().find(|(_, own)| own.contains(words)).or(errors.first());
        self.fail(own.map_or(usual, |(code, _)| *code));
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_until(now_ns);
        mailbox.clear();
        // Neither its zero nor its count of turns outlives the power: it finds itself within half a turn of the zero of its encoder.
        self.offset = 0.0;
        let turns = self.shaft() / TAU;
        self.offset = turns.round() * TAU;
        self.boot(now_ns);
    }

    fn set_gravity(&mut self, gravity: Gravity) {
        self.joint.set_gravity(gravity);
    }

    fn set_load_torque(&mut self, torque: f64) {
        self.joint.set_load_torque(torque);
    }

    fn inject_defect(&mut self, _: Nanoseconds, defect: Defect, is_present: bool) -> Result<(), Unsupported> {
        match defect {
            Defect::BlockedJoint => self.defects.is_blocked = is_present,
            Defect::ShortFeedback => self.defects.is_short = is_present,
            Defect::Alarm { code } => self.fail(code),
            Defect::TorqueOff => self.stop(),
            Defect::EncoderJump { distance } => self.offset -= distance * self.parameters.shaft_per_joint,
            Defect::OperationModeDisplay { mode } if self.shows_mode() => {
                self.defects.shown_mode = is_present.then(|| ShownMode::of_number(mode));
            }
            Defect::OperationModeDisplay { .. } => {
                let reason = "the replies of this drive do not show its mode";
                return Err(Unsupported { defect, reason });
            }
            Defect::StuckBrake
            | Defect::SilentSdoServer
            | Defect::OtherObjectMapped
            | Defect::Statusword { .. }
            | Defect::Disobedience(_)
            | Defect::Emergency { .. } => {
                let reason =
                    "a drive of bit fields has no brake, no objects, no statusword and no emergency messages";
                return Err(Unsupported { defect, reason });
            }
        }
        Ok(())
    }
}
