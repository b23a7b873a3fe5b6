//! What a stream wants: of an axis in one of its points, and of every axis in one slot.

use crate::plan::State;
use crate::record::MAX_AXES;
use crate::time::Nanoseconds;

/// What is done with a stream that asks for more than the limits of an axis allow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Follow {
    /// The axis follows as closely as its limits allow.
    #[default]
    Smooth,
    /// The group stops: every set-point is exactly what the stream wants, or a fault.
    Exact,
}

/// What a point of a stream says of one axis. rad (m) and seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisPoint {
    /// Where it is to be.
    pub position: f64,
    /// How fast; `None` takes it from the points beside.
    pub velocity: Option<f64>,
    /// With what acceleration; `None` takes it from the points beside.
    pub acceleration: Option<f64>,
}

impl AxisPoint {
    /// A position alone.
    pub const fn position(position: f64) -> Self {
        Self { position, velocity: None, acceleration: None }
    }

    /// A position with its velocity.
    pub const fn moving(position: f64, velocity: f64) -> Self {
        Self { position, velocity: Some(velocity), acceleration: None }
    }

    /// Whether every number of it is one.
    pub fn is_finite(&self) -> bool {
        let are_finite = |value: Option<f64>| value.is_none_or(f64::is_finite);
        self.position.is_finite() && are_finite(self.velocity) && are_finite(self.acceleration)
    }
}

impl From<f64> for AxisPoint {
    fn from(position: f64) -> Self {
        Self::position(position)
    }
}

impl From<State> for AxisPoint {
    fn from(state: State) -> Self {
        Self {
            position: state.position,
            velocity: Some(state.velocity),
            acceleration: Some(state.acceleration),
        }
    }
}

/// How a point is put among those that are there already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PointRole {
    /// By itself: it takes the place of one with the same stamp, and leaves the others.
    #[default]
    Single,
    /// As part of a chunk, whose points come in the order of their stamps. A chunk takes the place of every earlier point from
    /// its own first stamp on.
    Chunk {
        /// Whether the chunk begins with it.
        is_first: bool,
        /// Whether the chunk ends with it.
        is_last: bool,
    },
}

/// A point of a stream: where every axis is to be at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// What a source wants of an axis in one slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisTarget {
    /// To be in this state of motion at the end of the slot.
    Position(State),
}

impl Default for AxisTarget {
    fn default() -> Self {
        Self::Position(State::default())
    }
}

/// What a stream is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
pub struct StreamCounts {
    /// How far the set-points are behind the stamps now.
    pub lag_ns: Nanoseconds,
    /// Points that have come.
    pub points: u64,
    /// Points that have come too late for their time.
    pub late_points: u64,
    /// Points that found no room, or could not be used.
    pub lost_points: u64,
}

/// What observers see of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StreamReport {
    /// What it is doing.
    pub state: StreamState,
    /// How it has gone so far.
    pub counts: StreamCounts,
}

/// What a stream wants in one slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StreamWish<const AXES: usize = MAX_AXES> {
    /// Nothing yet: no point has come.
    Awaited,
    /// This of each axis.
    Targets([AxisTarget; AXES]),
    /// To come to rest: the points have run out, with these.
    Dry([AxisTarget; AXES]),
}

/// What a stream wants in one slot, and how it has gone so far.
#[derive(Clone, Copy, Debug, PartialEq)]
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
