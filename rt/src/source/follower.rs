//! The next set-point of an axis that follows a moving target within its limits.
//!
//! Every set-point is reached from the one before it with constant jerk, or by a motion of the planner. So the limits of
//! velocity, acceleration and jerk hold between set-points too, and in every finite difference of them.

use crate::group_trajectory::{fastest_stop, stop_limits};
use crate::guard::{AxisLimits, braking_distance};
use crate::plan::{PlanError, Problem, State};

/// How fast what is left of a small error goes away, in seconds.
const SETTLING_S: f64 = 0.01;
/// The time in which the acceleration limit would be reached by the jerk that corrects a small error at most, as a multiple of
/// [`SETTLING_S`].
const CORRECTING: f64 = 5.0;

/// The set-point one period after `start`, on the way to `target`, which is where the target will be then.
///
/// What starts where it can be stopped within the limits ends where it can be stopped within them. A target that moves within
/// the limits is followed to the last bit of what the change of its jerk leaves; one that leaps is reached as fast as the limits
/// allow, without overshoot. A target beyond a position limit is followed as far as the limit; so an axis that starts beyond the
/// limit comes back to it, and never moves farther out.
///
/// An axis that turns round within a period does so with the constant jerk of that period, where the fastest way would change its jerk
/// in it, or without a limit of the jerk its acceleration at once. From within a limit that leads beyond it by jerk · period³ / 3 at most
/// (2/9 · acceleration · period²).
///
/// # Errors
/// What is no number, or no number that can be planned with.
pub fn follow(start: &State, target: &State, limits: &AxisLimits, period_s: f64) -> Result<State, PlanError> {
    let target = within_range(start, target, limits);
    match corrected(start, &target, limits, period_s) {
        Some(next) => Ok(next),
        None => tracked(start, &target, limits, period_s),
    }
}

/// The target; or rest at the position limit that it is beyond. A start beyond a limit comes back first, and does not meet the
/// velocity of the target before.
fn within_range(start: &State, target: &State, limits: &AxisLimits) -> State {
    let is_within = |position: f64| (limits.position_min..=limits.position_max).contains(&position);
    let are_rates_finite = target.velocity.is_finite() && target.acceleration.is_finite();
    if !are_rates_finite || is_within(target.position) && is_within(start.position) {
        return *target;
    }
    State::rest(target.position.clamp(limits.position_min, limits.position_max))
}

/// The set-point with the jerk of the target and a little more, which takes a small error back. `None` where the error is not
/// small, or a limit is near: that takes a plan.
///
/// The jerk feeds the errors back that the target would leave at the end of the period: so that both poles of what remains of
/// them are real, and nothing overshoots or rings.
fn corrected(start: &State, target: &State, limits: &AxisLimits, period_s: f64) -> Option<State> {
    let h = period_s;
    let coasting = start.after(h);
    // Errors at the end of the period, in the units of the position.
    let by_position = target.position - coasting.position;
    let by_velocity = (target.velocity - coasting.velocity) * h;
    let by_acceleration = (target.acceleration - start.acceleration) * h * h;
    // What the jerk of the target makes of them, if it is where it was expected.
    let (off_position, off_velocity) =
        (by_position - by_acceleration / 6.0, by_velocity - by_acceleration / 2.0);
    let share = (h / SETTLING_S).min(1.0);
    let (position_gain, velocity_gain) = (share * share, share * (2.0 - share));
    let cubed = h * h * h;
    let correction = (position_gain * off_position.abs() + velocity_gain * off_velocity.abs()) / cubed;
    let steepest = limits.acceleration.min(limits.deceleration);
    // What is no number is not small either.
    let is_small = correction <= limits.jerk.min(steepest / (CORRECTING * SETTLING_S));
    if !is_small {
        return None;
    }
    let jerk = (by_acceleration + position_gain * off_position + velocity_gain * off_velocity) / cubed;
    if jerk.abs() > limits.jerk {
        return None;
    }
    let next = State {
        position: coasting.position + jerk * cubed / 6.0,
        velocity: coasting.velocity + jerk * h * h / 2.0,
        acceleration: start.acceleration + jerk * h,
    };
    is_safe(start, &next, limits, h).then_some(next)
}

