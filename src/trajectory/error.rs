//! Why a trajectory is refused.

use std::fmt;

use takt_wire::printable::Shown;

/// What of a point is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, bitcode::Encode, bitcode::Decode)]
#[non_exhaustive]
pub enum PointQuantity {
    /// Its position.
    Position,
    /// Its velocity.
    Velocity,
    /// Its acceleration.
    Acceleration,
}

impl fmt::Display for PointQuantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
        })
    }
}

/// The limit that a motion breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, bitcode::Encode, bitcode::Decode)]
#[non_exhaustive]
pub enum BrokenLimit {
    /// The lowest or the highest position.
    Position,
    /// The highest speed.
    Velocity,
    /// The highest acceleration, while the speed rises.
    Acceleration,
    /// The highest deceleration, while the speed falls.
    Deceleration,
    /// The highest jerk.
    Jerk,
}

impl fmt::Display for BrokenLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Deceleration => "deceleration",
            Self::Jerk => "jerk",
        })
    }
}

/// Why a trajectory is refused: the first thing that is wrong with it. Points and axes are counted from 0. Positions in rad (m),
/// and seconds. Nothing has changed then.
#[derive(Clone, Copy, Debug, PartialEq, bitcode::Encode, bitcode::Decode)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// There is no point.
    NoPoint,
    /// A point has values for another number of axes than there are. Velocities and accelerations may be missing.
    Count {
        /// The point.
        point: usize,
        /// Of what.
        quantity: PointQuantity,
        /// How many there are.
        given: usize,
        /// How many axes there are.
        axes: usize,
    },
    /// A point has no value of a kind that another point has, or accelerations without velocities.
    Missing {
        /// The point.
        point: usize,
        /// The axis.
        axis: usize,
        /// Of what.
        quantity: PointQuantity,
    },
    /// A value is infinite or not a number.
    NotFinite {
        /// The point.
        point: usize,
        /// The axis.
        axis: usize,
        /// What it is a value of.
        quantity: PointQuantity,
        /// The value.
        value: f64,
    },
    /// A time is negative, infinite or not a number.
    Time {
        /// The point.
        point: usize,
        /// Its time.
        time_s: f64,
    },
    /// A point is not later than the one before.
    TimeOrder {
        /// The point.
        point: usize,
        /// Its time.
        time_s: f64,
        /// The time of the one before.
        previous_s: f64,
    },
    /// The motion does not go on from where the axis is. A first point later than 0 leaves time to go there.
    Start {
        /// The axis.
        axis: usize,
        /// Of what.
        quantity: PointQuantity,
        /// What the first point has.
        given: f64,
        /// What the axis has.
        present: f64,
    },
    /// A limit is broken on the way to a point, or at it.
    Limit {
        /// The point.
        point: usize,
        /// The axis.
        axis: usize,
        /// The limit.
        broken: BrokenLimit,
        /// When, in seconds after the beginning.
        time_s: f64,
        /// The value that is beyond the limit.
        value: f64,
        /// The limit, with the sign of the value.
        limit: f64,
    },
    /// The way of an axis at rest to the first point leads far out of the positions at both ends: by more than twice the shortest run-up
    /// to the velocity of the point, and by more than 0.01 rad (m) or a hundredth of its range.
    Excursion {
        /// The point.
        point: usize,
        /// The axis.
        axis: usize,
        /// When the axis is farthest out, in seconds after the beginning.
        time_s: f64,
        /// Where it is then.
        position: f64,
        /// The position at the nearer end of the way.
        nearest: f64,
        /// The velocity at the point.
        velocity: f64,
    },
    /// A waypoint cannot be reached from the present motion within the limits.
    Unreachable {
        /// The waypoint.
        point: usize,
        /// The axis.
        axis: usize,
    },
    /// The last point has an acceleration, which would end in a step.
    EndAcceleration {
        /// The axis.
        axis: usize,
        /// The acceleration.
        acceleration: f64,
    },
    /// The last point is passed in motion, and the axis would come to rest outside its position limits.
    NoRoomToStop {
        /// The axis.
        axis: usize,
        /// Where it would come to rest.
        rest: f64,
        /// The limit.
        limit: f64,
    },
}

