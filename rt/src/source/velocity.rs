//! The next set-point of an axis that follows a velocity within its limits, those of its position included.

use super::follower::{follow, is_safe};
use crate::guard::AxisLimits;
use crate::plan::{PlanError, Quantity, State};

/// The slowest way to a position limit, as a share of the velocity limit: where nothing faster is wanted.
const SLOWEST: f64 = 1e-3;

/// The set-point one period after `start`, on the way to a velocity that is `velocity` then and changes by `acceleration`.
///
/// It gets there as fast as acceleration and jerk allow, and stays with a velocity that changes within them. It can always be
/// stopped before the position limits: near one it slows down, and comes to rest at it.
///
/// # Errors
/// What is no number, or no number that can be planned with.
pub fn follow_velocity(
    start: &State,
    velocity: f64,
    acceleration: f64,
    limits: &AxisLimits,
    period_s: f64,
) -> Result<State, PlanError> {
    for (value, quantity) in
        [(velocity, Quantity::TargetVelocity), (acceleration, Quantity::TargetAcceleration)]
    {
        if !value.is_finite() {
            return Err(PlanError::NotFinite { axis: 0, quantity });
        }
    }
    let wanted = velocity.clamp(-limits.velocity, limits.velocity);
    // Beyond a limit the velocity does not change any more.
    let change = if wanted == velocity { acceleration } else { 0.0 };
    let next = led(start, wanted, change, limits, period_s);
    if is_safe(start, &next, limits, period_s) {
        return Ok(next);
    }
    let direction = if wanted == 0.0 { start.velocity } else { wanted };
    let farthest = if direction < 0.0 {
        limits.position_min.min(start.position)
    } else {
        limits.position_max.max(start.position)
    };
    let gained = start.acceleration * start.acceleration / (2.0 * limits.jerk);
    let fastest = wanted.abs().max(start.velocity.abs() + gained).max(SLOWEST * limits.velocity);
    let limits = AxisLimits { velocity: fastest.min(limits.velocity), ..*limits };
    follow(start, &State::rest(farthest), &limits, period_s)
}

