//! The rules that faults break: each with its word in configurations, its number in recordings, and its category of stop.

#[cfg(doc)]
use crate::fault::Fault;
use crate::stop_category::StopCategory;

/// What is broken by a fault, without the numbers: the key of a configuration and the number of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub enum Rule {
    /// The stop was asked for.
    Requested = 0,
    /// [`Fault::NotFinite`].
    NotFinite = 1,
    /// [`Fault::PositionLimit`].
    PositionLimit = 2,
    /// [`Fault::VelocityLimit`].
    VelocityLimit = 3,
    /// [`Fault::AccelerationLimit`].
    AccelerationLimit = 4,
    /// [`Fault::FollowingError`].
    FollowingError = 5,
    /// [`Fault::StaleCommand`] and [`Fault::StreamNotBegun`].
    StaleCommand = 6,
    /// [`Fault::MissedFeedback`] and [`Fault::LateFeedback`].
    MissedFeedback = 7,
    /// [`Fault::DriveFault`].
    DriveFault = 8,
    /// [`Fault::DriveDisabled`].
    DriveDisabled = 9,
    /// [`Fault::ModeChanged`].
    ModeChanged = 10,
    /// [`Fault::EnableTimeout`].
    EnableTimeout = 11,
    /// [`Fault::NoTrajectory`].
    NoTrajectory = 12,
    /// [`Fault::BusOff`] and [`Fault::BusDown`].
    BusLost = 13,
    /// [`Fault::NotTransmitted`].
    NotTransmitted = 14,
    /// [`Fault::NotAcknowledged`].
    NotAcknowledged = 15,
    /// [`Fault::NodeLost`].
    NodeLost = 16,
    /// [`Fault::NodeNotOperational`].
    NodeNotOperational = 17,
    /// [`Fault::UnexpectedBootUp`].
    UnexpectedBootUp = 18,
    /// [`Fault::EmergencyMessage`].
    EmergencyMessage = 19,
    /// [`Fault::DuplicateNode`].
    DuplicateNode = 20,
    /// [`Fault::ForeignMaster`].
    ForeignMaster = 21,
    /// [`Fault::TimingUnfit`].
    TimingUnfit = 22,
    /// [`Fault::StartPose`].
    StartPose = 23,
    /// [`Fault::JerkLimit`].
    JerkLimit = 24,
    /// [`Fault::BusErrorPassive`].
    BusErrorPassive = 25,
    /// [`Fault::ImplausibleFeedback`].
    ImplausibleFeedback = 26,
    /// [`Fault::CallbackOverrun`].
    CallbackOverrun = 27,
    /// [`Fault::CallbackPanicked`].
    CallbackPanicked = 28,
    /// [`Fault::NoTorqueInMode`].
    NoTorqueInMode = 29,
    /// [`Fault::StiffnessLimit`].
    StiffnessLimit = 30,
    /// [`Fault::DampingLimit`].
    DampingLimit = 31,
    /// [`Fault::ModeNotShown`].
    ModeNotShown = 32,
    /// [`Fault::NotDisabled`].
    NotDisabled = 33,
    /// [`Fault::DriveEnabled`].
    DriveEnabled = 34,
    /// [`Fault::DriveLocal`].
    DriveLocal = 35,
    /// [`Fault::MeasuredPosition`].
    MeasuredPosition = 36,
    /// [`Fault::MeasuredVelocity`].
    MeasuredVelocity = 37,
    /// [`Fault::MeasuredTorque`].
    MeasuredTorque = 38,
    /// [`Fault::NotAtRest`].
    NotAtRest = 39,
}

impl Rule {
    /// Every rule, in the order of their numbers.
    pub const ALL: [Self; 40] = [
        Self::Requested,
        Self::NotFinite,
        Self::PositionLimit,
        Self::VelocityLimit,
        Self::AccelerationLimit,
        Self::FollowingError,
        Self::StaleCommand,
        Self::MissedFeedback,
        Self::DriveFault,
        Self::DriveDisabled,
        Self::ModeChanged,
        Self::EnableTimeout,
        Self::NoTrajectory,
        Self::BusLost,
        Self::NotTransmitted,
        Self::NotAcknowledged,
        Self::NodeLost,
        Self::NodeNotOperational,
        Self::UnexpectedBootUp,
        Self::EmergencyMessage,
        Self::DuplicateNode,
        Self::ForeignMaster,
        Self::TimingUnfit,
        Self::StartPose,
        Self::JerkLimit,
        Self::BusErrorPassive,
        Self::ImplausibleFeedback,
        Self::CallbackOverrun,
        Self::CallbackPanicked,
        Self::NoTorqueInMode,
        Self::StiffnessLimit,
        Self::DampingLimit,
        Self::ModeNotShown,
        Self::NotDisabled,
        Self::DriveEnabled,
        Self::DriveLocal,
        Self::MeasuredPosition,
        Self::MeasuredVelocity,
        Self::MeasuredTorque,
        Self::NotAtRest,
    ];

