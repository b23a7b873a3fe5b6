//! Any input gives an answer or an error, in bounded time, and never a result that is not a number.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use takt_rt::plan::{
    Limits, PlanError, PlanOptions, Problem, Profile, Return, State, Synchronisation, stop, synchronised,
    synchronised_velocity,
};

/// Numbers of all sizes, and those at which programs often fail.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -10.0..10.0_f64,
        2 => any::<f64>(),
        2 => prop::sample::select(vec![0.0, -0.0, 1.0, -1.0, 2.0, 0.5, 1e-300, 1e300, -1e300, 1e-12, 1e12, f64::MAX, f64::MIN_POSITIVE, f64::INFINITY, f64::NAN]),
        2 => (-12.0..12.0_f64, any::<bool>()).prop_map(|(exponent, negative)| if negative { -(10_f64.powf(exponent)) } else { 10_f64.powf(exponent) }),
        1 => (-110.0..110.0_f64, any::<bool>()).prop_map(|(exponent, negative)| if negative { -(10_f64.powf(exponent)) } else { 10_f64.powf(exponent) }),
    ]
}

fn state() -> impl Strategy<Value = State> {
    (number(), number(), number()).prop_map(|(position, velocity, acceleration)| State {
        position,
        velocity,
        acceleration,
    })
}

fn problem() -> impl Strategy<Value = Problem> {
    let limits = (number(), number(), number(), number(), number(), number(), number());
    (state(), state(), limits, any::<[bool; 2]>()).prop_map(|(start, target, limits, [signed, travel])| {
        let (vmax, vmin, amax, amin, jmax, pmin, pmax) = limits;
        let limits = if signed {
            Limits::asymmetric(vmax, vmin, amax, amin, jmax)
        } else {
            Limits::asymmetric(vmax.abs(), -vmin.abs(), amax.abs(), -amin.abs(), jmax.abs())
        };
        Problem { start, target, limits: if travel { limits.with_position(pmin, pmax) } else { limits } }
    })
}

fn timing() -> impl Strategy<Value = PlanOptions> {
    let modes = vec![
        Synchronisation::Time,
        Synchronisation::Phase,
        Synchronisation::Straight,
        Synchronisation::Independent,
    ];
    (prop::sample::select(modes), number(), prop::option::of(number()), any::<[bool; 2]>()).prop_map(
        |(synchronisation, minimum_duration_s, cycle_s, [settled, minimum])| PlanOptions {
            synchronisation,
            minimum_duration_s: if minimum { minimum_duration_s } else { 0.0 },
            cycle_s,
            return_to_limits: if settled { Return::Settled } else { Return::Fastest },
        },
    )
}

fn are_numbers(profiles: &[Profile]) -> bool {
    profiles.iter().all(|profile| {
        let times = [-1.0, 0.0, 0.3, 0.5, 0.9, 1.0].map(|part| part * profile.duration_s());
        let extrema = profile.extrema();
        profile.duration_s() >= 0.0
            && times.into_iter().all(|time_s| {
                let State { position, velocity, acceleration } = profile.sample(time_s);
                position.is_finite() && velocity.is_finite() && acceleration.is_finite()
            })
            && extrema.position.max.is_finite()
            && extrema.velocity.max.is_finite()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 5000, failure_persistence: None, rng_seed: RngSeed::Fixed(4), ..ProptestConfig::default() })]

    #[test]
    fn an_answer_is_a_number_everywhere(problems in prop::collection::vec(problem(), 1..4), timing in timing()) {
        let mut profiles = vec![Profile::hold(0.0); problems.len()];
        if let Ok(duration_s) = synchronised(&problems, &mut profiles, timing) {
            prop_assert!(duration_s.is_finite() && are_numbers(&profiles));
        }
        if let Ok(duration_s) = synchronised_velocity(&problems, &mut profiles, timing) {
            prop_assert!(duration_s.is_finite() && are_numbers(&profiles));
        }
        let starts: Vec<State> = problems.iter().map(|problem| problem.start).collect();
        let limits: Vec<Limits> = problems.iter().map(|problem| problem.limits).collect();
        if let Ok(duration_s) = stop(&starts, &limits, &mut profiles) {
            prop_assert!(duration_s.is_finite() && are_numbers(&profiles));
        }
        if let Ok(next) = problems[0].track(0.001) {
            prop_assert!(next.position.is_finite() && next.velocity.is_finite() && next.acceleration.is_finite());
        }
    }
}

