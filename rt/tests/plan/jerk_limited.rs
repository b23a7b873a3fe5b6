//! Properties of the jerk-limited planner, and problems on which other planners are known to fail.

use super::checker::{Arrival, judge};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use takt_rt::plan::{
    Limits, PlanError, PlanOptions, Problem, Profile, Return, State, Synchronisation, position, stop,
    synchronised, velocity,
};

pub fn state(position: f64, velocity: f64, acceleration: f64) -> State {
    State { position, velocity, acceleration }
}

fn limits() -> impl Strategy<Value = Limits> {
    (0.1..12.0, 0.1..12.0, 0.1..12.0, 0.1..12.0, 0.1..12.0).prop_map(
        |(vmax, vmin, amax, amin, jmax): (f64, f64, f64, f64, f64)| {
            Limits::asymmetric(vmax, -vmin, amax, -amin, jmax)
        },
    )
}

/// Any start, also one outside the limits, and any target that can be reached within them.
pub fn problem() -> impl Strategy<Value = Problem> {
    let or_zero = |range: core::ops::Range<f64>| prop_oneof![1 => Just(0.0), 3 => range];
    let start = (-4.0..4.0, or_zero(-3.0..3.0), or_zero(-3.0..3.0));
    let target = (-4.0..4.0, or_zero(-1.0..1.0), or_zero(-1.0..1.0));
    (limits(), start, target).prop_map(|(limits, (p0, v0, a0), (pf, v_part, a_part))| {
        let of = |part: f64, max: f64, min: f64| if part > 0.0 { part * max } else { -part * min };
        let af = of(a_part, limits.acceleration_max, limits.acceleration_min);
        let vf = of(v_part, limits.velocity_max, limits.velocity_min);
        // Within the velocities that the acceleration leaves.
        let before = af * af.abs() / (2.0 * limits.jerk_max);
        let vf = vf.clamp(
            limits.velocity_min + before.max(0.0),
            (limits.velocity_max + before.min(0.0)).max(limits.velocity_min + before.max(0.0)),
        );
        let reachable = vf <= limits.velocity_max
            && vf - before <= limits.velocity_max
            && vf - before >= limits.velocity_min;
        let target = if reachable { state(pf, vf, af) } else { state(pf, 0.0, 0.0) };
        Problem { start: state(p0, v0, a0), target, limits }
    })
}

fn plan(problems: &[Problem], timing: PlanOptions) -> (f64, Vec<Profile>) {
    let mut profiles = vec![Profile::hold(0.0); problems.len()];
    let duration_s = synchronised(problems, &mut profiles, timing).unwrap();
    (duration_s, profiles)
}

fn turned(problem: &Problem, start: State, target: State, swap_accelerations: bool) -> Problem {
    let Limits { velocity_max, velocity_min, acceleration_max, acceleration_min, jerk_max, .. } =
        problem.limits;
    let (amax, amin) = if swap_accelerations {
        (-acceleration_min, -acceleration_max)
    } else {
        (acceleration_max, acceleration_min)
    };
    Problem { start, target, limits: Limits::asymmetric(-velocity_min, -velocity_max, amax, amin, jerk_max) }
}

fn mirrored(problem: &Problem) -> Problem {
    let turn = |of: &State| state(-of.position, -of.velocity, -of.acceleration);
    turned(problem, turn(&problem.start), turn(&problem.target), true)
}

/// Backwards in time: the velocities change their signs, the accelerations do not.
fn reversed(problem: &Problem) -> Problem {
    let turn = |of: &State| state(of.position, -of.velocity, of.acceleration);
    turned(problem, turn(&problem.target), turn(&problem.start), false)
}

/// The same problem in a unit that is smaller by this factor.
pub fn scaled(problem: &Problem, factor: f64) -> Problem {
    let scale = |of: &State| state(of.position * factor, of.velocity * factor, of.acceleration * factor);
    let Limits { velocity_max, velocity_min, acceleration_max, acceleration_min, jerk_max, .. } =
        problem.limits;
    Problem {
        start: scale(&problem.start),
        target: scale(&problem.target),
        limits: Limits::asymmetric(
            velocity_max * factor,
            velocity_min * factor,
            acceleration_max * factor,
            acceleration_min * factor,
            jerk_max * factor,
        ),
    }
}

