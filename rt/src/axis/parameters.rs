//! Everything about an axis that does not change while it runs.

use arrayvec::ArrayVec;

use super::exchange::Exchange;
use super::position_counter::PositionCounter;
use crate::cia402::OperationMode;
use crate::cia402_codec::Cia402Codec;
use crate::control::{ControlLaw, GainError};
use crate::guard::{AxisLimits, LimitError};
use crate::pdo::MAX_NODE_AXES;
use crate::source::Follow;
use crate::units::Scale;

/// Since when feedback must have arrived to be that of the present cycle. PDOs carry no number: the time of their arrival
/// is what tells an answer of this cycle from one that is late.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum FeedbackSince {
    /// The cycle's SYNC, which the drive answers.
    #[default]
    Sync,
    /// The command phase of the cycle before, in which the drive was sent the set-point that it answers: the command that
    /// is sent in every cycle.
    SetPoint,
    /// The same, for a drive that reports when it likes.
    CommandPhase,
}

/// What a source may ask of an axis whose torque is made here. rad and N·m, or m and N.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct TorqueLimits {
    /// The highest stiffness of an impedance: N·m/rad.
    pub stiffness: f64,
    /// The highest damping of an impedance: N·m·s/rad.
    pub damping: f64,
    /// The highest rate at which the torque follows what is asked for: N·m/s. A change of gains counts, too.
    pub rate: f64,
}

impl TorqueLimits {
    /// No limit at all.
    pub const NONE: Self = Self { stiffness: f64::INFINITY, damping: f64::INFINITY, rate: f64::INFINITY };
}

/// What is sent to a drive beside its target, where its process data have room for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum FeedForward {
    /// Nothing: zero is sent.
    #[default]
    None,
    /// The velocity of the set-point, as the velocity offset (object 60B1) of a drive that follows positions.
    Velocity,
    /// The torque that a source feeds forward, as the torque offset (object 60B2) of a drive that follows positions or
    /// velocities.
    Torque,
    /// Both.
    VelocityAndTorque,
}

impl FeedForward {
    /// Returns `true` if the velocity of the set-point is sent.
    pub const fn has_velocity(self) -> bool {
        matches!(self, Self::Velocity | Self::VelocityAndTorque)
    }

    /// Returns `true` if a torque that is fed forward is sent.
    pub const fn has_torque(self) -> bool {
        matches!(self, Self::Torque | Self::VelocityAndTorque)
    }
}

/// When a drive takes another mode of operation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum ModeCondition {
    /// Only while it has no torque: the axis must be disabled before, and enabled again after that.
    #[default]
    Disabled,
    /// In any state. Here it changes while the joint is at rest.
    AtRest,
}

/// The modes that an axis may be changed to at run time, beside the one that it starts in. Its process data must carry object
/// 6060, the target of each mode, and object 6061.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct ModeChanges {
    /// How it is commanded in each of them: cyclic synchronous modes, each once.
    pub laws: ArrayVec<ControlLaw, { Self::MOST }>,
    /// When its drive takes another mode.
    pub condition: ModeCondition,
    /// Cycles within which its drive must show the new mode in object 6061.
    pub timeout_cycles: u32,
}

impl ModeChanges {
    /// The most other modes: there are three cyclic synchronous ones.
    pub const MOST: usize = 2;

    /// Checks the laws, and that they are for different modes.
    fn validate(&self, first: &ControlLaw) -> Result<(), AxisParametersError> {
        for (index, law) in self.laws.iter().enumerate() {
            law.validate().map_err(AxisParametersError::Gain)?;
            let (mode, mut earlier) = (law.operation_mode(), self.laws.iter().take(index));
            let is_repeated =
                mode == first.operation_mode() || earlier.any(|earlier| earlier.operation_mode() == mode);
            if is_repeated || !law.is_cyclic_synchronous() {
                return Err(AxisParametersError::OtherMode { mode });
            }
        }
        let mode = first.operation_mode();
        let is_possible = self.laws.is_empty() || first.is_cyclic_synchronous() && self.timeout_cycles > 0;
        if is_possible { Ok(()) } else { Err(AxisParametersError::OtherMode { mode }) }
    }
}

