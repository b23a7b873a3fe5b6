//! One axis: what its drive reported, where it is to be, and the numbers that go onto the wire.

mod delay;
mod profile_mode;

use arrayvec::ArrayVec;

use self::delay::SetPointDelay;

use crate::cia402::{Goal, State as DriveState, controlword};
use crate::control::{ControlLaw, LoopInput};
use crate::dialect::Dialect;
use crate::frame::{Frame, Id};
use crate::guard::{self, AxisLimits, Course, FollowingErrorGuard, OnViolation, Violation};
use crate::pdo::{CommandSlot, FeedbackSlot, Mapping, ProcessImage, TooShort};
use crate::plan::State;
use crate::profile::{ProfileCommand, ProfileTarget};
use crate::record::AxisRecord;
use crate::stop::Rule;
use crate::time::Nanoseconds;
use crate::units::Scale;
use crate::watch::{DuplicateWatch, NodeComplaint, NodeWatch};

/// A joint that seems faster than this many times its velocity limit has not moved: its encoder, or its drive's report,
/// is wrong. The counts are for limits so low that a count is more than they allow in a cycle.
const IMPLAUSIBLE_SPEED: f64 = 4.0;
const IMPLAUSIBLE_COUNTS: f64 = 64.0;
/// A fault shows in the statusword within this many slots of the emergency message that announces it.
const EMERGENCY_GRACE_CYCLES: u8 = 3;
/// The PDOs that a CANopen drive has in each direction here.
pub const MAX_PDOS: usize = 4;

/// A PDO: its identifier and its compiled mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct Pdo {
    /// The identifier.
    pub id: Id,
    /// What it carries.
    pub mapping: Mapping,
}

/// When a command is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cadence {
    /// In every cycle of its bus.
    EveryCycle,
    /// When the controlword changes, and again while the drive does not follow it.
    OnControlword,
}

/// A PDO that is sent to the drive.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandPdo {
    /// What.
    pub pdo: Pdo,
    /// When.
    pub cadence: Cadence,
}

impl CommandPdo {
    /// One that is sent in every cycle of its bus.
    pub const fn every_cycle(pdo: Pdo) -> Self {
        Self { pdo, cadence: Cadence::EveryCycle }
    }
}

/// Everything about an axis that does not change while it runs.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisParameters {
    /// The bus, an index into the engine's buses.
    pub bus: u8,
    /// The node number.
    pub node: u8,
    /// What is sent, in order.
    pub commands: ArrayVec<CommandPdo, MAX_PDOS>,
    /// What is expected each cycle of the bus.
    pub feedback: ArrayVec<Pdo, MAX_PDOS>,
    /// Identifiers of process data that the drive sends beside that, which carries nothing new.
    pub unused: ArrayVec<Id, MAX_PDOS>,
    /// How it speaks.
    pub dialect: Dialect,
    /// Cycles of the bus from one controlword to the next on the way to operation enabled; 0 where the drive shows how
    /// far it has come.
    pub controlword_spacing_cycles: u32,
    /// How it is commanded.
    pub law: ControlLaw,
    /// SI to drive units.
    pub scale: Scale,
    /// What it may never be asked to do.
    pub limits: AxisLimits,
    /// How far from the joint a stream may begin (rad or m).
    pub start_tolerance: f64,
    /// What is done with set-points of a stream that break a limit.
    pub on_violation: OnViolation,
    /// Slots without a heartbeat of the node that are allowed; `None` where it sends none.
    pub heartbeat_timeout_cycles: Option<u32>,
    /// Following error that is allowed at any time (rad or m).
    pub following_error_limit: f64,
    /// Cycles in a row that the following error may be larger.
    pub following_error_cycles: u32,
    /// Cycles of the bus in a row without feedback that are bridged.
    pub missed_feedback_cycles: u16,
}