/// Returns `true` if the start is within the limits and can stay there.
pub fn starts_inside(problem: &Problem) -> bool {
    let Problem { start, limits, .. } = problem;
    let bound_for = start.velocity + start.acceleration * start.acceleration.abs() / (2.0 * limits.jerk_max);
    let velocities = limits.velocity_min..=limits.velocity_max;
    velocities.contains(&start.velocity)
        && velocities.contains(&bound_for)
        && (limits.acceleration_min..=limits.acceleration_max).contains(&start.acceleration)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, rng_seed: RngSeed::Fixed(2), ..ProptestConfig::default() })]

    #[test]
    fn a_motion_keeps_its_limits_and_ends_at_the_target(problem in problem()) {
        let profile = position(&problem).unwrap();
        prop_assert_eq!(judge(&problem, &profile, Arrival::State), Ok(()));
    }

    #[test]
    fn axes_arrive_together_as_soon_as_all_can(problems in prop::collection::vec(problem(), 1..8)) {
        let (duration_s, profiles) = plan(&problems, PlanOptions::default());
        let slowest_s = profiles.iter().map(Profile::minimum_duration_s).fold(0.0, f64::max);
        prop_assert!(duration_s >= slowest_s);
        let mut ends = profiles.iter().flat_map(|profile| profile.blocked().iter().map(|blocked| blocked.before_s));
        prop_assert!(duration_s == slowest_s || ends.any(|end_s| end_s == duration_s));
        for (problem, profile) in problems.iter().zip(&profiles) {
            prop_assert_eq!(profile.duration_s(), duration_s);
            prop_assert_eq!(judge(problem, profile, Arrival::State), Ok(()));
        }
    }

    #[test]
    fn any_duration_that_is_not_blocked_is_possible(problem in problem(), factor in 1.0..2.0_f64) {
        let fastest = position(&problem).unwrap();
        let wanted_s = fastest.duration_s() * factor;
        let (duration_s, profiles) = plan(&[problem], PlanOptions { minimum_duration_s: wanted_s, ..PlanOptions::default() });
        prop_assert_eq!(judge(&problem, &profiles[0], Arrival::State), Ok(()));
        match fastest.blocked().iter().find(|blocked| blocked.after_s < wanted_s && wanted_s < blocked.before_s) {
            Some(blocked) => prop_assert_eq!(duration_s, blocked.before_s),
            None => prop_assert_eq!(duration_s, wanted_s),
        }
    }

    #[test]
    fn backwards_in_time_the_same_durations_are_blocked(problem in problem()) {
        let back = reversed(&problem);
        if !starts_inside(&problem) || !starts_inside(&back) {
            return Ok(());
        }
        let (forth, Ok(back)) = (position(&problem).unwrap(), position(&back)) else { return Ok(()) };
        prop_assert_eq!(forth.blocked().len(), back.blocked().len());
        for (one, other) in forth.blocked().iter().zip(back.blocked()) {
            prop_assert!((one.before_s - other.before_s).abs() <= 1e-7 * one.before_s);
        }
    }

    #[test]
    fn the_mirror_image_takes_the_same_time(problem in problem()) {
        let (one, other) = (position(&problem).unwrap(), position(&mirrored(&problem)).unwrap());
        prop_assert!((one.duration_s() - other.duration_s()).abs() <= 1e-9 * one.duration_s());
    }

    #[test]
    fn the_way_back_in_time_takes_the_same_time(problem in problem()) {
        if !starts_inside(&problem) {
            return Ok(());
        }
        let one = position(&problem).unwrap();
        if let Ok(other) = position(&reversed(&problem)) {
            prop_assert!((one.duration_s() - other.duration_s()).abs() <= 1e-9 * one.duration_s());
        }
    }

    #[test]
    fn extrema_are_the_envelope_of_all_samples(problem in problem()) {
        let profile = position(&problem).unwrap();
        let extrema = profile.extrema();
        let (mut low, mut high, mut fastest) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
        let samples = 2000;
        for step in 0..=samples {
            let now = profile.sample(profile.duration_s() * f64::from(step) / f64::from(samples));
            (low, high) = (low.min(now.position), high.max(now.position));
            fastest = fastest.max(now.acceleration.abs());
            prop_assert!(now.velocity >= extrema.velocity.min - 1e-9 && now.velocity <= extrema.velocity.max + 1e-9);
        }
        // Samples miss an extremum by at most half a step, where the position is quadratic in time.
        let step_s = profile.duration_s() / f64::from(samples);
        let slack = fastest * step_s * step_s + 1e-9 * (1.0 + high.abs() + low.abs());
        prop_assert!(extrema.position.min <= low + 1e-9 && extrema.position.min >= low - slack, "{extrema:?} {low}");
        prop_assert!(extrema.position.max >= high - 1e-9 && extrema.position.max <= high + slack, "{extrema:?} {high}");
    }

    #[test]
    fn the_unit_of_length_does_not_matter(problem in problem()) {
        let in_radians = position(&problem).unwrap();
        // Degrees, mrad, and counts of 17 and 23 bits a turn.
        for per_radian in [180.0 / core::f64::consts::PI, 1e3, 131_072.0 / core::f64::consts::TAU, 8_388_608.0 / core::f64::consts::TAU] {
            let scaled = scaled(&problem, per_radian);
            let profile = position(&scaled).unwrap();
            prop_assert_eq!(judge(&scaled, &profile, Arrival::State), Ok(()));
            prop_assert!((profile.duration_s() - in_radians.duration_s()).abs() <= 1e-9 * in_radians.duration_s());
        }
    }

    #[test]
    fn the_duration_is_a_multiple_of_the_cycle(problems in prop::collection::vec(problem(), 1..4), independent: bool) {
        let synchronisation = if independent { Synchronisation::Independent } else { Synchronisation::Time };
        let (duration_s, profiles) = plan(&problems, PlanOptions { cycle_s: Some(0.004), synchronisation, ..PlanOptions::default() });
        for (problem, profile) in problems.iter().zip(&profiles) {
            let cycles = profile.duration_s() / 0.004;
            prop_assert!(profile.duration_s() <= duration_s && (cycles - cycles.round()).abs() < 1e-6);
            prop_assert_eq!(judge(problem, profile, Arrival::State), Ok(()));
        }
    }

    #[test]
    fn a_stop_brings_all_axes_to_rest_together(problems in prop::collection::vec(problem(), 1..8)) {
        let starts: Vec<State> = problems.iter().map(|problem| problem.start).collect();
        let limits: Vec<Limits> = problems.iter().map(|problem| problem.limits).collect();
        let mut profiles = vec![Profile::hold(0.0); problems.len()];
        let duration_s = stop(&starts, &limits, &mut profiles).unwrap();
        for (problem, profile) in problems.iter().zip(&profiles) {
            prop_assert_eq!(profile.duration_s(), duration_s);
            let end = profile.sample(duration_s + 1.0);
            prop_assert_eq!(end, State::rest(profile.end().position));
            prop_assert_eq!(judge(&Problem { target: end, ..*problem }, profile, Arrival::Velocity), Ok(()));
        }
    }

    #[test]
    fn a_position_limit_is_kept_or_the_error_carries_a_stop(problems in prop::collection::vec(problem(), 1..4), room in 0.01..3.0_f64) {
        let problems: Vec<Problem> = problems
            .into_iter()
            .map(|problem| {
                let low = problem.start.position.min(problem.target.position) - room;
                let high = problem.start.position.max(problem.target.position) + room;
                Problem { limits: problem.limits.with_position(low, high), ..problem }
            })
            .collect();
        let mut profiles = vec![Profile::hold(0.0); problems.len()];
        match synchronised(&problems, &mut profiles, PlanOptions::default()) {
            Ok(duration_s) => {
                for (problem, profile) in problems.iter().zip(&profiles) {
                    prop_assert_eq!(profile.duration_s(), duration_s);
                    let range = profile.extrema().position;
                    prop_assert!(range.max <= problem.limits.position_max + 1e-9 && range.min >= problem.limits.position_min - 1e-9);
                    prop_assert_eq!(judge(problem, profile, if starts_inside(problem) { Arrival::State } else { Arrival::Velocity }), Ok(()));
                }
            }
            Err(PlanError::PositionBeyondLimit { .. }) => {
                for (problem, profile) in problems.iter().zip(&profiles) {
                    prop_assert_eq!(profile.end(), State::rest(profile.end().position));
                    prop_assert_eq!(profile.start().position, problem.start.position);
                }
            }
            Err(error) => prop_assert!(false, "{error:?}"),
        }
    }

    #[test]
    fn a_target_at_rest_within_the_position_limits_is_reached_whenever_the_axis_can_stop_within_them(
        problem in problem(), room in 0.01..3.0_f64,
    ) {
        let problem = Problem { target: State::rest(problem.target.position), ..problem };
        if !starts_inside(&problem) {
            return Ok(());
        }
        let low = problem.start.position.min(problem.target.position) - room;
        let high = problem.start.position.max(problem.target.position) + room;
        let problem = Problem { limits: problem.limits.with_position(low, high), ..problem };
        let mut profiles = [Profile::hold(0.0)];
        stop(&[problem.start], &[problem.limits], &mut profiles).unwrap();
        let (range, speeds) = (profiles[0].extrema().position, profiles[0].extrema().velocity);
        let keeps_velocity =
            speeds.max <= problem.limits.velocity_max && speeds.min >= problem.limits.velocity_min;
        let can_stop = range.max <= high && range.min >= low && keeps_velocity;
        let answer = synchronised(&[problem], &mut profiles, PlanOptions::default());
        prop_assert!(answer.is_ok() || !can_stop, "{answer:?}");
    }

    #[test]
    fn no_stop_is_shorter_than_the_shortest_which_is_taken_where_the_position_limit_asks_for_it(problem in problem()) {
        if !starts_inside(&problem) || problem.start.velocity <= 0.0 {
            return Ok(());
        }
        let Problem { start, limits, .. } = problem;
        // Full deceleration, in small steps, until the motion reverses.
        let (mut state, step_s) = (start, 1e-4);
        while state.velocity > 0.0 {
            let acceleration = (state.acceleration - limits.jerk_max * step_s).max(limits.acceleration_min);
            state.position += state.velocity * step_s + 0.25 * (acceleration + state.acceleration) * step_s * step_s;
            state.velocity += 0.5 * (acceleration + state.acceleration) * step_s;
            state.acceleration = acceleration;
        }
        let mut profiles = [Profile::hold(0.0)];
        let tight = limits.with_position(f64::NEG_INFINITY, start.position);
        stop(&[start], &[tight], &mut profiles).unwrap();
        prop_assert_eq!(judge(&Problem { target: profiles[0].end(), ..problem }, &profiles[0], Arrival::Velocity), Ok(()));
        prop_assert!((profiles[0].extrema().position.max - state.position).abs() < 1e-4 * (1.0 + state.position.abs()));
    }

    #[test]
    fn a_stop_keeps_the_velocity_limits_too_where_that_keeps_the_position_limit(problem in problem(), room in 0.0..1.0_f64) {
        let Problem { start, limits, .. } = problem;
        let turns_anyway = start.velocity + start.acceleration * start.acceleration.abs() / (2.0 * limits.jerk_max) < 0.0;
        if !starts_inside(&problem) || start.velocity <= 0.0 || turns_anyway {
            return Ok(());
        }
        // The least distance of the axis: it decelerates fully until it reverses. In the first case it decelerates only so
        // much that the motion back keeps the velocity limit.
        let back = (-2.0 * limits.jerk_max * limits.velocity_min).sqrt().min(-limits.acceleration_min);
        let full = (2.0 * limits.jerk_max * start.velocity + start.acceleration.powi(2)).sqrt().min(-limits.acceleration_min);
        let turn = |deceleration: f64| {
            velocity(&Problem { target: state(0.0, 0.0, -deceleration), ..problem }).unwrap().end().position
        };
        let (keeping_both, shortest) = (turn(back.min(full)), turn(full));
        let end = velocity(&Problem { target: State::rest(0.0), ..problem }).unwrap().end().position;
        let high = shortest + room * (end - shortest);
        let mut profiles = [Profile::hold(0.0)];
        stop(&[start], &[limits.with_position(f64::NEG_INFINITY, high)], &mut profiles).unwrap();
        prop_assert_eq!(judge(&Problem { target: profiles[0].end(), ..problem }, &profiles[0], Arrival::Velocity), Ok(()));
        let extrema = profiles[0].extrema();
        let rounding = 1e-9 * (1.0 + high.abs());
        prop_assert!(extrema.position.max <= high.max(start.position) + rounding, "{extrema:?}");
        if keeping_both <= high {
            prop_assert!(extrema.velocity.min >= limits.velocity_min * (1.0 + 1e-9), "{extrema:?}");
        } else {
            // The position comes first. The motion back is as slow as possible, because the axis reverses exactly at the limit.
            prop_assert!(extrema.position.max >= high - rounding, "{extrema:?}");
        }
    }

    #[test]
    fn a_lowered_velocity_limit_is_reached_without_going_below(
        vmax in 0.1..2.0_f64, excess in 0.0..3.0_f64, a0 in -1.0..1.0_f64, amax in 0.5..12.0_f64, jmax in 0.5..100.0_f64,
    ) {
        let start = state(0.0, vmax + excess, if excess < 0.1 { a0.max(0.0) } else { 0.0 });
        let problem = Problem { start, target: State::rest(1000.0), limits: Limits::symmetric(vmax, amax, jmax) };
        let timing = PlanOptions { return_to_limits: Return::Settled, ..PlanOptions::default() };
        let (duration_s, profiles) = plan(&[problem], timing);
        prop_assert_eq!(judge(&problem, &profiles[0], Arrival::State), Ok(()));
        let mut at_limit = false;
        for step in 0..1000 {
            let state = profiles[0].sample(duration_s * f64::from(step) / 1000.0);
            at_limit |= state.velocity <= vmax * (1.0 + 1e-9);
            let decelerating_to_target = problem.target.position - state.position < 0.5 * (problem.target.position);
            prop_assert!(state.velocity >= vmax * (1.0 - 1e-9) || decelerating_to_target, "{state:?}");
        }
        prop_assert!(at_limit);
    }
}

