//! What can go wrong: one enum, whose variants carry what was seen and what was allowed.

use crate::cia402::{DriveState, OperationMode};
use crate::frame::Id;
use crate::rule::Rule;
use crate::time::Nanoseconds;

/// What made the group stop without anybody asking for it. Lengths are in rad (m for a linear axis) and their derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum Fault {
    /// A set-point, or the torque that is made of it here, was not a finite number.
    NotFinite {
        /// The position of the set-point; NaN for a torque.
        position: f64,
    },
    /// A set-point lay outside the position limits; in a profile mode, the place where the joint would come to rest.
    PositionLimit {
        /// The position.
        position: f64,
        /// The limit that it breaks.
        limit: f64,
    },
    /// A set-point asked for more than the velocity limit.
    VelocityLimit {
        /// The velocity.
        velocity: f64,
        /// The highest speed.
        limit: f64,
    },
    /// A set-point asked for more than the acceleration limit.
    AccelerationLimit {
        /// The acceleration.
        acceleration: f64,
        /// The highest acceleration.
        limit: f64,
    },
    /// A set-point of a stream asked for more than the jerk limit.
    JerkLimit {
        /// The jerk.
        jerk: f64,
        /// The highest jerk.
        limit: f64,
    },
    /// A stream began too far from where the joint is.
    StartPose {
        /// The distance.
        distance: f64,
        /// The largest distance allowed.
        limit: f64,
    },
    /// The joint was farther from its set-point than allowed for longer than allowed.
    FollowingError {
        /// The following error.
        error: f64,
        /// The largest one allowed.
        limit: f64,
    },
    /// A joint was reported where it cannot be.
    ImplausibleFeedback {
        /// The distance from the last plausible position.
        distance: f64,
        /// The largest distance that the joint can have moved since.
        reachable: f64,
    },
    /// A stream was begun, and no command came.
    StreamNotBegun {
        /// Cycles since the stream was begun.
        cycles: u32,
        /// Cycles within which the first command must come.
        limit: u32,
    },
    /// A streamed command, a velocity or a torque expired and was not renewed.
    StaleCommand {
        /// Cycles since it expired.
        age_cycles: u64,
    },
    /// A drive has not reported in time for too many cycles.
    MissedFeedback {
        /// Cycles of its bus without feedback in time.
        cycles: u16,
        /// Cycles that are allowed.
        limit: u16,
    },
    /// A drive reports whole cycles late, in every cycle.
    LateFeedback {
        /// Cycles of its bus.
        cycles: u16,
    },
    /// A drive reports a fault.
    DriveFault {
        /// Object 603F, or the code of the last emergency message; 0 if the drive gave none.
        error_code: u16,
    },
    /// A drive has left operation enabled by itself.
    DriveDisabled {
        /// Object 6041.
        statusword: u16,
    },
    /// A drive was to be disabled and has not confirmed in time that it has no torque.
    NotDisabled {
        /// The state that it showed last.
        state: DriveState,
        /// Cycles of its bus without feedback; 0 if it reports.
        silent_cycles: u16,
    },
    /// A drive has torque although its group is disabled: it was enabled by something else than this controller.
    DriveEnabled {
        /// The state that it shows.
        state: DriveState,
    },
    /// An enabled drive does not obey the bus any more: it has cleared statusword bit 9 (remote), which it had set.
    DriveLocal {
        /// Object 6041.
        statusword: u16,
    },
    /// The joint of an enabled drive is beyond a position limit by more than the following error limit.
    MeasuredPosition {
        /// Where it is.
        position: f64,
        /// The limit.
        limit: f64,
    },
    /// The joint of an enabled drive is more than a fifth faster than its velocity limit.
    MeasuredVelocity {
        /// Its velocity.
        velocity: f64,
        /// The highest speed.
        limit: f64,
    },
    /// An enabled drive exerts more than a fifth more torque than the torque limit, and not the torque to which it limits itself
    /// (object 6072).
    MeasuredTorque {
        /// Object 6077 in N·m (N).
        torque: f64,
        /// The highest torque.
        limit: f64,
    },
    /// A drive shows another mode of operation than the one that it was set to.
    ModeChanged {
        /// Object 6061.
        shown: i8,
        /// Object 6060.
        expected: OperationMode,
    },
    /// A drive was told another mode of operation and has not shown it in time.
    ModeNotShown {
        /// Object 6061; 0 if it is not reported.
        shown: i8,
        /// Object 6060.
        expected: OperationMode,
    },
    /// A torque or an impedance was wanted of an axis in a mode that has none: only in cyclic synchronous torque the loop is
    /// closed here.
    NoTorqueInMode {
        /// The mode of the axis, object 6060.
        mode: OperationMode,
    },
    /// A stiffness was wanted that is negative, or more than the axis allows.
    StiffnessLimit {
        /// N·m/rad.
        stiffness: f64,
        /// The highest stiffness.
        limit: f64,
    },
    /// A damping was wanted that is negative, or more than the axis allows.
    DampingLimit {
        /// N·m·s/rad.
        damping: f64,
        /// The highest damping.
        limit: f64,
    },
    /// A drive in profile position does not acknowledge its target.
    NotAcknowledged {
        /// Cycles of its bus.
        cycles: u32,
        /// Cycles within which it must.
        limit: u32,
    },
    /// A drive did not reach operation enabled in time.
    EnableTimeout {
        /// Cycles since enabling began.
        cycles: u32,
        /// Cycles that are allowed.
        limit: u32,
    },
    /// A joint that was to be enabled did not come to rest in time: a drive is not enabled on a joint that moves.
    NotAtRest {
        /// How fast it was at the end: rad/s (m/s).
        velocity: f64,
        /// The mean velocity below which a joint is at rest.
        limit: f64,
    },
    /// No trajectory exists for what was asked.
    NoTrajectory,
    /// A controller of a bus has left it, because of its own errors (ISO 11898-1).
    BusOff,
    /// An interface is down, or has gone.
    BusDown,
    /// The error counters of an interface are near bus-off.
    BusErrorPassive,
    /// Frames of this controller do not get onto the wire.
    NotTransmitted {
        /// Cycles in a row.
        cycles: u32,
        /// Cycles that are allowed.
        limit: u32,
    },
    /// The heartbeat of a node has not come for too long.
    NodeLost {
        /// Cycles since the last one.
        cycles: u32,
        /// Cycles that are allowed.
        limit: u32,
    },
    /// A node is in another NMT state than operational.
    NodeNotOperational {
        /// The state that its heartbeat shows (CiA 301, 7.2.8.3.2.2).
        state: u8,
    },
    /// A node has started anew while it was to work.
    UnexpectedBootUp,
    /// A drive has sent an emergency message, and its statusword shows no fault that would explain it.
    EmergencyMessage {
        /// The error code.
        code: u16,
    },
    /// Two nodes answer with one node ID.
    DuplicateNode {
        /// The node ID.
        node: u8,
    },
    /// Another master sends SYNC, set-points or NMT commands on the bus.
    ForeignMaster {
        /// The identifier of its frame.
        id: Id,
    },
    /// Too many slots were missed.
    TimingUnfit {
        /// Missed slots that are not yet forgiven.
        missed: u32,
        /// As many are too many.
        limit: u32,
    },
    /// The computer was suspended while drives were under power.
    Suspended {
        /// For how long.
        suspended_ns: Nanoseconds,
    },
    /// A call of the owner's callback has taken longer than it may.
    CallbackOverrun {
        /// How long it took.
        spent_ns: Nanoseconds,
        /// How long it may take.
        budget_ns: Nanoseconds,
    },
    /// The owner's callback has panicked.
    CallbackPanicked,
}

