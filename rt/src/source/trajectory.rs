//! A trajectory that was checked before it began: a path, and how fast the group goes along it.
//!
//! The path is a polynomial for each axis between one point and the next, in path time. A time law tells the path time at each
//! moment of the execution: at first they are the same; a speed override, a pause or a resumption changes the law, and never
//! the path. The real-time thread only samples both, from memory that the host owns.

use crate::capacity::MAX_AXES;
use crate::plan::State;

/// A polynomial of the fifth degree, its coefficients in ascending order: the position of an axis (rad or m) at a time in
/// seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Polynomial(pub [f64; 6]);

impl Polynomial {
    /// One that goes on at a velocity.
    pub const fn linear(position: f64, velocity: f64) -> Self {
        Self([position, velocity, 0.0, 0.0, 0.0, 0.0])
    }

    /// Position, velocity and acceleration at this time.
    pub fn state(&self, time_s: f64) -> State {
        let [c0, c1, c2, c3, c4, c5] = self.0;
        let t = time_s;
        State {
            position: c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            velocity: c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
            acceleration: 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
        }
    }

    /// The jerk at this time.
    pub fn jerk(&self, time_s: f64) -> f64 {
        let [_, _, _, c3, c4, c5] = self.0;
        6.0 * c3 + time_s * (24.0 * c4 + time_s * 60.0 * c5)
    }
}

/// A part of a time law: from a time of the execution on, up to the next part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct TimeLawPhase {
    /// When it begins, in seconds after the beginning of the execution.
    pub from_s: f64,
    /// The path time in seconds, as a polynomial of the seconds since `from_s`, its coefficients in ascending order.
    pub path_s: [f64; 5],
}

impl TimeLawPhase {
    /// One that goes along the path at a constant rate: 1 as it was written, 0 not at all.
    pub const fn constant(from_s: f64, path_s: f64, rate: f64) -> Self {
        Self { from_s, path_s: [path_s, rate, 0.0, 0.0, 0.0] }
    }

    /// The path time at this time of the execution.
    pub fn at(&self, time_s: f64) -> PathTime {
        let [c0, c1, c2, c3, c4] = self.path_s;
        let t = time_s - self.from_s;
        PathTime {
            path_s: c0 + t * (c1 + t * (c2 + t * (c3 + t * c4))),
            rate: c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * 4.0 * c4)),
            rate_change: 2.0 * c2 + t * (6.0 * c3 + t * 12.0 * c4),
        }
    }
}

/// How far the group is on a path, and how fast it goes along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathTime {
    /// The time of the path, in seconds.
    pub path_s: f64,
    /// Seconds of the path in a second.
    pub rate: f64,
    /// Change of the rate in a second.
    pub rate_change: f64,
}

impl PathTime {
    /// What is left of the rates of a motion that is gone along at this rate.
    pub fn scale(&self, state: &State) -> State {
        let Self { rate, rate_change, .. } = *self;
        State {
            position: state.position,
            velocity: state.velocity * rate,
            acceleration: state.acceleration * rate * rate + state.velocity * rate_change,
        }
    }
}

/// A trajectory in memory of the host.
#[derive(Clone, Copy, Debug)]
pub struct TrajectoryView<'a> {
    /// The path times of the points, in seconds: the first is 0, and each is later than the one before.
    pub times_s: &'a [f64],
    /// For each point a polynomial of each axis, in the time since the point: the way to the next point, and behind the last
    /// point how it goes on.
    pub polynomials: &'a [Polynomial],
    /// The number of axes.
    pub axes: usize,
    /// The parts of the time law; the first begins at 0.
    pub law: &'a [TimeLawPhase],
    /// The time of the execution at which the last point is reached; infinite if it is not.
    pub duration_s: f64,
}

