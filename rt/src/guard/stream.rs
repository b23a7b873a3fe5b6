//! What a set-point of a stream must keep to beyond [`check`](super::check): its maker is not known, and nobody has
//! planned how it goes on.

use super::{AxisLimits, TOLERANCE, Violation};
use crate::plan::State;
use crate::stop::Rule;

/// What is done with a set-point of a stream that breaks a limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnViolation {
    /// The group stops.
    #[default]
    Reject,
    /// The nearest set-point within the limits takes its place, and is counted.
    Clamp,
}

/// Set-points of the last three cycles, newest first, and the one that is to follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// Positions that were sent, newest first (rad or m).
    pub sent: [f64; 3],
    /// The position that is to follow.
    pub next: f64,
    /// From one to the next, in seconds.
    pub period_s: f64,
}

impl Course {
    fn velocity(&self) -> f64 {
        (self.next - self.sent[0]) / self.period_s
    }

    fn last_velocity(&self) -> f64 {
        (self.sent[0] - self.sent[1]) / self.period_s
    }

    fn acceleration(&self) -> f64 {
        (self.velocity() - self.last_velocity()) / self.period_s
    }

    fn jerk(&self) -> f64 {
        let before = (self.last_velocity() - (self.sent[1] - self.sent[2]) / self.period_s) / self.period_s;
        (self.acceleration() - before) / self.period_s
    }

    /// What the rounding of positions comes to after so many divisions by the period.
    fn noise(&self, divisions: i32) -> f64 {
        let mut noise = 8.0 * f64::EPSILON * (1.0 + self.next.abs());
        for _ in 0..divisions {
            noise /= self.period_s;
        }
        noise
    }
}

/// Checks that a jerk limit is kept.
pub fn check_jerk(limit: f64, course: &Course) -> Result<(), Violation> {
    let jerk = course.jerk();
    if jerk.abs() > limit * (1.0 + TOLERANCE) + course.noise(3) {
        return Err(Violation { rule: Rule::JerkLimit, value: jerk, limit });
    }
    Ok(())
}

/// Checks that the joint can still come to rest within its position limits.
pub fn check_braking(limits: &AxisLimits, course: &Course) -> Result<(), Violation> {
    let velocity = course.velocity();
    let distance = braking_distance(limits, velocity, course.acceleration());
    let room = TOLERANCE * (limits.position_max - limits.position_min) + course.noise(0);
    let rest = course.next + distance;
    if velocity > 0.0 && rest > limits.position_max + room {
        return Err(Violation { rule: Rule::PositionLimit, value: rest, limit: limits.position_max });
    }
    if velocity < 0.0 && rest < limits.position_min - room {
        return Err(Violation { rule: Rule::PositionLimit, value: rest, limit: limits.position_min });
    }
    Ok(())
}

/// How far a joint goes on at least when it is stopped at the limits, with its sign. Acceleration along the way must
/// first be taken back, which speeds the joint up still.
pub fn braking_distance(limits: &AxisLimits, velocity: f64, acceleration: f64) -> f64 {
    let direction = if velocity < 0.0 { -1.0 } else { 1.0 };
    let (speed, along) = (velocity * direction, (acceleration * direction).max(0.0));
    let (taking_back_s, is_jerk_limited) =
        if limits.jerk.is_finite() { (along / limits.jerk, true) } else { (0.0, false) };
    // During that time the acceleration falls evenly from `along` to 0.
    let meanwhile = speed * taking_back_s + along * taking_back_s * taking_back_s / 3.0;
    let highest = speed + along * taking_back_s / 2.0;
    let building_up = if is_jerk_limited { highest * limits.deceleration / (2.0 * limits.jerk) } else { 0.0 };
    direction * (meanwhile + highest * highest / (2.0 * limits.deceleration) + building_up)
}