impl TrajectoryError {
    /// The point that it concerns.
    pub const fn point(&self) -> Option<usize> {
        match *self {
            Self::Count { point, .. }
            | Self::Missing { point, .. }
            | Self::NotFinite { point, .. }
            | Self::Time { point, .. }
            | Self::TimeOrder { point, .. }
            | Self::Limit { point, .. }
            | Self::Excursion { point, .. }
            | Self::Unreachable { point, .. } => Some(point),
            Self::Start { .. } => Some(0),
            Self::NoPoint | Self::EndAcceleration { .. } | Self::NoRoomToStop { .. } => None,
        }
    }

    /// The axis that it concerns.
    pub const fn axis(&self) -> Option<usize> {
        match *self {
            Self::Missing { axis, .. }
            | Self::NotFinite { axis, .. }
            | Self::Start { axis, .. }
            | Self::Limit { axis, .. }
            | Self::Excursion { axis, .. }
            | Self::Unreachable { axis, .. }
            | Self::EndAcceleration { axis, .. }
            | Self::NoRoomToStop { axis, .. } => Some(axis),
            Self::NoPoint | Self::Count { .. } | Self::Time { .. } | Self::TimeOrder { .. } => None,
        }
    }

    /// The whole text, with the axis by its name. `axes` are the names of those that the points are for, in their order.
    pub fn naming(&self, axes: &[&str]) -> String {
        let point = self.point().map(|point| format!("point {point}"));
        let axis = self.axis().map(|axis| axis_name(axes, axis));
        let place: Vec<String> = point.into_iter().chain(axis).collect();
        if place.is_empty() { self.words() } else { format!("{}: {}", place.join(", "), self.words()) }
    }

    /// What is wrong, without the point and the axis.
    pub fn words(&self) -> String {
        match *self {
            Self::NoPoint => "a trajectory needs at least one point".to_owned(),
            Self::Count { quantity, given, axes, .. } => {
                format!("{given} values of {quantity} are given for {axes} axes")
            }
            Self::Missing { quantity, .. } => {
                let others = match quantity {
                    PointQuantity::Position => "each point needs one",
                    PointQuantity::Velocity => {
                        "all points or none have one, and those with accelerations need one"
                    }
                    PointQuantity::Acceleration => "all points or none have one",
                };
                format!("its {quantity} is missing: {others}")
            }
            Self::NotFinite { quantity, value, .. } => format!("its {quantity} is {value}"),
            Self::Time { time_s, .. } => {
                format!("its time is {} s; a time is a finite number of seconds from 0 on", Shown(time_s))
            }
            Self::TimeOrder { time_s, previous_s, .. } => {
                let [time_s, previous_s] = [time_s, previous_s].map(Shown);
                format!("its time, {time_s} s, is not later than that of the point before, {previous_s} s")
            }
            Self::Start { quantity, given, present, .. } => format!(
                "the trajectory begins with the {quantity} {given}, and the present one is {present}; give the first point \
                 a time after 0, or go there first",
                given = Shown(given),
                present = Shown(present)
            ),
            Self::Limit { broken, time_s, value, limit, .. } => {
                format!(
                    "{broken} {value:.6} at {time_s:.6} s is beyond the limit of {limit:.6}",
                    value = Shown(value),
                    time_s = Shown(time_s),
                    limit = Shown(limit)
                )
            }
            Self::Excursion { time_s, position, nearest, velocity, .. } => format!(
                "to reach its velocity {velocity:.6} from rest, the way to it turns round at {position:.6} \
                 ({time_s:.6} s), beyond {nearest:.6}; give it an earlier time, the velocity 0, or points on the way to it",
                velocity = Shown(velocity),
                position = Shown(position),
                time_s = Shown(time_s),
                nearest = Shown(nearest)
            ),
            Self::Unreachable { .. } => {
                "it cannot be reached from the present motion within the limits".to_owned()
            }
            Self::EndAcceleration { acceleration, .. } => {
                format!("the last point has the acceleration {}; it must have none", Shown(acceleration))
            }
            Self::NoRoomToStop { rest, limit, .. } => format!(
                "the last point is passed in motion, and a stop behind it ends at {rest:.6}, beyond the limit of {limit:.6}",
                rest = Shown(rest),
                limit = Shown(limit)
            ),
        }
    }
}

impl fmt::Display for TrajectoryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.naming(&[]))
    }
}

/// The name of an axis of a call; its number where `axes` has none for it.
pub(crate) fn axis_name(axes: &[&str], axis: usize) -> String {
    axes.get(axis).map_or_else(|| format!("axis {axis}"), |name| (*name).to_owned())
}

impl std::error::Error for TrajectoryError {}
