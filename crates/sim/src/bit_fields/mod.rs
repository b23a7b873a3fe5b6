//! Drives that are spoken to by bit fields, simulated from the description of their make: hollow-shaft motors, and every drive with a
//! description file.
//!
//! A drive takes commands and frames with a meaning of their own, and answers each with a reply, as late as its description says. Without
//! commands it continues with the last one, unless a register has a time-out. It forgets with its power what is not stored.

mod bits;
mod can_simple;
mod current_loop;
mod registers;
mod shaft;

use std::collections::VecDeque;
use std::f64::consts::TAU;

use takt_rt::{
    CommandValue, DriveState, FieldMode, Frame, FrameFormat, FrameKind, ModeCodes, Nanoseconds,
    OperationMode, OwnFrame, PositionReference, ReplyValue,
};

use can_simple::{CanSimple, Condition, Deed};

use super::defect::{Defect, Unsupported, shorter};
use super::drive::{Drive, DriveFault, NodeState, Observation};
use super::mailbox::Mailbox;
use super::motion::{Actual, Generator};
use super::plant::{Gravity, Joint, JointParameters};
use super::servo::{LoopFactors, Servo};
use current_loop::CurrentLoop;
use registers::{Asked, RegisterAnswer, RegisterServer};
pub use shaft::{Command, Reply};
use takt_wire::bit_fields::{
    BesideTargetKind, DescribedLifeCycle, DescribedScan, FieldDevice, FieldUnit, FixedFrame, RegisterRole,
    ReplyMoment, Setting, SetupFrame, Zeroing,
};

/// The period of the drive's loops.
const STEP_NS: Nanoseconds = 125_000;
const STEP_S: f64 = STEP_NS as f64 * 1e-9;
/// Commands further apart are not those of a cycle.
const LONGEST_PERIOD_S: f64 = 0.1;
const TEMPERATURE: f64 = 30.0;
/// Answers that wait at most.
const MAX_ANSWERS: usize = 32;

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
    /// The bit rates of its bus, in the arbitration and in the data phase, where they are known.
    pub bit_rates: Option<[u32; 2]>,
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

/// Something that is under way to the master.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Answer {
    due_ns: Nanoseconds,
    told: Told,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Told {
    /// The reply as it is when it leaves.
    Reply,
    Frame(Frame),
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
    /// The device in them is as the registers have set it.
    parameters: FieldSimulationParameters,
    /// The motor ID that it listens to now.
    motor_id: u8,
    orders: Vec<(FixedFrame, Order)>,
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
    /// When it reports by itself.
    report_ns: Option<Nanoseconds>,
    /// What is under way to the master, in the order in which it was asked for.
    answers: VecDeque<Answer>,
    /// When it last heard a frame that was meant for it.
    heard_ns: Nanoseconds,
    registers: RegisterServer,
    can_simple: Option<CanSimple>,
    heartbeat_ns: Option<Nanoseconds>,
    ready_ns: Nanoseconds,
    stepped_ns: Nanoseconds,
}

