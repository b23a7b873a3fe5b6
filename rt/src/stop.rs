//! Why and how the group stops.

/// How a stop is made (IEC 60204-1, 9.2.2). takt's stops are not safety-rated: STO is hardware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum StopCategory {
    /// Category 0: power is removed from the drives at once.
    Zero = 0,
    /// Category 1: decelerate at the limits, then remove power and apply the brakes.
    One = 1,
    /// Category 2: decelerate at the limits and hold position under power.
    Two = 2,
}

/// What made the group stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Rule {
    /// Somebody asked for it.
    Requested = 0,
    /// A set-point was not a finite number.
    NotFinite = 1,
    /// A set-point lay outside the position limits.
    PositionLimit = 2,
    /// A set-point asked for more than the velocity limit.
    VelocityLimit = 3,
    /// A set-point asked for more than the acceleration limit.
    AccelerationLimit = 4,
    /// The joint was further from its set-point than allowed for longer than allowed.
    FollowingError = 5,
    /// A stream of set-points ended without its owner ending it.
    StaleCommand = 6,
    /// A drive has not reported for too many cycles.
    MissedFeedback = 7,
    /// A drive reports a fault.
    DriveFault = 8,
    /// A drive has left operation enabled by itself.
    DriveDisabled = 9,
    /// A drive shows another mode of operation than the one it was set to.
    ModeChanged = 10,
    /// A drive did not reach operation enabled in time.
    EnableTimeout = 11,
    /// No trajectory exists for what was asked.
    NoTrajectory = 12,
    /// An interface is bus-off or down.
    BusLost = 13,
    /// Own frames are not getting onto the wire.
    NotTransmitted = 14,
    /// A drive in profile position does not acknowledge its target.
    NotAcknowledged = 15,
}

impl Rule {
    /// Every rule, in the order of their numbers.
    pub const ALL: [Self; 16] = [
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
    ];

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
            | Self::NoTrajectory => StopCategory::Two,
            Self::FollowingError
            | Self::MissedFeedback
            | Self::DriveFault
            | Self::DriveDisabled
            | Self::ModeChanged
            | Self::EnableTimeout
            | Self::BusLost
            | Self::NotTransmitted
            | Self::NotAcknowledged => StopCategory::One,
        }
    }
}

/// What the group was doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[repr(u8)]
pub enum Phase {
    /// No set-points are sent: the drives are being brought up, or are not to be touched.
    #[default]
    Passive = 0,
    /// Set-points follow the actual positions; no torque.
    Disabled = 1,
    /// The drives are on their way to operation enabled.
    Enabling = 2,
    /// Enabled and standing still.
    Holding = 3,
    /// Enabled and on a trajectory.
    Moving = 4,
    /// Enabled and following a stream of set-points from outside.
    Streaming = 5,
    /// Decelerating.
    Stopping = 6,
    /// The drives are on their way to ready to switch on.
    Disabling = 7,
}

impl Phase {
    /// Every phase, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Passive,
        Self::Disabled,
        Self::Enabling,
        Self::Holding,
        Self::Moving,
        Self::Streaming,
        Self::Stopping,
        Self::Disabling,
    ];
}

/// The one reason of a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopReason {
    /// The category of the stop that it led to.
    pub category: StopCategory,
    /// What was broken.
    pub rule: Rule,
    /// The axis concerned; `None` when it was not one axis.
    pub axis: Option<u8>,
    /// What was seen, in the unit of the rule (rad, rad/s, rad/s², cycles, an error code …).
    pub value: f64,
    /// What would have been allowed, in the same unit.
    pub limit: f64,
    /// The slot in which it was seen.
    pub slot: u64,
    /// What the group was doing then.
    pub phase: Phase,
}
