use super::*;
use proptest::prelude::*;

const LIMITS: AxisLimits = AxisLimits {
    position_min: -2.0,
    position_max: 2.0,
    velocity: 2.0,
    acceleration: 8.0,
    deceleration: 12.0,
    jerk: 150.0,
    torque: 40.0,
};
const PERIOD_S: f64 = 0.001;

fn point(time_s: f64, positions: &[f64]) -> TrajectoryPoint {
    TrajectoryPoint { time_s, positions: positions.to_vec(), ..TrajectoryPoint::default() }
}

fn with_velocity(time_s: f64, position: f64, velocity: f64) -> TrajectoryPoint {
    TrajectoryPoint { velocities: vec![velocity], ..point(time_s, &[position]) }
}

fn from(start: &[State], points: &[TrajectoryPoint]) -> Result<Trajectory, TrajectoryError> {
    let limits = vec![LIMITS; start.len()];
    Trajectory::new(points, &TrajectoryConditions { start, limits: &limits, period_s: PERIOD_S })
}

fn from_rest(points: &[TrajectoryPoint]) -> Result<Trajectory, TrajectoryError> {
    from(&[State::rest(0.0)], points)
}

#[test]
fn a_trajectory_goes_through_its_points_at_their_times_and_ends_at_rest() {
    let points = [point(1.0, &[0.5]), point(1.8, &[0.8]), point(3.0, &[0.1])];
    let trajectory = from_rest(&points).unwrap();
    assert_eq!(trajectory.duration_s(), 3.0);
    for point in &points {
        assert_eq!(trajectory.sample(point.time_s).states[0].position, point.positions[0]);
    }
    assert_eq!(trajectory.sample(0.0).states[0], State::rest(0.0));
    assert_eq!(trajectory.sample(3.0).states[0], State::rest(0.1));
    assert_eq!(trajectory.sample(9.0).states[0], State::rest(0.1));
}

#[test]
fn what_is_wrong_with_points_is_named_with_the_first_of_them() {
    let refused = |points: &[TrajectoryPoint]| from_rest(points).unwrap_err();
    assert_eq!(refused(&[]), TrajectoryError::NoPoint);
    let time = TrajectoryError::Time { point: 0, time_s: -0.5 };
    assert_eq!(refused(&[point(-0.5, &[0.0])]), time);
    assert!(matches!(refused(&[point(f64::NAN, &[0.0])]), TrajectoryError::Time { point: 0, .. }));
    let order = TrajectoryError::TimeOrder { point: 2, time_s: 1.0, previous_s: 1.0 };
    assert_eq!(refused(&[point(0.5, &[0.0]), point(1.0, &[0.0]), point(1.0, &[0.0])]), order);
    let count = TrajectoryError::Count { point: 1, quantity: PointQuantity::Position, given: 2, axes: 1 };
    assert_eq!(refused(&[point(0.5, &[0.0]), point(1.0, &[0.0, 0.0])]), count);
    let missing = TrajectoryError::Missing { point: 1, axis: 0, quantity: PointQuantity::Velocity };
    assert_eq!(refused(&[with_velocity(0.5, 0.0, 0.0), point(1.0, &[0.0])]), missing);
    let accelerated = TrajectoryPoint { accelerations: vec![0.0], ..point(0.5, &[0.0]) };
    let missing = TrajectoryError::Missing { point: 0, axis: 0, quantity: PointQuantity::Velocity };
    assert_eq!(refused(&[accelerated]), missing);
    let infinite = refused(&[point(0.5, &[0.0]), point(1.0, &[f64::INFINITY])]);
    let value = f64::INFINITY;
    let expected = TrajectoryError::NotFinite { point: 1, axis: 0, quantity: PointQuantity::Position, value };
    assert_eq!(infinite, expected);
    let close = refused(&[point(0.5, &[0.0]), point(0.5 + 1e-15, &[0.1])]);
    assert!(matches!(close, TrajectoryError::Limit { point: 1, axis: 0, .. }), "{close:?}");
    assert_eq!(count.to_string(), "point 1: 2 values of position are given for 1 axes",);
}

