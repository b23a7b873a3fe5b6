//! Why a request is rejected.

use crate::cia402::OperationMode;
use crate::frame::Id;
use crate::pdo::MappedObject;
use crate::phase::Phase;
use crate::request::RequestKind;
use crate::rule::Rule;

/// Why a request is rejected. Lengths in rad (m), velocities in rad/s (m/s), torques in N·m (N).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum RejectReason {
    /// It is not possible in the phase that the group is in.
    Phase,
    /// A fault has stopped the group and has not been reset.
    StopLatched {
        /// The rule that was broken.
        rule: Rule,
    },
    /// The run is ending: enabling is refused since [`Request::InhibitEnable`](crate::Request::InhibitEnable).
    EnableInhibited,
    /// Slots are missed too often for a stream.
    MissedSlots {
        /// Missed slots that are not yet forgiven.
        missed: u32,
        /// From so many on no stream begins.
        limit: u32,
    },
    /// There is no such axis.
    UnknownAxis {
        /// The number that was asked for.
        axis: u8,
        /// How many axes there are.
        axes: u8,
    },
    /// The axis is in a mode that takes no such target.
    WrongMode {
        /// The mode that it is in.
        mode: OperationMode,
    },
    /// A number is infinite or not a number.
    NotFinite {
        /// The number.
        value: f64,
    },
    /// A target lies outside the position limits.
    PositionLimit {
        /// The target.
        position: f64,
        /// The limit.
        limit: f64,
    },
    /// A velocity is beyond the limit.
    VelocityLimit {
        /// The velocity.
        velocity: f64,
        /// The limit.
        limit: f64,
    },
    /// A torque is beyond the limit.
    TorqueLimit {
        /// The torque.
        torque: f64,
        /// The limit.
        limit: f64,
    },
    /// A target is passed at a speed from which the axis comes to rest only outside the position limits.
    NoRoomToStop {
        /// Where it would come to rest.
        rest: f64,
        /// The limit.
        limit: f64,
    },
    /// The fraction of the velocity limits is not above 0 and up to 1.
    VelocityScale {
        /// The fraction.
        scale: f64,
    },
    /// The fraction of the acceleration limits is not above 0 and up to 1.
    AccelerationScale {
        /// The fraction.
        scale: f64,
    },
    /// The shortest duration is negative, or so long that no trajectory can be planned for it.
    MinimumDuration {
        /// The duration in seconds.
        duration_s: f64,
    },
    /// No trajectory within the limits leads there.
    NoTrajectory,
    /// A rated torque is not a positive number.
    RatedTorque {
        /// The torque.
        torque: f64,
    },
    /// No process data would be left in one direction.
    NoProcessData,
    /// A PDO maps too many objects.
    TooManyObjects,
    /// An object cannot be mapped.
    Mapping {
        /// The object.
        object: MappedObject,
    },
    /// An identifier is in use.
    IdTaken {
        /// The identifier.
        id: Id,
    },
    /// The frames of a cycle would not fit into one batch.
    TooManyFrames {
        /// How many frames the bus would need.
        frames: u16,
        /// How many fit.
        limit: u16,
    },
    /// The drives are not told the time of day.
    NoTime,
    /// The host has no trajectory under this number.
    UnknownTrajectory,
    /// A trajectory does not begin where the axis is, or not at its velocity and acceleration.
    StartMismatch {
        /// Where it begins.
        position: f64,
        /// Where the axis is then.
        present: f64,
    },
    /// The cycle at which a trajectory was to take the place of another one has passed, or that one is not under way.
    TooLate,
    /// Another trajectory is already to take the place of the present one.
    SuccessorPending,
    /// There is no such group.
    UnknownGroup {
        /// The number that was asked for.
        group: u8,
        /// How many groups there are.
        groups: u8,
    },
    /// It is for one group, there are several, and none is named.
    GroupNotNamed {
        /// How many groups there are.
        groups: u8,
    },
    /// The axis is in another group.
    OtherGroup {
        /// The group that was asked.
        asked: u8,
        /// The group that the axis is in.
        of_axis: u8,
    },
    /// The host has no callback under this number.
    UnknownCallback,
    /// The mode of the group is being changed.
    ModeChanging,
    /// The axis is not set up for this mode.
    UnknownMode {
        /// The mode that was asked for.
        mode: OperationMode,
    },
    /// The process data of the axis do not carry an object that the change of its mode needs.
    ObjectNotMapped {
        /// The object.
        object: MappedObject,
    },
    /// The drive takes another mode only while it is disabled.
    NotDisabled,
    /// The joint is not at rest.
    NotAtRest {
        /// How fast it is, or was a few cycles ago.
        velocity: f64,
    },
    /// The joint is at rest too far from its set-point: in another mode it would be pulled there in one step.
    OffSetPoint {
        /// How far.
        distance: f64,
        /// How far it may be.
        limit: f64,
    },
    /// The joint is beyond a wrap of its drive's position counter, or so far beyond its limits that it may as well be a lap of the counter
    /// away: the drive cannot be commanded where it is.
    BeyondCounter {
        /// Where it is, by what its drive has counted.
        position: f64,
        /// The nearest position limit.
        limit: f64,
    },
    /// The last bring-up of the group has failed, or has not been confirmed yet: see
    /// [`Request::ConfirmBringUp`](crate::Request::ConfirmBringUp).
    NotBroughtUp,
}