/// Ruckig 0.19.4 crashes on this problem.
#[test]
fn the_problem_that_crashes_ruckig_is_solved() {
    let problem = Problem {
        start: state(0.0, -1.0, 2.0),
        target: state(0.0, 1.0, 2.0),
        limits: Limits::symmetric(2.0, 2.0, 1.0),
    };
    let profile = position(&problem).unwrap();
    assert_eq!(judge(&problem, &profile, Arrival::State), Ok(()));
    // Holding the acceleration leads straight there.
    assert!((profile.duration_s() - 1.0).abs() < 1e-12);
}

/// Planners with absolute tolerances fail on large or small units.
#[test]
fn an_arm_in_counts_needs_the_same_time_as_in_radians() {
    let radians = Problem {
        start: state(0.3, 0.7, -2.0),
        target: state(1.9, 0.2, 0.0),
        limits: Limits::symmetric(2.5, 15.0, 1500.0),
    };
    let duration_s = position(&radians).unwrap().duration_s();
    for bits in [17, 20, 23] {
        let counts = scaled(&radians, f64::from(1 << bits) / core::f64::consts::TAU);
        let own_s = position(&counts).unwrap().duration_s();
        assert!((own_s - duration_s).abs() <= 1e-9 * duration_s, "{bits} bits: {own_s} {duration_s}");
    }
}

