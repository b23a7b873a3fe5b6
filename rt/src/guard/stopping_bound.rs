//! How fast and how far a joint goes on at least, however hard it is stopped.

use super::AxisLimits;
use crate::plan::State;

/// What a joint reaches at least towards positive positions if it is stopped from now on, as fast as the limits allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StoppingBound {
    /// The velocity, with its sign, once an acceleration in this direction has been taken back.
    pub velocity: f64,
    /// The position.
    pub position: f64,
}

impl StoppingBound {
    pub(super) fn of(state: &State, limits: &AxisLimits) -> Self {
        let State { position, velocity, acceleration } = *state;
        let along = acceleration.max(0.0);
        // Without a limit of the jerk that takes no time.
        let gain = if limits.jerk.is_finite() { along * along / (2.0 * limits.jerk) } else { 0.0 };
        Self {
            velocity: velocity + gain,
            position: position + braking_distance(limits, velocity, acceleration),
        }
    }
}

/// How far a joint goes on at least towards positive positions, however hard it is stopped at the limits; 0 if it does not.
/// Acceleration in that direction must first be taken back, which speeds the joint up still, or turns it round.
///
/// The shortest stop still decelerates when the joint stands still, and swings back: by so much that the velocity limit is
/// kept on the way back. It is the one that [`stop`](crate::plan::stop) makes where a position limit asks for it.
pub fn braking_distance(limits: &AxisLimits, velocity: f64, acceleration: f64) -> f64 {
    let (jerk, (_, deceleration)) = (limits.jerk, limits.rising_and_falling(velocity));
    if velocity <= 0.0 && (acceleration <= 0.0 || jerk.is_infinite()) {
        return 0.0;
    }
    if jerk.is_infinite() {
        return velocity * velocity / (2.0 * deceleration);
    }
    // The planner takes back what is beyond the limit.
    let acceleration = acceleration.max(-deceleration);
    // The stop is part of one that begins without acceleration: later than now, or before.
    let apart_s = acceleration / jerk;
    let fastest = velocity + acceleration * apart_s / 2.0;
    if fastest <= 0.0 {
        return 0.0;
    }
    let apart = velocity * apart_s + acceleration * apart_s * apart_s / 3.0;
    (apart + shortest_stop(limits, deceleration, fastest)).max(0.0)
}

/// From this velocity, without acceleration, to the standstill.
fn shortest_stop(limits: &AxisLimits, deceleration: f64, velocity: f64) -> f64 {
    let jerk = limits.jerk;
    // At the standstill; the swing back is as fast as the same deceleration takes back.
    let last = libm::sqrt(2.0 * jerk * limits.velocity).min(deceleration);
    if velocity * jerk <= last * last / 2.0 {
        // The deceleration builds up to the end.
        return 2.0 / 3.0 * velocity * libm::sqrt(2.0 * velocity / jerk);
    }
    let most = libm::sqrt(jerk * velocity + last * last / 2.0).min(deceleration);
    let (building_up_s, taking_back_s) = (most / jerk, (most - last) / jerk);
    let building_up = building_up_s * (velocity - most * building_up_s / 6.0);
    let (from, to) = (velocity - most * building_up_s / 2.0, (last + most) * taking_back_s / 2.0);
    let constant = (from * from - to * to).max(0.0) / (2.0 * most);
    let taking_back = taking_back_s * taking_back_s * (last / 2.0 + (most - last) / 6.0);
    building_up + constant + taking_back
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{self, Limits, Profile};
    use proptest::prelude::*;

    const LIMITS: AxisLimits = AxisLimits {
        position_min: -1.0,
        position_max: 2.0,
        velocity: 3.0,
        acceleration: 10.0,
        deceleration: 20.0,
        jerk: 100.0,
        torque: 50.0,
    };

    #[test]
    fn a_limited_jerk_makes_the_way_to_rest_longer() {
        let plain = braking_distance(&AxisLimits { jerk: f64::INFINITY, ..LIMITS }, 2.0, 0.0);
        assert_eq!(plain, 0.1);
        // All of 2 rad/s is gone when the deceleration has built up to 20 rad/s² in 0.2 s.
        assert!((braking_distance(&LIMITS, 2.0, 0.0) - 0.8 / 3.0).abs() < 1e-12);
        assert!(braking_distance(&LIMITS, 2.0, 10.0) > braking_distance(&LIMITS, 2.0, 0.0));
        assert!(braking_distance(&LIMITS, 2.0, -10.0) < braking_distance(&LIMITS, 2.0, 0.0));
        assert_eq!(braking_distance(&LIMITS, -2.0, 0.0), 0.0);
        // The acceleration turns the joint round while it is taken back within 0.3 s: -0.6 + 0.9 rad, at 2.5 rad/s in the end.
        // The velocity falls no faster than that of a joint that goes the way from which it has come.
        let stop = braking_distance(&AxisLimits { deceleration: 10.0, ..LIMITS }, 2.5, 0.0);
        assert!((braking_distance(&LIMITS, -2.0, 30.0) - 0.3 - stop).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn a_stop_of_the_planner_leads_no_further_than_it_must(
            velocity in -2.9f64..2.9,
            share in -1.0f64..1.0,
            jerk in prop_oneof![20.0f64..200.0, 200.0f64..5000.0, Just(f64::INFINITY)],
            highest in (2.0f64..30.0, 2.0f64..30.0),
        ) {
            let limits =
                AxisLimits { jerk, acceleration: highest.0, deceleration: highest.1, velocity: 3.0, ..LIMITS };
            let (rising, falling) = limits.rising_and_falling(velocity);
            // As much as the velocity limit leaves room for.
            let room = libm::sqrt(2.0 * jerk.min(1e6) * (3.0 - velocity * share.signum()));
            let along = room.min(if share > 0.0 { rising } else { falling });
            let acceleration = share * along;
            let distance = braking_distance(&limits, velocity, acceleration);
            let start = State { position: 0.0, velocity, acceleration };
            let within = |room: f64| {
                let planned = Limits::asymmetric(3.0, -3.0, rising, -falling, jerk)
                    .with_position(-1e3, room);
                let mut profile = [Profile::hold(0.0)];
                plan::stop(&[start], &[planned], &mut profile).unwrap();
                profile[0].extrema()
            };
            let room = 1e-9 * (1.0 + distance);
            let kept = within(distance + room);
            prop_assert!(kept.position.max <= distance + 2.0 * room, "{} > {distance}", kept.position.max);
            prop_assert!(kept.velocity.min >= -3.0 - 1e-6 && kept.velocity.max <= 3.0 + 1e-6, "{:?}", kept.velocity);
            if distance > 1e-6 {
                // Less room is not kept, or only at the cost of the velocity on the way back.
                let kept = within(distance * (1.0 - 1e-6));
                prop_assert!(
                    kept.position.max > distance * (1.0 - 1e-6) || kept.velocity.min < -3.0,
                    "{} of {distance}", kept.position.max
                );
            }
        }
    }
}
