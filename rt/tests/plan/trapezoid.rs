//! Properties of the second-order planner.

use super::checker::{Arrival, judge};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use takt_rt::plan::{
    Limit, Limits, PlanError, PlanOptions, Problem, Profile, State, Synchronisation, position, stop,
    synchronised, synchronised_velocity,
};

fn limits() -> impl Strategy<Value = Limits> {
    (0.1..12.0, 0.1..12.0, 0.1..12.0, 0.1..12.0).prop_map(|(vmax, vmin, amax, amin): (f64, f64, f64, f64)| {
        Limits::asymmetric(vmax, -vmin, amax, -amin, f64::INFINITY)
    })
}

fn state(position: f64, velocity: f64) -> State {
    State { position, velocity, acceleration: 0.0 }
}

/// Any start, also one outside the velocity limits, and any target within them; often exactly at rest.
fn problem() -> impl Strategy<Value = Problem> {
    let rest_or = |range: core::ops::Range<f64>| prop_oneof![1 => Just(0.0), 3 => range];
    (limits(), -4.0..4.0, rest_or(-3.0..3.0), -4.0..4.0, rest_or(-1.0..1.0)).prop_map(
        |(limits, p0, v0, pf, part)| {
            let vf = if part > 0.0 { part * limits.velocity_max } else { -part * limits.velocity_min };
            Problem { start: state(p0, v0), target: state(pf, vf), limits }
        },
    )
}

fn problem_from_rest() -> impl Strategy<Value = Problem> {
    (limits(), -4.0..4.0, -4.0..4.0).prop_map(|(limits, p0, pf)| Problem {
        start: State::rest(p0),
        target: State::rest(pf),
        limits,
    })
}

fn plan(problems: &[Problem], timing: PlanOptions) -> Result<(f64, Vec<Profile>), PlanError> {
    let mut profiles = vec![Profile::hold(0.0); problems.len()];
    let duration_s = synchronised(problems, &mut profiles, timing)?;
    Ok((duration_s, profiles))
}

fn close(left: f64, right: f64, tolerance: f64) -> bool {
    (left - right).abs() <= tolerance * (1.0 + left.abs().max(right.abs()))
}

