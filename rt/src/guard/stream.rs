//! What a set-point of a stream must keep beyond [`check`](super::check): no planner has made it, and how it goes on is not
//! known.

use super::stopping_bound::StoppingBound;
use super::{AxisLimits, TOLERANCE};
use crate::fault::Fault;
use crate::plan::State;

/// By how much a position may be off, relative to it or to 1 rad: whoever samples a trajectory adds up times and evaluates
/// polynomials, each with a rounding. The third difference divides what comes of it by the cube of the period.
const ROUNDINGS: f64 = 64.0;

/// Relative to the limits that a stop must be able to keep: half of what [`check`](super::check) allows, so that every step of
/// the stop passes it.
const BRAKING_TOLERANCE: f64 = TOLERANCE / 2.0;

/// Set-points of the last three cycles, newest first, and the one that is to follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPointSteps {
    /// Positions that were sent, newest first (rad or m).
    pub sent: [f64; 3],
    /// The position that is to follow.
    pub next: f64,
    /// From one to the next, in seconds.
    pub period_s: f64,
}

impl SetPointSteps {
    fn velocity(&self) -> f64 {
        (self.next - self.sent[0]) / self.period_s
    }

    fn last_velocity(&self) -> f64 {
        (self.sent[0] - self.sent[1]) / self.period_s
    }

    fn acceleration(&self) -> f64 {
        (self.velocity() - self.last_velocity()) / self.period_s
    }

    /// The same steps with positive and negative exchanged.
    fn mirrored(&self) -> Self {
        Self { sent: self.sent.map(|position| -position), next: -self.next, period_s: self.period_s }
    }

    /// The state at the end of the next step if the acceleration stays as it was at its beginning. The velocity of a step is
    /// that of its middle.
    fn even_end(&self) -> State {
        let acceleration = self.acceleration();
        let velocity = self.velocity() + acceleration * self.period_s / 2.0;
        State { position: self.next, velocity, acceleration }
    }

    /// The state at the end of the next step if the joint has been braked on its way towards positive positions since the
    /// acceleration was as the steps show it, which is one cycle ago: as hard as the limits allow.
    ///
    /// Of all motions within the limits of deceleration and jerk that lead through these positions none is slower in the end,
    /// and none decelerates more. And what goes on from this state within the limits has steps that keep them too, the
    /// first ones as well.
    fn braked_end(&self, limits: &AxisLimits) -> State {
        let (velocity, acceleration, period_s) = (self.velocity(), self.acceleration(), self.period_s);
        let most = limits.rising_and_falling(velocity).1.max(-acceleration);
        let braked = acceleration - limits.jerk * period_s;
        let (velocity, acceleration) = if braked > -most {
            let lost = limits.jerk * period_s * period_s / 3.0;
            (velocity + acceleration * period_s / 2.0 - lost, braked)
        } else {
            (velocity - most * period_s / 2.0, -most)
        };
        State { position: self.next, velocity, acceleration }
    }

    /// The state at the end of the next step, as the steps show it, for a stop that begins there. They leave open what the
    /// acceleration has become since the beginning of the step: it counts as unchanged, unless only a joint that has been
    /// braked since can be stopped within the limits. Whatever is planned from there goes on with these steps without a jump
    /// of the acceleration; one beyond the limit of its direction is for the planner to take back.
    pub fn state(&self, limits: &AxisLimits) -> State {
        let even = self.even_end();
        let too_far = Direction::both(self, limits).find(|direction| {
            let state = if direction.sign < 0.0 { mirrored(&even) } else { even };
            !direction.is_kept(&StoppingBound::of(&state, limits))
        });
        match too_far {
            None => even,
            Some(direction) if direction.sign < 0.0 => mirrored(&direction.steps.braked_end(limits)),
            Some(direction) => direction.steps.braked_end(limits),
        }
    }

    fn jerk(&self) -> f64 {
        let before = (self.last_velocity() - (self.sent[1] - self.sent[2]) / self.period_s) / self.period_s;
        (self.acceleration() - before) / self.period_s
    }

    /// What the rounding of positions comes to after so many divisions by the period.
    fn noise(&self, divisions: i32) -> f64 {
        let mut noise = ROUNDINGS * f64::EPSILON * (1.0 + self.next.abs());
        for _ in 0..divisions {
            noise /= self.period_s;
        }
        noise
    }
}

fn mirrored(state: &State) -> State {
    State { position: -state.position, velocity: -state.velocity, acceleration: -state.acceleration }
}

/// The steps as seen in one of the two directions, which is positive here.
struct Direction<'a> {
    steps: SetPointSteps,
    sign: f64,
    farthest: f64,
    limits: &'a AxisLimits,
}

impl<'a> Direction<'a> {
    fn both(steps: &SetPointSteps, limits: &'a AxisLimits) -> impl Iterator<Item = Self> {
        let (max, min) = (limits.position_max, limits.position_min);
        [(*steps, 1.0, max), (steps.mirrored(), -1.0, -min)]
            .into_iter()
            .map(move |(steps, sign, farthest)| Self { steps, sign, farthest, limits })
    }

    /// Returns `true` if the limits are kept to the last bit. From outside those of the position the joint may come back.
    fn is_kept(&self, bound: &StoppingBound) -> bool {
        bound.velocity <= self.limits.velocity && bound.position <= self.farthest.max(self.steps.next)
    }