/// Rest to rest where the largest acceleration is just reached.
#[test]
fn rest_to_rest_just_where_the_acceleration_limit_is_reached_is_solved_for_plain_decimals() {
    for acceleration in 2..=40 {
        for jerk in 1..=100 {
            let (amax, jmax) = (f64::from(acceleration) * 0.5, f64::from(jerk) * 50.0);
            let distance = 2.0 * amax * amax * amax / (jmax * jmax);
            for start in [0.0, 0.001, -2.7] {
                let problem = Problem {
                    start: State::rest(start),
                    target: State::rest(start + distance),
                    limits: Limits::symmetric(100.0, amax, jmax),
                };
                let profile = position(&problem).unwrap();
                assert_eq!(judge(&problem, &profile, Arrival::State), Ok(()));
                let expected_s = 4.0 * amax / jmax;
                assert!((profile.duration_s() - expected_s).abs() <= 1e-6 * expected_s);
            }
        }
    }
}

/// Ruckig 0.19.4 skips phases of constant acceleration here.
#[test]
fn extrema_are_found_within_phases_of_constant_acceleration() {
    let problem = Problem {
        start: state(0.0, 3.0, -1.0),
        target: State::rest(-4.0),
        limits: Limits::symmetric(4.0, 1.0, 50.0),
    };
    let profile = position(&problem).unwrap();
    let extrema = profile.extrema();
    // An axis at 3 rad/s with −1 rad/s² reverses after 4.5 rad.
    assert!((extrema.position.max - 4.5).abs() < 1e-9, "{extrema:?}");
}