fn mirrored(problem: &Problem) -> Problem {
    let Limits { velocity_max, velocity_min, acceleration_max, acceleration_min, jerk_max, .. } =
        problem.limits;
    let turn =
        |of: &State| State { position: -of.position, velocity: -of.velocity, acceleration: -of.acceleration };
    let limits =
        Limits::asymmetric(-velocity_min, -velocity_max, -acceleration_min, -acceleration_max, jerk_max);
    Problem { start: turn(&problem.start), target: turn(&problem.target), limits }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn a_motion_keeps_its_limits_and_ends_at_the_target(problem in problem()) {
        let profile = position(&problem).unwrap();
        prop_assert_eq!(judge(&problem, &profile, Arrival::State), Ok(()));
    }

    #[test]
    fn a_motion_from_rest_to_rest_keeps_its_limits_and_ends_at_the_target(problem in problem_from_rest()) {
        let profile = position(&problem).unwrap();
        prop_assert_eq!(judge(&problem, &profile, Arrival::State), Ok(()));
        prop_assert_eq!(profile.blocked(), &[]);
        let range = profile.extrema().position;
        let (low, high) = (problem.start.position.min(problem.target.position), problem.start.position.max(problem.target.position));
        prop_assert!(range.min >= low - 1e-12 && range.max <= high + 1e-12);
    }

    #[test]
    fn axes_arrive_together_as_soon_as_the_slowest_can(problems in prop::collection::vec(problem(), 1..8)) {
        let (duration_s, profiles) = plan(&problems, PlanOptions::default()).unwrap();
        let slowest_s = profiles.iter().map(Profile::minimum_duration_s).fold(0.0, f64::max);
        let blocked = profiles.iter().flat_map(Profile::blocked).any(|blocked| blocked.after_s < slowest_s && slowest_s < blocked.before_s);
        prop_assert_eq!(duration_s != slowest_s, blocked);
        for (problem, profile) in problems.iter().zip(&profiles) {
            prop_assert_eq!(profile.duration_s(), duration_s);
            prop_assert_eq!(judge(problem, profile, Arrival::State), Ok(()));
            let possible = profile.blocked().iter().all(|blocked| duration_s <= blocked.after_s * (1.0 + 1e-12) || duration_s >= blocked.before_s);
            prop_assert!(possible);
        }
    }

    #[test]
    fn any_duration_that_is_not_blocked_is_possible_and_a_blocked_one_is_prolonged(problem in problem(), factor in 1.0..3.0_f64) {
        let fastest = position(&problem).unwrap();
        let wanted_s = fastest.duration_s() * factor;
        let (duration_s, profiles) = plan(&[problem], PlanOptions { minimum_duration_s: wanted_s, ..PlanOptions::default() }).unwrap();
        prop_assert_eq!(judge(&problem, &profiles[0], Arrival::State), Ok(()));
        match fastest.blocked().iter().find(|blocked| blocked.after_s < wanted_s && wanted_s < blocked.before_s) {
            Some(blocked) => prop_assert_eq!(duration_s, blocked.before_s),
            None => prop_assert_eq!(duration_s, wanted_s),
        }
    }

    #[test]
    fn the_duration_is_a_multiple_of_the_cycle(problems in prop::collection::vec(problem(), 1..4), independent: bool) {
        let synchronisation = if independent { Synchronisation::Independent } else { Synchronisation::Time };
        let timing = PlanOptions { cycle_s: Some(0.004), synchronisation, ..PlanOptions::default() };
        let (duration_s, profiles) = plan(&problems, timing).unwrap();
        prop_assert!(profiles.iter().all(|profile| profile.duration_s() <= duration_s));
        for (problem, profile) in problems.iter().zip(&profiles) {
            let cycles = profile.duration_s() / 0.004;
            prop_assert!((cycles - cycles.round()).abs() < 1e-9);
            prop_assert_eq!(judge(problem, profile, Arrival::State), Ok(()));
        }
    }

    #[test]
    fn the_mirror_image_and_the_reverse_take_the_same_time(problem in problem_from_rest(), v0 in -0.1..0.1, vf in -0.1..0.1) {
        let problem = Problem {
            start: State { velocity: v0, ..problem.start }, target: State { velocity: vf, ..problem.target }, ..problem
        };
        let duration_s = position(&problem).unwrap().duration_s();
        let mirror_s = position(&mirrored(&problem)).unwrap().duration_s();
        prop_assert!(close(duration_s, mirror_s, 1e-12), "{duration_s} {mirror_s}");
        // Backwards in time, the velocities change their signs and the accelerations do not.
        let reverse = Problem {
            start: State { velocity: -vf, ..problem.target },
            target: State { velocity: -v0, ..problem.start },
            limits: Limits::asymmetric(-problem.limits.velocity_min, -problem.limits.velocity_max,
                problem.limits.acceleration_max, problem.limits.acceleration_min, f64::INFINITY),
        };
        let reverse_s = position(&reverse).unwrap().duration_s();
        prop_assert!(close(duration_s, reverse_s, 1e-12), "{duration_s} {reverse_s}");
    }

    #[test]
    fn planning_anew_in_every_cycle_arrives_at_the_same_time(problems in prop::collection::vec(problem(), 1..5), cycles in 5..400_u32) {
        let (total_s, mut profiles) = plan(&problems, PlanOptions::default()).unwrap();
        let mut problems = problems;
        let mut time_s = 0.0;
        let cycle_s = total_s / f64::from(cycles);
        while profiles[0].duration_s() > cycle_s * 1.000_001 {
            for (problem, profile) in problems.iter_mut().zip(&profiles) {
                problem.start = profile.sample(cycle_s);
            }
            let remaining_s = synchronised(&problems, &mut profiles, PlanOptions::default()).unwrap();
            time_s += cycle_s;
            // A detour for a rounding error takes the square root of that error in time.
            prop_assert!(close(time_s + remaining_s, total_s, 1e-6), "{} {total_s}", time_s + remaining_s);
        }
        for (problem, profile) in problems.iter().zip(&profiles) {
            prop_assert_eq!(judge(problem, profile, Arrival::State), Ok(()));
        }
    }

    #[test]
    fn extrema_are_the_envelope_of_all_samples(problem in problem()) {
        let profile = position(&problem).unwrap();
        let extrema = profile.extrema();
        let mut seen = (f64::INFINITY, f64::NEG_INFINITY);
        for step in 0..=4000 {
            let state = profile.sample(profile.duration_s() * f64::from(step) / 4000.0);
            seen = (seen.0.min(state.position), seen.1.max(state.position));
            prop_assert!(state.velocity >= extrema.velocity.min - 1e-12 && state.velocity <= extrema.velocity.max + 1e-12);
            prop_assert!(state.acceleration >= extrema.acceleration.min && state.acceleration <= extrema.acceleration.max);
        }
        prop_assert!(extrema.position.min <= seen.0 + 1e-12 && extrema.position.max >= seen.1 - 1e-12);
        // 4,000 samples miss an extremum by at most half a step, where the position is quadratic in time.
        let step_s = profile.duration_s() / 4000.0;
        let slack = 12.0 * step_s * step_s + 1e-12;
        prop_assert!(extrema.position.min >= seen.0 - slack && extrema.position.max <= seen.1 + slack);
    }

    #[test]
    fn a_stop_brings_all_axes_to_rest_together(problems in prop::collection::vec(problem(), 1..8)) {
        let starts: Vec<State> = problems.iter().map(|problem| problem.start).collect();
        let limits: Vec<Limits> = problems.iter().map(|problem| problem.limits).collect();
        let mut profiles = vec![Profile::hold(0.0); problems.len()];
        let duration_s = stop(&starts, &limits, &mut profiles).unwrap();
        for ((start, limits), profile) in starts.iter().zip(&limits).zip(&profiles) {
            prop_assert_eq!(profile.duration_s(), duration_s);
            let end = profile.sample(duration_s + 1.0);
            prop_assert_eq!(end, State::rest(profile.end().position));
            let problem = Problem { start: *start, target: end, limits: *limits };
            prop_assert_eq!(judge(&problem, profile, Arrival::State), Ok(()));
        }
    }

    #[test]
    fn target_velocities_are_reached_together(problems in prop::collection::vec(problem(), 1..8)) {
        let mut profiles = vec![Profile::hold(0.0); problems.len()];
        let duration_s = synchronised_velocity(&problems, &mut profiles, PlanOptions::default()).unwrap();
        for (problem, profile) in problems.iter().zip(&profiles) {
            prop_assert_eq!(profile.duration_s(), duration_s);
            prop_assert_eq!(judge(problem, profile, Arrival::Velocity), Ok(()));
        }
    }

    #[test]
    fn a_position_limit_is_kept_or_the_error_carries_a_stop(problem in problem(), room in 0.0..2.0_f64) {
        let high = problem.start.position.max(problem.target.position) + room;
        let problem = Problem { limits: problem.limits.with_position(f64::NEG_INFINITY, high), ..problem };
        let mut profiles = [Profile::hold(0.0)];
        match synchronised(&[problem], &mut profiles, PlanOptions::default()) {
            Ok(_) => prop_assert!(profiles[0].extrema().position.max <= high + 1e-9),
            Err(error) => {
                prop_assert_eq!(error, PlanError::PositionBeyondLimit { axis: 0, limit: Limit::PositionMax });
                prop_assert_eq!(profiles[0].end().velocity, 0.0);
                prop_assert_eq!(profiles[0].start().position, problem.start.position);
            }
        }
    }
}