/// Returns `true` if a set-point keeps the limits, and can be stopped within them.
pub(super) fn is_safe(start: &State, next: &State, limits: &AxisLimits, period_s: f64) -> bool {
    let State { position, velocity, acceleration } = *next;
    let steepest = limits.acceleration.max(limits.deceleration);
    let (rising, falling) = limits.rising_and_falling(velocity);
    if acceleration > rising || -acceleration > falling || start.acceleration.abs() > steepest {
        return false;
    }
    let step = position - start.position;
    // What the acceleration still adds to the velocity before the jerk has taken it back.
    let gain = acceleration * acceleration / (2.0 * limits.jerk);
    let fastest = velocity.abs() + if velocity * acceleration >= 0.0 { gain } else { 0.0 };
    if fastest.max(gain - velocity.abs()) > limits.velocity || step.abs() > limits.velocity * period_s {
        return false;
    }
    // Beyond a position limit it only comes back, also between two set-points with an inward velocity: the guard lets nothing else pass.
    let (lowest, highest) =
        (limits.position_min.min(start.position), limits.position_max.max(start.position));
    if position < lowest || position > highest {
        return false;
    }
    // Nor must its acceleration turn it round later.
    let turns_outward =
        |velocity: f64, acceleration: f64| velocity + if acceleration > 0.0 { gain } else { 0.0 } > 0.0;
    if position > limits.position_max && turns_outward(velocity, acceleration)
        || position < limits.position_min && turns_outward(-velocity, -acceleration)
    {
        return false;
    }
    // From the fastest velocity with the highest acceleration.
    let farthest = braking_bound(limits);
    if position + farthest <= limits.position_max && position - farthest >= limits.position_min {
        return true;
    }
    stops_in_range(next, &limits.both_ways())
}

/// Returns `true` if the axis can be stopped before its position limits, or where it is beyond one.
fn stops_in_range(state: &State, limits: &AxisLimits) -> bool {
    let State { position, velocity, acceleration } = *state;
    let highest = position + braking_distance(limits, velocity, acceleration);
    let lowest = position - braking_distance(limits, -velocity, -acceleration);
    // One that has come back within a limit does not go beyond it again.
    highest <= limits.position_max.max(position) && lowest >= limits.position_min.min(position)
}

/// More than any stop within the limits needs.
fn braking_bound(limits: &AxisLimits) -> f64 {
    let slowest = limits.acceleration.min(limits.deceleration);
    let steepest = limits.acceleration.max(limits.deceleration);
    let building_up_s = if limits.jerk.is_finite() { 2.0 * steepest / limits.jerk } else { 0.0 };
    limits.velocity * (limits.velocity / slowest + building_up_s)
}

