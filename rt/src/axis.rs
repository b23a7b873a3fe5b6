//! One axis: what its drive reported, where it is to be, and the numbers that go onto the wire.

use arrayvec::ArrayVec;

use crate::cia402::{self, State as DriveState};
use crate::control::{ControlLaw, LoopInput};
use crate::frame::{Frame, Id};
use crate::guard::{self, AxisLimits, FollowingErrorGuard, Violation};
use crate::pdo::{CommandSlot, FeedbackSlot, Mapping, ProcessImage, TooShort};
use crate::plan::State;
use crate::record::AxisRecord;
use crate::units::Scale;

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

/// Everything about an axis that does not change while it runs.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisParameters {
    /// The bus, an index into the engine's buses.
    pub bus: u8,
    /// The node number.
    pub node: u8,
    /// What is sent each cycle, in order.
    pub commands: ArrayVec<Pdo, MAX_PDOS>,
    /// What is expected each cycle.
    pub feedback: ArrayVec<Pdo, MAX_PDOS>,
    /// How it is commanded.
    pub law: ControlLaw,
    /// SI to drive units.
    pub scale: Scale,
    /// What it may never be asked to do.
    pub limits: AxisLimits,
    /// Following error that is allowed at any time (rad or m).
    pub following_error_limit: f64,
    /// Cycles in a row that the following error may be larger.
    pub following_error_cycles: u32,
    /// Cycles in a row without feedback that are bridged.
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
    position: f64,
    position_raw: i32,
    velocity: f64,
    /// Which feedback PDOs have come since the last command phase, a bit each.
    arrived: u8,
    age: u16,
    is_heard: bool,
    emergency_code: u16,
    following_error: f64,
    following_guard: FollowingErrorGuard,
    command_raw: i32,
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
            position: 0.0,
            position_raw: 0,
            velocity: 0.0,
            arrived: 0,
            age: 0,
            is_heard: false,
            emergency_code: 0,
            following_error: 0.0,
            following_guard,
            command_raw: 0,
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

    /// Takes feedback PDO number `pdo` (from 0). One that is too short changes nothing.
    pub fn receive(&mut self, pdo: usize, frame: &Frame) -> Result<(), TooShort> {
        let Some(parameters) = self.parameters.feedback.get(pdo) else { return Ok(()) };
        parameters.mapping.unpack(frame.first_word(), frame.payload().len(), &mut self.feedback)?;
        self.arrived |= 1 << (pdo & 7);
        Ok(())
    }

    /// Takes the error code of an emergency message; 0 says that all errors are gone.
    pub fn receive_emergency(&mut self, code: u16) {
        self.emergency_code = code;
    }

    /// Begins a command phase with what has arrived. `elapsed_s` is the time since the last one.
    pub fn begin_cycle(&mut self, elapsed_s: f64) {
        let expected = (1u8 << self.parameters.feedback.len().min(7)) - 1;
        if self.arrived & expected != expected {
            self.age = self.age.saturating_add(1);
            return;
        }
        let span_s = elapsed_s * f64::from(self.age.saturating_add(1));
        self.arrived = 0;
        self.age = 0;
        let last = self.position;
        self.position_raw = self.feedback.feedback(FeedbackSlot::Position);
        self.position = self.parameters.scale.position_from_counts(self.position_raw);
        self.velocity = if self.reports(FeedbackSlot::Velocity) {
            self.parameters.scale.velocity_from_counts(self.feedback.feedback(FeedbackSlot::Velocity))
        } else if self.is_heard && span_s > 0.0 {
            (self.position - last) / span_s
        } else {
            0.0
        };
        self.is_heard = true;
        self.following_error = self.set[2].position - self.position;
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

    /// The drive's state by its last statusword.
    pub fn drive_state(&self) -> DriveState {
        if self.is_heard { DriveState::decode(self.statusword()) } else { DriveState::NotReadyToSwitchOn }
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
        self.drive_state() == DriveState::OperationEnabled
    }

    /// The newest set-point.
    pub fn set_point(&self) -> State {
        self.set[0]
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
    pub fn follow_actual(&mut self) {
        self.set = [State { position: self.position, ..State::default() }; 3];
        self.following_error = 0.0;
        self.following_guard.reset();
    }

    /// Checks the next set-point against the guard.
    pub fn check(&self, next: &State, period_s: f64) -> Result<(), Violation> {
        guard::check(&self.parameters.limits, period_s, self.set[1].position, self.set[0].position, next)
    }

    /// Checks the following error of this cycle, if there was feedback.
    pub fn check_following(&mut self) -> Result<(), Violation> {
        if self.age > 0 { Ok(()) } else { self.following_guard.check(self.following_error) }
    }

    /// Takes the next set-point.
    pub fn advance(&mut self, next: State) {
        self.set = [next, self.set[0], self.set[1]];
    }

    /// Writes the command of this cycle: a controlword, and the target of an axis with or without torque.
    pub fn command(&mut self, controlword: u16, has_torque: bool) {
        self.command.set(CommandSlot::Controlword, controlword.into());
        (self.command_raw, self.torque_set) = if has_torque {
            let input = LoopInput {
                set: self.set[0],
                due: self.set[2],
                position: self.position,
                velocity: self.velocity,
            };
            let parameters = &self.parameters;
            parameters.law.command(&input, &parameters.scale, &parameters.limits, &mut self.command)
        } else {
            (self.parameters.law.idle(self.position_raw, &mut self.command), 0.0)
        };
    }

    /// The controlword that was written last.
    pub fn controlword(&self) -> u16 {
        self.command.command(CommandSlot::Controlword) as u16
    }

    /// The frames of this cycle's command.
    pub fn frames(&self) -> impl Iterator<Item = Frame> {
        self.parameters.commands.iter().filter_map(|pdo| {
            let payload = pdo.mapping.pack(&self.command);
            Frame::data(pdo.id, payload.get(..pdo.mapping.length())?).ok()
        })
    }

    /// What this cycle leaves behind.
    pub fn record(&self, period_s: f64, record: &mut AxisRecord) {
        let torque = self.feedback.feedback(FeedbackSlot::Torque);
        *record = AxisRecord {
            position_set: self.set[0].position,
            position: self.position,
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
            command_raw: self.command_raw,
            position_raw: self.position_raw,
        };
    }

    /// The controlword that brings the drive one step nearer to `goal`.
    pub fn controlword_towards(&self, goal: cia402::Goal) -> u16 {
        self.drive_state().controlword_towards(goal)
    }
}