const SECOND_ORDER: Limits = Limits::symmetric(2.0, 8.0, f64::INFINITY);

#[test]
fn before_the_start_is_the_start_and_behind_the_end_the_target_goes_on() {
    let problem = Problem { start: State::rest(1.0), target: state(2.0, 0.5), limits: SECOND_ORDER };
    let profile = position(&problem).unwrap();
    assert_eq!(profile.sample(-1.0).position, 1.0);
    assert_eq!(profile.sample(f64::NAN).position, 1.0);
    assert_eq!(profile.sample(profile.duration_s()), state(2.0, 0.5));
    assert!((profile.sample(profile.duration_s() + 2.0).position - 3.0).abs() < 1e-12);
    let hold = Profile::hold(0.3);
    assert_eq!(
        (hold.duration_s(), hold.sample(0.0), hold.sample(9.0)),
        (0.0, State::rest(0.3), State::rest(0.3))
    );
    assert_eq!(hold.extrema().position.max, 0.3);
}

#[test]
fn at_the_target_already_the_motion_takes_no_time() {
    let problem = Problem { start: state(1.0, 0.5), target: state(1.0, 0.5), limits: SECOND_ORDER };
    assert_eq!(position(&problem).unwrap().duration_s(), 0.0);
}

#[test]
fn an_axis_that_cannot_wait_makes_the_others_wait() {
    // The first axis passes its target at speed. If it arrives a little later, it has to come back.
    let passing = Problem { start: state(0.0, 1.0), target: state(0.05, 1.0), limits: SECOND_ORDER };
    let other = Problem { start: State::rest(0.0), target: State::rest(0.02), limits: SECOND_ORDER };
    let alone = [position(&passing).unwrap(), position(&other).unwrap()];
    let blocked = alone[0].blocked()[0];
    assert!(blocked.after_s < alone[1].duration_s() && alone[1].duration_s() < blocked.before_s);
    let (duration_s, _) = plan(&[passing, other], PlanOptions::default()).unwrap();
    assert_eq!(duration_s, blocked.before_s);
}

