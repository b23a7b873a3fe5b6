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
    /// Somebody asked for it. A fault that comes up before that stop is over takes its place.
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
    /// A drive has not reported in time for too many cycles; or, with a limit of 0, it reports so many cycles late in every
    /// cycle.
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
    /// A node's heartbeat has not come for too long.
    NodeLost = 16,
    /// A node is in another state than operational.
    NodeNotOperational = 17,
    /// A node has started anew while it was to work.
    UnexpectedBootUp = 18,
    /// A drive has sent an emergency message, and shows no fault that would explain it.
    EmergencyMessage = 19,
    /// Two nodes answer under one number.
    DuplicateNode = 20,
    /// Somebody else sends SYNC, set-points or commands to nodes on our bus.
    ForeignMaster = 21,
    /// Slots passed unused too often.
    TimingUnfit = 22,
    /// A stream began too far from where the joint is.
    StartPose = 23,
    /// A set-point of a stream asked for more than the jerk limit.
    JerkLimit = 24,
    /// The error counters of an interface are near bus-off.
    BusErrorPassive = 25,
    /// A joint was reported where it cannot have got to.
    ImplausibleFeedback = 26,
}

impl Rule {
    /// Every rule, in the order of their numbers.
    pub const ALL: [Self; 27] = [
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
            | Self::BusErrorPassive => StopCategory::Two,
            Self::FollowingError
            | Self::MissedFeedback
            | Self::DriveFault
            | Self::DriveDisabled
            | Self::ModeChanged
            | Self::EnableTimeout
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

/// The category of the stop for each rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StopCategories([StopCategory; Rule::ALL.len()]);

impl Default for StopCategories {
    fn default() -> Self {
        Self(Rule::ALL.map(Rule::default_category))
    }
}

impl StopCategories {
    /// The category of a rule.
    pub fn of(&self, rule: Rule) -> StopCategory {
        self.0.get(rule as usize).copied().unwrap_or(StopCategory::One)
    }

    /// Sets the category of a rule.
    pub fn set(&mut self, rule: Rule, category: StopCategory) {
        if let Some(present) = self.0.get_mut(rule as usize) {
            *present = category;
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

/// What a stop concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Origin {
    /// The group as a whole: what was asked of it, or how it is paced.
    #[default]
    Group,
    /// The axis with this number.
    Axis(u8),
    /// The bus with this number.
    Bus(u8),
}

impl Origin {
    /// The axis, if it is one.
    pub const fn axis(self) -> Option<u8> {
        match self {
            Self::Axis(axis) => Some(axis),
            Self::Group | Self::Bus(_) => None,
        }
    }

    /// The bus, if it is one.
    pub const fn bus(self) -> Option<u8> {
        match self {
            Self::Bus(bus) => Some(bus),
            Self::Group | Self::Axis(_) => None,
        }
    }
}

/// The one reason of a stop: the first fault, or that it was asked for where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopReason {
    /// The category of the stop that it led to.
    pub category: StopCategory,
    /// What was broken.
    pub rule: Rule,
    /// What it concerns.
    pub origin: Origin,
    /// What was seen, in the unit of the rule (rad, rad/s, rad/s², cycles, an error code …).
    pub value: f64,
    /// What would have been allowed, in the same unit.
    pub limit: f64,
    /// The slot in which it was seen.
    pub slot: u64,
    /// What the group was doing then.
    pub phase: Phase,
}

impl StopReason {
    /// The axis concerned; `None` when it was not one axis.
    pub const fn axis(&self) -> Option<u8> {
        self.origin.axis()
    }
}