/// The second number of [`Fault::ForeignMaster`] where the identifier has 29 bits; 0 where it has 11, as in earlier recordings.
const EXTENDED_ID_BITS: f64 = 29.0;

impl Fault {
    /// The rule that is broken.
    pub const fn rule(&self) -> Rule {
        match self {
            Self::NotFinite { .. } => Rule::NotFinite,
            Self::PositionLimit { .. } => Rule::PositionLimit,
            Self::VelocityLimit { .. } => Rule::VelocityLimit,
            Self::AccelerationLimit { .. } => Rule::AccelerationLimit,
            Self::JerkLimit { .. } => Rule::JerkLimit,
            Self::StartPose { .. } => Rule::StartPose,
            Self::FollowingError { .. } => Rule::FollowingError,
            Self::ImplausibleFeedback { .. } => Rule::ImplausibleFeedback,
            Self::StreamNotBegun { .. } | Self::StaleCommand { .. } => Rule::StaleCommand,
            Self::MissedFeedback { .. } | Self::LateFeedback { .. } => Rule::MissedFeedback,
            Self::DriveFault { .. } => Rule::DriveFault,
            Self::DriveDisabled { .. } => Rule::DriveDisabled,
            Self::ModeChanged { .. } => Rule::ModeChanged,
            Self::ModeNotShown { .. } => Rule::ModeNotShown,
            Self::NoTorqueInMode { .. } => Rule::NoTorqueInMode,
            Self::StiffnessLimit { .. } => Rule::StiffnessLimit,
            Self::DampingLimit { .. } => Rule::DampingLimit,
            Self::NotAcknowledged { .. } => Rule::NotAcknowledged,
            Self::EnableTimeout { .. } => Rule::EnableTimeout,
            Self::NotAtRest { .. } => Rule::NotAtRest,
            Self::NoTrajectory => Rule::NoTrajectory,
            Self::BusOff | Self::BusDown => Rule::BusLost,
            Self::BusErrorPassive => Rule::BusErrorPassive,
            Self::NotTransmitted { .. } => Rule::NotTransmitted,
            Self::NodeLost { .. } => Rule::NodeLost,
            Self::NodeNotOperational { .. } => Rule::NodeNotOperational,
            Self::UnexpectedBootUp => Rule::UnexpectedBootUp,
            Self::EmergencyMessage { .. } => Rule::EmergencyMessage,
            Self::DuplicateNode { .. } => Rule::DuplicateNode,
            Self::ForeignMaster { .. } => Rule::ForeignMaster,
            Self::TimingUnfit { .. } | Self::Suspended { .. } => Rule::TimingUnfit,
            Self::CallbackOverrun { .. } => Rule::CallbackOverrun,
            Self::CallbackPanicked => Rule::CallbackPanicked,
            Self::NotDisabled { .. } => Rule::NotDisabled,
            Self::DriveEnabled { .. } => Rule::DriveEnabled,
            Self::DriveLocal { .. } => Rule::DriveLocal,
            Self::MeasuredPosition { .. } => Rule::MeasuredPosition,
            Self::MeasuredVelocity { .. } => Rule::MeasuredVelocity,
            Self::MeasuredTorque { .. } => Rule::MeasuredTorque,
        }
    }

