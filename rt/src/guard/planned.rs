//! What the planner plans within the limits passes the guard of a stream, sample by sample, and what goes beyond them does
//! not, and can be stopped before.

extern crate std;

use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::{AxisLimits, SetPointSteps, TOLERANCE, braking_distance, check, check_braking, check_jerk};
use crate::fault::Fault;
use crate::group_trajectory::{GroupTrajectory, Leg, ProfileStore};
use crate::places::Places;
use crate::plan::State;

/// A stream of positions of one axis, which is all that the guard looks at.
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
struct Stream {
    sent: [f64; 3],
    limits: AxisLimits,
    period_s: f64,
}

impl Stream {
    fn at_rest(position: f64, limits: AxisLimits, period_s: f64) -> Self {
        Self { sent: [position; 3], limits, period_s }
    }

    fn check(&self, next: f64) -> Result<(), Fault> {
        self.check_steps(next)?;
        check_braking(&self.limits, &self.steps(next))
    }

    fn check_steps(&self, next: f64) -> Result<(), Fault> {
        let state = State { position: next, ..State::default() };
        check(&self.limits, self.period_s, self.sent[1], self.sent[0], &state)?;
        check_jerk(self.limits.jerk, &self.steps(next))
    }

    fn steps(&self, next: f64) -> SetPointSteps {
        SetPointSteps { sent: self.sent, next, period_s: self.period_s }
    }

    fn take(&mut self, next: f64) {
        self.sent = [next, self.sent[0], self.sent[1]];
    }

    /// The state that a stop begins from, see `Axis::derive_from_steps`.
    fn state(&self) -> State {
        let [newest, last, before] = self.sent;
        let steps = SetPointSteps { sent: [last, before, before], next: newest, period_s: self.period_s };
        steps.state(&self.limits)
    }
}

fn limits() -> impl Strategy<Value = AxisLimits> {
    let jerk = prop_oneof![3 => 20.0f64..400.0, 2 => 400.0f64..20_000.0, 1 => Just(f64::INFINITY)];
    (0.1f64..2.0, 0.2f64..5.0, 1.0f64..30.0, 1.0f64..30.0, jerk).prop_map(
        |(range, velocity, acceleration, deceleration, jerk)| AxisLimits {
            position_min: -range / 3.0,
            position_max: range,
            velocity,
            acceleration,
            deceleration,
            jerk,
            torque: 50.0,
        },
    )
}

/// Where to, as a share of the range; at which share of the highest velocity; for how many cycles at most.
fn targets() -> impl Strategy<Value = Vec<(f64, f64, usize)>> {
    let position = prop_oneof![Just(0.0), Just(1.0), 0.0f64..=1.0];
    let velocity = prop_oneof![3 => Just(0.0), 1 => -1.0f64..=1.0];
    let cycles = prop_oneof![1usize..400, Just(usize::MAX)];
    prop::collection::vec((position, velocity, cycles), 1..6)
}

/// A target that can be stopped behind, where it is passed at speed: up to a cycle later.
fn target(limits: &AxisLimits, share: f64, speed: f64, period_s: f64) -> State {
    let position = limits.position_min + share * (limits.position_max - limits.position_min);
    let velocity = speed * limits.velocity;
    let way = |velocity: f64| velocity.max(0.0) * period_s + braking_distance(limits, velocity, 0.0);
    let is_possible = limits.contain(position + way(velocity)) && limits.contain(position - way(-velocity));
    State { position, velocity: if is_possible { velocity } else { 0.0 }, acceleration: 0.0 }
}