/// How it is seen that the node of an axis lives, beside its feedback (CiA 301, 7.2.8).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum Supervision {
    /// Its feedback alone shows it.
    #[default]
    Feedback,
    /// The node sends heartbeats.
    Heartbeat {
        /// Slots without one that are allowed.
        timeout_cycles: u32,
    },
    /// The controller asks the node for its state: node guarding.
    Guarding {
        /// Slots from one request to the next: the guard time.
        guard_cycles: u32,
        /// Slots without a reply that are allowed, from the first request without one on: the life time.
        life_cycles: u32,
    },
}

impl Supervision {
    /// Slots without a sign of life that are allowed; `None` where none is expected.
    pub const fn timeout_cycles(self) -> Option<u32> {
        match self {
            Self::Feedback => None,
            Self::Heartbeat { timeout_cycles } => Some(timeout_cycles),
            Self::Guarding { life_cycles, .. } => Some(life_cycles),
        }
    }

    /// Slots from one request to the next, where the node is asked.
    pub const fn guard_cycles(self) -> Option<u32> {
        match self {
            Self::Guarding { guard_cycles, .. } => Some(guard_cycles),
            Self::Feedback | Self::Heartbeat { .. } => None,
        }
    }
}

/// Everything about an axis that does not change while it runs.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct AxisParameters {
    /// The bus, an index into the engine's buses.
    pub bus: u8,
    /// The node ID, 1 to 127.
    pub node: u8,
    /// Its number among the axes of the node, 1 to 8: 1 where the node has one axis. The objects of axis n stand 0x800 · (n − 1) higher
    /// than those of the first one.
    pub node_axis: u8,
    /// What is exchanged with the drive in each cycle of the bus.
    pub exchange: Exchange,
    /// Since when feedback must have arrived.
    pub feedback_since: FeedbackSince,
    /// How its drive uses controlword and statusword.
    pub codec: Cia402Codec,
    /// Cycles of the bus from one controlword to the next on the way to operation enabled; 0 where the drive shows how
    /// far it has come.
    pub controlword_spacing_cycles: u32,
    /// How it is commanded. A change of its mode exchanges this with one of `mode_changes`.
    pub law: ControlLaw,
    /// The modes that it may be changed to.
    pub mode_changes: ModeChanges,
    /// SI to drive units.
    pub scale: Scale,
    /// The counts that the drive reports as its position.
    pub counter: PositionCounter,
    /// What it may never be asked to do.
    pub limits: AxisLimits,
    /// What a source may ask of it where its torque is made here.
    pub torque_limits: TorqueLimits,
    /// What is sent beside the target.
    pub feed_forward: FeedForward,
    /// How far from the joint a stream that is followed exactly may begin (rad or m).
    pub start_tolerance: f64,
    /// What is done with a stream that asks for more than the limits allow.
    pub follow: Follow,
    /// How it is seen that its node lives. Axes of one node have the same.
    pub supervision: Supervision,
    /// Slots after the controller's last sign of life in which the drive stops by itself; `None` if it never does, or after a time
    /// that is not known.
    pub stops_by_itself_cycles: Option<u32>,
    /// Following error that is allowed at any time (rad or m).
    pub following_error_limit: f64,
    /// Cycles in a row that the following error may be larger.
    pub following_error_cycles: u32,
    /// Cycles of the bus in a row without feedback that are bridged.
    pub missed_feedback_cycles: u16,
}

/// The node IDs of CANopen (CiA 301, 7.3.2): 0 is for all nodes, and more than 7 bits do not fit into an identifier.
const NODE_IDS: core::ops::RangeInclusive<u8> = 1..=127;
/// The addresses of drives that are spoken to outside of the cycle, and may be on another line than CAN.
const ADDRESSES: core::ops::RangeInclusive<u8> = 1..=247;