/// An axis at run time.
#[derive(Clone, Debug)]
pub struct Axis {
    parameters: AxisParameters,
    command: ProcessImage,
    feedback: ProcessImage,
    /// Set-points, newest first: of this cycle, the last, and the one before.
    set: [State; 3],
    /// Those that wait until the axes on slower buses are as far.
    delay: SetPointDelay,
    /// The same of the cycles in which they were sent.
    sent: [State; 3],
    profile: ProfileCommand,
    /// What `profile` stands for; `None` before the first target since the drive was enabled.
    profile_target: Option<ProfileTarget>,
    /// When a velocity or a torque expires.
    profile_until_ns: Nanoseconds,
    position: f64,
    position_raw: i32,
    velocity: f64,
    /// Which feedback PDOs have come since the last command phase, a bit each.
    arrived: u8,
    age: u16,
    /// Time since the feedback before.
    span_s: f64,
    /// The last such time between two feedbacks.
    cycle_s: f64,
    is_heard: bool,
    /// Cycles in which a drive in profile position has stood before its target.
    stalled_cycles: u32,
    /// What the statuswords have shown, see [`Axis::drive_state`].
    state: DriveState,
    /// Statuswords in a row that do not show operation enabled, after one that did.
    contradictions: u8,
    /// Whether the drive left operation enabled by itself and must not be led back to it.
    is_lost: bool,
    /// How far the joint has jumped between two reports, where no joint can.
    jump: Option<f64>,
    /// Whether `position_raw` is what the drive has said.
    is_position_known: bool,
    emergency_code: u16,
    /// Cycles since an emergency message came.
    since_emergency: Option<u8>,
    node_watch: NodeWatch,
    duplicate_watch: DuplicateWatch,
    following_error: f64,
    following_guard: FollowingErrorGuard,
    /// Bits 0 to 3 and 7 of the last controlword.
    base_word: u16,
    since_controlword: u32,
    is_controlword_due: bool,
    torque_set: f64,
}

impl Axis {
    /// An axis that has heard nothing yet.
    pub fn new(parameters: AxisParameters) -> Self {
        let following_guard =
            FollowingErrorGuard::new(parameters.following_error_limit, parameters.following_error_cycles);
        let mut command = ProcessImage::default();
        command.set(CommandSlot::OperationMode, parameters.law.operation_mode() as i32);
        Self {
            parameters,
            command,
            feedback: ProcessImage::default(),
            set: [State::default(); 3],
            delay: SetPointDelay::default(),
            sent: [State::default(); 3],
            profile: ProfileCommand::default(),
            profile_target: None,
            profile_until_ns: 0,
            position: 0.0,
            position_raw: 0,
            velocity: 0.0,
            arrived: 0,
            age: 0,
            span_s: 0.0,
            cycle_s: 0.0,
            is_heard: false,
            state: DriveState::NotReadyToSwitchOn,
            stalled_cycles: 0,
            contradictions: 0,
            is_lost: false,
            jump: None,
            is_position_known: false,
            emergency_code: 0,
            since_emergency: None,
            node_watch: NodeWatch::default(),
            duplicate_watch: DuplicateWatch::default(),
            following_error: 0.0,
            following_guard,
            base_word: 0,
            since_controlword: 0,
            is_controlword_due: false,
            torque_set: 0.0,
        }
    }

    /// What does not change.
    pub fn parameters(&self) -> &AxisParameters {
        &self.parameters
    }

    /// Uses the rated torque that the drive has reported (N·m, or N). Nonsense changes nothing.
    pub fn set_rated_torque(&mut self, torque: f64) -> bool {
        match self.parameters.scale.with_rated_torque(torque) {
            Ok(scale) => {
                self.parameters.scale = scale;
                true
            }
            Err(_) => false,
        }
    }