    /// Its word in configurations and reports.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Requested => "requested",
            Self::NotFinite => "not_finite",
            Self::PositionLimit => "position_limit",
            Self::VelocityLimit => "velocity_limit",
            Self::AccelerationLimit => "acceleration_limit",
            Self::FollowingError => "following_error",
            Self::StaleCommand => "stale_command",
            Self::MissedFeedback => "missed_feedback",
            Self::DriveFault => "drive_fault",
            Self::DriveDisabled => "drive_disabled",
            Self::ModeChanged => "mode_changed",
            Self::EnableTimeout => "enable_timeout",
            Self::NoTrajectory => "no_trajectory",
            Self::BusLost => "bus_lost",
            Self::NotTransmitted => "not_transmitted",
            Self::NotAcknowledged => "not_acknowledged",
            Self::NodeLost => "node_lost",
            Self::NodeNotOperational => "node_not_operational",
            Self::UnexpectedBootUp => "unexpected_boot_up",
            Self::EmergencyMessage => "emergency_message",
            Self::DuplicateNode => "duplicate_node",
            Self::ForeignMaster => "foreign_master",
            Self::TimingUnfit => "timing_unfit",
            Self::StartPose => "start_pose",
            Self::JerkLimit => "jerk_limit",
            Self::BusErrorPassive => "bus_error_passive",
            Self::ImplausibleFeedback => "implausible_feedback",
            Self::CallbackOverrun => "callback_overrun",
            Self::CallbackPanicked => "callback_panicked",
            Self::NoTorqueInMode => "no_torque_in_mode",
            Self::StiffnessLimit => "stiffness_limit",
            Self::DampingLimit => "damping_limit",
            Self::ModeNotShown => "mode_not_shown",
            Self::NotDisabled => "not_disabled",
            Self::DriveEnabled => "drive_enabled",
            Self::DriveLocal => "drive_local",
            Self::MeasuredPosition => "measured_position",
            Self::MeasuredVelocity => "measured_velocity",
            Self::MeasuredTorque => "measured_torque",
            Self::NotAtRest => "not_at_rest",
        }
    }

    /// The stop that this rule asks for unless a configuration says otherwise. A drive that no longer obeys, or
    /// whose obedience cannot be seen, gets its power removed with the others' in a controlled stop; a bad
    /// command is a reason to stand still, not to drop the load onto the brakes.
    pub const fn default_category(self) -> StopCategory {
        match self {
            Self::Requested
            | Self::NotFinite
            | Self::PositionLimit
            | Self::VelocityLimit
            | Self::AccelerationLimit
            | Self::StaleCommand
            | Self::NoTrajectory
            | Self::StartPose
            | Self::JerkLimit
            | Self::NoTorqueInMode
            | Self::StiffnessLimit
            | Self::DampingLimit
            | Self::BusErrorPassive
            | Self::CallbackOverrun
            | Self::CallbackPanicked => StopCategory::Two,
            Self::FollowingError
            | Self::MissedFeedback
            | Self::DriveFault
            | Self::DriveDisabled
            | Self::NotDisabled
            | Self::DriveEnabled
            | Self::DriveLocal
            | Self::MeasuredPosition
            | Self::MeasuredVelocity
            | Self::MeasuredTorque
            | Self::ModeChanged
            | Self::ModeNotShown
            | Self::EnableTimeout
            | Self::NotAtRest
            | Self::BusLost
            | Self::NotTransmitted
            | Self::NotAcknowledged
            | Self::NodeLost
            | Self::NodeNotOperational
            | Self::UnexpectedBootUp
            | Self::EmergencyMessage
            | Self::DuplicateNode
            | Self::ForeignMaster
            | Self::TimingUnfit
            | Self::ImplausibleFeedback => StopCategory::One,
        }
    }
}