impl FieldSimulation {
    /// A drive whose supply is switched on at time 0.
    pub fn new(parameters: FieldSimulationParameters) -> Self {
        let FieldSimulationParameters { device, motor_id, joint, .. } = &parameters;
        let (orders, mode) = (orders(device), device.description.modes.first().copied());
        let fixed = |setup: &SetupFrame| (*setup, device.fixed(&setup.frame, *motor_id), false);
        let mut drive = Self {
            motor_id: *motor_id,
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
            report_ns: None,
            answers: VecDeque::with_capacity(MAX_ANSWERS),
            heard_ns: 0,
            registers: RegisterServer::new(device, *motor_id, parameters.bit_rates),
            can_simple: device.description.speaks_can_simple.then(|| CanSimple::new(*motor_id)),
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
        self.answers.clear();
        self.registers.boot();
        self.adopt_registers();
        if let Some(can_simple) = &mut self.can_simple {
            can_simple.boot();
        }
        self.setup.iter_mut().for_each(|(_, _, is_taken)| *is_taken = false);
        // It forgets every gain with its power.
        self.factors = LoopFactors::PRESET;
        self.servo.set_factors(self.factors);
        self.current_loop = CurrentLoop::default();
        self.ready_ns = now_ns.saturating_add(self.parameters.power_up_ns);
        self.report_ns = match self.parameters.device.description.reply_moment {
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
        if self.parameters.device.description.forgets_command {
            self.command = None;
        }
        let is_cleared_by_stop = !self.orders.iter().any(|(_, order)| *order == Order::Clear);
        if self.power == Power::On || is_cleared_by_stop {
            self.power = Power::Off;
        }
        self.torque = 0.0;
    }

    fn zero(&mut self) {
        let zeroing = self.parameters.device.description.zeroing;
        if zeroing == Zeroing::WhenStopped && self.power != Power::Off {
            return;
        }
        self.offset += self.shaft();
        if zeroing == Zeroing::WithTarget {
            if let Some(command) = &mut self.command {
                command.position = 0.0;
            }
            self.rest();
        }
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Start => self.start(),
            Order::Stop => self.stop(),
            Order::Zero => self.zero(),
            Order::Clear if self.power != Power::On => self.power = Power::Off,
            Order::Clear if self.parameters.device.description.clear_stops => self.stop(),
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
        let command = Command::read(&self.parameters.device, payload);
        self.follow(now_ns, command);
    }

    fn follow(&mut self, now_ns: Nanoseconds, mut command: Command) {
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
            if let Some((longest_ns, error)) = self.registers.time_out()
                && self.power == Power::On
                && self.stepped_ns.saturating_sub(self.heard_ns) > longest_ns
            {
                self.fail(error);
            }
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
        let torque_limit = limit(CommandValue::Torque, command.torque * per_joint);
        let velocity_limit = limit(CommandValue::Velocity, command.velocity / per_joint);
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
        let FieldSimulationParameters { device, shaft_per_joint, .. } = &self.parameters;
        let reply_id = device.reply_id(self.motor_id);
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
            motor_id: self.motor_id,
        };
        let frame = reply.frame(device, reply_id)?;
        let length = device.description.bytes_before_setup.filter(|_| !self.is_set_up());
        match length.and_then(|length| frame.payload().get(..length)) {
            Some(payload) => Frame::data(reply_id, payload).ok(),
            None => Some(if self.defects.is_short { shorter(frame) } else { frame }),
        }
    }

    /// The heartbeat that is due. Each byte of it is the lowest that the description allows.
    fn take_heartbeat(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        let due_ns = self.heartbeat_ns.filter(|due_ns| *due_ns <= now_ns)?;
        let device = &self.parameters.device;
        let heartbeat = device.description.heartbeat?;
        self.heartbeat_ns = Some(due_ns.saturating_add(heartbeat.period_ns));
        if self.can_simple.is_some() {
            return CanSimple::heartbeat(&self.condition());
        }
        let bytes: Vec<u8> = match &device.description.scan {
            Some(DescribedScan::Heartbeat(scan)) => scan.bytes.iter().map(|range| *range.start()).collect(),
            Some(DescribedScan::Registers(_)) | None => vec![0; heartbeat.bytes],
        };
        Frame::data(device.id(&heartbeat.id, self.motor_id), &bytes).ok()
    }

    /// What the messages of CAN Simple show.
    fn condition(&self) -> Condition {
        let FieldSimulationParameters { device, shaft_per_joint, .. } = &self.parameters;
        let torque = self.torque / shaft_per_joint;
        Condition {
            node: self.motor_id,
            runs: self.power == Power::On,
            error: match self.power {
                Power::Fault(code) => Some(code),
                Power::Off | Power::On => None,
            },
            position: self.shaft() / TAU,
            velocity: self.joint.velocity() * shaft_per_joint / TAU,
            torque,
            current: torque / device.settings.get(Setting::TorqueConstant).unwrap_or(1.0),
            temperature: TEMPERATURE,
        }
    }

    /// Does what a message of CAN Simple asks.
    fn do_deed(&mut self, now_ns: Nanoseconds, deed: Deed) {
        let mut command = self.command.unwrap_or(Command { position: self.shaft(), ..Command::default() });
        match deed {
            Deed::Position(position, velocity, torque) => {
                (command.position, command.velocity, command.torque) =
                    (position * TAU, velocity * TAU, torque);
            }
            Deed::Velocity(velocity, torque) => {
                (command.velocity, command.torque) = (velocity * TAU, torque);
            }
            Deed::Torque(torque) => command.torque = torque,
            Deed::Start => return self.obey(Order::Start),
            Deed::Stop => return self.obey(Order::Stop),
            Deed::Clear => return self.obey(Order::Clear),
            Deed::Mode(mode) => return self.obey(Order::Mode(mode)),
            Deed::Fail(error) => return self.fail(error),
            Deed::Place(turns) => {
                self.offset += self.shaft() - turns * TAU;
                return self.rest();
            }
            Deed::Reboot => return self.boot(now_ns),
            Deed::Node(node) => {
                self.motor_id = node;
                return;
            }
            Deed::Send(frame) => return self.promise(now_ns, self.delay_ns(), Told::Frame(frame)),
            Deed::Nothing => return,
        }
        self.follow(now_ns, command);
    }

    fn delay_ns(&self) -> Nanoseconds {
        match self.parameters.device.description.reply_moment {
            ReplyMoment::AfterCommand { delay_ns } => delay_ns.max(1),
            ReplyMoment::Cyclic { .. } => 1,
        }
    }

    /// Sends something later. More than fits is lost, as in a drive that is asked faster than it can send.
    fn promise(&mut self, now_ns: Nanoseconds, delay_ns: Nanoseconds, told: Told) {
        if self.answers.len() < MAX_ANSWERS {
            let last_ns = self.answers.back().map_or(0, |answer| answer.due_ns);
            let due_ns = now_ns.saturating_add(delay_ns).max(last_ns);
            self.answers.push_back(Answer { due_ns, told });
        }
    }

    /// Returns `true` if the drive answers a frame by its identifier alone.
    fn is_heard(&self, frame: &Frame) -> bool {
        let FieldDevice { description, .. } = &self.parameters.device;
        let device = &self.parameters.device;
        description.hears.iter().any(|id| device.id(id, self.motor_id) == frame.id())
    }

    /// The order of a frame.
    fn order(&self, frame: &Frame, is_heard: bool) -> Option<Order> {
        let is_it = |(described, _): &&(FixedFrame, Order)| {
            let own = self.parameters.device.fixed(described, self.motor_id);
            let has_payload = match is_heard {
                true => frame.payload().starts_with(&own.payload),
                false => frame.payload() == own.payload,
            };
            has_payload && (is_heard || own.id == frame.id())
        };
        self.orders.iter().find(is_it).map(|(_, order)| *order)
    }

    /// Returns `true` if a frame is the command of the mode. A drive that looks at identifiers alone takes a longer one, too.
    fn is_command(&self, frame: &Frame) -> bool {
        let FieldDevice { description, .. } = &self.parameters.device;
        let command = &description.command;
        let is_fd = command.format != FrameFormat::Classic;
        let (length, is_open) = (frame.payload().len(), !description.hears.is_empty());
        frame.id() == self.parameters.device.id(&command.id, self.motor_id)
            && (length == command.bytes || is_open && length > command.bytes)
            && (frame.is_fd() == is_fd || is_open)
    }

    /// Does what is asked of the registers, and answers it.
    fn answer(&mut self, now_ns: Nanoseconds, asked: Asked) {
        let delay_ns = self.delay_ns();
        let answer = match asked {
            Asked::Status => {
                self.promise(now_ns, delay_ns, Told::Reply);
                return;
            }
            Asked::Read { register } => {
                let live = self.live(register);
                self.registers.read(register, live)
            }
            Asked::Write { register, value } => {
                if self.registers.write(register, value) {
                    self.adopt_registers();
                }
                let live = self.live(register);
                self.registers.written(register, live)
            }
            Asked::Store if self.power == Power::On => None,
            Asked::Store => self.registers.store(),
        };
        let Some(RegisterAnswer { id, payload, bytes, extra_ns }) = answer else { return };
        let device = &self.parameters.device;
        let format = device.format(device.description.reply.format);
        let id = device.id(&id, self.motor_id);
        let frame = payload.get(..bytes).and_then(|payload| shaft::framed(id, format, payload));
        if let Some(frame) = frame {
            self.promise(now_ns, delay_ns.saturating_add(extra_ns), Told::Frame(frame));
        }
    }

    /// What a register shows that is measured.
    fn live(&self, register: u8) -> Option<f64> {
        match self.registers.role(register)? {
            RegisterRole::Position => Some(self.shaft()),
            RegisterRole::MotorPosition => Some(self.shaft() * self.registers.gear_ratio()),
            RegisterRole::Temperature => Some(TEMPERATURE),
            _ => None,
        }
    }

    /// Takes the numbers of the registers over.
    fn adopt_registers(&mut self) {
        let Some(adopted) = self.registers.adopted() else { return };
        self.motor_id = adopted.motor_id.unwrap_or(self.motor_id);
        if let Some(mode) = adopted.mode {
            self.change_description(mode);
        }
        for (setting, value, of_new) in self.registers.settings().into_iter().flatten() {
            match setting {
                Setting::VelocityLoopKp
                | Setting::VelocityLoopKi
                | Setting::CurrentLoopKp
                | Setting::CurrentLoopKi => self.multiply(setting, value / of_new),
                _ => self.parameters.device.settings.set(setting, value),
            }
        }
        if adopted.master_id.is_some() {
            self.parameters.device.settings.master_id = adopted.master_id;
        }
    }

    /// Puts what differs from mode to mode in the place of that of the mode before.
    fn change_description(&mut self, mode: u32) {
        let description = &mut self.parameters.device.description;
        let Some(DescribedScan::Registers(scan)) = &mut description.scan else { return };
        let other = description.other_modes.iter_mut().find(|other| other.mode_is == mode);
        let Some(other) = other.filter(|_| scan.mode_is != mode) else { return };
        std::mem::swap(&mut other.mode_is, &mut scan.mode_is);
        std::mem::swap(&mut other.command, &mut description.command);
        std::mem::swap(&mut other.modes, &mut description.modes);
        std::mem::swap(&mut other.beside_target, &mut description.beside_target);
        let needed = description.command.field(CommandValue::Torque).map(|field| field.scale.unit);
        self.mode = description.modes.first().copied().unwrap_or(self.mode);
        self.command = None;
        self.rest();
        let settings = &mut self.parameters.device.settings;
        // The axis does not say what only this mode needs.
        if needed == Some(FieldUnit::Amperes) && settings.get(Setting::TorqueConstant).is_none() {
            let most = self.registers.most_current();
            settings.set(Setting::CurrentFullScale, most);
            let shaft_torque = self.parameters.peak_torque / self.parameters.shaft_per_joint.abs();
            settings.set(Setting::TorqueConstant, shaft_torque / most);
        }
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
fn orders(device: &FieldDevice) -> Vec<(FixedFrame, Order)> {
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
    frames.all().map(|(name, frame)| (*frame, order(name))).collect()
}

impl Drive for FieldSimulation {
    fn node(&self) -> u8 {
        self.parameters.motor_id
    }

    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, _: &mut Mailbox) {
        let FieldDevice { description, .. } = &self.parameters.device;
        let is_deaf = description.is_deaf_until_reply && !self.answers.is_empty();
        let is_fd = description.command.format != FrameFormat::Classic;
        let is_foreign = frame.is_fd() && !is_fd;
        if now_ns < self.ready_ns || is_deaf || is_foreign || !self.registers.is_on_bus() {
            return;
        }
        self.run_until(now_ns);
        let condition = self.condition();
        if let Some(can_simple) = &mut self.can_simple {
            if let Some(deed) = can_simple.take(&condition, frame) {
                self.do_deed(now_ns, deed);
            }
            return;
        }
        if frame.kind() == FrameKind::Remote {
            return;
        }
        if let Some(asked) = self.registers.asked(&self.parameters.device, frame, self.motor_id) {
            self.answer(now_ns, asked);
            return;
        }
        let is_heard = self.is_heard(frame);
        if is_heard {
            self.heard_ns = now_ns;
        }
        let is_answered = if let Some(order) = self.order(frame, is_heard) {
            self.obey(order);
            true
        } else if self.is_command(frame) {
            self.take_command(now_ns, frame.payload());
            true
        } else {
            self.take_setup(frame) || is_heard
        };
        if is_answered
            && let ReplyMoment::AfterCommand { .. } = self.parameters.device.description.reply_moment
        {
            self.promise(now_ns, self.delay_ns(), Told::Reply);
        }
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_until(now_ns);
        while let Some(Answer { told, .. }) = self.answers.pop_front_if(|answer| answer.due_ns <= now_ns) {
            let frame = match told {
                Told::Reply => self.reply(),
                Told::Frame(frame) => Some(frame),
            };
            if let Some(frame) = frame {
                mailbox.push(frame);
            }
        }
        if let ReplyMoment::Cyclic { period_ns } = self.parameters.device.description.reply_moment
            && let Some(due_ns) = self.report_ns.filter(|due_ns| *due_ns <= now_ns)
        {
            if let Some(frame) = self.reply() {
                mailbox.push(frame);
            }
            self.report_ns = Some(due_ns.saturating_add(period_ns));
        }
        if let Some(frame) = self.take_heartbeat(now_ns) {
            mailbox.push(frame);
        }
    }

    fn wake_ns(&self) -> Nanoseconds {
        let step_ns = self.stepped_ns + STEP_NS;
        [self.answers.front().map(|answer| answer.due_ns), self.report_ns, self.heartbeat_ns]
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
        // Its count of turns does not outlive the power: it finds itself within half a turn of its zero, which is that of its encoder
        // unless it stores it.
        if self.parameters.device.description.zeroing != Zeroing::WithTarget {
            self.offset = 0.0;
        }
        let turns = self.shaft() / TAU;
        self.offset += turns.round() * TAU;
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
