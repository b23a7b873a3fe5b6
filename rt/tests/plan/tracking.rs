//! Following a target that moves.

use nalgebra::vector;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use takt_rt::plan::{GroupState, Limit, Limits, PlanError, PlanOptions, Problem, State, Trajectory};

/// The limits of a joint of an arm.
const ARM: Limits = Limits::symmetric(2.5, 15.0, 1000.0);
const CYCLE_S: f64 = 0.001;

fn state(position: f64, velocity: f64, acceleration: f64) -> State {
    State { position, velocity, acceleration }
}

fn sine(time_s: f64) -> State {
    let (amplitude, rate) = (0.5, 2.0);
    let (sin, cos) = (rate * time_s).sin_cos();
    state(amplitude * sin, amplitude * rate * cos, -amplitude * rate * rate * sin)
}

#[test]
fn a_sine_is_followed_within_the_limits_with_a_small_error_once_it_is_met() {
    for jerk in [100.0, 1000.0, 10_000.0] {
        let limits = Limits { jerk_max: jerk, ..ARM };
        let mut command = State::rest(0.4);
        let (mut squares, mut count) = (0.0, 0.0);
        for cycle in 0..10_000_u32 {
            let now_s = f64::from(cycle) * CYCLE_S;
            let problem = Problem { start: command, target: sine(now_s), limits };
            let next = problem.track(CYCLE_S).unwrap();
            assert!(
                next.velocity.abs() <= 2.5 * (1.0 + 1e-9) && next.acceleration.abs() <= 15.0 * (1.0 + 1e-9)
            );
            if cycle > 2_000 {
                let error = next.position - sine(now_s + CYCLE_S).position;
                squares += error * error;
                count += 1.0;
            }
            command = next;
        }
        let rms = f64::sqrt(squares / count);
        assert!(rms < 1.3e-4, "{rms} rad at a jerk of {jerk}");
    }
}

#[test]
fn a_target_that_runs_away_is_followed_at_the_velocity_limit() {
    let mut command = State::rest(0.0);
    for cycle in 0..5_000_u32 {
        let target = state(4.0 * f64::from(cycle) * CYCLE_S, 4.0, 0.0);
        command = Problem { start: command, target, limits: ARM }.track(CYCLE_S).unwrap();
        assert!(command.velocity <= 2.5 * (1.0 + 1e-9));
    }
    assert!(command.velocity > 2.5 * (1.0 - 1e-6));
}

#[test]
fn a_target_beyond_the_position_limit_is_awaited_at_it() {
    let limits = ARM.with_position(-1.0, 1.0);
    let mut command = State::rest(0.0);
    for _ in 0..3_000 {
        command = Problem { start: command, target: state(3.0, 0.5, 0.0), limits }.track(CYCLE_S).unwrap();
        assert!(command.position <= 1.0 + 1e-9);
    }
    assert!((command.position - 1.0).abs() < 1e-9 && command.velocity.abs() < 1e-9);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, rng_seed: RngSeed::Fixed(3), ..ProptestConfig::default() })]

    #[test]
    fn whatever_the_target_does_the_command_keeps_the_limits(
        targets in prop::collection::vec((-2.0..2.0, -4.0..4.0, -30.0..30.0_f64), 1..20), jerk in 50.0..5000.0_f64,
    ) {
        let limits = Limits { jerk_max: jerk, ..ARM }.with_position(-1.0, 1.0);
        let mut command = State::rest(0.0);
        for (position, velocity, acceleration) in targets {
            for cycle in 0..50_u32 {
                let t = f64::from(cycle) * CYCLE_S;
                let target = state(position + velocity * t + 0.5 * acceleration * t * t, velocity + acceleration * t, acceleration);
                let next = Problem { start: command, target, limits }.track(CYCLE_S).unwrap();
                prop_assert!(next.velocity.abs() <= 2.5 * (1.0 + 1e-6), "{next:?}");
                prop_assert!(next.acceleration.abs() <= 15.0 * (1.0 + 1e-6), "{next:?}");
                prop_assert!(next.position.abs() <= 1.0 + 1e-6, "{next:?}");
                // The axis keeps its jerk limit, apart from the change of the target's acceleration, which it follows.
                prop_assert!((next.position - command.position).abs() <= 2.5 * CYCLE_S * (1.0 + 1e-6));
                command = next;
            }
        }
    }
}

#[test]
fn a_group_that_would_leave_its_position_limits_is_refused_with_a_stop() {
    let limits = [ARM, ARM.with_position(-1.0, 1.0)];
    let start = GroupState { velocity: vector![0.5, 2.0], ..GroupState::rest(vector![0.0, 0.9]) };
    let refusal =
        Trajectory::plan(&start, &GroupState::rest(vector![1.0, 0.0]), &limits, PlanOptions::default())
            .unwrap_err();
    assert_eq!(refusal.error, PlanError::PositionBeyondLimit { axis: 1, limit: Limit::PositionMax });
    let stop = refusal.stop.unwrap();
    let end = stop.sample(stop.duration_s());
    assert_eq!((end.velocity, end.acceleration), (vector![0.0, 0.0], vector![0.0, 0.0]));
    assert_eq!(stop.extrema()[1].velocity.max, 2.0);
}

/// Found by random search: the velocity exceeded its limit within the cycle, and was back at the limit at its end.
#[test]
fn the_step_of_a_cycle_at_the_velocity_limit_is_not_too_far_while_the_target_accelerates() {
    let limits = Limits { jerk_max: 4127.0, ..ARM }.with_position(-1.0, 1.0);
    let start = state(0.5153011208264682, 2.5, 0.0);
    let target = state(0.70845470786804, -0.8256510783529238, 22.54566159916036);
    let next = Problem { start, target, limits }.track(CYCLE_S).unwrap();
    assert!(next.position - start.position <= 2.5 * CYCLE_S * (1.0 + 1e-9), "{next:?}");
}
