//! What an axis is to do between two points of a stream, whatever they say of it.
//!
//! Between two points of the same kind torques, gains and velocities change evenly, and positions as `interpolation` has it.
//! Between two of different kinds the axis does what the later one says.

use super::interpolation::{BEGIN, END, Piece, WINDOW, Window};
use super::target::{AxisPoint, AxisTarget, PositionPoint};
use crate::guard::AxisLimits;
use crate::plan::State;

/// A time in the interval between two points, or behind it.
#[derive(Clone, Copy, Debug)]
pub(super) struct IntervalTime {
    /// Since the beginning of the interval, in seconds.
    pub since_begin_s: f64,
    /// One divided by the length of the interval.
    pub rate: f64,
    /// How fast time passes for the points.
    pub time_rate: f64,
}

/// A number that changes evenly from one point to the next, and stays behind that.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Ramp {
    begin: f64,
    change: f64,
}

impl Ramp {
    const fn between(begin: f64, end: f64) -> Self {
        Self { begin, change: end - begin }
    }

    const fn constant(value: f64) -> Self {
        Self { begin: value, change: 0.0 }
    }

    fn value(&self, time: &IntervalTime) -> f64 {
        self.begin + self.change * (time.since_begin_s * time.rate).clamp(0.0, 1.0)
    }

    fn slope(&self, time: &IntervalTime) -> f64 {
        let is_inside = (0.0..1.0).contains(&(time.since_begin_s * time.rate));
        if is_inside { self.change * time.rate } else { 0.0 }
    }
}

/// What an axis is to do between two points.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum AxisPiece {
    Position { path: Piece, torque: Ramp },
    Impedance { path: Piece, stiffness: Ramp, damping: Ramp, torque: Ramp },
    Velocity(Ramp),
    Torque(Ramp),
}

impl Default for AxisPiece {
    fn default() -> Self {
        Self::Position { path: Piece::default(), torque: Ramp::default() }
    }
}

impl AxisPiece {
    /// Between the two points of a window that an interval has as its ends.
    pub(super) fn new(window: &Window, points: &[&AxisPoint; WINDOW], limits: &AxisLimits) -> Self {
        match (points[BEGIN], points[END]) {
            (AxisPoint::Position { torque: begin, .. }, AxisPoint::Position { torque, .. }) => {
                let path = path(window, points, limits);
                Self::Position { path, torque: Ramp::between(*begin, *torque) }
            }
            (_, AxisPoint::Position { torque, .. }) => {
                Self::Position { path: path(window, points, limits), torque: Ramp::constant(*torque) }
            }
            (
                AxisPoint::Impedance { stiffness: begin_kp, damping: begin_kd, torque: begin, .. },
                AxisPoint::Impedance { stiffness, damping, torque, .. },
            ) => Self::Impedance {
                path: path(window, points, limits),
                stiffness: Ramp::between(*begin_kp, *stiffness),
                damping: Ramp::between(*begin_kd, *damping),
                torque: Ramp::between(*begin, *torque),
            },
            (_, AxisPoint::Impedance { stiffness, damping, torque, .. }) => Self::Impedance {
                path: path(window, points, limits),
                stiffness: Ramp::constant(*stiffness),
                damping: Ramp::constant(*damping),
                torque: Ramp::constant(*torque),
            },
            (AxisPoint::Velocity(begin), AxisPoint::Velocity(end)) => {
                Self::Velocity(Ramp::between(*begin, *end))
            }
            (_, AxisPoint::Velocity(velocity)) => Self::Velocity(Ramp::constant(*velocity)),
            (AxisPoint::Torque(begin), AxisPoint::Torque(end)) => Self::Torque(Ramp::between(*begin, *end)),
            (_, AxisPoint::Torque(torque)) => Self::Torque(Ramp::constant(*torque)),
        }
    }

    /// What it wants at a time.
    pub(super) fn target(&self, time: &IntervalTime, limits: &AxisLimits) -> AxisTarget {
        let rate = time.time_rate;
        let state_of = |path: &Piece| {
            let State { position, velocity, acceleration } = path.state(time.since_begin_s, limits);
            State { position, velocity: velocity * rate, acceleration: acceleration * rate * rate }
        };
        match self {
            Self::Position { path, torque } => {
                AxisTarget::Position { state: state_of(path), torque: torque.value(time) }
            }
            Self::Impedance { path, stiffness, damping, torque } => AxisTarget::Impedance {
                state: state_of(path),
                stiffness: stiffness.value(time),
                damping: damping.value(time),
                torque: torque.value(time),
            },
            Self::Velocity(velocity) => AxisTarget::Velocity {
                velocity: velocity.value(time) * rate,
                acceleration: velocity.slope(time) * rate * rate,
            },
            Self::Torque(torque) => AxisTarget::Torque(torque.value(time)),
        }
    }
}

