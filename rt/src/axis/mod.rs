//! One axis: what its drive reported, where it is to be, and the numbers that go onto the wire.
//!
//! The parts of an [`Axis`], a file each: `set_points` and `delay` (where it is to be), `torque_loop` (the torque where it is made here),
//! `mode` and `profile_mode` (the mode of its drive, and the target in a profile mode), `joint`, `plausibility`, `position_counter`,
//! `velocity_estimate` and `standstill` (where the joint is, and whether it has stopped), `measured` (whether it is beyond its limits),
//! `reception` and `late_reply` (which feedback has arrived, and in time), `drive_report` (state and errors), `power`, `controlword`,
//! `sdo_fallback` (the controlword when process data do not arrive). `parameters` and `exchange` do not change.
//!
//! What becomes of them: `feedback` (what the drive reports, in the cycle or outside of it), `stream` (what a source wants, and the set-points
//! that come of it), `next_set_point` (the guard), `profile_targets` (targets instead of set-points), `command` (the frames), `bit_fields` (the
//! same for a drive without PDOs), `mode_change`, `drive_power`, `sdo_stop`, `measured_limits`, `rest` (has the joint stopped).
//!
//! # Power
//!
//! The power of a drive, as it is commanded and confirmed, is one state with these transitions. A dash leaves the state as it is.
//! A drive that is latched off is Releasing, and its set-point is kept. Before its first report a drive is Releasing, too.
//!
//! | event | Off | Enabling | On | Releasing | NotReleased |
//! | --- | --- | --- | --- | --- | --- |
//! | [`Axis::begin_again`] | – | Releasing | Releasing | – | Releasing |
//! | [`Axis::begin_watch`] | Enabling | – | Enabling | Enabling | – |
//! | [`Axis::prepare_to_enable`], its conditions hold | – | On | – | – | – |
//! | [`Axis::latch_off`] | Releasing | Releasing | Releasing | – | Releasing |
//! | [`Axis::release_power`] | Releasing | Releasing | Releasing | – | – |
//! | [`Axis::settle_power`], the drive has confirmed that it has no torque | – | – | – | Off | Off |
//! | the same, it has not, and is overdue | – | – | – | NotReleased | – |
//! | some reports in a row show torque | NotReleased | – | – | – | – |

mod bit_fields;
mod command;
mod controlword;
mod delay;
mod drive_power;
mod drive_report;
mod exchange;
mod feedback;
mod joint;
mod late_reply;
mod measured;
mod measured_limits;
mod mode;
mod mode_change;
mod next_set_point;
mod off_cycle;
mod parameters;
mod plausibility;
mod position_counter;
mod power;
mod profile_mode;
mod profile_targets;
mod reception;
mod rest;
mod sdo_fallback;
mod sdo_stop;
mod set_points;
mod standstill;
mod stream;
mod torque_loop;
mod velocity_estimate;

use crate::bit_fields::FieldDrive;
use crate::cia402::OperationMode;
use crate::control::{ControlLaw, TrackingError};
use crate::frame::Frame;
use crate::guard::FollowingErrorGuard;
use crate::host::AxisSnapshot;
use crate::pdo::{CommandSlot, FeedbackSlot, FeedbackSlots, ProcessImage};
use crate::record::AxisRecord;
use crate::source::Follow;
use crate::watch::{DuplicateNodeDetector, NodeMonitor};

use controlword::ControlwordSender;
use drive_report::DriveReport;
use joint::JointEstimate;
use late_reply::{LateReplyDetector, SetPointSkip};
use measured::Measured;
use mode::Mode;
use power::Power;
use profile_mode::ProfileMode;
use reception::Reception;
use sdo_fallback::SdoFallback;
use set_points::SetPoints;
use torque_loop::TorqueLoop;

pub use exchange::{CommandPdo, Exchange, NoFeedback, Pdo, Pdos};
pub use joint::Jump;
pub use off_cycle::OffCycleReport;
pub use parameters::{
    AxisParameters, AxisParametersError, FeedForward, FeedbackSince, ModeChanges, ModeCondition, Supervision,
    TorqueLimits,
};
pub use position_counter::PositionCounter;