#[test]
fn what_is_wrong_with_a_problem_is_said_with_its_axis() {
    let good = Problem { start: State::rest(0.0), target: State::rest(1.0), limits: SECOND_ORDER };
    let refused = |bad: Problem| plan(&[good, bad], PlanOptions::default()).unwrap_err();
    let zero = Limits { velocity_max: 0.0, ..SECOND_ORDER };
    assert_eq!(
        refused(Problem { limits: zero, ..good }),
        PlanError::InvalidLimit { axis: 1, limit: Limit::VelocityMax }
    );
    let fast = Problem { target: state(1.0, 2.5), ..good };
    assert_eq!(refused(fast), PlanError::TargetBeyondLimit { axis: 1, limit: Limit::VelocityMax });
    let nowhere = Problem { target: State::rest(f64::NAN), ..good };
    assert!(matches!(refused(nowhere), PlanError::NotFinite { axis: 1, .. }));
    let huge = Problem { target: State::rest(1e308), start: State::rest(-1e308), ..good };
    assert_eq!(refused(huge), PlanError::NotRepresentable { axis: 1 });
    let length = synchronised(&[good], &mut [], PlanOptions::default());
    assert_eq!(length, Err(PlanError::LengthMismatch { expected: 1, received: 0 }));
    let timing = PlanOptions { minimum_duration_s: -1.0, ..PlanOptions::default() };
    assert_eq!(plan(&[good], timing).unwrap_err(), PlanError::InvalidTiming);
    let timing = PlanOptions { cycle_s: Some(0.0), ..PlanOptions::default() };
    assert_eq!(plan(&[good], timing).unwrap_err(), PlanError::InvalidTiming);
}