    /// Exchanges other process data than it was set up for; before the first feedback.
    pub fn set_process_data(
        &mut self,
        commands: ArrayVec<CommandPdo, MAX_PDOS>,
        feedback: ArrayVec<Pdo, MAX_PDOS>,
    ) {
        self.parameters.commands = commands;
        self.parameters.feedback = feedback;
        self.arrived = 0;
    }

    /// Takes feedback PDO number `pdo` (from 0). One that is too short changes nothing.
    pub fn receive(&mut self, pdo: usize, frame: &Frame) -> Result<(), TooShort> {
        let Some(parameters) = self.parameters.feedback.get(pdo) else { return Ok(()) };
        parameters.mapping.unpack(frame.first_word(), frame.payload().len(), &mut self.feedback)?;
        let bit = 1 << (pdo & 7);
        if self.arrived & bit != 0 {
            self.duplicate_watch.again();
        }
        self.arrived |= bit;
        Ok(())
    }

    /// Takes the error code of an emergency message; 0 says that all errors are gone.
    pub fn receive_emergency(&mut self, code: u16) {
        self.emergency_code = code;
        self.since_emergency = (code != 0).then_some(0);
    }

    /// Takes the state in a boot-up message or heartbeat.
    pub fn receive_error_control(&mut self, state: u8) {
        self.node_watch.receive(state);
    }

    /// Begins to watch the node anew.
    pub fn begin_watch(&mut self) {
        self.is_lost = false;
        self.node_watch.begin();
        self.duplicate_watch = DuplicateWatch::default();
        self.since_emergency = None;
    }

    /// Lets a slot pass for what is watched over time.
    pub fn watch(&mut self) {
        self.watch_stall();
        self.node_watch.pass();
        self.duplicate_watch.pass();
        self.since_emergency = self.since_emergency.map(|cycles| cycles.saturating_add(1));
    }

    /// What the node's error control messages say against it.
    pub fn node_complaint(&self) -> Option<NodeComplaint> {
        self.node_watch.complaint(self.parameters.heartbeat_timeout_cycles)
    }

    /// Whether another node answers under the same number.
    pub fn is_duplicate(&self) -> bool {
        self.duplicate_watch.is_duplicate()
    }

    /// The code of an emergency message that the statusword has had time to explain by a fault.
    pub fn unexplained_emergency(&self) -> Option<u16> {
        self.since_emergency.filter(|cycles| *cycles >= EMERGENCY_GRACE_CYCLES).map(|_| self.emergency_code)
    }

    /// Lets time pass in a slot in which the axis' bus has no cycle.
    pub fn wait(&mut self, elapsed_s: f64) {
        self.span_s += elapsed_s;
    }

    /// Begins a command phase with what has arrived. `elapsed_s` is the time since the last slot.
    pub fn begin_cycle(&mut self, elapsed_s: f64) {
        self.span_s += elapsed_s;
        let expected = (1u8 << self.parameters.feedback.len().min(7)) - 1;
        if self.arrived & expected != expected {
            self.age = self.age.saturating_add(1);
            return;
        }
        let span_s = self.span_s;
        self.span_s = 0.0;
        self.cycle_s = span_s;
        self.arrived = 0;
        self.age = 0;
        let last = self.position;
        self.position_raw = self.feedback.feedback(FeedbackSlot::Position);
        self.position = self.parameters.scale.position_from_counts(self.position_raw);
        self.velocity = if self.reports(FeedbackSlot::Velocity) {
            self.parameters.scale.velocity_from_drive(self.feedback.feedback(FeedbackSlot::Velocity))
        } else if self.is_heard && span_s > 0.0 {
            (self.position - last) / span_s
        } else {
            0.0
        };
        let farthest = IMPLAUSIBLE_SPEED * self.parameters.limits.velocity * span_s
            + IMPLAUSIBLE_COUNTS / self.parameters.scale.resolution();
        let distance = (self.position - last).abs();
        self.jump = (self.is_heard && distance > farthest).then_some(distance);
        self.is_heard = true;
        self.notice_state();
        self.is_position_known = true;
        self.following_error = if self.is_profile() { 0.0 } else { self.sent[2].position - self.position };
    }

