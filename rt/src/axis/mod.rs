//! One axis: what its drive reported, where it is to be, and the numbers that go onto the wire.

mod command;
mod delay;
mod feedback;
mod parameters;
mod position_watch;
mod profile_mode;
mod punctuality;
mod rest;
mod service;
mod set_point;

use arrayvec::ArrayVec;

use self::delay::SetPointDelay;

use crate::cia402::{State as DriveState, controlword};
use crate::guard::{FollowingErrorGuard, StreamCommands};
use crate::pdo::{CommandSlot, FeedbackSlot, ProcessImage};
use crate::plan::State;
use crate::profile::{ProfileCommand, ProfileTarget};
use crate::record::AxisRecord;
use crate::time::Nanoseconds;
use crate::watch::{DuplicateWatch, NodeWatch};

use position_watch::PositionWatch;
use punctuality::Punctuality;
use service::ServiceCommand;
use set_point::Following;

pub use feedback::Jump;
pub use parameters::{AxisParameters, Cadence, CommandPdo, FeedbackSince, MAX_PDOS, Pdo};

/// Cycles of its bus after which a drive has obeyed a controlword and has said so.
const SETTLED_CYCLES: u32 = 4;

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
    /// The commands of the present stream, and what its set-points follow.
    stream: StreamCommands,
    following: Following,
    profile: ProfileCommand,
    /// What `profile` stands for; `None` before the first target since the drive was enabled.
    profile_target: Option<ProfileTarget>,
    /// When a velocity or a torque expires.
    profile_until_ns: Nanoseconds,
    position_watch: PositionWatch,
    /// Where the joint is believed to be, in counts too, and how fast.
    position: f64,
    position_counts: i32,
    velocity: f64,
    /// What arrived before this is no feedback of the present cycle.
    expected_since_ns: Nanoseconds,
    /// The same of the cycle of the last report; 0 before the first one.
    asked_ns: Nanoseconds,
    /// Which feedback PDOs have come since then, a bit each.
    arrived: u8,
    age: u16,
    /// The period of its bus.
    cycle_s: f64,
    /// Time since the feedback before.
    span_s: f64,
    /// The last such time between two feedbacks: slots that are missed make it longer than a cycle.
    last_span_s: f64,
    is_heard: bool,
    /// Cycles in which a drive in profile position has stood before its target.
    stalled_cycles: u32,
    /// Reports in a row that the joint stands, since the last stop began.
    standing_reports: u32,
    /// What the statuswords have shown, see [`Axis::drive_state`].
    state: DriveState,
    /// Statuswords in a row that do not show operation enabled, after one that did.
    contradictions: u8,
    /// Whether the drive left operation enabled by itself and must not be led back to it.
    is_lost: bool,
    /// Whether the node takes no process data any more, see [`Axis::notice_deafness`].
    is_deaf: bool,
    service: ServiceCommand,
    /// Whether it may be led up, see [`Axis::prepare_to_enable`].
    is_ready: bool,
    /// The last report of the joint where it cannot have got to, if none was believed since.
    jump: Option<Jump>,
    /// Whether `position` is what the drive has said.
    is_position_known: bool,
    emergency_code: u16,
    /// See [`Axis::is_being_reset`].
    is_being_reset: bool,
    /// Cycles since an emergency message came.
    since_emergency: Option<u8>,
    node_watch: NodeWatch,
    duplicate_watch: DuplicateWatch,
    punctuality: Punctuality,
    /// Whether the next set-point is left out, and whether that of this cycle is.
    is_next_left_out: bool,
    is_left_out: bool,
    following_error: f64,
    following_guard: FollowingErrorGuard,
    /// Bits 0 to 3 and 7 of the last controlword.
    base_word: u16,
    since_controlword: u32,
    is_controlword_due: bool,
    /// See [`Axis::is_led_up`].
    is_led_up: bool,
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
            stream: StreamCommands::default(),
            following: Following::Commands,
            profile: ProfileCommand::default(),
            profile_target: None,
            profile_until_ns: 0,
            position_watch: PositionWatch::default(),
            position: 0.0,
            position_counts: 0,
            velocity: 0.0,
            expected_since_ns: 0,
            asked_ns: 0,
            arrived: 0,
            age: 0,
            cycle_s: 0.0,
            span_s: 0.0,
            last_span_s: 0.0,
            is_heard: false,
            state: DriveState::NotReadyToSwitchOn,
            stalled_cycles: 0,
            standing_reports: 0,
            contradictions: 0,
            is_lost: false,
            is_deaf: false,
            service: ServiceCommand::default(),
            is_ready: false,
            jump: None,
            is_position_known: false,
            emergency_code: 0,
            is_being_reset: false,
            since_emergency: None,
            node_watch: NodeWatch::default(),
            duplicate_watch: DuplicateWatch::default(),
            punctuality: Punctuality::default(),
            is_next_left_out: false,
            is_left_out: false,
            following_error: 0.0,
            following_guard,
            base_word: 0,
            since_controlword: 0,
            is_controlword_due: false,
            is_led_up: false,
            torque_set: 0.0,
        }
    }

    /// What does not change.
    pub fn parameters(&self) -> &AxisParameters {
        &self.parameters
    }

    /// Takes over the period of the axis' bus.
    pub fn set_cycle(&mut self, cycle_s: f64) {
        self.cycle_s = cycle_s;
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

    /// Begins to watch the node anew.
    pub fn begin_watch(&mut self) {
        self.is_lost = false;
        self.is_deaf = false;
        self.is_ready = false;
        self.node_watch.begin();
        self.duplicate_watch = DuplicateWatch::default();
        self.punctuality.forget_findings();
        self.since_emergency = None;
    }

    /// Lets a slot pass for what is watched over time.
    pub fn watch(&mut self) {
        self.watch_stall();
        self.node_watch.pass();
        self.duplicate_watch.pass();
        self.since_emergency = self.since_emergency.map(|cycles| cycles.saturating_add(1));
    }

    /// The drive has left operation enabled by itself: it is not led back to it before it is watched anew.
    pub fn give_up(&mut self) {
        self.is_lost = true;
    }

    /// The drive has no torque, or is not waited for any longer: its set-point follows the joint again.
    pub fn let_go(&mut self) {
        self.is_lost = false;
    }

    /// Looks whether the drive may be led up: it has been disabled long enough for nothing older to be under way in either
    /// direction, its reports come in their own cycle, and its joint is at rest on the set-point. That remains so until the
    /// node is watched anew.
    pub fn prepare_to_enable(&mut self, period_s: f64) {
        self.is_ready |= self.age == 0
            && self.punctuality.is_punctual()
            && !self.drive_state().has_torque()
            && self.base_word == controlword::SHUTDOWN
            && self.since_controlword >= SETTLED_CYCLES
            && self.is_settled()
            && self.is_on_joint(period_s);
    }

    /// Whether the drive may be led up.
    pub fn is_ready(&self) -> bool {
        self.is_ready
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
            position_raw: self.feedback.feedback(FeedbackSlot::Position),
        };
    }
}