/// An axis at run time.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Axis {
    parameters: AxisParameters,
    /// The numbers that are sent, and those that were received.
    command: ProcessImage,
    feedback: ProcessImage,
    /// Which numbers the drive reports.
    reported_slots: FeedbackSlots,
    /// The life of a drive without PDOs.
    field_drive: FieldDrive,
    /// The frame of this cycle to such a drive.
    field_frame: Option<Frame>,
    /// What a drive that is spoken to outside of the cycle has told of its temperature: °C.
    off_cycle_temperature: Option<f32>,
    set_points: SetPoints,
    mode: Mode,
    /// The mode of operation in which the drive is brought up.
    first_mode: OperationMode,
    /// What is done with a target beyond the limits, by what leads the axis now.
    follow: Follow,
    /// Where the axis rests while a stream has run dry, or a callback commands nothing.
    stream_rest: f64,
    torque_loop: TorqueLoop,
    /// What the loops that are closed here go on with if the next feedback does not come.
    error_if_unheard: TrackingError,
    profile: ProfileMode,
    joint: JointEstimate,
    measured: Measured,
    /// The torque to which the drive limits itself (object 6072): N·m (N); infinite if it has not told.
    torque_limit_of_drive: f64,
    following: FollowingErrorGuard,
    reception: Reception,
    late_reply: LateReplyDetector,
    set_point_skip: SetPointSkip,
    /// True if a set-point, which requests the feedback, has been made since the last cycle of the bus.
    is_asked_by_set_point: bool,
    report: DriveReport,
    power: Power,
    controlwords: ControlwordSender,
    sdo_fallback: SdoFallback,
    node_monitor: NodeMonitor,
    duplicate_node: DuplicateNodeDetector,
    /// The torque that is commanded: N·m (N).
    torque_set: f64,
    number: u8,
}

impl Axis {
    /// The axis with this number, whose drive has reported nothing yet.
    pub fn new(number: u8, parameters: AxisParameters) -> Self {
        let following =
            FollowingErrorGuard::new(parameters.following_error_limit, parameters.following_error_cycles);
        let mut command = ProcessImage::default();
        let first_mode = parameters.law.operation_mode();
        command.set(CommandSlot::OperationMode, first_mode as i32);
        Self {
            reported_slots: parameters.exchange.reported_slots(),
            follow: parameters.follow,
            parameters,
            command,
            feedback: ProcessImage::default(),
            field_drive: FieldDrive::default(),
            field_frame: None,
            off_cycle_temperature: None,
            set_points: SetPoints::default(),
            mode: Mode::default(),
            first_mode,
            stream_rest: 0.0,
            torque_loop: TorqueLoop::default(),
            error_if_unheard: TrackingError::default(),
            profile: ProfileMode::default(),
            joint: JointEstimate::default(),
            measured: Measured::default(),
            torque_limit_of_drive: f64::INFINITY,
            following,
            reception: Reception::default(),
            late_reply: LateReplyDetector::default(),
            set_point_skip: SetPointSkip::default(),
            is_asked_by_set_point: false,
            report: DriveReport::default(),
            power: Power::default(),
            controlwords: ControlwordSender::default(),
            sdo_fallback: SdoFallback::default(),
            node_monitor: NodeMonitor::default(),
            duplicate_node: DuplicateNodeDetector::default(),
            torque_set: 0.0,
            number,
        }
    }

    /// Its number among the axes of the controller, in the order of the configuration.
    pub const fn number(&self) -> u8 {
        self.number
    }

    /// What is its own of what there is of every axis of the controller.
    pub fn own<T: Copy + Default>(&self, all: &[T]) -> T {
        all.get(usize::from(self.number)).copied().unwrap_or_default()
    }

    /// What does not change.
    pub fn parameters(&self) -> &AxisParameters {
        &self.parameters
    }

    /// Forgets what the drive has reported, but for that it has no torque, and goes back to the mode of operation in which it is brought up.
    /// Process data, units and the delay of its set-points stay.
    pub fn begin_again(&mut self) {
        self.return_to_first_mode();
        let (set_points, power) = (self.set_points.anew(), self.power.anew());
        let cycle_s = self.reception.cycle_s();
        *self = Self { set_points, power, ..Self::new(self.number, self.parameters.clone()) };
        self.set_cycle(cycle_s);
    }

    /// Takes over the period of the axis' bus.
    pub fn set_cycle(&mut self, cycle_s: f64) {
        self.reception.set_cycle(cycle_s, self.parameters.exchange.report_cycles());
    }

    /// Goes on with the parameters of another one of the same joint, but for the process data and the units: bring-up has told them.
    #[cfg(feature = "checkpoint")]
    pub(crate) fn take_parameters_of(&mut self, other: &Self) {
        let AxisParameters { exchange, scale, law, mode_changes, .. } = self.parameters.clone();
        self.parameters = AxisParameters { exchange, scale, law, mode_changes, ..other.parameters.clone() };
        self.take_laws_of(other);
        self.following.take_limit_of(&other.following);
    }