/// Found by the fuzzer: limits whose powers are too small for a number.
#[test]
fn limits_that_are_next_to_nothing_are_refused() {
    let tiny = 1.249_785_523_836_551_2e-221;
    let start = State { position: tiny, velocity: tiny, acceleration: tiny };
    let limits = Limits::asymmetric(1.27e-221, -tiny, 3.4e-161, -2.57e-289, 3.6e-135);
    let problem = Problem { start, target: State { acceleration: 1.6e-303, ..start }, limits };
    let refused = Err(PlanError::NotRepresentable { axis: 0 });
    let mut profiles = [Profile::hold(0.0)];
    assert_eq!(synchronised(&[problem], &mut profiles, PlanOptions::default()), refused);
    assert_eq!(synchronised_velocity(&[problem], &mut profiles, PlanOptions::default()), refused);
    assert_eq!(stop(&[start], &[limits], &mut profiles), refused);
}

/// Found by the fuzzer: each number is far below the end of the range of `f64`, but some of their products are beyond it.
#[test]
fn states_and_limits_whose_products_overflow_are_refused() {
    let limits = Limits::symmetric(3.5e59, 3.5e59, 3.4e59);
    let problem = Problem { start: State::rest(-3.4e59), target: State::rest(3.5e59), limits };
    let answer = synchronised(&[problem], &mut [Profile::hold(0.0)], PlanOptions::default());
    assert_eq!(answer, Err(PlanError::NotRepresentable { axis: 0 }));
}

/// Found by the fuzzer.
#[test]
fn limits_that_are_beyond_all_measure_are_refused() {
    let limits = Limits::symmetric(8.2e136, 8.2e136, 6.8e136);
    let problem = Problem { start: State::rest(0.0), target: State::rest(0.0), limits };
    let answer = synchronised(&[problem], &mut [Profile::hold(0.0)], PlanOptions::default());
    assert_eq!(answer, Err(PlanError::NotRepresentable { axis: 0 }));
}

/// Found by the fuzzer: the duration has more cycles than an `f64` can count.
#[test]
fn a_cycle_that_is_next_to_nothing_is_refused() {
    let limits = Limits::symmetric(1.0, 1.0, 1.0);
    let problem = Problem { start: State::rest(0.0), target: State::rest(1.0), limits };
    for (cycle_s, minimum_duration_s) in [(4.8e-299, 1.6e11), (1e-31, 0.0), (1e31, 0.0), (0.001, 1e31)] {
        let synchronisation = Synchronisation::Independent;
        let timing = PlanOptions {
            cycle_s: Some(cycle_s),
            minimum_duration_s,
            synchronisation,
            ..PlanOptions::default()
        };
        let answer = synchronised(&[problem], &mut [Profile::hold(0.0)], timing);
        assert_eq!(answer, Err(PlanError::InvalidTiming));
    }
}

/// Found by the fuzzer: the motion lasts 2e-307 s, and every phase of it is too short to exist.
#[test]
fn a_motion_that_lasts_next_to_no_time_is_where_it_should_be() {
    let start = State { position: 1.5e11, velocity: 3.399_986_479_566_3e-311, acceleration: 1.5e11 };
    let target = State { velocity: 3.399_986_479_656e-311, ..start };
    let problem = Problem { start, target, limits: Limits::symmetric(1.6e11, 1.6e11, 1.6e11) };
    let timing = PlanOptions { minimum_duration_s: 2e-307, ..PlanOptions::default() };
    let mut profiles = [Profile::hold(0.0)];
    synchronised_velocity(&[problem], &mut profiles, timing).unwrap();
    for part in [0.0, 0.5, 1.0] {
        let State { position, velocity, .. } = profiles[0].sample(part * profiles[0].duration_s());
        assert_eq!(position, 1.5e11);
        assert!(velocity.abs() < 1e-295, "{velocity}");
    }
    assert_eq!(profiles[0].phases().count(), 1);
}

/// Found by the fuzzer: rounding made the duration negative, and a result was not a number.
#[test]
fn a_motion_that_takes_no_time_beyond_a_position_limit_is_waited_for_or_refused() {
    let limits =
        Limits::asymmetric(6.4e10, -1.6e11, 507_658_818.258_823_6, -1.6e11, 1.297_367_442_234_912_3e-13)
            .with_position(-3.5e-11, 5.6e-319);
    let target = State { position: 2.2e-106, velocity: 0.0, acceleration: 1.331_267_540_180_239_4e-302 };
    let problem = Problem { start: State::rest(0.0), target, limits };
    let mut profiles = [Profile::hold(0.0)];
    let answer = synchronised(&[problem], &mut profiles, PlanOptions::default());
    assert!(answer.is_ok() || matches!(answer, Err(PlanError::PositionBeyondLimit { .. })), "{answer:?}");
    assert!(profiles[0].duration_s() >= 0.0 && are_numbers(&profiles));
}