/// The motion between two points of which the later one has a position, with the points around them as far as they have one, too.
fn path(window: &Window, points: &[&AxisPoint; WINDOW], limits: &AxisLimits) -> Piece {
    let mut motions = [PositionPoint::default(); WINDOW];
    let (mut from, mut to) = (0, WINDOW);
    for (place, (motion, point)) in motions.iter_mut().zip(points).enumerate() {
        match point.position_point() {
            Some(known) => *motion = *known,
            None if place <= BEGIN => from = place + 1,
            None => to = to.min(place),
        }
    }
    if from > BEGIN {
        return window.arrival(&motions[END]);
    }
    match (from, to) {
        (0, WINDOW) => window.piece(&motions, limits),
        _ => window.narrowed(from, to).piece(&motions, limits),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STAMPS_NS: [u64; WINDOW] = [0, 100_000_000, 200_000_000, 300_000_000, 400_000_000, 500_000_000];

    fn target(points: [AxisPoint; WINDOW], since_begin_s: f64) -> AxisTarget {
        let limits = AxisLimits::NONE;
        let piece = AxisPiece::new(&Window::new(&STAMPS_NS, 0, WINDOW), &points.each_ref(), &limits);
        piece.target(&IntervalTime { since_begin_s, rate: 10.0, time_rate: 1.0 }, &limits)
    }

    #[test]
    fn torques_velocities_and_gains_change_evenly_and_stay_behind_the_last_point() {
        let torques = [1.0, 1.0, 2.0, 4.0, 9.0, 9.0].map(AxisPoint::Torque);
        assert_eq!(target(torques, 0.05), AxisTarget::Torque(3.0));
        assert_eq!(target(torques, 0.15), AxisTarget::Torque(4.0));
        let velocities = [0.0, 0.0, 0.5, 1.0, 1.5, 2.0].map(AxisPoint::Velocity);
        let AxisTarget::Velocity { velocity, acceleration } = target(velocities, 0.05) else { panic!() };
        assert_eq!((velocity, acceleration), (0.75, 5.0));
        let expected = AxisTarget::Velocity { velocity: 1.0, acceleration: 0.0 };
        assert_eq!(target(velocities, 0.1), expected);
        let soft = |stiffness: f64| AxisPoint::position(0.3).with_impedance(stiffness, 2.0).with_torque(1.0);
        let AxisTarget::Impedance { state, stiffness, damping, torque } =
            target([10.0, 10.0, 10.0, 30.0, 30.0, 30.0].map(soft), 0.05)
        else {
            panic!()
        };
        assert_eq!((state, stiffness, damping, torque), (State::rest(0.3), 20.0, 2.0, 1.0));
    }

    #[test]
    fn between_points_of_different_kinds_the_later_one_counts() {
        let (torque, position) = (AxisPoint::Torque(5.0), AxisPoint::position(0.2));
        assert_eq!(
            target([position, position, position, torque, torque, torque], 0.02),
            AxisTarget::Torque(5.0)
        );
        let moving = AxisPoint::moving(0.2, 1.0).with_torque(3.0);
        let AxisTarget::Position { state, torque: fed_forward } =
            target([torque, torque, torque, moving, position, torque], 0.02)
        else {
            panic!()
        };
        assert!((state.position - 0.12).abs() < 1e-12 && state.velocity == 1.0, "{state:?}");
        assert_eq!(fed_forward, 3.0);
    }

    #[test]
    fn positions_beside_points_without_one_are_interpolated_by_what_is_known() {
        let (torque, line) = (AxisPoint::Torque(5.0), |place: f64| AxisPoint::position(0.1 * place));
        let points = [torque, torque, line(2.0), line(3.0), torque, torque];
        let AxisTarget::Position { state, .. } = target(points, 0.05) else { panic!() };
        assert!((state.position - 0.25).abs() < 1e-9, "{state:?}");
    }
}