    /// Uses the rated torque that the drive has reported (N·m, or N), and the torque to which it limits itself, in thousandths of that.
    /// Nonsense changes nothing.
    pub fn set_rated_torque(&mut self, torque: f64, limit_per_mille: Option<u16>) -> bool {
        match self.parameters.scale.with_rated_torque(torque) {
            Ok(scale) => {
                self.torque_limit_of_drive = limit_per_mille
                    .map_or(f64::INFINITY, |limit| scale.torque_from_per_mille(limit.into()).abs());
                self.parameters.scale = scale;
                true
            }
            Err(_) => false,
        }
    }

    /// Returns `true` if the drive has PDOs.
    pub const fn has_pdos(&self) -> bool {
        matches!(self.parameters.exchange, Exchange::Pdos(_))
    }

    /// Returns `true` if the drive is spoken to outside of the cycle.
    pub const fn is_off_cycle(&self) -> bool {
        matches!(self.parameters.exchange, Exchange::OffCycle { .. })
    }

    /// Changes the process data that are exchanged; before the first feedback.
    pub fn set_process_data(&mut self, pdos: Pdos) {
        self.parameters.exchange = Exchange::Pdos(pdos);
        self.reported_slots = self.parameters.exchange.reported_slots();
        self.reception.drop_arrived();
    }

    /// Begins to watch the node anew: the group begins to enable its drives.
    pub fn begin_watch(&mut self) {
        self.begin_to_watch_power();
        self.node_monitor.begin();
        self.duplicate_node = DuplicateNodeDetector::default();
        self.late_reply.forget_findings();
        self.report.dismiss_emergency();
    }

    /// Lets a slot pass for what is watched over time. Comes after [`Axis::begin_cycle`] or [`Axis::wait`].
    #[inline]
    pub fn watch(&mut self) {
        self.watch_stall();
        if self.parameters.supervision.guard_cycles().is_none() {
            self.node_monitor.pass();
        }
        self.duplicate_node.pass();
        self.report.pass();
        if self.torque_loop.is_compliant() {
            self.following.restart();
        } else if self.feedback_age() == 0 {
            self.following.pass();
        }
    }

    /// Lets a slot pass in which the node has still to reply to node guarding.
    pub fn note_unanswered_guarding(&mut self) {
        self.node_monitor.pass();
    }

    /// Returns `true` if a fault that was there when the last reset began has been there ever since.
    pub fn is_being_reset(&self) -> bool {
        self.report.is_being_reset()
    }

    /// Shows the state to observers. `shown` keeps when the drive reported last.
    #[inline]
    pub(crate) fn show(&self, shown: &mut AxisSnapshot) {
        let set_point = self.set_point();
        // The values that depend on a condition come first, so that none of the others has to be kept meanwhile.
        *shown = AxisSnapshot {
            temperature: self.temperature(),
            is_confirmed_off: self.confirms_off(),
            feedback_age: self.cycles_since_report(),
            error_code: self.error_code(),
            torque: self.torque(),
            current_per_mille: self.current_per_mille(),
            mode: self.mode(),
            position_set: set_point.position,
            velocity_set: set_point.velocity,
            torque_set: self.torque_set,
            position: self.joint.position(),
            velocity: self.joint.velocity(),
            following_error: self.following.error(),
            mode_set: self.mode_set(),
            controlword: self.controlword(),
            statusword: self.statusword(),
            drive_state: self.drive_state(),
            is_heard: self.is_heard(),
            unanswered: self.unanswered(),
            feedback_slot: shown.feedback_slot,
            feedback_ns: shown.feedback_ns,
        };
    }

    /// What this cycle leaves behind, beside what is shown of it.
    #[inline]
    pub(crate) fn record(&self, period_s: f64, shown: &AxisSnapshot, record: &mut AxisRecord) {
        let torque = self.feedback.feedback(FeedbackSlot::Torque);
        let acceleration = self.set_point().acceleration;
        *record = AxisRecord {
            position_set: shown.position_set,
            position: shown.position,
            drive_state: shown.drive_state,
            velocity_set: shown.velocity_set as f32,
            acceleration_set: acceleration as f32,
            jerk_set: (self.set_points.acceleration_change() / period_s) as f32,
            velocity: shown.velocity as f32,
            torque_set: shown.torque_set as f32,
            torque: self.parameters.scale.torque_from_per_mille(torque) as f32,
            following_error: shown.following_error as f32,
            controlword: self.controlword(),
            statusword: shown.statusword,
            error_code: shown.error_code,
            feedback_age: shown.feedback_age,
            command_raw: self.command.command(self.parameters.law.target_slot()),
            position_raw: self.feedback.feedback(FeedbackSlot::Position),
        };
    }
}