/// Why an axis cannot be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisParametersError {
    /// The node ID is not one from 1 to 127; for a drive that is spoken to outside of the cycle, 1 to 247.
    NodeId {
        /// What it is.
        node: u8,
    },
    /// The number of the axis in its node is not one from 1 to 8.
    NodeAxis {
        /// What it is.
        node_axis: u8,
    },
    /// There is no PDO in one of the directions.
    NoPdo,
    /// A limit is not a number that can be kept.
    Limit(LimitError),
    /// A gain is not a number that can be used.
    Gain(GainError),
    /// A mode to change to or from is none of the cyclic synchronous ones, is named twice, or has no time to be shown in.
    OtherMode {
        /// The mode.
        mode: OperationMode,
    },
    /// A highest stiffness or damping, or the rate of the torque, is negative or no number.
    TorqueLimit {
        /// What it is.
        value: f64,
    },
    /// The limit of the following error is not a positive number.
    FollowingErrorLimit {
        /// What it is.
        value: f64,
    },
    /// The distance from the joint at which a stream may begin is negative or no number.
    StartTolerance {
        /// What it is.
        value: f64,
    },
}

impl core::error::Error for AxisParametersError {}

impl core::fmt::Display for AxisParametersError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NodeId { node } => write!(f, "{node} is no node ID: those are 1 to 127"),
            Self::NodeAxis { node_axis } => {
                write!(f, "{node_axis} is no number of an axis in its node: those are 1 to 8")
            }
            Self::NoPdo => f.write_str("there must be a PDO to the drive and one from it"),
            Self::Limit(error) => error.fmt(f),
            Self::Gain(error) => error.fmt(f),
            Self::OtherMode { mode } => write!(
                f,
                "{mode:?} cannot be changed to at run time: only cyclic synchronous modes can, each named once, with a time-out"
            ),
            Self::TorqueLimit { value } => {
                write!(f, "a highest stiffness, damping or rate of the torque must not be negative: {value}")
            }
            Self::FollowingErrorLimit { value } => {
                write!(f, "the limit of the following error must be a positive number: {value}")
            }
            Self::StartTolerance { value } => {
                write!(f, "the tolerance of a stream's start must not be negative: {value}")
            }
        }
    }
}