    /// What was seen and what was allowed, as two numbers for recordings; 0 where there is none.
    /// [`Fault::from_numbers`] is the way back.
    pub fn numbers(&self) -> (f64, f64) {
        match *self {
            Self::NotFinite { position } => (position, 0.0),
            Self::PositionLimit { position, limit } | Self::MeasuredPosition { position, limit } => {
                (position, limit)
            }
            Self::VelocityLimit { velocity, limit }
            | Self::MeasuredVelocity { velocity, limit }
            | Self::NotAtRest { velocity, limit } => (velocity, limit),
            Self::MeasuredTorque { torque, limit } => (torque, limit),
            Self::AccelerationLimit { acceleration, limit } => (acceleration, limit),
            Self::JerkLimit { jerk, limit } => (jerk, limit),
            Self::StartPose { distance, limit } => (distance, limit),
            Self::FollowingError { error, limit } => (error, limit),
            Self::ImplausibleFeedback { distance, reachable } => (distance, reachable),
            Self::StaleCommand { age_cycles } => (age_cycles as f64, 0.0),
            Self::MissedFeedback { cycles, limit } => (cycles.into(), limit.into()),
            Self::LateFeedback { cycles } => (cycles.into(), 0.0),
            Self::DriveFault { error_code: code } | Self::EmergencyMessage { code } => (code.into(), 0.0),
            Self::DriveDisabled { statusword } | Self::DriveLocal { statusword } => (statusword.into(), 0.0),
            Self::NotDisabled { state, silent_cycles } => (f64::from(state as u8), silent_cycles.into()),
            Self::DriveEnabled { state } => (f64::from(state as u8), 0.0),
            Self::ModeChanged { shown, expected } | Self::ModeNotShown { shown, expected } => {
                (shown.into(), (expected as i8).into())
            }
            Self::NoTorqueInMode { mode } => (0.0, (mode as i8).into()),
            Self::StiffnessLimit { stiffness, limit } => (stiffness, limit),
            Self::DampingLimit { damping, limit } => (damping, limit),
            Self::StreamNotBegun { cycles, limit }
            | Self::NotAcknowledged { cycles, limit }
            | Self::EnableTimeout { cycles, limit }
            | Self::NotTransmitted { cycles, limit }
            | Self::NodeLost { cycles, limit }
            | Self::TimingUnfit { missed: cycles, limit } => (cycles.into(), limit.into()),
            // Slots are counted, and at least one is allowed.
            Self::Suspended { suspended_ns } => (suspended_ns as f64, 0.0),
            Self::NodeNotOperational { state } => (state.into(), 0.0),
            Self::DuplicateNode { node } => (node.into(), 0.0),
            Self::ForeignMaster { id } => {
                (id.value().into(), if id.is_extended() { EXTENDED_ID_BITS } else { 0.0 })
            }
            Self::CallbackOverrun { spent_ns, budget_ns } => (spent_ns as f64, budget_ns as f64),
            Self::BusDown => (1.0, 0.0),
            Self::NoTrajectory
            | Self::BusOff
            | Self::BusErrorPassive
            | Self::UnexpectedBootUp
            | Self::CallbackPanicked => (0.0, 0.0),
        }
    }