#[test]
fn a_first_point_at_the_beginning_must_be_where_the_axis_is() {
    let error = from_rest(&[point(0.0, &[0.01]), point(1.0, &[0.1])]).unwrap_err();
    let expected =
        TrajectoryError::Start { axis: 0, quantity: PointQuantity::Position, given: 0.01, present: 0.0 };
    assert_eq!(error, expected);
    let error = from_rest(&[with_velocity(0.0, 0.0, 0.2), with_velocity(1.0, 0.1, 0.0)]).unwrap_err();
    assert!(matches!(error, TrajectoryError::Start { quantity: PointQuantity::Velocity, .. }));
    // Rounding in a file is not a step: the trajectory begins exactly where the axis is.
    let begun = from_rest(&[point(0.0, &[1e-7]), point(1.0, &[0.1])]).unwrap();
    assert_eq!(begun.sample(0.0).states[0], State::rest(0.0));
}

#[test]
fn a_trajectory_goes_on_from_an_axis_in_motion_without_a_step() {
    let start = State { position: 0.2, velocity: 0.5, acceleration: -1.0 };
    for points in [
        vec![point(1.0, &[0.5]), point(2.0, &[0.6])],
        vec![with_velocity(1.0, 0.5, 0.2), with_velocity(2.0, 0.6, 0.0)],
    ] {
        let trajectory = from(&[start], &points).unwrap();
        assert_eq!(trajectory.sample(0.0).states[0], start);
    }
}

/// How far an axis is outside of its first position and the first point, at most, before that point.
fn excursion(trajectory: &Trajectory, first_s: f64) -> f64 {
    let position = |step: i32| trajectory.sample(first_s * f64::from(step) / 1_000.0).states[0].position;
    let (lowest, highest) = (position(0).min(position(1_000)), position(0).max(position(1_000)));
    (0..=1_000).map(|step| (position(step) - highest).max(lowest - position(step))).fold(0.0, f64::max)
}

#[test]
fn a_wait_is_no_part_of_the_run_up_to_a_first_point_in_motion() {
    for wait_s in [2.0, 5.0, 10.0, 20.0, 60.0] {
        let points = [with_velocity(wait_s, 0.0, 0.3), with_velocity(wait_s + 1.5, 0.3, 0.0)];
        let error = from_rest(&points).unwrap_err();
        assert_eq!((error.point(), error.axis()), (Some(0), Some(0)), "{wait_s} s: {error}");
        // An axis in motion takes over, as from a trajectory that is about to end.
        let start = [State { position: 0.2, velocity: -0.015, acceleration: 0.3 }];
        assert!(wait_s > 10.0 || from(&start, &[point(wait_s, &[0.0])]).is_ok(), "{wait_s} s");
        // Standing, it waits and then begins.
        let waiting = from_rest(&[with_velocity(wait_s, 0.0, 0.0), with_velocity(wait_s + 1.5, 0.3, 0.0)]);
        assert_eq!(excursion(&waiting.unwrap(), wait_s), 0.0);
    }
}

#[test]
fn a_first_point_in_motion_is_reached_by_a_run_up_that_its_velocity_asks_for() {
    let most = largest_excursion(0.3, &LIMITS);
    for (time_s, position) in [(0.3, 0.0), (0.3, 0.03), (1.0, 0.15), (1.0, 0.12), (4.0, 1.0)] {
        let points = [with_velocity(time_s, position, 0.3), with_velocity(time_s + 1.5, position + 0.3, 0.0)];
        let trajectory = from_rest(&points).unwrap();
        assert!(excursion(&trajectory, time_s) <= most, "{time_s} s, {position}");
    }
    // As a planner sends them: from the present state, at rest or in motion, at the time 0.
    for velocity in [0.0, 0.4] {
        let start = [State { position: 0.1, velocity, acceleration: 0.0 }];
        let points = [with_velocity(0.0, 0.1, velocity), with_velocity(1.5, 0.4, 0.0)];
        assert!(from(&start, &points).is_ok(), "{velocity}");
    }
}

#[test]
fn the_way_to_the_first_point_and_each_later_one_is_checked() {
    let limit_of = |points: &[TrajectoryPoint]| match from_rest(points).unwrap_err() {
        TrajectoryError::Limit { point, broken, .. } => (point, broken),
        error => panic!("{error}"),
    };
    assert_eq!(limit_of(&[point(0.2, &[1.0])]), (0, BrokenLimit::Velocity));
    assert_eq!(limit_of(&[point(2.0, &[1.0]), point(4.0, &[2.1])]), (1, BrokenLimit::Position));
    assert_eq!(limit_of(&[point(0.0, &[0.0]), point(0.2, &[0.05])]), (1, BrokenLimit::Jerk));
    assert_eq!(limit_of(&[point(0.0, &[0.0]), point(0.55, &[0.5])]), (1, BrokenLimit::Acceleration));
}