    /// Takes the position that the drive has reported otherwise than by process data, if there has been none.
    pub fn set_reported_position(&mut self, counts: i32) {
        if !self.is_heard {
            self.position_raw = counts;
            self.position = self.parameters.scale.position_from_counts(counts);
            self.is_position_known = true;
        }
    }

    fn reports(&self, slot: FeedbackSlot) -> bool {
        self.parameters.feedback.iter().any(|pdo| pdo.mapping.carries(slot))
    }

    /// Whether the drive has reported at all.
    pub fn is_heard(&self) -> bool {
        self.is_heard
    }

    /// Cycles since the drive last reported.
    pub fn feedback_age(&self) -> u16 {
        self.age
    }

    /// A drive that was enabled is taken for disabled only when it says so again: one false statusword would let its
    /// set-point follow the joint while the drive still obeys, and disable it. A fault counts at once.
    fn notice_state(&mut self) {
        let shown = self.parameters.dialect.state(self.statusword());
        let contradicts = self.state == DriveState::OperationEnabled
            && shown != DriveState::OperationEnabled
            && !shown.is_faulted();
        self.contradictions = if contradicts { self.contradictions.saturating_add(1) } else { 0 };
        if self.contradictions != 1 {
            self.state = shown;
        }
    }

    /// The drive's state by its statuswords.
    pub fn drive_state(&self) -> DriveState {
        self.state
    }

    /// The drive has left operation enabled by itself: it is not led back to it before it is watched anew.
    pub fn give_up(&mut self) {
        self.is_lost = true;
    }

    /// Whether the joint has jumped since the report before, and how far: rad (m).
    pub fn jump(&self) -> Option<f64> {
        self.jump.filter(|_| self.age == 0)
    }

    /// Object 6041 as last received.
    pub fn statusword(&self) -> u16 {
        self.feedback.feedback(FeedbackSlot::Statusword) as u16
    }

    /// Object 603F if it is reported, else the code of the last emergency message.
    pub fn error_code(&self) -> u16 {
        match self.feedback.feedback(FeedbackSlot::ErrorCode) as u16 {
            0 => self.emergency_code,
            code => code,
        }
    }

    /// The mode that the drive shows, if it reports one that differs from ours.
    pub fn foreign_mode(&self) -> Option<i8> {
        let shown = self.feedback.feedback(FeedbackSlot::OperationModeDisplay) as i8;
        let ours = self.parameters.law.operation_mode() as i8;
        (self.reports(FeedbackSlot::OperationModeDisplay) && shown != ours).then_some(shown)
    }

    /// Whether the drive follows set-points.
    pub fn is_enabled(&self) -> bool {
        self.drive_state() == DriveState::OperationEnabled && !self.is_lost
    }

    /// The newest set-point.
    pub fn set_point(&self) -> State {
        self.set[0]
    }

    /// The newest set-point, with velocity and acceleration as the steps of the positions give them.
    pub fn stepped(&self, period_s: f64) -> State {
        let [newest, last, before] = self.set.map(|state| state.position);
        let limits = &self.parameters.limits;
        let acceleration = ((newest - last) - (last - before)) / (period_s * period_s);
        let acceleration = acceleration.clamp(-limits.deceleration, limits.acceleration);
        // The step is what the velocity was in the middle of the cycle.
        let velocity = (newest - last) / period_s + acceleration * period_s / 2.0;
        State { position: newest, velocity: velocity.clamp(-limits.velocity, limits.velocity), acceleration }
    }

    /// The actual position (rad or m).
    pub fn position(&self) -> f64 {
        self.position
    }

