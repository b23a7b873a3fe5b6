//! What can be asked of the controller and of its groups. Why it may be rejected is in `rejection`.

use crate::capacity::MAX_AXES;
use crate::cia402::OperationMode;
use crate::frame::Id;
use crate::pdo::{MAX_OBJECTS, MAX_PDOS, MappedObject, TransmissionType};
use crate::profile::ProfileTarget;
use crate::source::CallbackRun;
use crate::stop_category::StopCategory;
use crate::time::Nanoseconds;

/// The number of a request, never given twice, whoever asks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct RequestId(pub u64);

/// A request with the number by which whoever asked finds out what came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct RequestEnvelope<const AXES: usize = MAX_AXES> {
    /// The number.
    pub id: RequestId,
    /// Who it is for.
    pub target: RequestTarget,
    /// The request.
    pub request: Request<AXES>,
}

/// Who a request is for. What concerns the controller as a whole (SYNC, the time of day, the end), and what names its axis, is
/// the same whoever it is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum RequestTarget {
    /// Every group: all of them do it, or none. A motion of several groups does not exist: where there is more than one,
    /// [`Request::Move`], [`Request::Stream`] and the like must name theirs.
    #[default]
    All,
    /// The group with this number.
    Group(u8),
}

/// What can be asked.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[expect(clippy::large_enum_variant, reason = "there is no heap to put the large ones on")]
pub enum Request<const AXES: usize = MAX_AXES> {
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
        /// Object 6072 in thousandths of that: the torque to which the drive limits itself, if it has told.
        limit_per_mille: Option<u16>,
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
    /// Leave [`Phase::Passive`](crate::Phase::Passive): begin to send set-points, with the drives disabled.
    Activate,
    /// Go back to [`Phase::Passive`](crate::Phase::Passive), from disabled: the host brings the drives up again, and asks for
    /// [`Request::Activate`] then, whether that has succeeded or not. What they have reported is forgotten, and they start in the mode of
    /// operation of the parameters. A latched fault stays. Groups with axes of the same node do it together. Until
    /// [`Request::ConfirmBringUp`], enabling and changes of the mode are refused.
    BringUp,
    /// Allow enabling and changes of the mode after [`Request::BringUp`] and [`Request::Activate`]: every drive is configured and reports. A
    /// host whose bring-up has failed does not send it.
    ConfirmBringUp,
    /// Bring every drive to operation enabled; set-points follow the actual positions until it is.
    Enable,
    /// Move to a target, now: a move under way is re-planned from where it is.
    Move(Move<AXES>),
    /// Give a drive in a profile mode a target. The group is moving until all its targets are reached, and as long as a
    /// velocity or a torque is wanted.
    SetProfileTarget(ProfileMove),
    /// Change the mode of operation of drives. The group must be disabled; or where the drive takes another mode at any time
    /// ([`ModeCondition::AtRest`](crate::ModeCondition::AtRest)), it may hold its position, with its joints at rest on their
    /// set-points. It is a motion by its answer: finished when the drives show their new modes. A drive that does not in time is a
    /// fault, and is told its former mode again. Until then the group is still in the phase that it was in, and takes nothing but a
    /// stop and [`Request::Disable`]. A stop that takes the power ends the change.
    ChangeMode(ModeChange<AXES>),
    /// Follow [`HostInterface::stream`](crate::HostInterface::stream). A command that was written before counts, unless it has
    /// expired by the cycle that takes this request up.
    Stream,
    /// Carry out a trajectory of the host: see [`HostInterface::trajectory`](crate::HostInterface::trajectory).
    Execute {
        /// Which.
        trajectory: TrajectoryId,
        /// When it begins.
        start: ExecutionStart,
    },
    /// Let a callback of the host lead the group: see [`HostInterface::callback`](crate::HostInterface::callback). It may take the place
    /// of another one.
    RunCallback(CallbackRun),
    /// Stop by this category.
    Stop(StopCategory),
    /// Bring every drive to ready to switch on, decelerating first if need be.
    Disable,
    /// Clear latched faults: raise controlword bit 7 for some cycles. Refused while any drive is enabled.
    ResetFaults,
    /// Refuse to enable and to change modes from now on, whoever asks, and end a change that is under way: the run is ending, and the drives' watchdogs are about to be switched off.
    InhibitEnable,
    /// Leave the loop after this cycle. The drives get no more set-points.
    Shutdown,
}