/// The set-point with the acceleration from which the jerk limit leads to the wanted velocity without going beyond it.
fn led(start: &State, velocity: f64, change: f64, limits: &AxisLimits, period_s: f64) -> State {
    let (h, jerk) = (period_s, limits.jerk);
    // As seen from a joint that has the wanted velocity already.
    let ahead = start.acceleration - change;
    let missing = (velocity - change * h) - start.velocity - 0.5 * ahead * h;
    let relative = if jerk.is_finite() {
        let root = libm::sqrt(h * h + 2.0 * missing.abs() / jerk) - h;
        (jerk * root).copysign(missing)
    } else {
        missing / h
    };
    let (rising, falling) = limits.rising_and_falling(start.velocity);
    let most = jerk * h;
    let acceleration = (change + relative)
        .clamp(-falling, rising)
        .max(start.acceleration - most)
        .min(start.acceleration + most);
    State {
        position: start.position + h * (start.velocity + h * (2.0 * start.acceleration + acceleration) / 6.0),
        velocity: start.velocity + 0.5 * h * (start.acceleration + acceleration),
        acceleration,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::follower::tests::{self, SetPoints, farthest};
    use proptest::prelude::*;

    const PERIOD_S: f64 = 0.001;
    const LIMITS: AxisLimits =
        AxisLimits { acceleration: 10.0, deceleration: 10.0, jerk: 200.0, ..tests::LIMITS };

    /// The motion after so many seconds of a velocity.
    fn after(duration_s: f64, velocity: f64, start: State) -> State {
        (0..(duration_s / PERIOD_S) as u32)
            .fold(start, |state, _| follow_velocity(&state, velocity, 0.0, &LIMITS, PERIOD_S).unwrap())
    }

    #[test]
    fn a_velocity_is_reached_as_fast_as_the_limits_allow_and_not_passed() {
        // 1 rad/s at 10 rad/s² with 200 rad/s³: 0.05 s up, 0.05 s at the limit, 0.05 s down.
        let mut state = State::default();
        for _ in 0..153 {
            state = follow_velocity(&state, 1.0, 0.0, &LIMITS, PERIOD_S).unwrap();
            assert!(state.velocity <= 1.0 + 1e-9, "{state:?}");
        }
        assert!((state.velocity - 1.0).abs() < 2e-3, "{state:?}");
        let state = after(0.05, 1.0, state);
        assert!((state.velocity - 1.0).abs() < 1e-9 && state.acceleration.abs() < 1e-6, "{state:?}");
    }

    #[test]
    fn a_velocity_that_changes_within_the_limits_is_followed_closely() {
        let mut state = State::default();
        let mut farthest: f64 = 0.0;
        for cycle in 1..1000 {
            let time_s = f64::from(cycle) * PERIOD_S;
            let (velocity, change) = (0.5 * (1.0 - (5.0 * time_s).cos()), 2.5 * (5.0 * time_s).sin());
            state = follow_velocity(&state, velocity, change, &LIMITS, PERIOD_S).unwrap();
            farthest = farthest.max((state.velocity - velocity).abs());
        }
        assert!(farthest < 1e-4, "{farthest}");
    }

    #[test]
    fn at_a_position_limit_the_joint_rests_whatever_velocity_is_wanted() {
        for (velocity, limit) in [(3.0, 2.0), (0.2, 2.0), (-3.0, -1.0), (-0.01, -1.0)] {
            let rest = after(30.0 / f64::abs(velocity).max(0.1), velocity, State::rest(limit * 0.95));
            assert!((rest.position - limit).abs() < 1e-6 && rest.velocity.abs() < 1e-6, "{rest:?}");
            let back = after(1.0, -0.1 * velocity, rest);
            assert!((back.velocity + 0.1 * velocity).abs() < 1e-9, "{back:?}");
        }
    }

    #[test]
    fn what_is_no_number_is_an_error() {
        for (velocity, acceleration) in [(f64::NAN, 0.0), (0.0, f64::NAN), (f64::INFINITY, 0.0)] {
            let result = follow_velocity(&State::default(), velocity, acceleration, &LIMITS, PERIOD_S);
            assert!(matches!(result, Err(PlanError::NotFinite { .. })), "{result:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn whatever_velocity_is_wanted_no_difference_of_the_set_points_is_beyond_a_limit(
            wanted in prop::collection::vec((-5.0f64..5.0, -30.0f64..30.0, 1usize..300), 1..30),
            (acceleration, deceleration) in prop::sample::select(&[(8.0, 8.0), (10.0, 20.0), (20.0, 10.0)][..]),
            jerk in prop_oneof![50.0f64..1000.0, Just(f64::INFINITY)],
        ) {
            let limits = AxisLimits { acceleration, deceleration, jerk, ..LIMITS };
            let (mut state, mut set_points) = (State::rest(0.0), SetPoints::default());
            for (velocity, acceleration, cycles) in wanted {
                for cycle in 0..cycles {
                    let velocity = velocity + acceleration * cycle as f64 * PERIOD_S;
                    state = follow_velocity(&state, velocity, acceleration, &limits, PERIOD_S).unwrap();
                    set_points.check(state.position, &limits)?;
                }
            }
        }
    }

    /// Checks every set-point of an axis that rests so far beyond its position limit at first, by where it may be at the farthest. The
    /// velocities are wanted each with its change and for so many cycles.
    fn check_return(
        wanted: &[(f64, f64, usize)],
        out: f64,
        jerk: f64,
        farthest: impl Fn(f64, &AxisLimits) -> f64,
    ) {
        let limits = AxisLimits { jerk, ..LIMITS };
        let mut state = State::rest(2.0 + out);
        for (velocity, acceleration, cycles) in wanted {
            for _ in 0..*cycles {
                let next = follow_velocity(&state, *velocity, *acceleration, &limits, PERIOD_S).unwrap();
                assert!(next.position <= farthest(state.position, &limits), "{state:?} {next:?}");
                state = next;
            }
        }
    }

    #[test]
    fn an_axis_that_has_just_come_back_within_a_position_limit_does_not_go_beyond_it_again() {
        let wanted = [
            (0.0, 0.05258090807104925, 1),
            (-0.38192311085138847, 0.0, 1),
            (0.04874183428150848, 0.0, 12),
            (0.0, 0.03364816583140992, 2),
            (0.38780291886555945, 0.0, 3),
        ];
        let farthest = |position: f64, limits: &AxisLimits| position.max(limits.position_max) + 1e-9;
        check_return(&wanted, 5.305317959533109e-6, 988.5643926242113, farthest);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        #[test]
        fn an_axis_beyond_a_position_limit_never_moves_farther_out(
            wanted in prop::collection::vec(
                (prop_oneof![-1.0f64..1.0, -1e-4f64..1e-4, -1e-6f64..1e-6], -0.1f64..0.1, prop_oneof![1usize..3, 1usize..40]),
                1..60,
            ),
            out in prop_oneof![0.0f64..1e-5, 0.0f64..0.5],
            jerk in prop_oneof![50.0f64..1000.0, Just(f64::INFINITY)],
        ) {
            check_return(&wanted, out, jerk, |position, limits| farthest(position, limits, PERIOD_S));
        }
    }
}