    /// The actual velocity (rad/s or m/s).
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// Makes the actual position the set-point, as if it had always been.
    ///
    /// The set-point of an axis that has been given up stays where it was: nobody follows it, and nothing is to look like
    /// a step.
    pub fn follow_actual(&mut self) {
        if self.is_lost {
            self.set = [State { position: self.set[0].position, ..State::default() }; 3];
            self.delay.fill(self.set[0]);
            self.following_error = 0.0;
            return;
        }
        self.set = [State { position: self.position, ..State::default() }; 3];
        self.delay.fill(self.set[0]);
        self.sent = self.set;
        self.following_error = 0.0;
        self.following_guard.reset();
    }

    /// Checks the next set-point against the guard.
    pub fn check(&self, next: &State, period_s: f64) -> Result<(), Violation> {
        guard::check(&self.parameters.limits, period_s, self.set[1].position, self.set[0].position, next)
    }

    /// Checks the next set-point of a stream, beyond [`Axis::check`]. After a command that did not come and was bridged the
    /// jerk is not the stream's own, and is not judged.
    pub fn check_stream(&self, next: &State, period_s: f64, is_bridged: bool) -> Result<(), Violation> {
        let limits = &self.parameters.limits;
        let jerk = if is_bridged { f64::INFINITY } else { limits.jerk };
        guard::check_jerk(jerk, &self.course(next, period_s))?;
        guard::check_braking(limits, &self.course(next, period_s))
    }

    /// The set-point within the limits that is nearest to one of a stream.
    pub fn clamped(&self, next: &State, period_s: f64) -> State {
        guard::clamp(&self.parameters.limits, &self.course(next, period_s))
    }

    fn course(&self, next: &State, period_s: f64) -> Course {
        let sent = [self.set[0].position, self.set[1].position, self.set[2].position];
        Course { sent, next: next.position, period_s }
    }

    /// Checks that a stream begins where the joint is. What is no number is left to [`Axis::check`].
    pub fn check_start(&self, first: &State) -> Result<(), Violation> {
        let (distance, limit) = ((first.position - self.position).abs(), self.parameters.start_tolerance);
        if distance > limit {
            Err(Violation { rule: Rule::StartPose, value: distance, limit })
        } else {
            Ok(())
        }
    }

    /// Checks the following error of this cycle, if there was feedback.
    pub fn check_following(&mut self) -> Result<(), Violation> {
        if self.age > 0 { Ok(()) } else { self.following_guard.check(self.following_error) }
    }

    /// Has set-points wait for so many cycles before they are sent, for the axes on slower buses.
    pub fn delay_set_points(&mut self, cycles: u32) {
        self.delay.set(cycles);
    }

    /// Takes the next set-point. In a profile mode there is none: the target stays.
    pub fn advance(&mut self, next: State) {
        let next = if self.is_profile() { self.shown_set_point() } else { next };
        self.set = [next, self.set[0], self.set[1]];
        self.delay.push(next);
    }

    /// Writes the command of this cycle of the axis' bus: one step towards `goal`, unless another controlword is to be
    /// sent, and the target.
    pub fn command(&mut self, goal: Goal, other_word: Option<u16>) {
        let is_enabled = self.is_enabled();
        let word = other_word.unwrap_or_else(|| self.word_towards(goal));
        let is_repeated = self.parameters.controlword_spacing_cycles > 0
            && self.since_controlword >= self.parameters.controlword_spacing_cycles
            && is_enabled != (goal == Goal::Enabled);
        self.is_controlword_due = word != self.base_word || is_repeated;
        self.since_controlword =
            if self.is_controlword_due { 0 } else { self.since_controlword.saturating_add(1) };
        self.base_word = word;
        self.sent = [self.delay.due(), self.sent[0], self.sent[1]];

        let parameters = &self.parameters;
        let law = parameters.law;
        let raw = if !is_enabled {
            self.profile.rest(law.idle(self.position_raw));
            self.profile_target = None;
            self.torque_set = 0.0;
            // One that has been given up may still follow its target until it takes the controlword that disables it: a
            // position stays what it was, so that this is no step by the following error.
            let still_follows = self.is_lost
                && self.drive_state() == DriveState::OperationEnabled
                && law.target_slot() == CommandSlot::TargetPosition
                && !law.is_profile();
            if still_follows { self.command.command(law.target_slot()) } else { self.profile.target_raw() }
        } else if law.is_profile() {
            self.torque_set = match self.profile_target {
                Some(ProfileTarget::Torque(torque)) => torque,
                _ => 0.0,
            };
            self.profile.target_raw()
        } else {
            let input = LoopInput {
                set: self.sent[0],
                due: self.sent[2],
                position: self.position,
                velocity: self.velocity,
            };
            let (raw, torque) = law.target(&input, &parameters.scale, &parameters.limits);
            self.torque_set = torque;
            raw
        };
        self.command.set(law.target_slot(), raw);
        let mode_bits = if is_enabled { self.mode_bits() } else { 0 };
        self.command.set(CommandSlot::Controlword, (word | mode_bits).into());
    }

