//! The door between the real-time thread and everything else: a handful of bounded, lock-free channels, seen from
//! inside as this one trait. No call waits; a full channel drops, and says so.

use crate::axis::{MAX_PDOS, TransmissionType};
use crate::cia402;
use crate::frame::{Frame, Id};
use crate::motion_reports::MotionReports;
use crate::pdo::{MAX_OBJECTS, MappedObject};
use crate::plan;
use crate::port::{BusHealth, Received};
use crate::profile::ProfileTarget;
use crate::record::{CycleRecord, Event, MAX_AXES, MAX_BUSES};
use crate::refusal::{Answers, RequestKind};
use crate::stop::{Phase, StopCategory, StopReason};
use crate::time::Nanoseconds;
use crate::watch::TimingLevel;

/// What the real-time thread asks of and tells the outside.
pub trait HostInterface {
    /// The oldest request that waits.
    fn request(&mut self) -> Option<RequestEnvelope>;

    /// The newest streamed command, if one has come since the last call.
    fn stream(&mut self) -> Option<StreamCommand>;

    /// The oldest service frame (NMT, SDO …) that waits to be sent on this bus.
    fn service_frame(&mut self, bus: usize) -> Option<Frame>;

    /// Hands over a frame that is not process data. Returns whether there was room.
    fn received(&mut self, bus: usize, frame: &Received) -> bool;

    /// Hands over the record of a cycle. Returns whether there was room.
    fn record(&mut self, record: &CycleRecord) -> bool;

    /// Hands over an event. Returns whether there was room.
    fn event(&mut self, event: &Event) -> bool;

    /// Shows the present state to whoever looks.
    fn publish(&mut self, snapshot: &Snapshot);
}

/// The number of a request, never given twice, whoever asks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RequestId(pub u64);

/// A request with the number by which whoever asked finds out what came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RequestEnvelope {
    /// The number.
    pub id: RequestId,
    /// The request.
    pub request: Request,
}

/// What can be asked of the group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// Begin to send SYNC (`true`) or cease (`false`).
    Sync(bool),
    /// The time of day at zero of the cycle's clock, for TIME: nanoseconds after the beginning of 1984-01-01 UTC.
    TimeOfDay {
        /// ns
        at_zero_ns: u64,
    },
    /// Use what the drive has reported about itself. Refused while any drive may have torque.
    RatedTorque {
        /// The axis.
        axis: u8,
        /// Object 6076 in N·m (N for a linear axis).
        torque: f64,
    },
    /// Exchange this process data with an axis' drive, as the drive has reported it, before anything moves.
    ProcessData(AxisProcessData),
    /// Where the drive has said that it is, for as long as it has not reported it by process data: nothing is sent to a
    /// drive of which this is not known.
    Position {
        /// The axis.
        axis: u8,
        /// Object 6064 in counts.
        counts: i32,
    },
    /// Leave [`Phase::Passive`]: begin to send set-points, with the drives disabled.
    Activate,
    /// Bring every drive to operation enabled; set-points follow the actual positions until it is.
    Enable,
    /// Move to a target, now: a move under way is re-planned from where it is.
    Move(Move),
    /// Give a drive in a profile mode a target. The group is moving until all its targets are reached, and as long as a
    /// velocity or a torque is wanted.
    SetProfileTarget(ProfileMove),
    /// Follow [`HostInterface::stream`].
    Stream,
    /// Stop by this category.
    Stop(StopCategory),
    /// Bring every drive to ready to switch on, decelerating first if need be.
    Disable,
    /// Clear latched faults: raise controlword bit 7 for some cycles. Refused while any drive is enabled.
    ResetFaults,
    /// Enable nothing any more, whoever asks for it: the run is on its way out, and the drives' watchdogs are to be switched
    /// off.
    InhibitEnable,
    /// Leave the loop after this cycle. The drives get no more set-points.
    Shutdown,
}

impl Request {
    /// What it is, without its parameters.
    pub const fn kind(&self) -> RequestKind {
        match self {
            Self::Sync(_) => RequestKind::Sync,
            Self::TimeOfDay { .. } => RequestKind::TimeOfDay,
            Self::RatedTorque { .. } => RequestKind::RatedTorque,
            Self::ProcessData(_) => RequestKind::ProcessData,
            Self::Position { .. } => RequestKind::Position,
            Self::Activate => RequestKind::Activate,
            Self::Enable => RequestKind::Enable,
            Self::Move(_) => RequestKind::Move,
            Self::SetProfileTarget(_) => RequestKind::SetProfileTarget,
            Self::Stream => RequestKind::Stream,
            Self::Stop(_) => RequestKind::Stop,
            Self::Disable => RequestKind::Disable,
            Self::ResetFaults => RequestKind::ResetFaults,
            Self::InhibitEnable => RequestKind::InhibitEnable,
            Self::Shutdown => RequestKind::Shutdown,
        }
    }
}