/// A lower velocity limit while the axis cruises.
#[test]
fn a_lower_velocity_limit_while_cruising_does_not_reverse_the_joint() {
    let problem = Problem {
        start: state(0.0, 2.0, 0.0),
        target: State::rest(5.0),
        limits: Limits::symmetric(0.5, 10.0, 20.0),
    };
    let settled =
        plan(&[problem], PlanOptions { return_to_limits: Return::Settled, ..PlanOptions::default() }).1[0];
    assert_eq!(judge(&problem, &settled, Arrival::State), Ok(()));
    assert!(settled.extrema().velocity.min >= 0.0);
    // The fastest return reaches 0.5 rad/s earlier, but goes on to −0.5 rad/s.
    assert!(position(&problem).unwrap().extrema().velocity.min < -0.4);
}

/// Durations that are a multiple of the cycle.
#[test]
fn discrete_durations_hit_a_moving_target_in_every_mode() {
    let moving = Problem {
        start: state(0.0, 0.1, 0.0),
        target: state(1.0, 0.4, 0.2),
        limits: Limits::symmetric(1.0, 3.0, 30.0),
    };
    let other = Problem { target: state(-0.3, 0.1, 0.0), ..moving };
    // On a straight line with the first.
    let beside = Problem { start: state(0.5, -0.05, 0.0), target: state(0.0, -0.2, -0.1), ..moving };
    for (problems, synchronisation) in [
        ([moving, other], Synchronisation::Time),
        ([moving, other], Synchronisation::Phase),
        ([moving, other], Synchronisation::Independent),
        ([moving, beside], Synchronisation::Phase),
        ([moving, beside], Synchronisation::Straight),
    ] {
        let timing = PlanOptions { cycle_s: Some(0.001), synchronisation, ..PlanOptions::default() };
        for (problem, profile) in problems.iter().zip(plan(&problems, timing).1) {
            assert_eq!(judge(problem, &profile, Arrival::State), Ok(()));
            let cycles = profile.duration_s() / 0.001;
            assert!((cycles - cycles.round()).abs() < 1e-9);
        }
    }
}