impl RejectReason {
    /// One of each, in the order of their numbers, with numbers of no meaning.
    pub const ALL: [Self; 38] = [
        Self::Phase,
        Self::StopLatched { rule: Rule::FollowingError },
        Self::EnableInhibited,
        Self::MissedSlots { missed: 1, limit: 2 },
        Self::UnknownAxis { axis: 1, axes: 2 },
        Self::WrongMode { mode: OperationMode::ProfilePosition },
        Self::NotFinite { value: 1.0 },
        Self::PositionLimit { position: 1.0, limit: 2.0 },
        Self::VelocityLimit { velocity: 1.0, limit: 2.0 },
        Self::TorqueLimit { torque: 1.0, limit: 2.0 },
        Self::NoRoomToStop { rest: 1.0, limit: 2.0 },
        Self::VelocityScale { scale: 1.0 },
        Self::AccelerationScale { scale: 1.0 },
        Self::MinimumDuration { duration_s: 1.0 },
        Self::NoTrajectory,
        Self::RatedTorque { torque: 1.0 },
        Self::NoProcessData,
        Self::Mapping { object: MappedObject::new(0x2000, 1, 16) },
        Self::IdTaken { id: Id::canopen(0x180, 1) },
        Self::NoTime,
        Self::TooManyObjects,
        Self::TooManyFrames { frames: 1, limit: 2 },
        Self::UnknownTrajectory,
        Self::StartMismatch { position: 1.0, present: 2.0 },
        Self::TooLate,
        Self::SuccessorPending,
        Self::UnknownGroup { group: 1, groups: 2 },
        Self::GroupNotNamed { groups: 2 },
        Self::OtherGroup { asked: 1, of_axis: 2 },
        Self::UnknownCallback,
        Self::ModeChanging,
        Self::UnknownMode { mode: OperationMode::CyclicSynchronousTorque },
        Self::ObjectNotMapped { object: MappedObject::new(0x6060, 0, 8) },
        Self::NotDisabled,
        Self::NotAtRest { velocity: 1.0 },
        Self::OffSetPoint { distance: 2.0, limit: 1.0 },
        Self::BeyondCounter { position: 2.0, limit: 1.0 },
        Self::NotBroughtUp,
    ];

    /// The number that stands for it in recordings.
    pub const fn number(&self) -> u8 {
        match self {
            Self::Phase => 0,
            Self::StopLatched { .. } => 1,
            Self::EnableInhibited => 2,
            Self::MissedSlots { .. } => 3,
            Self::UnknownAxis { .. } => 4,
            Self::WrongMode { .. } => 5,
            Self::NotFinite { .. } => 6,
            Self::PositionLimit { .. } => 7,
            Self::VelocityLimit { .. } => 8,
            Self::TorqueLimit { .. } => 9,
            Self::NoRoomToStop { .. } => 10,
            Self::VelocityScale { .. } => 11,
            Self::AccelerationScale { .. } => 12,
            Self::MinimumDuration { .. } => 13,
            Self::NoTrajectory => 14,
            Self::RatedTorque { .. } => 15,
            Self::NoProcessData => 16,
            Self::Mapping { .. } => 17,
            Self::IdTaken { .. } => 18,
            Self::NoTime => 19,
            Self::TooManyObjects => 20,
            Self::TooManyFrames { .. } => 21,
            Self::UnknownTrajectory => 22,
            Self::StartMismatch { .. } => 23,
            Self::TooLate => 24,
            Self::SuccessorPending => 25,
            Self::UnknownGroup { .. } => 26,
            Self::GroupNotNamed { .. } => 27,
            Self::OtherGroup { .. } => 28,
            Self::UnknownCallback => 29,
            Self::ModeChanging => 30,
            Self::UnknownMode { .. } => 31,
            Self::ObjectNotMapped { .. } => 32,
            Self::NotDisabled => 33,
            Self::NotAtRest { .. } => 34,
            Self::OffSetPoint { .. } => 35,
            Self::BeyondCounter { .. } => 36,
            Self::NotBroughtUp => 37,
        }
    }