    /// The controlword that brings the drive one step nearer to `goal`.
    fn word_towards(&self, goal: Goal) -> u16 {
        let is_too_early = goal == Goal::Enabled
            && !self.is_enabled()
            && self.base_word != 0
            && self.since_controlword < self.parameters.controlword_spacing_cycles;
        if is_too_early {
            return self.base_word;
        }
        self.parameters.dialect.controlword(self.drive_state(), goal, self.base_word)
    }

    /// What the mode of operation adds to the controlword of an enabled drive.
    fn mode_bits(&mut self) -> u16 {
        let has_handshake = self.parameters.dialect.acknowledges_set_points();
        match self.parameters.law {
            ControlLaw::ProfilePosition if has_handshake => self.profile.position_bits(self.statusword()),
            ControlLaw::ProfilePosition => {
                self.profile.pass();
                controlword::BIT_5
            }
            ControlLaw::ProfileVelocity | ControlLaw::ProfileTorque => {
                self.profile.pass();
                0
            }
            // Interpolate (CiA 402-2, interpolated position mode).
            ControlLaw::Interpolated if has_handshake => controlword::BIT_4,
            _ => 0,
        }
    }

    /// The controlword that was written last.
    pub fn controlword(&self) -> u16 {
        self.command.command(CommandSlot::Controlword) as u16
    }

    /// The frames of this cycle's command; none while it is not known where the drive is.
    pub fn frames(&self) -> impl Iterator<Item = Frame> {
        let is_due = |command: &CommandPdo| {
            self.is_position_known && (command.cadence == Cadence::EveryCycle || self.is_controlword_due)
        };
        self.parameters.commands.iter().filter(move |command| is_due(command)).filter_map(|command| {
            let payload = command.pdo.mapping.pack(&self.command);
            Frame::data(command.pdo.id, payload.get(..command.pdo.mapping.length())?).ok()
        })
    }

    /// What this cycle leaves behind.
    pub fn record(&self, period_s: f64, record: &mut AxisRecord) {
        let torque = self.feedback.feedback(FeedbackSlot::Torque);
        *record = AxisRecord {
            position_set: self.set[0].position,
            position: self.position,
            drive_state: self.drive_state(),
            velocity_set: self.set[0].velocity as f32,
            acceleration_set: self.set[0].acceleration as f32,
            jerk_set: ((self.set[0].acceleration - self.set[1].acceleration) / period_s) as f32,
            velocity: self.velocity as f32,
            torque_set: self.torque_set as f32,
            torque: self.parameters.scale.torque_from_per_mille(torque) as f32,
            following_error: self.following_error as f32,
            controlword: self.controlword(),
            statusword: self.statusword(),
            error_code: self.error_code(),
            feedback_age: self.age,
            command_raw: self.command.command(self.parameters.law.target_slot()),
            position_raw: self.position_raw,
        };
    }
}