/// The set-point on the fastest way to meet the target.
///
/// An axis whose acceleration is the smaller one, and that was led here by something else, may come to rest before a position
/// limit by its deceleration alone. That is what it does first.
fn tracked(start: &State, target: &State, limits: &AxisLimits, period_s: f64) -> Result<State, PlanError> {
    let smaller = limits.both_ways();
    let can_brake_harder = limits.acceleration < limits.deceleration && limits.contain(start.position);
    if can_brake_harder && !stops_in_range(start, &smaller) {
        return Ok(fastest_stop(start, limits)?.sample(period_s));
    }
    Problem { start: *start, target: target.after(-period_s), limits: stop_limits(start, &smaller) }
        .track(period_s)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    const PERIOD_S: f64 = 0.001;
    pub const LIMITS: AxisLimits = AxisLimits {
        position_min: -1.0,
        position_max: 2.0,
        velocity: 3.0,
        acceleration: 8.0,
        deceleration: 8.0,
        jerk: 100.0,
        torque: 50.0,
    };

    /// The last four set-points, the newest first.
    #[derive(Default)]
    pub struct SetPoints([f64; 4]);

    impl SetPoints {
        /// Checks that no difference of them is beyond a limit after the next one.
        pub fn check(&mut self, position: f64, limits: &AxisLimits) -> Result<(), TestCaseError> {
            self.0 = [position, self.0[0], self.0[1], self.0[2]];
            let [newest, last, before, oldest] = self.0;
            let steepest = limits.acceleration.max(limits.deceleration);
            let difference = (newest - last) / PERIOD_S;
            prop_assert!(difference.abs() <= limits.velocity * (1.0 + 1e-9), "velocity {difference}");
            let difference = (newest - 2.0 * last + before) / PERIOD_S.powi(2);
            prop_assert!(difference.abs() <= steepest * (1.0 + 1e-6), "acceleration {difference}");
            let difference = (newest - 3.0 * last + 3.0 * before - oldest) / PERIOD_S.powi(3);
            prop_assert!(difference.abs() <= limits.jerk * (1.0 + 1e-5) + 1e-4, "jerk {difference}");
            let within = limits.position_min - 1e-6..=limits.position_max + 1e-6;
            prop_assert!(within.contains(&newest), "position {newest}");
            Ok(())
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn whatever_the_target_does_no_difference_of_the_set_points_is_beyond_a_limit(
            targets in prop::collection::vec((-2.5f64..2.5, -5.0f64..5.0, -30.0f64..30.0, 1usize..300), 1..30),
            (acceleration, deceleration) in prop::sample::select(&[(8.0, 8.0), (10.0, 20.0), (20.0, 10.0)][..]),
            jerk in prop_oneof![50.0f64..1000.0, Just(f64::INFINITY)],
        ) {
            let limits = AxisLimits { acceleration, deceleration, jerk, ..LIMITS };
            let (mut state, mut set_points) = (State::rest(0.0), SetPoints::default());
            for (position, velocity, acceleration, cycles) in targets {
                let mut target = State { position, velocity, acceleration };
                for _ in 0..cycles {
                    target = target.after(PERIOD_S);
                    state = follow(&state, &target, &limits, PERIOD_S).unwrap();
                    set_points.check(state.position, &limits)?;
                }
            }
        }
    }

    /// How far the next set-point of an axis near its upper position limit may be: see [`follow`].
    pub fn farthest(position: f64, limits: &AxisLimits, period_s: f64) -> f64 {
        let steepest = limits.acceleration.max(limits.deceleration) * period_s.powi(2);
        let from_within = match limits.jerk.is_finite() {
            true => limits.jerk * period_s.powi(3) / 3.0,
            false => 2.0 / 9.0 * steepest,
        };
        const ROUNDING: f64 = 1e-12;
        (limits.position_max + from_within).max(position) + ROUNDING
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        #[test]
        fn an_axis_beyond_a_position_limit_comes_back_and_never_moves_farther_out(
            targets in prop::collection::vec(
                (prop_oneof![1.5f64..3.0, 1.99999f64..2.00001], -0.5f64..3.0, prop_oneof![1usize..3, 1usize..40]),
                1..60,
            ),
            out in prop_oneof![0.0f64..1e-5, 0.0f64..1e-4, 0.0f64..0.5],
            jerk in prop_oneof![50.0f64..1000.0, Just(f64::INFINITY)],
        ) {
            let limits = AxisLimits { jerk, ..LIMITS };
            let mut state = State::rest(2.0 + out);
            for (position, velocity, cycles) in targets {
                let mut target = State { position, velocity, acceleration: 0.0 };
                for _ in 0..cycles {
                    target = target.after(PERIOD_S);
                    let next = follow(&state, &target, &limits, PERIOD_S).unwrap();
                    let farthest = farthest(state.position, &limits, PERIOD_S);
                    prop_assert!(next.position <= farthest, "{state:?} {next:?}");
                    state = next;
                }
            }
        }
    }

    /// Any finite number, as a callback may say it.
    fn any_finite() -> impl Strategy<Value = f64> {
        prop_oneof![
            4 => -3.0f64..3.0,
            1 => prop::sample::select(&[f64::MAX, f64::MIN, 1e300, -1e300, 1e10, -1e10, f64::MIN_POSITIVE][..]),
            1 => any::<f64>().prop_filter("finite", |number| number.is_finite()),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        /// However far away a target is and however fast: the next set-point is a number within the limits, or there is none.
        #[test]
        fn any_finite_target_is_followed_by_finite_steps_or_refused(
            targets in prop::collection::vec((any_finite(), any_finite(), any_finite(), 1usize..20), 1..20),
            jerk in prop_oneof![50.0f64..1000.0, Just(f64::INFINITY)],
        ) {
            let limits = AxisLimits { jerk, ..LIMITS };
            let mut state = State::rest(0.0);
            for (position, velocity, acceleration, cycles) in targets {
                let target = State { position, velocity, acceleration };
                for _ in 0..cycles {
                    let next = follow(&state, &target, &limits, PERIOD_S).unwrap_or(state);
                    let State { position, velocity, acceleration } = next;
                    prop_assert!(position.is_finite() && velocity.is_finite() && acceleration.is_finite());
                    prop_assert!((position - state.position).abs() <= limits.velocity * PERIOD_S * (1.0 + 1e-9));
                    prop_assert!((-1.0 - 1e-3..=2.0 + 1e-3).contains(&position), "{next:?}");
                    state = next;
                }
            }
        }

        #[test]
        fn a_target_beyond_every_limit_is_never_refused_where_it_is_to_rest(far in any_finite()) {
            let mut state = State::rest(0.0);
            for _ in 0..3_000 {
                state = follow(&state, &State::rest(far), &LIMITS, PERIOD_S).unwrap();
            }
            prop_assert!((state.position - far.clamp(-1.0, 2.0)).abs() < 1e-9, "{state:?}");
        }
    }

    const EVEN: AxisLimits = AxisLimits { acceleration: 1.0, deceleration: 1.0, ..LIMITS };

    /// The acceleration is the smaller one: from 1.7 rad/s it stops an axis within 0.43 rad, the deceleration within 0.25 rad.
    const SLOW_TO_START: AxisLimits =
        AxisLimits { acceleration: 3.4, deceleration: 6.0, jerk: f64::INFINITY, ..LIMITS };
    const FAST: State = State { position: 1.7, velocity: 1.7, acceleration: 0.0 };

    #[test]
    fn an_axis_on_its_way_back_to_a_limit_does_not_turn_outward_within_a_cycle() {
        let limits = AxisLimits { position_min: -0.2, position_max: 0.0, velocity: 0.15, jerk: 20.0, ..EVEN };
        let start =
            State { position: 2.379735876762739e-7, velocity: -1.0176204e-6, acceleration: 3.2315236e-3 };
        for nanometres in -10_000..10 {
            let target = State::rest(f64::from(nanometres) * 1e-9);
            let next = follow(&start, &target, &limits, 2.0 * PERIOD_S).unwrap();
            assert!(next.position <= start.position, "{target:?}: {next:?}");
        }
    }

    #[test]
    fn an_axis_that_only_its_deceleration_stops_before_a_position_limit_is_stopped_by_it() {
        for jerk in [400.0, f64::INFINITY] {
            let limits = AxisLimits { jerk, ..SLOW_TO_START };
            let mut state = FAST;
            for _ in 0..2_000 {
                state = follow(&state, &State::rest(5.0), &limits, PERIOD_S).unwrap();
                assert!(state.position <= limits.position_max + 1e-9, "{state:?}");
            }
            assert!((state.position - limits.position_max).abs() < 1e-9, "{state:?}");
        }
    }

    #[test]
    fn what_is_no_number_is_an_error() {
        let bad = State { velocity: f64::NAN, ..State::default() };
        assert!(matches!(
            follow(&State::default(), &bad, &LIMITS, PERIOD_S),
            Err(PlanError::NotFinite { axis: 0, .. })
        ));
    }
}