impl TrajectoryView<'_> {
    /// How far along the path the group is at this time of the execution.
    pub fn path_time(&self, at_s: f64) -> PathTime {
        let phase = self.law.partition_point(|phase| phase.from_s <= at_s).saturating_sub(1);
        let as_written = TimeLawPhase::constant(0.0, 0.0, 1.0);
        self.law.get(phase).unwrap_or(&as_written).at(at_s)
    }

    /// Where the axes are to be at this time of the execution. Two binary searches, and a polynomial for each axis.
    pub fn sample<const AXES: usize>(&self, at_s: f64) -> TrajectorySample<AXES> {
        let path_time = self.path_time(at_s);
        let point = self.times_s.partition_point(|time_s| *time_s <= path_time.path_s).saturating_sub(1);
        let since_point_s = path_time.path_s - self.times_s.get(point).copied().unwrap_or(0.0);
        let polynomials = self.polynomials.get(point * self.axes..).unwrap_or_default();
        let mut states = [State::default(); AXES];
        for (state, polynomial) in states.iter_mut().zip(polynomials.iter().take(self.axes)) {
            *state = path_time.scale(&polynomial.state(since_point_s));
        }
        TrajectorySample { states, remaining_s: (self.duration_s - at_s).max(0.0) }
    }
}

/// What a trajectory wants at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct TrajectorySample<const AXES: usize = MAX_AXES> {
    /// Where the axes are to be; those that it does not have are at zero.
    pub states: [State; AXES],
    /// Time left to the last point, in seconds: 0 from there on, infinite while the group pauses on the path.
    pub remaining_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two axes: from 1 to 2 rad in 2 s by t³/8, then on at 1.5 rad/s; the other one stays.
    const POLYNOMIALS: [Polynomial; 4] = [
        Polynomial([1.0, 0.0, 0.0, 0.125, 0.0, 0.0]),
        Polynomial::linear(0.5, 0.0),
        Polynomial::linear(2.0, 1.5),
        Polynomial::linear(0.5, 0.0),
    ];

    fn view<'a>(law: &'a [TimeLawPhase], duration_s: f64) -> TrajectoryView<'a> {
        TrajectoryView { times_s: &[0.0, 2.0], polynomials: &POLYNOMIALS, axes: 2, law, duration_s }
    }

    #[test]
    fn a_path_is_sampled_at_its_points_between_them_and_behind_the_last_one() {
        let law = [TimeLawPhase::constant(0.0, 0.0, 1.0)];
        let at = |at_s: f64| view(&law, 2.0).sample::<3>(at_s);
        assert_eq!(at(0.0).states[0], State::rest(1.0));
        assert_eq!(at(1.0).states[0], State { position: 1.125, velocity: 0.375, acceleration: 0.75 });
        assert_eq!(at(2.0).states[0], State { position: 2.0, velocity: 1.5, acceleration: 0.0 });
        assert_eq!(at(3.0).states[0], State { position: 3.5, velocity: 1.5, acceleration: 0.0 });
        assert!([0.0, 1.7, 5.0].iter().all(|at_s| at(*at_s).states[1] == State::rest(0.5)));
        assert_eq!((at(1.5).remaining_s, at(2.5).remaining_s), (0.5, 0.0));
        assert_eq!(at(1.0).states[2], State::default(), "an axis that it does not have");
    }

    #[test]
    fn a_time_law_changes_the_rates_and_never_the_path() {
        // As written for 0.5 s, then the rate falls to 0 within 1 s.
        let slowing = TimeLawPhase { from_s: 0.5, path_s: [0.5, 1.0, -0.5, 0.0, 0.0] };
        let law = [TimeLawPhase::constant(0.0, 0.0, 1.0), slowing, TimeLawPhase::constant(1.5, 1.0, 0.0)];
        let view = view(&law, f64::INFINITY);
        let middle = view.sample::<2>(1.0);
        // Path time 0.875 at half the rate, which falls by 1 in a second.
        let on_path = POLYNOMIALS[0].state(0.875);
        assert_eq!(middle.states[0].position, on_path.position);
        assert_eq!(middle.states[0].velocity, on_path.velocity / 2.0);
        assert_eq!(middle.states[0].acceleration, on_path.acceleration / 4.0 - on_path.velocity);
        assert_eq!(view.sample::<2>(9.0).states[0], State::rest(1.125));
        assert_eq!(view.sample::<2>(9.0).remaining_s, f64::INFINITY);
    }

    #[test]
    fn a_trajectory_without_points_stays_at_zero() {
        let empty = TrajectoryView { times_s: &[], polynomials: &[], axes: 2, law: &[], duration_s: 0.0 };
        assert_eq!(empty.sample::<2>(1.0).states, [State::default(); 2]);
    }
}