    /// What was asked for and what is allowed, as two numbers for recordings; 0 where there is none.
    /// [`RejectReason::from_numbers`] is the way back.
    pub fn numbers(&self) -> (f64, f64) {
        match *self {
            Self::StopLatched { rule } => (f64::from(rule as u8), 0.0),
            Self::MissedSlots { missed, limit } => (missed.into(), limit.into()),
            Self::UnknownAxis { axis, axes } => (axis.into(), axes.into()),
            Self::WrongMode { mode } | Self::UnknownMode { mode } => ((mode as i8).into(), 0.0),
            Self::PositionLimit { position: value, limit }
            | Self::VelocityLimit { velocity: value, limit }
            | Self::TorqueLimit { torque: value, limit }
            | Self::NoRoomToStop { rest: value, limit }
            | Self::BeyondCounter { position: value, limit }
            | Self::OffSetPoint { distance: value, limit } => (value, limit),
            Self::VelocityScale { scale: value } | Self::AccelerationScale { scale: value } => (value, 1.0),
            Self::NotFinite { value }
            | Self::MinimumDuration { duration_s: value }
            | Self::NotAtRest { velocity: value }
            | Self::RatedTorque { torque: value } => (value, 0.0),
            Self::Mapping { object } | Self::ObjectNotMapped { object } => (object.parameter().into(), 0.0),
            Self::IdTaken { id } => (id.value().into(), 0.0),
            Self::TooManyFrames { frames, limit } => (frames.into(), limit.into()),
            Self::UnknownGroup { group, groups } => (group.into(), groups.into()),
            Self::GroupNotNamed { groups } => (groups.into(), 0.0),
            Self::OtherGroup { asked, of_axis } => (asked.into(), of_axis.into()),
            Self::StartMismatch { position, present } => (position, present),
            Self::UnknownTrajectory
            | Self::UnknownCallback
            | Self::ModeChanging
            | Self::NotDisabled
            | Self::NotBroughtUp
            | Self::TooLate
            | Self::SuccessorPending
            | Self::Phase
            | Self::EnableInhibited
            | Self::NoTrajectory
            | Self::NoProcessData
            | Self::TooManyObjects
            | Self::NoTime => (0.0, 0.0),
        }
    }

    /// The reason that these numbers stand for; `None` for numbers that no reason has.
    pub fn from_numbers(number: u8, asked: f64, allowed: f64) -> Option<Self> {
        Some(match number {
            0 => Self::Phase,
            1 => Self::StopLatched { rule: *Rule::ALL.get(asked as usize)? },
            2 => Self::EnableInhibited,
            3 => Self::MissedSlots { missed: asked as u32, limit: allowed as u32 },
            4 => Self::UnknownAxis { axis: asked as u8, axes: allowed as u8 },
            5 => Self::WrongMode { mode: OperationMode::from_number(asked as i8)? },
            6 => Self::NotFinite { value: asked },
            7 => Self::PositionLimit { position: asked, limit: allowed },
            8 => Self::VelocityLimit { velocity: asked, limit: allowed },
            9 => Self::TorqueLimit { torque: asked, limit: allowed },
            10 => Self::NoRoomToStop { rest: asked, limit: allowed },
            11 => Self::VelocityScale { scale: asked },
            12 => Self::AccelerationScale { scale: asked },
            13 => Self::MinimumDuration { duration_s: asked },
            14 => Self::NoTrajectory,
            15 => Self::RatedTorque { torque: asked },
            16 => Self::NoProcessData,
            17 => Self::Mapping { object: MappedObject::from_parameter(asked as u32) },
            18 => Self::IdTaken { id: Id::base(asked as u32).ok()? },
            19 => Self::NoTime,
            20 => Self::TooManyObjects,
            21 => Self::TooManyFrames { frames: asked as u16, limit: allowed as u16 },
            22 => Self::UnknownTrajectory,
            23 => Self::StartMismatch { position: asked, present: allowed },
            24 => Self::TooLate,
            25 => Self::SuccessorPending,
            26 => Self::UnknownGroup { group: asked as u8, groups: allowed as u8 },
            27 => Self::GroupNotNamed { groups: asked as u8 },
            28 => Self::OtherGroup { asked: asked as u8, of_axis: allowed as u8 },
            29 => Self::UnknownCallback,
            30 => Self::ModeChanging,
            31 => Self::UnknownMode { mode: OperationMode::from_number(asked as i8)? },
            32 => Self::ObjectNotMapped { object: MappedObject::from_parameter(asked as u32) },
            33 => Self::NotDisabled,
            34 => Self::NotAtRest { velocity: asked },
            35 => Self::OffSetPoint { distance: asked, limit: allowed },
            36 => Self::BeyondCounter { position: asked, limit: allowed },
            37 => Self::NotBroughtUp,
            _ => return None,
        })
    }
}