    /// Checks that they can be kept, but for the tolerance.
    fn check(&self) -> Result<(), Fault> {
        let bound = StoppingBound::of(&self.steps.braked_end(self.limits), self.limits);
        let fastest = self.limits.velocity;
        if bound.velocity > fastest * (1.0 + BRAKING_TOLERANCE) + self.steps.noise(1) {
            return Err(Fault::VelocityLimit { velocity: self.sign * bound.velocity, limit: fastest });
        }
        let room = BRAKING_TOLERANCE * (self.limits.position_max - self.limits.position_min);
        if bound.position > (self.farthest + room).max(self.steps.next) + self.steps.noise(0) {
            return Err(Fault::PositionLimit {
                position: self.sign * bound.position,
                limit: self.sign * self.farthest,
            });
        }
        Ok(())
    }
}

/// Checks that a jerk limit is kept.
pub fn check_jerk(limit: f64, steps: &SetPointSteps) -> Result<(), Fault> {
    let jerk = steps.jerk();
    if jerk.abs() > limit * (1.0 + TOLERANCE) + steps.noise(3) {
        return Err(Fault::JerkLimit { jerk, limit });
    }
    Ok(())
}

/// Checks that the joint can still come to rest within its limits of position, and of velocity on the way.
///
/// What can is let pass: every motion within the limits, sampled once a period. What cannot is refused: whatever passes can
/// be stopped from [`SetPointSteps::state`] with all of its steps within the limits, but for the tolerance that every check of the
/// guard has for rounding, a millionth of the limit (of the range of positions).
pub fn check_braking(limits: &AxisLimits, steps: &SetPointSteps) -> Result<(), Fault> {
    Direction::both(steps, limits).try_for_each(|direction| direction.check())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::group_trajectory::{GroupTrajectory, ProfileStore};
    use crate::guard;
    use crate::places::Places;
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

    fn moving_at(position: f64, velocity: f64) -> SetPointSteps {
        let step = velocity * PERIOD_S;
        SetPointSteps {
            sent: [position - step, position - 2.0 * step, position - 3.0 * step],
            next: position,
            period_s: PERIOD_S,
        }
    }

    #[test]
    fn a_stream_must_leave_room_to_stop_before_the_limit() {
        // 2 rad/s at 20 rad/s² take 0.1 rad; the joint has been braked for half a step in which it has lost 0.01 rad/s.
        assert_eq!(check_braking(&LIMITS, &moving_at(1.9, 2.0)), Ok(()));
        let fault = check_braking(&LIMITS, &moving_at(1.91, 2.0)).unwrap_err();
        let Fault::PositionLimit { position, limit } = fault else { panic!("{fault:?}") };
        assert_eq!(limit, 2.0);
        assert!((position - (1.91 + 1.99 * 1.99 / 40.0)).abs() < 1e-9);
        assert_eq!(check_braking(&LIMITS, &moving_at(1.99, -2.0)), Ok(()));
        assert!(check_braking(&LIMITS, &moving_at(-0.95, -2.0)).is_err());
    }

    #[test]
    fn jerk_is_the_third_difference() {
        let third = |jerk: f64| SetPointSteps { next: jerk * PERIOD_S.powi(3), ..moving_at(0.0, 0.0) };
        assert_eq!(check_jerk(100.0, &third(99.0)), Ok(()));
        assert!(matches!(check_jerk(100.0, &third(101.0)), Err(Fault::JerkLimit { .. })));
    }

    proptest! {
        #[test]
        fn a_stop_from_wherever_a_stream_may_go_leaps_in_none_of_its_rates(
            jerks in prop::collection::vec((-1.0f64..=1.0, 1usize..200), 1..40),
            (acceleration, deceleration) in prop::sample::select(&[(10.0, 20.0), (20.0, 10.0)][..]),
        ) {
            let limits = AxisLimits { jerk: 150.0, acceleration, deceleration, ..LIMITS };
            let mut sent = [0.0; 3];
            for (jerk, times) in jerks {
                for _ in 0..times {
                    let next = 3.0 * (sent[0] - sent[1]) + sent[2] + jerk * limits.jerk * PERIOD_S.powi(3);
                    let steps = SetPointSteps { sent, next, period_s: PERIOD_S };
                    let state = State { position: next, ..State::default() };
                    let is_passed = guard::check(&limits, PERIOD_S, sent[1], sent[0], &state)
                        .and_then(|()| check_jerk(limits.jerk, &steps))
                        .and_then(|()| check_braking(&limits, &steps));
                    if is_passed.is_ok() {
                        sent = [next, sent[0], sent[1]];
                    }
                }
            }
            let last = SetPointSteps { sent: [sent[1], sent[2], sent[2]], next: sent[0], period_s: PERIOD_S };
            let (mut profiles, mut motion) = (ProfileStore::<4>::default(), GroupTrajectory::new(Places { first: 0, end: 1 }));
            motion.stop(&mut profiles, [(last.state(&limits), &limits)].into_iter()).unwrap();
            while !motion.is_finished() {
                motion.advance(PERIOD_S);
                let next = motion.states(&profiles).next().unwrap();
                let passed = guard::check(&limits, PERIOD_S, sent[1], sent[0], &next)
                    .and_then(|()| check_jerk(limits.jerk, &SetPointSteps { sent, next: next.position, period_s: PERIOD_S }));
                prop_assert!(passed.is_ok(), "{passed:?} from {sent:?} to {next:?}");
                sent = [next.position, sent[0], sent[1]];
            }
        }
    }
}
