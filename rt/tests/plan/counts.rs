//! Commands that are rounded to the counts of an encoder.

use core::f64::consts::TAU;
use takt_rt::plan::{Limits, PlanOptions, Problem, Profile, State, position, synchronised};
use takt_rt::{Scale, ScaleParameters};

const CYCLE_S: f64 = 0.001;

fn scale(counts_per_turn: f64, reversed: bool) -> Scale {
    Scale::new(ScaleParameters {
        counts_per_turn,
        velocity_units_per_turn: counts_per_turn,
        gear_ratio: 1.0,
        travel_per_turn: TAU,
        reversed,
        zero_counts: 1234.0,
        rated_torque: 1.0,
    })
    .unwrap()
}

/// The largest step of a velocity limit in one cycle.
fn step_max(scale: &Scale, limits: &Limits) -> i32 {
    (limits.velocity_max * CYCLE_S * scale.resolution()).ceil() as i32
}

#[test]
fn counts_are_half_a_count_off_at_most_and_step_no_further_than_the_velocity_limit_allows() {
    let limits = Limits::asymmetric(2.5, -2.5, 15.0, -10.0, 1000.0);
    for (bits, reversed) in [(12, false), (15, true), (17, false), (20, true), (23, false)] {
        let scale = scale(f64::from(1_u32 << bits), reversed);
        let target = State { position: 1.7, velocity: -0.4, acceleration: 0.0 };
        let problem =
            Problem { start: State { position: -0.3, velocity: 1.1, acceleration: 2.0 }, target, limits };
        let profile = position(&problem).unwrap();
        let mut last = scale.position_to_counts(profile.sample(0.0).position);
        let mut cycle = 0_u32;
        while f64::from(cycle) * CYCLE_S < profile.duration_s() {
            cycle += 1;
            let state = profile.sample(f64::from(cycle) * CYCLE_S);
            let counts = scale.position_to_counts(state.position);
            let error = (scale.position_from_counts(counts) - state.position) * scale.resolution();
            assert!(error.abs() <= 0.5 + 1e-9, "{error} counts in cycle {cycle} with {bits} bits");
            let step = counts - last;
            assert!(
                step.abs() <= step_max(&scale, &limits),
                "{step} counts in cycle {cycle} with {bits} bits"
            );
            last = counts;
        }
        assert!(cycle > 1000);
    }
}

/// The axis goes there and back for a long time. Each motion starts from the last command, not from the rounded one.
#[test]
fn counts_do_not_drift() {
    let limits = Limits::symmetric(2.5, 15.0, 1000.0);
    let scale = scale(f64::from(1_u32 << 15), false);
    let ends = [0.1, 1.1].map(|position| (position, scale.position_to_counts(position)));
    let mut command = State::rest(0.1);
    let mut profiles = [Profile::hold(0.0)];
    for (target, counts) in ends.iter().cycle().skip(1).take(200) {
        let problem = |start| [Problem { start, target: State::rest(*target), limits }];
        let mut cycles = 0_u32;
        while command != State::rest(*target) {
            synchronised(&problem(command), &mut profiles, PlanOptions::default()).unwrap();
            command = profiles[0].sample(CYCLE_S);
            cycles += 1;
            assert!(cycles < 2000, "{command:?}");
        }
        assert_eq!(scale.position_to_counts(command.position), *counts);
    }
}

/// The feed-forward comes from the trajectory. Computed from the counts, the acceleration would break its limit.
#[test]
fn velocity_and_acceleration_for_the_drive_are_those_of_the_trajectory_and_not_of_the_counts() {
    let limits = Limits::symmetric(2.5, 15.0, 1000.0);
    let problem = Problem { start: State::rest(0.0), target: State::rest(1.7), limits };
    let profile = position(&problem).unwrap();
    for bits in [15, 17, 20] {
        let scale = scale(f64::from(1_u32 << bits), false);
        let at = |cycle: u32| profile.sample(f64::from(cycle) * CYCLE_S);
        let rounded = |cycle: u32| scale.position_from_counts(scale.position_to_counts(at(cycle).position));
        let (mut fed, mut counted) = (0.0_f64, 0.0_f64);
        for cycle in 1..1000 {
            fed = fed.max(at(cycle).acceleration.abs());
            let second = rounded(cycle + 1) - 2.0 * rounded(cycle) + rounded(cycle - 1);
            counted = counted.max((second / (CYCLE_S * CYCLE_S)).abs());
            let step = (rounded(cycle + 1) - rounded(cycle)) / CYCLE_S;
            let middle = 0.5 * (at(cycle).velocity + at(cycle + 1).velocity);
            let count = 1.0 / (scale.resolution() * CYCLE_S);
            assert!(
                (step - middle).abs() <= count + 1000.0 * CYCLE_S * CYCLE_S,
                "{bits} bits in cycle {cycle}"
            );
        }
        assert!(fed <= limits.acceleration_max * (1.0 + 1e-12), "{fed}");
        assert!(bits > 17 || counted > 2.0 * limits.acceleration_max, "{counted} with {bits} bits");
    }
}