impl<const AXES: usize> Request<AXES> {
    /// What it is, without its parameters.
    pub const fn kind(&self) -> RequestKind {
        match self {
            Self::Sync(_) => RequestKind::Sync,
            Self::TimeOfDay { .. } => RequestKind::TimeOfDay,
            Self::RatedTorque { .. } => RequestKind::RatedTorque,
            Self::ProcessData(_) => RequestKind::ProcessData,
            Self::Position { .. } => RequestKind::Position,
            Self::Activate => RequestKind::Activate,
            Self::BringUp => RequestKind::BringUp,
            Self::ConfirmBringUp => RequestKind::ConfirmBringUp,
            Self::Enable => RequestKind::Enable,
            Self::Move(_) => RequestKind::Move,
            Self::SetProfileTarget(_) => RequestKind::SetProfileTarget,
            Self::ChangeMode(_) => RequestKind::ChangeMode,
            Self::Stream => RequestKind::Stream,
            Self::Execute { .. } => RequestKind::Execute,
            Self::RunCallback(_) => RequestKind::RunCallback,
            Self::Stop(_) => RequestKind::Stop,
            Self::Disable => RequestKind::Disable,
            Self::ResetFaults => RequestKind::ResetFaults,
            Self::InhibitEnable => RequestKind::InhibitEnable,
            Self::Shutdown => RequestKind::Shutdown,
        }
    }
}

/// The number under which the host has a trajectory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct TrajectoryId(pub u64);

/// When a trajectory begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum ExecutionStart {
    /// In this cycle. The group must hold its position, and the trajectory must begin there.
    Now,
    /// In place of another trajectory, where that one is at a later cycle.
    After {
        /// The present trajectory.
        trajectory: TrajectoryId,
        /// So many cycles of the present trajectory are carried out before.
        cycles: u64,
        /// True if it is the same motion, at another speed along its path. Otherwise it replaces that motion.
        is_same_motion: bool,
    },
}

/// The process data of one axis, to replace what it was set up with.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
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
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct MappedPdo {
    /// The identifier.
    pub id: Id,
    /// When it is sent, if by us.
    pub transmission: TransmissionType,
    /// What it carries, in order.
    pub objects: [Option<MappedObject>; MAX_OBJECTS],
}

/// A coordinated move of every axis, to rest unless a velocity is given.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Move<const AXES: usize = MAX_AXES> {
    /// Where to (rad or m), an axis each.
    pub target: [f64; AXES],
    /// Velocity at the target (rad/s or m/s). A move that ends in motion goes over into a stop at the limits, for which there
    /// must be room within the position limits.
    pub target_velocity: [f64; AXES],
    /// Fraction of each axis' velocity limit, above 0 up to 1.
    pub velocity_scale: f64,
    /// Fraction of each axis' acceleration (and jerk) limit, above 0 up to 1.
    pub acceleration_scale: f64,
    /// The move takes at least this long.
    pub minimum_duration_s: f64,
}

/// Other modes of operation for the axes of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct ModeChange<const AXES: usize = MAX_AXES> {
    /// The mode for each axis, by its number; `None` leaves it as it is. What is there for axes of other groups does not count.
    pub modes: [Option<OperationMode>; AXES],
}

/// A target for one drive in a profile mode.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct ProfileMove {
    /// The axis.
    pub axis: u8,
    /// Where to, how fast, or how strongly.
    pub target: ProfileTarget,
    /// When a velocity or a torque that is not zero expires; after that the group stops. A position does not expire.
    pub valid_until_ns: Nanoseconds,
}

/// What was asked for, without its parameters: [`Request::kind`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub enum RequestKind {
    /// SYNC on or off.
    Sync = 0,
    /// The time of day.
    TimeOfDay = 1,
    /// The rated torque of a drive.
    RatedTorque = 2,
    /// The process data of a drive.
    ProcessData = 3,
    /// Where a drive is.
    Position = 4,
    /// The beginning of set-points.
    Activate = 5,
    /// Enabling.
    Enable = 6,
    /// A move.
    Move = 7,
    /// A target for a drive in a profile mode.
    SetProfileTarget = 8,
    /// The beginning of a stream.
    Stream = 9,
    /// A stop.
    Stop = 10,
    /// Disabling.
    Disable = 11,
    /// A fault reset.
    ResetFaults = 12,
    /// Enabling is to be refused from now on.
    InhibitEnable = 13,
    /// The end of the loop.
    Shutdown = 14,
    /// A trajectory.
    Execute = 15,
    /// A callback.
    RunCallback = 16,
    /// Another mode of operation.
    ChangeMode = 17,
    /// Another bring-up of the drives.
    BringUp = 18,
    /// The end of another bring-up that has succeeded.
    ConfirmBringUp = 19,
}

impl RequestKind {
    /// Every kind, in the order of their numbers.
    pub const ALL: [Self; 20] = [
        Self::Sync,
        Self::TimeOfDay,
        Self::RatedTorque,
        Self::ProcessData,
        Self::Position,
        Self::Activate,
        Self::Enable,
        Self::Move,
        Self::SetProfileTarget,
        Self::Stream,
        Self::Stop,
        Self::Disable,
        Self::ResetFaults,
        Self::InhibitEnable,
        Self::Shutdown,
        Self::Execute,
        Self::RunCallback,
        Self::ChangeMode,
        Self::BringUp,
        Self::ConfirmBringUp,
    ];
}