impl AxisParameters {
    /// Checks everything that an axis relies on. A [`Scale`] and a [`Mapping`](crate::Mapping) are checked when they are made.
    pub fn validate(&self) -> Result<(), AxisParametersError> {
        let node_ids = if matches!(self.exchange, Exchange::OffCycle { .. }) { ADDRESSES } else { NODE_IDS };
        if !node_ids.contains(&self.node) {
            return Err(AxisParametersError::NodeId { node: self.node });
        }
        if !(1..=MAX_NODE_AXES).contains(&self.node_axis) {
            return Err(AxisParametersError::NodeAxis { node_axis: self.node_axis });
        }
        if let Exchange::Pdos(pdos) = &self.exchange
            && (pdos.commands.is_empty() || pdos.feedback.is_empty())
        {
            return Err(AxisParametersError::NoPdo);
        }
        self.limits.validate().map_err(AxisParametersError::Limit)?;
        self.law.validate().map_err(AxisParametersError::Gain)?;
        self.mode_changes.validate(&self.law)?;
        let TorqueLimits { stiffness, damping, rate } = self.torque_limits;
        if let Some(value) =
            [stiffness, damping, rate].into_iter().find(|value| value.is_nan() || *value < 0.0)
        {
            return Err(AxisParametersError::TorqueLimit { value });
        }
        let value = self.following_error_limit;
        // An infinite one is no limit, which is allowed; what is no number would be none unseen.
        if value.is_nan() || value <= 0.0 {
            return Err(AxisParametersError::FollowingErrorLimit { value });
        }
        let value = self.start_tolerance;
        if value.is_nan() || value < 0.0 {
            return Err(AxisParametersError::StartTolerance { value });
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::exchange::{CommandPdo, Pdo, Pdos};
    use super::*;
    use crate::frame::Id;
    use crate::pdo::{MappedObject, Mapping};
    use crate::units::ScaleParameters;
    use core::f64::consts::TAU;

    pub fn parameters() -> AxisParameters {
        let pdo = |id, objects: &[MappedObject], compile: fn(&[MappedObject]) -> Result<Mapping, _>| {
            Pdo::classic(id, compile(objects).unwrap())
        };
        let command = pdo(Id::canopen(0x200, 5), &[MappedObject::new(0x6040, 0, 16)], Mapping::commands);
        let feedback = pdo(Id::canopen(0x180, 5), &[MappedObject::new(0x6041, 0, 16)], Mapping::feedback);
        AxisParameters {
            bus: 0,
            node: 5,
            node_axis: 1,
            exchange: Exchange::Pdos(Pdos {
                commands: [CommandPdo::every_cycle(command)].into_iter().collect(),
                feedback: [feedback].into_iter().collect(),
                unused: ArrayVec::new(),
            }),
            feedback_since: FeedbackSince::Sync,
            codec: Cia402Codec::default(),
            controlword_spacing_cycles: 0,
            law: ControlLaw::Position,
            mode_changes: ModeChanges::default(),
            scale: Scale::new(ScaleParameters {
                counts_per_turn: 524_288.0,
                velocity_units_per_turn: 524_288.0,
                gear_ratio: 1.0,
                travel_per_turn: TAU,
                reversed: false,
                zero_counts: 0.0,
                rated_torque: 31.0,
            })
            .unwrap(),
            counter: PositionCounter::default(),
            limits: AxisLimits {
                position_min: -3.0,
                position_max: 3.0,
                velocity: 2.0,
                acceleration: 10.0,
                deceleration: 10.0,
                jerk: f64::INFINITY,
                torque: 40.0,
            },
            torque_limits: TorqueLimits::NONE,
            feed_forward: FeedForward::None,
            start_tolerance: 0.01,
            follow: Follow::Smooth,
            supervision: Supervision::Feedback,
            stops_by_itself_cycles: None,
            following_error_limit: 0.1,
            following_error_cycles: 10,
            missed_feedback_cycles: 3,
        }
    }

    fn error_of(change: impl Fn(&mut AxisParameters)) -> AxisParametersError {
        let mut changed = parameters();
        change(&mut changed);
        changed.validate().unwrap_err()
    }

    #[test]
    fn what_an_axis_relies_on_is_checked_and_named() {
        assert_eq!(parameters().validate(), Ok(()));
        for node in [0, 128, 129, 255] {
            assert_eq!(error_of(|axis| axis.node = node), AxisParametersError::NodeId { node });
        }
        for node_axis in [0, 9, 255] {
            assert_eq!(
                error_of(|axis| axis.node_axis = node_axis),
                AxisParametersError::NodeAxis { node_axis }
            );
        }
        assert_eq!(
            error_of(|axis| axis.exchange = Exchange::Pdos(Pdos::default())),
            AxisParametersError::NoPdo
        );
        let error = error_of(|axis| axis.limits.velocity = -1.0);
        assert_eq!(error, AxisParametersError::Limit(LimitError::Velocity { value: -1.0 }));
        let error = error_of(|axis| axis.law = ControlLaw::Velocity { position_gain: f64::INFINITY });
        assert!(matches!(error, AxisParametersError::Gain(_)));
        let velocity = ControlLaw::Velocity { position_gain: 10.0 };
        let other_modes = |first: ControlLaw, laws: &[ControlLaw], timeout_cycles: u32| {
            let mode_changes = ModeChanges {
                laws: laws.iter().copied().collect(),
                timeout_cycles,
                ..ModeChanges::default()
            };
            AxisParameters { law: first, mode_changes, ..parameters() }.validate()
        };
        assert_eq!(other_modes(ControlLaw::Position, &[velocity], 1), Ok(()));
        for (first, laws, timeout_cycles) in [
            (ControlLaw::Position, [ControlLaw::Position].as_slice(), 1),
            (ControlLaw::Position, &[velocity, velocity], 1),
            (ControlLaw::Position, &[ControlLaw::ProfileVelocity], 1),
            (ControlLaw::ProfilePosition, &[velocity], 1),
            (ControlLaw::Position, &[velocity], 0),
        ] {
            let refused = other_modes(first, laws, timeout_cycles);
            assert!(matches!(refused, Err(AxisParametersError::OtherMode { .. })), "{laws:?}");
        }
        for bad in [f64::NAN, 0.0, -0.1] {
            let error = error_of(|axis| axis.following_error_limit = bad);
            assert!(matches!(error, AxisParametersError::FollowingErrorLimit { .. }));
        }
        let error = error_of(|axis| axis.torque_limits.rate = -1.0);
        assert_eq!(error, AxisParametersError::TorqueLimit { value: -1.0 });
        let error = error_of(|axis| axis.start_tolerance = f64::NAN);
        assert!(matches!(error, AxisParametersError::StartTolerance { .. }));
    }
}