#[test]
fn the_last_point_may_be_passed_in_motion_where_there_is_room_for_a_stop() {
    let passing = |position: f64| from_rest(&[with_velocity(2.0, position, 1.0)]);
    let trajectory = passing(1.0).unwrap();
    assert_eq!(trajectory.sample(2.0).states[0], State { position: 1.0, velocity: 1.0, acceleration: 0.0 });
    let error = passing(1.95).unwrap_err();
    assert!(matches!(error, TrajectoryError::NoRoomToStop { axis: 0, limit: 2.0, .. }), "{error:?}");
    let accelerated = TrajectoryPoint { accelerations: vec![0.5], ..with_velocity(2.0, 1.0, 0.0) };
    let error = from_rest(&[accelerated]).unwrap_err();
    assert_eq!(error, TrajectoryError::EndAcceleration { axis: 0, acceleration: 0.5 });
}

#[test]
fn an_axis_that_a_trajectory_does_not_move_is_known() {
    let trajectory = from(&[State::rest(0.0), State::rest(0.3)], &[point(1.0, &[0.2, 0.3])]).unwrap();
    assert!(trajectory.moves(0) && !trajectory.moves(1));
}

/// What the guard of the real-time thread says of the set-points that a trajectory makes, beyond it the third difference, and
/// whether it stays within the limits of the position.
fn broken_by_samples(trajectory: &Trajectory, axis: usize) -> Option<String> {
    let cycles = (trajectory.duration_s() / PERIOD_S).ceil() as u32 + 4;
    let at = |cycle: u32| trajectory.sample(f64::from(cycle) * PERIOD_S).states[axis].position;
    let mut sent = [at(0); 3];
    for cycle in 1..=cycles {
        let next = at(cycle);
        let velocity = (next - sent[0]) / PERIOD_S;
        let acceleration = (next - 2.0 * sent[0] + sent[1]) / (PERIOD_S * PERIOD_S);
        let jerk = (next - 3.0 * sent[0] + 3.0 * sent[1] - sent[2]) / PERIOD_S.powi(3);
        let steepest = LIMITS.acceleration.max(LIMITS.deceleration);
        let is_kept = (LIMITS.position_min..=LIMITS.position_max).contains(&next)
            && velocity.abs() <= LIMITS.velocity * (1.0 + 1e-6)
            && acceleration.abs()
                <= steepest * (1.0 + 1e-6) + 4.0 * f64::EPSILON * 3.0 / (PERIOD_S * PERIOD_S)
            && jerk.abs() <= LIMITS.jerk * (1.0 + 1e-6) + 64.0 * f64::EPSILON * 3.0 / PERIOD_S.powi(3);
        if !is_kept {
            return Some(format!("cycle {cycle}: {next} {velocity} {acceleration} {jerk}"));
        }
        sent = [next, sent[0], sent[1]];
    }
    None
}