proptest! {
    #[test]
    fn every_sample_of_what_is_planned_within_the_limits_passes_as_a_stream(
        all in prop::collection::vec(limits(), 1..4),
        targets in targets(),
        period_s in prop::sample::select(&[0.000_5, 0.001, 0.002, 0.004][..]),
    ) {
        let mut streams: Vec<Stream> =
            all.iter().map(|limits| Stream::at_rest(0.0, *limits, period_s)).collect();
        let mut states = vec![State::default(); all.len()];
        let (mut profiles, mut motion) = (ProfileStore::<4>::default(), GroupTrajectory::new(Places { first: 0, end: all.len() }));
        // To rest where the last one is passed at speed.
        for (share, speed, cycles) in targets.into_iter().chain([(0.5, 0.0, usize::MAX)]) {
            let legs = all.iter().zip(&states).map(|(limits, start)| Leg {
                start: *start,
                target: target(limits, share, speed, period_s),
                limits,
            });
            // The way may be too short for the speed.
            if motion.move_to(&mut profiles, legs, 1.0, 1.0, 0.0).is_err() {
                let here = states.iter().copied().zip(&all);
                motion.stop(&mut profiles, here).unwrap();
            }
            for _ in 0..cycles {
                if motion.is_finished() {
                    break;
                }
                motion.advance(period_s);
                states = motion.states(&profiles).collect();
                for (stream, state) in streams.iter_mut().zip(&states) {
                    let passed = stream.check(state.position);
                    prop_assert!(passed.is_ok(), "{passed:?} at {state:?} of {:?}", stream.limits);
                    stream.take(state.position);
                }
            }
        }
    }

    #[test]
    fn what_goes_beyond_a_limit_is_refused_while_a_stop_still_keeps_them_all(
        limits in limits(),
        targets in targets(),
        // By how much each limit that the stream keeps to is higher than that of the guard.
        beyond in prop::collection::vec(prop_oneof![Just(0.0), 1e-7f64..1e-5, 1e-5f64..0.01, 0.01f64..2.0], 5),
        cycles in 1usize..3000,
    ) {
        let period_s = 0.001;
        let range = limits.position_max - limits.position_min;
        let wider = AxisLimits {
            position_max: limits.position_max + beyond[0] * range,
            velocity: limits.velocity * (1.0 + beyond[1]),
            acceleration: limits.acceleration * (1.0 + beyond[2]),
            deceleration: limits.deceleration * (1.0 + beyond[3]),
            jerk: limits.jerk * (1.0 + beyond[4]),
            ..limits
        };
        let steepest = limits.acceleration.max(limits.deceleration);
        let mut stream = Stream::at_rest(0.0, limits, period_s);
        let (mut profiles, mut motion) = (ProfileStore::<4>::default(), GroupTrajectory::new(Places { first: 0, end: 1 }));
        let mut state = State::default();
        let targets = targets.into_iter().map(|(share, _, cycles)| (share, cycles));
        let positions = targets.flat_map(|(share, cycles)| {
            let target = target(&wider, share, 0.0, period_s);
            // Where that is not possible the motion goes on as it is.
            let _ = motion.move_to(&mut profiles, [Leg { start: state, target, limits: &wider }].into_iter(), 1.0, 1.0, 0.0);
            let mut leg = Vec::new();
            while !motion.is_finished() && leg.len() < cycles {
                motion.advance(period_s);
                state = motion.states(&profiles).next().unwrap();
                leg.push(state.position);
            }
            leg
        });
        for next in positions.take(cycles) {
            let [last, before, first] = stream.sent;
            let excesses = [
                (next - limits.position_max) / range,
                ((next - last) / period_s).abs() / limits.velocity - 1.0,
                ((next - 2.0 * last + before) / period_s.powi(2)).abs() / steepest - 1.0,
                ((next - 3.0 * last + 3.0 * before - first) / period_s.powi(3)).abs() / limits.jerk - 1.0,
            ];
            if stream.check(next).is_err() {
                break;
            }
            stream.take(next);
            // The rounding of positions shows in what is small against it.
            let worst = excesses.into_iter().fold(0.0, f64::max);
            prop_assert!(worst < 4.0 * TOLERANCE, "{excesses:?} was let pass");
        }
        // Wherever the stream has ended, refused or not.
        motion.stop(&mut profiles, [(stream.state(), &limits)].into_iter()).unwrap();
        while !motion.is_finished() {
            motion.advance(period_s);
            let next = motion.states(&profiles).next().unwrap().position;
            let passed = stream.check_steps(next);
            prop_assert!(passed.is_ok(), "{passed:?} at {next} of {limits:?}");
            let farthest = limits.position_max + 1.1 * TOLERANCE * range;
            prop_assert!(next <= farthest && next >= limits.position_min - 1.1 * TOLERANCE * range, "{next}");
            stream.take(next);
        }
    }
}