/// The process data of one axis, to replace what it was set up with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisProcessData {
    /// The axis.
    pub axis: u8,
    /// What is sent, in order.
    pub commands: [Option<MappedPdo>; MAX_PDOS],
    /// What is expected each cycle of the bus.
    pub feedback: [Option<MappedPdo>; MAX_PDOS],
    /// What the drive sends beside that.
    pub unused: [Option<Id>; MAX_PDOS],
}

/// A PDO by its mapping parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MappedPdo {
    /// The identifier.
    pub id: Id,
    /// When it is sent, if by us.
    pub cadence: TransmissionType,
    /// What it carries, in order.
    pub objects: [Option<MappedObject>; MAX_OBJECTS],
}

/// A coordinated move of every axis, to rest unless a velocity is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// A number of the caller's, shown in [`Snapshot::finished_move`] when the move is done.
    pub id: u32,
    /// Where to (rad or m), an axis each.
    pub target: [f64; MAX_AXES],
    /// Velocity at the target (rad/s or m/s). A move that ends in motion goes over into a stop at the limits, for which there
    /// must be room within the position limits.
    pub target_velocity: [f64; MAX_AXES],
    /// Fraction of each axis' velocity limit, above 0 up to 1.
    pub velocity_scale: f64,
    /// Fraction of each axis' acceleration (and jerk) limit, above 0 up to 1.
    pub acceleration_scale: f64,
    /// The move takes at least this long.
    pub minimum_duration_s: f64,
}

/// A target for one drive in a profile mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileMove {
    /// A number of the caller's, shown in [`Snapshot::finished_move`] when the target has been reached.
    pub id: u32,
    /// The axis.
    pub axis: u8,
    /// Where to, how fast, or how strongly.
    pub target: ProfileTarget,
    /// When a velocity or a torque that is not zero expires; after that the group stops. A position does not expire.
    pub valid_until_ns: Nanoseconds,
}

/// One streamed set-point for every axis, with the time at which it loses its meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StreamCommand {
    /// When this command expires; after that the group decelerates and holds.
    pub valid_until_ns: Nanoseconds,
    /// Position, velocity and acceleration, an axis each. The position counts; the others are fed forward as far as they
    /// agree with its steps and the limits.
    pub set_points: [plan::State; MAX_AXES],
}

/// The state of the controller after a cycle, for any number of observers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// The slot that it describes.
    pub slot: u64,
    /// The time at which it was made.
    pub at_ns: Nanoseconds,
    /// What the group is doing.
    pub phase: Phase,
    /// Slots that passed unused since the start.
    pub missed_slots: u64,
    /// How late the controller has been of late.
    pub timing: TimingLevel,
    /// Set-points of streams that were replaced by the nearest ones within the limits, since the start.
    pub clamped: u64,
    /// Events and records that found no room, since the start.
    pub dropped: u64,
    /// Requests that were refused, since the start.
    pub refused: u64,
    /// What became of the last requests.
    pub answers: Answers,
    /// What became of the last motions.
    pub motions: MotionReports,
    /// The number of the last finished move; 0 before the first.
    pub finished_move: u32,
    /// Planned time left of the present move or stop, in seconds.
    pub remaining_s: f64,
    /// Why the group stopped or is stopping; `None` again after it has been re-enabled.
    pub stop: Option<StopReason>,
    /// How many of `axes` count.
    pub axis_count: u8,
    /// The axes in the order of the configuration.
    pub axes: [AxisSnapshot; MAX_AXES],
    /// How many of `buses` count.
    pub bus_count: u8,
    /// The buses in the order of the configuration.
    pub buses: [BusHealth; MAX_BUSES],
}

impl Default for Snapshot {
    fn default() -> Self {
        Self {
            slot: 0,
            at_ns: 0,
            phase: Phase::default(),
            missed_slots: 0,
            timing: TimingLevel::Normal,
            clamped: 0,
            dropped: 0,
            refused: 0,
            answers: Answers::default(),
            motions: MotionReports::default(),
            finished_move: 0,
            remaining_s: 0.0,
            stop: None,
            axis_count: 0,
            axes: [AxisSnapshot::default(); MAX_AXES],
            bus_count: 0,
            buses: [BusHealth::default(); MAX_BUSES],
        }
    }
}

/// One axis after a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisSnapshot {
    /// Set-point (rad or m).
    pub position_set: f64,
    /// Actual position (rad or m).
    pub position: f64,
    /// Actual velocity (rad/s or m/s).
    pub velocity: f64,
    /// Object 6041.
    pub statusword: u16,
    /// What it says of the drive.
    pub drive_state: cia402::DriveState,
    /// Object 603F or the code of the last emergency message.
    pub error_code: u16,
    /// Whether the drive has reported since the controller became active.
    pub is_heard: bool,
    /// SYNCs, or set-points where it answers these, that the drive has left without an answer, or has not answered yet. One that stays so may have been lost, or
    /// every answer since then comes so many cycles late: that is looked into whenever the group is enabled.
    pub unanswered: u16,
}