    /// The fault that these numbers stand for; `None` for [`Rule::Requested`], and for numbers that no fault has.
    pub fn from_numbers(rule: Rule, seen: f64, allowed: f64) -> Option<Self> {
        Some(match rule {
            Rule::Requested => return None,
            Rule::NotFinite => Self::NotFinite { position: seen },
            Rule::PositionLimit => Self::PositionLimit { position: seen, limit: allowed },
            Rule::VelocityLimit => Self::VelocityLimit { velocity: seen, limit: allowed },
            Rule::AccelerationLimit => Self::AccelerationLimit { acceleration: seen, limit: allowed },
            Rule::JerkLimit => Self::JerkLimit { jerk: seen, limit: allowed },
            Rule::StartPose => Self::StartPose { distance: seen, limit: allowed },
            Rule::FollowingError => Self::FollowingError { error: seen, limit: allowed },
            Rule::ImplausibleFeedback => Self::ImplausibleFeedback { distance: seen, reachable: allowed },
            Rule::StaleCommand if allowed > 0.0 => {
                Self::StreamNotBegun { cycles: seen as u32, limit: allowed as u32 }
            }
            Rule::StaleCommand => Self::StaleCommand { age_cycles: seen as u64 },
            Rule::MissedFeedback if allowed == 0.0 => Self::LateFeedback { cycles: seen as u16 },
            Rule::MissedFeedback => Self::MissedFeedback { cycles: seen as u16, limit: allowed as u16 },
            Rule::DriveFault => Self::DriveFault { error_code: seen as u16 },
            Rule::DriveDisabled => Self::DriveDisabled { statusword: seen as u16 },
            Rule::ModeChanged => {
                Self::ModeChanged { shown: seen as i8, expected: OperationMode::from_number(allowed as i8)? }
            }
            Rule::ModeNotShown => {
                Self::ModeNotShown { shown: seen as i8, expected: OperationMode::from_number(allowed as i8)? }
            }
            Rule::NoTorqueInMode => Self::NoTorqueInMode { mode: OperationMode::from_number(allowed as i8)? },
            Rule::StiffnessLimit => Self::StiffnessLimit { stiffness: seen, limit: allowed },
            Rule::DampingLimit => Self::DampingLimit { damping: seen, limit: allowed },
            Rule::NotAcknowledged => Self::NotAcknowledged { cycles: seen as u32, limit: allowed as u32 },
            Rule::EnableTimeout => Self::EnableTimeout { cycles: seen as u32, limit: allowed as u32 },
            Rule::NotAtRest => Self::NotAtRest { velocity: seen, limit: allowed },
            Rule::NoTrajectory => Self::NoTrajectory,
            Rule::BusLost if seen > 0.0 => Self::BusDown,
            Rule::BusLost => Self::BusOff,
            Rule::BusErrorPassive => Self::BusErrorPassive,
            Rule::NotTransmitted => Self::NotTransmitted { cycles: seen as u32, limit: allowed as u32 },
            Rule::NodeLost => Self::NodeLost { cycles: seen as u32, limit: allowed as u32 },
            Rule::NodeNotOperational => Self::NodeNotOperational { state: seen as u8 },
            Rule::UnexpectedBootUp => Self::UnexpectedBootUp,
            Rule::EmergencyMessage => Self::EmergencyMessage { code: seen as u16 },
            Rule::DuplicateNode => Self::DuplicateNode { node: seen as u8 },
            Rule::ForeignMaster if allowed == EXTENDED_ID_BITS => {
                Self::ForeignMaster { id: Id::extended(seen as u32).ok()? }
            }
            Rule::ForeignMaster => Self::ForeignMaster { id: Id::base(seen as u32).ok()? },
            Rule::TimingUnfit if allowed == 0.0 => Self::Suspended { suspended_ns: seen as u64 },
            Rule::TimingUnfit => Self::TimingUnfit { missed: seen as u32, limit: allowed as u32 },
            Rule::CallbackOverrun => {
                Self::CallbackOverrun { spent_ns: seen as u64, budget_ns: allowed as u64 }
            }
            Rule::CallbackPanicked => Self::CallbackPanicked,
            Rule::NotDisabled => {
                Self::NotDisabled { state: drive_state(seen)?, silent_cycles: allowed as u16 }
            }
            Rule::DriveEnabled => Self::DriveEnabled { state: drive_state(seen)? },
            Rule::DriveLocal => Self::DriveLocal { statusword: seen as u16 },
            Rule::MeasuredPosition => Self::MeasuredPosition { position: seen, limit: allowed },
            Rule::MeasuredVelocity => Self::MeasuredVelocity { velocity: seen, limit: allowed },
            Rule::MeasuredTorque => Self::MeasuredTorque { torque: seen, limit: allowed },
        })
    }
}

/// The state of a drive with this number in a recording.
fn drive_state(number: f64) -> Option<DriveState> {
    DriveState::ALL.into_iter().find(|state| f64::from(*state as u8) == number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_of_another_master_keeps_the_length_of_its_identifier() {
        for id in [Id::base(0x080).unwrap(), Id::extended(0x080).unwrap(), Id::extended(0x1234_5678).unwrap()]
        {
            let fault = Fault::ForeignMaster { id };
            let (seen, allowed) = fault.numbers();
            assert_eq!(Fault::from_numbers(Rule::ForeignMaster, seen, allowed), Some(fault));
        }
    }
}