/// Random points of two axes, from gentle to violent, with velocities or without.
fn random_points() -> impl Strategy<Value = Vec<TrajectoryPoint>> {
    let step = (0.05f64..1.5, [-1.0f64..1.0, -1.0f64..1.0], [-1.0f64..1.0, -1.0f64..1.0]);
    (prop::collection::vec(step, 1..12), 0.02f64..1.5, any::<bool>()).prop_map(
        |(steps, size, has_velocities)| {
            let mut time_s = 0.0;
            let count = steps.len();
            let points = steps.into_iter().enumerate().map(|(index, (step, positions, velocities))| {
                time_s += step;
                let end = if index + 1 == count { 0.0 } else { 1.0 };
                let velocities =
                    if has_velocities { velocities.map(|v| v * size * end).to_vec() } else { vec![] };
                TrajectoryPoint { velocities, ..point(time_s, &positions.map(|position| position * size)) }
            });
            points.collect()
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn what_passes_the_check_passes_the_guard_in_every_cycle(points in random_points()) {
        let start = [State::rest(0.0), State::rest(0.1)];
        if let Ok(trajectory) = from(&start, &points) {
            for axis in 0..2 {
                prop_assert_eq!(broken_by_samples(&trajectory, axis), None);
            }
        }
    }

    #[test]
    fn what_breaks_a_limit_is_refused_at_the_first_point_and_axis_that_samples_show(points in random_points()) {
        let start = [State::rest(0.0), State::rest(0.1)];
        let loose = AxisLimits {
            position_min: -1e9, position_max: 1e9, velocity: 1e9, acceleration: 1e9, deceleration: 1e9, jerk: 1e12, torque: 1.0,
        };
        let conditions = TrajectoryConditions { start: &start, limits: &[loose; 2], period_s: PERIOD_S };
        // Without limits, hardly any excursion on the way to the first point is short enough.
        let Ok(Trajectory { path, .. }) = Trajectory::new(&points, &conditions) else { return Ok(()) };
        // For each way to a point and each axis: by how much samples of it are beyond the limits.
        let excess = |point: usize, axis: usize| {
            let polynomial = path.polynomials[point * 2 + axis];
            let duration_s = path.times_s[point + 1] - path.times_s[point];
            (0..=400).map(|step| {
                let time_s = duration_s * f64::from(step) / 400.0;
                let State { position, velocity, acceleration } = polynomial.state(time_s);
                // Where the axis turns round, rounding decides the sign of the velocity: the samples beside it judge.
                let is_faster = velocity * acceleration > 1e-9;
                let steepest = if is_faster { LIMITS.acceleration } else { LIMITS.deceleration };
                [
                    position.abs() / LIMITS.position_max, velocity.abs() / LIMITS.velocity, acceleration.abs() / steepest,
                    polynomial.jerk(time_s).abs() / LIMITS.jerk,
                ].into_iter().fold(0.0, f64::max)
            }).fold(0.0, f64::max)
        };
        // What the points say by themselves comes before what the polynomials make of them.
        let own = |point: usize, axis: usize| {
            let [before, this] = [point, point + 1].map(|knot| path.polynomials[knot * 2 + axis].state(0.0));
            let speed = (this.position - before.position) / (path.times_s[point + 1] - path.times_s[point]);
            (this.position.abs() / LIMITS.position_max)
                .max(speed.abs() / LIMITS.velocity)
                .max(this.velocity.abs() / LIMITS.velocity * f64::from(u8::from(!points[0].velocities.is_empty())))
        };
        let places = || (0..points.len()).flat_map(|point| [(point, 0), (point, 1)]);
        let first = places().map(|(point, axis)| (point, axis, own(point, axis)))
            .chain(places().map(|(point, axis)| (point, axis, excess(point, axis))))
            .find(|(_, _, excess)| *excess > 0.98);
        match (first, from(&start, &points)) {
            // Too near to the limit for samples to tell.
            (Some((_, _, excess)), _) if excess < 1.02 => {}
            (None, result) => prop_assert!(result.is_ok(), "{result:?}"),
            (Some((point, axis, _)), result) => {
                let error = result.unwrap_err();
                let is_limit = matches!(error, TrajectoryError::Limit { .. });
                prop_assert!(is_limit && error.point() == Some(point) && error.axis() == Some(axis), "{error:?}");
            }
        }
    }
}

#[test]
fn a_joint_that_turns_round_at_a_point_slows_down_on_its_way_there_and_speeds_up_behind_it() {
    // Rounding makes the joint turn round 2e-16 s before the first point. There it slows down, with less than the limit of that.
    let points = [
        point(0.4283779411302248, &[0.2670346674300507]),
        point(0.9150255741123452, &[-0.04568410709475186]),
        point(1.8627984395373585, &[0.0]),
    ];
    assert_eq!(from_rest(&points).unwrap_err().point(), Some(1));
}

/// The largest use of a limit that samples of a trajectory show, by differences of positions with a small step.
fn largest_use(trajectory: &Trajectory, axes: usize, limits: &AxisLimits) -> f64 {
    let step_s = 1e-3;
    let end_s = trajectory.duration_s().min(30.0) + 0.01;
    let count = (end_s / step_s) as usize;
    let mut most: f64 = 0.0;
    for axis in 0..axes {
        let p: Vec<f64> =
            (0..count).map(|k| trajectory.sample(k as f64 * step_s).states[axis].position).collect();
        for four in p.windows(4) {
            let velocity = (four[1] - four[0]) / step_s;
            let acceleration = (four[2] - 2.0 * four[1] + four[0]) / (step_s * step_s);
            let jerk = (four[3] - 3.0 * four[2] + 3.0 * four[1] - four[0]) / step_s.powi(3);
            let steepest =
                if velocity * acceleration > 0.0 { limits.acceleration } else { limits.deceleration };
            most = most
                .max(velocity.abs() / limits.velocity)
                .max(acceleration.abs() / steepest.max(limits.acceleration.min(limits.deceleration)))
                .max(jerk.abs() / limits.jerk);
        }
    }
    most
}

const EVEN: AxisLimits = AxisLimits { deceleration: 8.0, ..LIMITS };

fn even_limits(axes: usize) -> Vec<AxisLimits> {
    vec![EVEN; axes]
}

/// A path of two axes there and back.
fn there_and_back() -> Trajectory {
    let start = [State::rest(0.0), State::rest(0.1)];
    let points = [point(1.0, &[0.8, 0.0]), point(1.7, &[0.4, 0.5]), point(2.6, &[0.0, 0.1])];
    let conditions = TrajectoryConditions { start: &start, limits: &even_limits(2), period_s: PERIOD_S };
    Trajectory::new(&points, &conditions).unwrap()
}

#[test]
fn a_pause_comes_to_rest_on_the_path_and_a_resumption_goes_on_to_its_end() {
    let written = there_and_back();
    for at_s in [0.05, 0.3, 0.5, 0.9, 1.3, 1.9] {
        let pausing = written.at_rate(at_s, 0.0, &even_limits(2)).unwrap();
        assert_eq!(pausing.sample(0.0).states, written.sample(at_s).states, "without a step");
        assert_eq!(pausing.duration_s(), f64::INFINITY);
        let rest = pausing.sample(20.0);
        assert!(rest.states.iter().all(|state| state.velocity == 0.0 && state.acceleration == 0.0));
        let stopped_s = pausing.path_time(20.0).path_s;
        assert_eq!(rest.states[0].position, written.sample(stopped_s).states[0].position, "on the path");
        assert!(stopped_s - at_s < 0.6, "{at_s}: {stopped_s}");
        assert!(largest_use(&pausing, 2, &EVEN) < 1.0 + 1e-4, "{at_s}");
        let resumed = pausing.at_rate(20.0, 1.0, &even_limits(2)).unwrap();
        assert_eq!(resumed.sample(0.0).states, rest.states);
        let end = resumed.sample(resumed.duration_s()).states;
        assert!((end[0].position, end[0].velocity) == (0.0, 0.0) && end[1].position == 0.1, "{end:?}");
        assert!(largest_use(&resumed, 2, &EVEN) < 1.0 + 1e-4, "{at_s}");
    }
}

#[test]
fn a_lower_rate_takes_longer_and_a_higher_one_is_refused_where_a_limit_is_in_the_way() {
    let written = there_and_back();
    let limits = even_limits(2);
    let slow = written.at_rate(0.2, 0.5, &limits).unwrap();
    let expected = 2.0 * (written.duration_s() - 0.2);
    assert!(slow.duration_s() < expected && slow.duration_s() > 0.9 * expected, "{}", slow.duration_s());
    assert!(largest_use(&slow, 2, &EVEN) < 1.0 + 1e-4);
    // From the middle of a change to another rate.
    let faster = slow.at_rate(0.05, 0.8, &limits).unwrap();
    assert_eq!(faster.sample(0.0).states, slow.sample(0.05).states);
    assert!(faster.duration_s() < slow.duration_s() - 0.05);
    assert!(largest_use(&faster, 2, &EVEN) < 1.0 + 1e-4);
    let quick = written.at_rate(0.2, 1.05, &limits).unwrap();
    assert!(quick.duration_s() < written.duration_s() - 0.2);
    assert!(largest_use(&quick, 2, &EVEN) < 1.0 + 1e-4);
    let refused = written.at_rate(0.2, 3.0, &limits).unwrap_err();
    assert!(matches!(refused, RateError::Limit { .. }), "{refused:?}");
    for rate in [-0.1, f64::NAN, f64::INFINITY] {
        assert!(matches!(written.at_rate(0.2, rate, &limits), Err(RateError::NotARate { .. })));
    }
    assert_eq!(written.at_rate(2.7, 0.5, &limits), Err(RateError::Over));
}

#[test]
fn the_same_rate_changes_nothing() {
    let written = there_and_back();
    let same = written.at_rate(0.7, 1.0, &even_limits(2)).unwrap();
    for at_s in [0.0, 0.4, 1.9, 3.0] {
        assert_eq!(same.sample(at_s).states, written.sample(0.7 + at_s).states);
    }
}

fn through(waypoints: &[Vec<f64>], start: &[f64]) -> Result<Trajectory, TrajectoryError> {
    let start: Vec<State> = start.iter().map(|position| State::rest(*position)).collect();
    let limits = even_limits(start.len());
    Trajectory::through(
        waypoints,
        &TrajectoryConditions { start: &start, limits: &limits, period_s: PERIOD_S },
    )
}

/// The time of moves from rest to rest through all waypoints.
fn stopping_s(waypoints: &[Vec<f64>], start: &[f64], limits: &AxisLimits) -> f64 {
    use takt_rt::plan::{Limits, PlanOptions, Problem, Profile, synchronised};
    let steepest = limits.acceleration.min(limits.deceleration);
    let limits = Limits::symmetric(limits.velocity, steepest, limits.jerk);
    let mut from = start.to_vec();
    let mut sum_s = 0.0;
    for to in waypoints {
        let problems: Vec<Problem> = from
            .iter()
            .zip(to)
            .map(|(from, to)| Problem { start: State::rest(*from), target: State::rest(*to), limits })
            .collect();
        let mut profiles = vec![Profile::hold(0.0); problems.len()];
        sum_s += synchronised(&problems, &mut profiles, PlanOptions::default()).unwrap();
        from.clone_from(to);
    }
    sum_s
}

#[test]
fn waypoints_are_passed_without_stopping_within_all_limits() {
    let waypoints = [vec![0.5, 0.2], vec![0.9, 0.6], vec![1.2, 0.3], vec![1.5, 0.0]];
    let trajectory = through(&waypoints, &[0.0, 0.0]).unwrap();
    let view = trajectory.view();
    for waypoint in waypoints.iter().take(3) {
        let is_there = |time_s: &&f64| {
            let states = trajectory.sample(**time_s).states;
            (0..2).all(|axis| (states[axis].position - waypoint[axis]).abs() < 1e-12)
        };
        let time_s = view.times_s.iter().find(is_there).expect("it is passed");
        assert!(trajectory.sample(*time_s).states[0].velocity > 0.5, "{waypoint:?}");
    }
    let end = trajectory.sample(trajectory.duration_s()).states;
    assert_eq!((end[0], end[1]), (State::rest(1.5), State::rest(0.0)));
    let used = largest_use(&trajectory, 2, &EVEN);
    assert!(used < 1.0 + 1e-4 && used > 0.97, "{used}");
    assert!(trajectory.duration_s() < 0.7 * stopping_s(&waypoints, &[0.0, 0.0], &EVEN));
}

#[test]
fn waypoints_on_the_way_of_the_fastest_motion_cost_hardly_any_time() {
    use takt_rt::plan::{Limits, Problem, position};
    let limits = Limits::symmetric(EVEN.velocity, EVEN.acceleration, EVEN.jerk);
    for way in [0.01, 0.1, 0.5, 1.5] {
        let fastest =
            position(&Problem { start: State::rest(0.0), target: State::rest(way), limits }).unwrap();
        for count in [1, 2, 4, 8] {
            let at = |index: i32| fastest.sample(fastest.duration_s() * f64::from(index) / f64::from(count));
            let waypoints: Vec<Vec<f64>> = (1..=count).map(|index| vec![at(index).position]).collect();
            let trajectory = through(&waypoints, &[0.0]).unwrap();
            let ratio = trajectory.duration_s() / fastest.duration_s();
            assert!((1.0 - 1e-9..1.02).contains(&ratio), "{count} waypoints to {way}: {ratio}");
        }
    }
}

#[test]
fn waypoints_are_passed_from_any_motion_without_a_step() {
    let start = [
        State { position: 0.1, velocity: 0.8, acceleration: -2.0 },
        State { position: -0.2, velocity: -0.5, acceleration: 1.0 },
    ];
    let limits = even_limits(2);
    let conditions = TrajectoryConditions { start: &start, limits: &limits, period_s: PERIOD_S };
    let trajectory = Trajectory::through(&[vec![0.5, 0.2], vec![-0.4, 0.6]], &conditions).unwrap();
    assert_eq!(trajectory.sample(0.0).states[..2], start);
    assert!(largest_use(&trajectory, 2, &EVEN) < 1.0 + 1e-4);
    // Back to where it is now: that is a waypoint, too.
    let trajectory = Trajectory::through(&[vec![0.1, -0.2]], &conditions).unwrap();
    assert!(trajectory.duration_s() > 0.3);
    assert_eq!(trajectory.sample(trajectory.duration_s()).states[..2], [State::rest(0.1), State::rest(-0.2)]);
    // It cannot stop before the limit of 2.
    let start = [State { position: 1.99, velocity: 1.5, acceleration: 0.0 }, State::rest(0.0)];
    let conditions = TrajectoryConditions { start: &start, ..conditions };
    let error = Trajectory::through(&[vec![1.5, 0.1]], &conditions).unwrap_err();
    assert_eq!(error, TrajectoryError::Unreachable { point: 0, axis: 0 });
}

#[test]
fn waypoints_that_cannot_be_passed_are_named() {
    let error = through(&[vec![0.5], vec![2.5], vec![1.0]], &[0.0]).unwrap_err();
    assert_eq!((error.point(), error.axis()), (Some(1), Some(0)));
    assert!(matches!(error, TrajectoryError::Limit { broken: BrokenLimit::Position, .. }));
    assert!(matches!(through(&[vec![0.5], vec![]], &[0.0]), Err(TrajectoryError::Count { point: 1, .. })));
    assert!(matches!(through(&[vec![f64::NAN]], &[0.0]), Err(TrajectoryError::NotFinite { point: 0, .. })));
    assert_eq!(through(&[], &[0.0]), Err(TrajectoryError::NoPoint));
    let standing = through(&[vec![0.3], vec![0.3]], &[0.3]).unwrap();
    assert_eq!((standing.duration_s(), standing.sample(1.0).states[0]), (0.0, State::rest(0.3)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn random_waypoints_are_passed_within_all_limits_and_faster_than_with_stops(
        waypoints in prop::collection::vec([-2.0f64..=2.0, -2.0f64..=2.0, -0.1f64..=0.1], 1..8),
        range in 0.0f64..=1.0,
        velocity in prop::sample::select(vec![0.05, 2.0]),
        deceleration in prop::sample::select(vec![8.0, 20.0]),
        jerk in prop::sample::select(vec![100.0, 2_000.0, f64::INFINITY]),
    ) {
        // Many of the waypoints are at a position limit.
        let (position_min, position_max) = (-2.0 * range - 1e-3, 2.0 * range + 1e-3);
        let limits = AxisLimits { position_min, position_max, velocity, deceleration, jerk, ..EVEN };
        let within = |position: f64| position.clamp(position_min, position_max);
        let waypoints: Vec<Vec<f64>> = waypoints.into_iter().map(|waypoint| waypoint.map(within).to_vec()).collect();
        let conditions =
            TrajectoryConditions { start: &[State::rest(0.0); 3], limits: &[limits; 3], period_s: PERIOD_S };
        let trajectory = Trajectory::through(&waypoints, &conditions).unwrap();
        prop_assert!(largest_use(&trajectory, 3, &limits) < 1.0 + 1e-3);
        prop_assert!(trajectory.duration_s() <= stopping_s(&waypoints, &[0.0; 3], &limits) * (1.0 + 1e-9));
    }

    #[test]
    fn a_pause_from_anywhere_keeps_the_limits(at_s in 0.0f64..2.55, rate in 0.0f64..1.0) {
        let written = there_and_back();
        let limits = even_limits(2);
        if let Ok(changed) = written.at_rate(at_s, rate, &limits) {
            prop_assert_eq!(changed.sample(0.0).states, written.sample(at_s).states);
            prop_assert!(largest_use(&changed, 2, &EVEN) < 1.0 + 1e-3);
        } else {
            prop_assert!(at_s > 2.0, "{at_s}");
        }
    }
}
