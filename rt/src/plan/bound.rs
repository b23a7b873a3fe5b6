//! Counts the work of the planner and compares it with the promised bound.

extern crate std;

use std::vec;
use std::vec::Vec;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::jerk_limited::SEARCHES_MAX;
use super::jerk_limited::roots::{EVALUATIONS_MAX, work};
use super::{
    Limits, PlanOptions, Problem, Profile, Return, State, Synchronisation, position, stop, synchronised,
    synchronised_velocity,
};

/// The most searches for an axis whose motions leave their position limits. After the first plan there are three rounds. Each
/// plans two motions with a stop between them, and then all axes again.
const SEARCHES_WITHIN_LIMITS_MAX: u32 = SEARCHES_MAX + 3 * (2 * SEARCHES_MAX + SEARCHES_MAX);

/// Numbers of usual sizes, integers (where one type of profile meets another), and tiny and huge numbers.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -4.0..4.0_f64,
        4 => (-3..=3_i32).prop_map(f64::from),
        1 => (-30.0..30.0_f64, any::<bool>()).prop_map(|(decade, negative)| {
            libm::copysign(libm::exp10(decade), if negative { -1.0 } else { 1.0 })
        }),
        1 => any::<f64>(),
    ]
}

fn state() -> impl Strategy<Value = State> {
    [number(), number(), number()].prop_map(|[position, velocity, acceleration]| State {
        position,
        velocity,
        acceleration,
    })
}

fn problem() -> impl Strategy<Value = Problem> {
    let limits = [number(), number(), number(), number(), number()];
    let travel = prop_oneof![3 => Just(None), 1 => (number(), number()).prop_map(Some)];
    (state(), state(), limits, travel).prop_map(|(start, target, [vmax, vmin, amax, amin, jmax], travel)| {
        let limits = Limits::asymmetric(vmax.abs(), -vmin.abs(), amax.abs(), -amin.abs(), jmax.abs());
        let limits = match travel {
            Some((below, above)) => limits.with_position(
                start.position.min(target.position) - below.abs(),
                start.position.max(target.position) + above.abs(),
            ),
            None => limits,
        };
        Problem { start, target, limits }
    })
}

fn timing() -> impl Strategy<Value = PlanOptions> {
    let modes = vec![
        Synchronisation::Time,
        Synchronisation::Phase,
        Synchronisation::Straight,
        Synchronisation::Independent,
    ];
    (prop::sample::select(modes), 0.0..10.0_f64, any::<[bool; 3]>()).prop_map(
        |(synchronisation, minimum_duration_s, [minimum, cycle, settled])| PlanOptions {
            synchronisation,
            minimum_duration_s: if minimum { minimum_duration_s } else { 0.0 },
            cycle_s: cycle.then_some(0.001),
            return_to_limits: if settled { Return::Settled } else { Return::Fastest },
        },
    )
}

/// Checks that the work since the last call keeps the bound.
fn keeps_bound(searches_max: u32) -> Result<(), TestCaseError> {
    let (searches, evaluations) = work::take();
    prop_assert!(searches <= searches_max, "{searches} searches of {searches_max}");
    prop_assert!(evaluations <= searches * EVALUATIONS_MAX, "{evaluations} in {searches} searches");
    Ok(())
}

#[test]
fn the_count_notices_the_searches_of_a_plan() {
    let target = State { velocity: 0.3, ..State::rest(1.0) };
    work::take();
    let problem = Problem { start: State::rest(0.0), target, limits: Limits::symmetric(1.0, 2.0, 3.0) };
    assert!(position(&problem).is_ok());
    let (searches, evaluations) = work::take();
    assert!((1..SEARCHES_MAX).contains(&searches) && evaluations >= searches, "{searches} {evaluations}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, rng_seed: RngSeed::Fixed(9), ..ProptestConfig::default() })]

    #[test]
    fn the_work_never_exceeds_its_bound(problems in prop::collection::vec(problem(), 1..5), timing in timing()) {
        let mut profiles: Vec<Profile> = problems.iter().map(|_| Profile::hold(0.0)).collect();
        let axes = problems.len() as u32;
        work::take();
        let free: Vec<Problem> = problems.iter().map(|problem| Problem {
            limits: problem.limits.with_position(f64::NEG_INFINITY, f64::INFINITY), ..*problem
        }).collect();
        let _ = synchronised(&free, &mut profiles, timing);
        keeps_bound(SEARCHES_MAX * (axes + 1))?;
        let _ = synchronised(&problems, &mut profiles, timing);
        keeps_bound(SEARCHES_WITHIN_LIMITS_MAX * axes + SEARCHES_MAX)?;
        let _ = synchronised_velocity(&problems, &mut profiles, timing);
        keeps_bound(0)?;
        let starts: Vec<State> = problems.iter().map(|problem| problem.start).collect();
        let limits: Vec<Limits> = problems.iter().map(|problem| problem.limits).collect();
        let _ = stop(&starts, &limits, &mut profiles);
        keeps_bound(0)?;
        let _ = problems[0].track(0.001);
        keeps_bound(2 * SEARCHES_WITHIN_LIMITS_MAX)?;
    }

    /// The axis is planned again from every cycle of its motion. There, roots are close to the ends of their brackets.
    #[test]
    fn planning_anew_never_exceeds_the_bound(problem in problem(), cycles in 5..50_u32) {
        let mut problem = Problem {
            limits: problem.limits.with_position(f64::NEG_INFINITY, f64::INFINITY), ..problem
        };
        work::take();
        let mut answer = position(&problem);
        keeps_bound(SEARCHES_MAX)?;
        for _ in 1..cycles {
            let Ok(profile) = answer else { break };
            problem.start = profile.sample(profile.duration_s() / f64::from(cycles));
            answer = position(&problem);
            keeps_bound(SEARCHES_MAX)?;
        }
    }
}