/// The set-point nearest to the one asked for that keeps the limits of velocity, acceleration and position. A target
/// that is no number counts as the wish to stop.
pub fn clamp(limits: &AxisLimits, course: &Course) -> State {
    let (period_s, last) = (course.period_s, course.sent[0]);
    let last_velocity = course.last_velocity();
    let wanted = if course.next.is_finite() { course.velocity() } else { 0.0 };
    let change = limits.acceleration.min(limits.deceleration) * period_s;
    let (lowest, highest) = (last_velocity - change, last_velocity + change);
    let towards = |limit: f64, direction: f64| highest_speed(limits, (limit - last) * direction, change);
    let velocity = wanted
        .clamp(-limits.velocity, limits.velocity)
        .min(towards(limits.position_max, 1.0))
        .max(-towards(limits.position_min, -1.0))
        .max(lowest)
        .min(highest);
    State {
        position: last + velocity * period_s,
        velocity,
        acceleration: (velocity - last_velocity) / period_s,
    }
}

/// The highest speed towards a limit at this distance from which whole steps of the deceleration lead to rest before it.
fn highest_speed(limits: &AxisLimits, distance: f64, change: f64) -> f64 {
    let deceleration = limits.acceleration.min(limits.deceleration);
    libm::sqrt(2.0 * deceleration * distance.max(0.0) + change * change / 4.0) - 1.5 * change
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guard;
    use proptest::prelude::*;

    const LIMITS: AxisLimits = AxisLimits {
        position_min: -1.0,
        position_max: 2.0,
        velocity: 3.0,
        acceleration: 10.0,
        deceleration: 20.0,
        jerk: f64::INFINITY,
        torque: 50.0,
    };
    const PERIOD_S: f64 = 0.001;

    fn moving_at(position: f64, velocity: f64) -> Course {
        let step = velocity * PERIOD_S;
        Course {
            sent: [position - step, position - 2.0 * step, position - 3.0 * step],
            next: position,
            period_s: PERIOD_S,
        }
    }

    #[test]
    fn a_stream_must_leave_room_to_stop_before_the_limit() {
        // 2 rad/s at 20 rad/s² take 0.1 rad.
        assert_eq!(check_braking(&LIMITS, &moving_at(1.89, 2.0)), Ok(()));
        let violation = check_braking(&LIMITS, &moving_at(1.91, 2.0)).unwrap_err();
        assert_eq!((violation.rule, violation.limit), (Rule::PositionLimit, 2.0));
        assert!((violation.value - 2.01).abs() < 1e-9);
        assert_eq!(check_braking(&LIMITS, &moving_at(1.99, -2.0)), Ok(()));
        assert!(check_braking(&LIMITS, &moving_at(-0.95, -2.0)).is_err());
    }

    #[test]
    fn a_limited_jerk_makes_the_way_to_rest_longer() {
        let limits = AxisLimits { jerk: 100.0, ..LIMITS };
        let plain = braking_distance(&LIMITS, 2.0, 0.0);
        // The deceleration builds up over 0.2 s: half of what that takes longer at 2 rad/s.
        assert!((braking_distance(&limits, 2.0, 0.0) - plain - 0.2).abs() < 1e-12);
        assert!(braking_distance(&limits, 2.0, 10.0) > braking_distance(&limits, 2.0, 0.0));
        assert_eq!(braking_distance(&limits, -2.0, -10.0), -braking_distance(&limits, 2.0, 10.0));
    }

    #[test]
    fn jerk_is_the_third_difference() {
        let third = |jerk: f64| Course { next: jerk * PERIOD_S.powi(3), ..moving_at(0.0, 0.0) };
        assert_eq!(check_jerk(100.0, &third(99.0)), Ok(()));
        assert_eq!(check_jerk(100.0, &third(101.0)).unwrap_err().rule, Rule::JerkLimit);
    }

    proptest! {
        #[test]
        fn whatever_is_asked_for_the_clamped_course_passes_the_guard_and_stays_inside(
            targets in prop::collection::vec(prop_oneof![-5.0f64..5.0, Just(f64::NAN), Just(1e300)], 1..400),
        ) {
            let mut sent = [0.0; 3];
            for target in targets.into_iter().flat_map(|target| [target; 5]) {
                let next = clamp(&LIMITS, &Course { sent, next: target, period_s: PERIOD_S });
                let passed = guard::check(&LIMITS, PERIOD_S, sent[1], sent[0], &next);
                prop_assert!(passed.is_ok(), "{passed:?}");
                prop_assert!(LIMITS.contain(next.position), "{next:?}");
                sent = [next.position, sent[0], sent[1]];
            }
        }
    }
}