/// Motions on a straight line.
#[test]
fn a_straight_line_is_kept_by_random_motions_from_rest_to_rest_and_planned_anew_on_the_line() {
    let all_limits = [
        Limits::symmetric(2.0, 10.0, 300.0),
        Limits::asymmetric(1.0, -0.5, 8.0, -4.0, 100.0),
        Limits::symmetric(3.0, 5.0, 1000.0),
    ];
    let from = [0.1, -0.4, 1.0];
    for turn in 0..200 {
        let angle = f64::from(turn) * 0.31;
        let direction = [angle.cos(), 0.7 * angle.sin(), 0.3 * (2.0 * angle).cos()];
        let mut problems: Vec<Problem> = (0..3)
            .map(|axis| Problem {
                start: State::rest(from[axis]),
                target: State::rest(from[axis] + direction[axis]),
                limits: all_limits[axis],
            })
            .collect();
        let timing = PlanOptions { synchronisation: Synchronisation::Straight, ..PlanOptions::default() };
        let (total_s, mut profiles) = plan(&problems, timing);
        for cycle in 0..20 {
            for ((axis, problem), profile) in problems.iter_mut().enumerate().zip(&profiles) {
                assert_eq!(judge(problem, profile, Arrival::State), Ok(()));
                problem.start = profile.sample(total_s / 40.0);
                let along = (problem.start.position - from[axis]) * direction[0];
                let along_first = (problems_first(&profiles, total_s / 40.0) - from[0]) * direction[axis];
                assert!((along - along_first).abs() < 1e-12, "axis {axis} in cycle {cycle}");
            }
            let (remaining_s, anew) = plan(&problems, timing);
            let arrival_s = remaining_s + total_s * f64::from(cycle + 1) / 40.0;
            assert!((arrival_s - total_s).abs() < 1e-6 * total_s, "{arrival_s} {total_s}");
            profiles = anew;
        }
    }
}

