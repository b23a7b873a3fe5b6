//! What a stream wants: of an axis in one of its points, and of every axis in one slot.

use crate::capacity::MAX_AXES;
use crate::plan::State;
use crate::time::Nanoseconds;

/// What is done with a stream that asks for more than the limits of an axis allow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum Follow {
    /// The axis follows as closely as its limits allow.
    #[default]
    Smooth,
    /// The group stops: every set-point is exactly what the stream wants, or a fault.
    Exact,
}

/// What a point says of the position of an axis. rad (m) and seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct PositionPoint {
    /// Where it is to be.
    pub position: f64,
    /// How fast; `None` takes it from the points beside.
    pub velocity: Option<f64>,
    /// With what acceleration; `None` takes it from the points beside.
    pub acceleration: Option<f64>,
}

impl PositionPoint {
    fn is_finite(&self) -> bool {
        let are_finite = |value: Option<f64>| value.is_none_or(f64::is_finite);
        self.position.is_finite() && are_finite(self.velocity) && are_finite(self.acceleration)
    }
}

/// What a point of a stream says of one axis. rad and N·m (m and N), and seconds.
///
/// Between two points of the same kind everything changes evenly. Between two of different kinds the axis does what the later
/// one says.
///
/// ```
/// use takt_rt::AxisPoint;
///
/// let stiff = AxisPoint::moving(0.5, 0.1);
/// let with_gravity = AxisPoint::position(0.5).with_torque(4.0);
/// let soft = AxisPoint::position(0.5).with_impedance(50.0, 3.0);
/// let turning = AxisPoint::Velocity(0.2);
/// let pushing = AxisPoint::Torque(4.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum AxisPoint {
    /// It is to be somewhere.
    Position {
        /// Where, and how it moves there.
        motion: PositionPoint,
        /// The torque that is fed forward.
        torque: f64,
    },
    /// It is held at a position by a spring and a damper.
    Impedance {
        /// Where, and how that moves.
        motion: PositionPoint,
        /// kp: N·m/rad.
        stiffness: f64,
        /// kd: N·m·s/rad.
        damping: f64,
        /// The torque that is fed forward.
        torque: f64,
    },
    /// It is to move at this velocity.
    Velocity(f64),
    /// It is driven by this torque.
    Torque(f64),
}

impl AxisPoint {
    /// A position alone.
    pub const fn position(position: f64) -> Self {
        Self::motion(PositionPoint { position, velocity: None, acceleration: None })
    }

    /// A position with its velocity.
    pub const fn moving(position: f64, velocity: f64) -> Self {
        Self::motion(PositionPoint { position, velocity: Some(velocity), acceleration: None })
    }

    /// A position with what is known of its velocity and acceleration.
    pub const fn motion(motion: PositionPoint) -> Self {
        Self::Position { motion, torque: 0.0 }
    }

    /// The same with this torque: fed forward at a position, in place of the other one at a torque. A velocity has none.
    #[must_use]
    pub const fn with_torque(self, torque: f64) -> Self {
        match self {
            Self::Position { motion, .. } => Self::Position { motion, torque },
            Self::Impedance { motion, stiffness, damping, .. } => {
                Self::Impedance { motion, stiffness, damping, torque }
            }
            Self::Velocity(_) => self,
            Self::Torque(_) => Self::Torque(torque),
        }
    }

    /// The same position, held by a spring (kp, N·m/rad) and a damper (kd, N·m·s/rad). What has no position stays as it is.
    #[must_use]
    pub const fn with_impedance(self, stiffness: f64, damping: f64) -> Self {
        match self {
            Self::Position { motion, torque } | Self::Impedance { motion, torque, .. } => {
                Self::Impedance { motion, stiffness, damping, torque }
            }
            Self::Velocity(_) | Self::Torque(_) => self,
        }
    }

    /// What it says of the position, if it says anything of it.
    pub const fn position_point(&self) -> Option<&PositionPoint> {
        match self {
            Self::Position { motion, .. } | Self::Impedance { motion, .. } => Some(motion),
            Self::Velocity(_) | Self::Torque(_) => None,
        }
    }

    /// What it wants of an axis that is to stay as the point has it.
    pub const fn at_rest(&self) -> AxisTarget {
        match *self {
            Self::Position { motion, torque } => {
                AxisTarget::Position { state: State::rest(motion.position), torque }
            }
            Self::Impedance { motion, stiffness, damping, torque } => {
                let state = State::rest(motion.position);
                AxisTarget::Impedance { state, stiffness, damping, torque }
            }
            Self::Velocity(_) => AxisTarget::Velocity { velocity: 0.0, acceleration: 0.0 },
            Self::Torque(torque) => AxisTarget::Torque(torque),
        }
    }

    /// Returns `true` if every number of it is one.
    pub fn is_finite(&self) -> bool {
        match self {
            Self::Position { motion, torque } => motion.is_finite() && torque.is_finite(),
            Self::Impedance { motion, stiffness, damping, torque } => {
                let are_finite = stiffness.is_finite() && damping.is_finite() && torque.is_finite();
                motion.is_finite() && are_finite
            }
            Self::Velocity(value) | Self::Torque(value) => value.is_finite(),
        }
    }
}

impl Default for AxisPoint {
    fn default() -> Self {
        Self::position(0.0)
    }
}

impl From<f64> for AxisPoint {
    fn from(position: f64) -> Self {
        Self::position(position)
    }
}