/// A request that was rejected. Nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct RequestError {
    /// What was asked for.
    pub request: RequestKind,
    /// Why it was rejected.
    pub reason: RejectReason,
    /// The axis concerned; `None` when it is not one axis.
    pub axis: Option<u8>,
    /// What the group was doing.
    pub phase: Phase,
}

impl core::fmt::Display for RejectReason {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::Phase => f.write_str("not possible in this phase"),
            Self::StopLatched { rule } => {
                write!(f, "a fault ({}) has stopped the group and must be reset first", rule.key())
            }
            Self::EnableInhibited => f.write_str("enabling is inhibited"),
            Self::MissedSlots { missed, limit } => {
                write!(f, "{missed} slots were missed of late; from {limit} on no stream begins")
            }
            Self::UnknownAxis { axis, axes } => write!(f, "there is no axis {axis}: there are {axes}"),
            Self::WrongMode { mode } => write!(f, "the axis is in {mode:?}, which takes no such target"),
            Self::NotFinite { value } => write!(f, "{value} is not a finite number"),
            Self::PositionLimit { position, limit } => {
                write!(f, "position {position} is beyond the limit of {limit}")
            }
            Self::VelocityLimit { velocity, limit } => {
                write!(f, "velocity {velocity} is beyond the limit of {limit}")
            }
            Self::TorqueLimit { torque, limit } => {
                write!(f, "torque {torque} is beyond the limit of {limit}")
            }
            Self::NoRoomToStop { rest, limit } => {
                write!(f, "the axis would come to rest at {rest}, beyond its limit of {limit}")
            }
            Self::VelocityScale { scale } | Self::AccelerationScale { scale } => {
                write!(f, "{scale} is not a fraction above 0 and up to 1")
            }
            Self::MinimumDuration { duration_s } => write!(f, "{duration_s} s is not a possible duration"),
            Self::NoTrajectory => f.write_str("no trajectory within the limits leads there"),
            Self::RatedTorque { torque } => write!(f, "{torque} is not a possible rated torque"),
            Self::NoProcessData => f.write_str("there would be no PDO in one direction"),
            Self::TooManyObjects => f.write_str("a PDO would have too many objects"),
            Self::Mapping { object } => {
                write!(f, "object {:04X}:{:02X} cannot be mapped", object.index, object.subindex)
            }
            Self::IdTaken { id } => write!(f, "identifier {id:?} is in use"),
            Self::TooManyFrames { frames, limit } => write!(f, "{frames} frames in a cycle; {limit} fit"),
            Self::NoTime => f.write_str("TIME is not sent"),
            Self::UnknownGroup { group, groups } => {
                write!(f, "there is no group {group}: there are {groups}")
            }
            Self::GroupNotNamed { groups } => write!(f, "it must name one of the {groups} groups"),
            Self::OtherGroup { asked, of_axis } => {
                write!(f, "the axis is in group {of_axis}, not in group {asked}")
            }
            Self::UnknownTrajectory => f.write_str("the host has no such trajectory"),
            Self::UnknownCallback => f.write_str("the host has no such callback"),
            Self::ModeChanging => f.write_str("the mode of operation is being changed"),
            Self::UnknownMode { mode } => write!(f, "the axis is not set up for {mode:?}"),
            Self::ObjectNotMapped { object } => {
                write!(f, "object {object} is not in the process data, and a change of the mode needs it")
            }
            Self::NotBroughtUp => f.write_str("the last bring-up has failed or is not confirmed"),
            Self::NotDisabled => f.write_str("the drive takes another mode only while it is disabled"),
            Self::NotAtRest { velocity } => {
                write!(f, "the joint is not at rest, or has not been for some cycles: {velocity}")
            }
            Self::OffSetPoint { distance, limit } => {
                write!(f, "the joint is {distance} from its set-point; at most {limit} is allowed")
            }
            Self::BeyondCounter { position, limit } => {
                write!(
                    f,
                    "the joint is at {position}, where the count of its drive may have wrapped; its limit is {limit}"
                )
            }
            Self::StartMismatch { position, present } => {
                write!(
                    f,
                    "the trajectory begins at {position} while the axis is at {present}, or not at its velocity"
                )
            }
            Self::TooLate => f.write_str("the cycle at which the trajectory was to begin has passed"),
            Self::SuccessorPending => {
                f.write_str("another trajectory is already to take the place of the present one")
            }
        }
    }
}

impl core::fmt::Display for RequestError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:?} was rejected in phase {:?}", self.request, self.phase)?;
        match self.axis {
            Some(axis) => write!(f, ", axis {axis}: {}", self.reason),
            None => write!(f, ": {}", self.reason),
        }
    }
}

impl core::error::Error for RequestError {}