fn problems_first(profiles: &[Profile], time_s: f64) -> f64 {
    profiles[0].sample(time_s).position
}

#[test]
fn a_motion_off_the_line_is_refused_in_the_strict_mode_with_its_axis() {
    let limits = Limits::symmetric(1.0, 3.0, 30.0);
    let good = Problem { start: State::rest(0.0), target: State::rest(1.0), limits };
    let bad = Problem { start: state(0.0, 0.3, 0.0), target: State::rest(0.5), limits };
    let timing = PlanOptions { synchronisation: Synchronisation::Straight, ..PlanOptions::default() };
    let answer = synchronised(&[good, bad], &mut [Profile::hold(0.0); 2], timing);
    assert_eq!(answer, Err(PlanError::NotStraight { axis: 1 }));
}

#[test]
fn an_axis_with_a_limited_jerk_does_not_follow_the_leaps_of_one_without() {
    // On a straight line with the other one.
    let leaping = Problem {
        start: state(0.0, -0.4, 0.0),
        target: State::rest(1.0),
        limits: Limits::symmetric(1.0, 8.0, f64::INFINITY),
    };
    let other = Problem {
        start: state(0.0, -0.1, 0.0),
        target: State::rest(0.25),
        limits: Limits::symmetric(1.0, 8.0, 40.0),
    };
    let timing = PlanOptions { synchronisation: Synchronisation::Phase, ..PlanOptions::default() };
    for problems in [[leaping, other], [other, leaping]] {
        for (problem, profile) in problems.iter().zip(plan(&problems, timing).1) {
            assert_eq!(judge(problem, &profile, Arrival::State), Ok(()));
        }
    }
}

#[test]
fn a_velocity_is_reached_in_the_shortest_time() {
    let problem = Problem {
        start: state(0.0, 0.0, 0.0),
        target: state(0.0, 2.0, 0.0),
        limits: Limits::symmetric(10.0, 1.0, 2.0),
    };
    let profile = velocity(&problem).unwrap();
    assert_eq!(judge(&problem, &profile, Arrival::Velocity), Ok(()));
    assert_eq!(profile.duration_s(), 2.5);
}