impl From<State> for AxisPoint {
    fn from(state: State) -> Self {
        Self::motion(PositionPoint {
            position: state.position,
            velocity: Some(state.velocity),
            acceleration: Some(state.acceleration),
        })
    }
}

/// How a point is put among those that are there already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum PointRole {
    /// By itself: it takes the place of one with the same stamp, and leaves the others.
    #[default]
    Single,
    /// As part of a chunk, whose points come in the order of their stamps. A chunk takes the place of every earlier point from
    /// its own first stamp on.
    Chunk {
        /// True if the chunk begins with it.
        is_first: bool,
        /// True if the chunk ends with it.
        is_last: bool,
    },
}

/// A point of a stream: what every axis is to do at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct StreamPoint<const AXES: usize = MAX_AXES> {
    /// The time that it is meant for.
    pub at_ns: Nanoseconds,
    /// How it is put among the others.
    pub role: PointRole,
    /// What it says of each axis.
    pub axes: [AxisPoint; AXES],
}

impl<const AXES: usize> Default for StreamPoint<AXES> {
    fn default() -> Self {
        Self { at_ns: 0, role: PointRole::Single, axes: [AxisPoint::default(); AXES] }
    }
}

/// What a source wants of an axis in one slot. rad and N·m (m and N), and seconds.
///
/// A position or a velocity is followed within the limits of velocity, acceleration and jerk, and within those of the position.
/// An impedance and a torque need an axis whose loop is closed here: cyclic synchronous torque. What changes in a torque or a
/// gain takes effect at the rate that the axis allows for its torque.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum AxisTarget {
    /// To be in this state of motion at the end of the slot.
    Position {
        /// Where, how fast, and with what acceleration.
        state: State,
        /// The torque that is fed forward.
        torque: f64,
    },
    /// To be held by a spring and a damper at a position that is in this state of motion at the end of the slot.
    Impedance {
        /// Where, how fast, and with what acceleration.
        state: State,
        /// kp: N·m/rad.
        stiffness: f64,
        /// kd: N·m·s/rad.
        damping: f64,
        /// The torque that is fed forward.
        torque: f64,
    },
    /// To move like this at the end of the slot.
    Velocity {
        /// How fast.
        velocity: f64,
        /// With what acceleration.
        acceleration: f64,
    },
    /// To be driven by this torque.
    Torque(f64),
}

impl AxisTarget {
    /// A state of motion, with no torque fed forward.
    pub const fn position(state: State) -> Self {
        Self::Position { state, torque: 0.0 }
    }
}

impl From<State> for AxisTarget {
    fn from(state: State) -> Self {
        Self::position(state)
    }
}

impl Default for AxisTarget {
    fn default() -> Self {
        Self::position(State::default())
    }
}

/// What a stream is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum StreamState {
    /// The group does not stream.
    #[default]
    Idle,
    /// It does, and no point has come yet: the axes hold.
    Awaited,
    /// The axes follow the points.
    Following,
    /// The points have run out: the axes come to rest, and go on when points come again.
    Dry,
    /// No points lead the axes: a callback does.
    Callback,
}

impl StreamState {
    /// Every state, in the order of their numbers.
    pub const ALL: [Self; 5] = [Self::Idle, Self::Awaited, Self::Following, Self::Dry, Self::Callback];

    /// Its name, for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Awaited => "awaited",
            Self::Following => "following",
            Self::Dry => "dry",
            Self::Callback => "callback",
        }
    }
}

/// How a stream has gone so far: counts since its beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct StreamCounts {
    /// How far the set-points are behind the stamps now.
    pub lag_ns: Nanoseconds,
    /// Points that have come.
    pub points: u64,
    /// Points that have come too late for their time.
    pub late_points: u64,
    /// Points that found no room, could not be used, or were discarded when the stream ended.
    pub lost_points: u64,
}

/// What observers see of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct StreamReport {
    /// What it is doing.
    pub state: StreamState,
    /// How it has gone so far.
    pub counts: StreamCounts,
}

/// What a stream wants in one slot.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum StreamWish<const AXES: usize = MAX_AXES> {
    /// Nothing yet: no point has come.
    Awaited,
    /// This of each axis.
    Targets([AxisTarget; AXES]),
    /// To come to rest: the points have run out, with these.
    Dry([AxisTarget; AXES]),
}

impl<const AXES: usize> StreamWish<AXES> {
    /// From now on it is [`StreamWish::Targets`], as `put` writes them: they are large, and stay where they are.
    pub(super) fn put_targets(&mut self, put: impl FnOnce(&mut [AxisTarget; AXES])) {
        if !matches!(self, Self::Targets(_)) {
            *self = Self::Targets([AxisTarget::default(); AXES]);
        }
        if let Self::Targets(targets) = self {
            put(targets);
        }
    }

    /// The same of [`StreamWish::Dry`].
    pub(super) fn put_dry(&mut self, put: impl FnOnce(&mut [AxisTarget; AXES])) {
        if !matches!(self, Self::Dry(_)) {
            *self = Self::Dry([AxisTarget::default(); AXES]);
        }
        if let Self::Dry(targets) = self {
            put(targets);
        }
    }
}

/// What a stream wants in one slot, and how it has gone so far.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct StreamSample<const AXES: usize = MAX_AXES> {
    /// What it wants.
    pub wish: StreamWish<AXES>,
    /// How it has gone.
    pub counts: StreamCounts,
}

impl<const AXES: usize> Default for StreamSample<AXES> {
    fn default() -> Self {
        Self { wish: StreamWish::Awaited, counts: StreamCounts::default() }
    }
}
