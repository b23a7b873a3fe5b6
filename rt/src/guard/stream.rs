//! What a set-point of a stream must keep beyond [`check`](super::check): no planner has made it, and how it goes on is not
//! known.

use super::stopping_bound::StoppingBound;
use super::{AxisLimits, TOLERANCE};
use crate::fault::Fault;
use crate::plan::State;

/// By how much a position may be off, relative to it or to 1 rad: whoever samples a trajectory adds up times and evaluates
/// polynomials, each with a rounding. The third difference divides what comes of it by the cube of the period.
pub(super) const ROUNDINGS: f64 = 64.0;

/// Relative to the limits that a stop must be able to keep: half of what [`check`](super::check) allows, so that every step of
/// the stop passes it.
pub(super) const BRAKING_TOLERANCE: f64 = TOLERANCE / 2.0;

/// What is done with a command of a stream that breaks a limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnViolation {
    /// The group stops.
    #[default]
    Reject,
    /// A set-point within the limits, on the way to the command, takes its place and is counted.
    Clamp,
}

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

pub(super) fn mirrored(state: &State) -> State {
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

    /// Whether the limits are kept to the last bit. From outside those of the position the joint may come back.
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

/// The set-point nearest to the one asked for that keeps the limits of velocity and acceleration, and from which a stop
/// at all limits, that of the jerk too, stays within those of the position. A target that is no number counts as the
/// wish to stop.
pub fn clamp(limits: &AxisLimits, steps: &SetPointSteps) -> State {
    let (period_s, last, last_velocity) = (steps.period_s, steps.sent[0], steps.last_velocity());
    let wanted = if steps.next.is_finite() { steps.velocity() } else { 0.0 };
    let speeding_up = limits.acceleration * period_s;
    let slowing_down = limits.deceleration * period_s;
    let (lowest, highest) = match last_velocity > 0.0 {
        true => ((last_velocity - slowing_down).max(-speeding_up), last_velocity + speeding_up),
        false => (last_velocity - speeding_up, (last_velocity + slowing_down).min(speeding_up)),
    };
    let at = |velocity: f64| SetPointSteps { next: last + velocity * period_s, ..*steps };
    let is_within = |steps: SetPointSteps, farthest: f64| {
        let bound = StoppingBound::of(&steps.braked_end(limits), limits);
        bound.position <= farthest && bound.velocity <= limits.velocity
    };
    let is_low_enough = |velocity: f64| is_within(at(velocity), limits.position_max);
    let is_high_enough = |velocity: f64| is_within(at(velocity).mirrored(), -limits.position_min);
    let within = wanted.clamp(-limits.velocity, limits.velocity).max(lowest).min(highest);
    // The limit that the joint goes towards has the last word.
    let velocity = match last_velocity > 0.0 {
        true => nearest(nearest(within, highest, is_high_enough), lowest, is_low_enough),
        false => nearest(nearest(within, lowest, is_low_enough), highest, is_high_enough),
    };
    State {
        position: last + velocity * period_s,
        velocity,
        acceleration: (velocity - last_velocity) / period_s,
    }
}

/// Halvings of an interval until what is left of it is rounding.
const HALVINGS: u32 = 48;

/// The value nearest to `wanted`, on the way to `end`, that is possible; `end` if none before it is.
fn nearest(wanted: f64, end: f64, is_possible: impl Fn(f64) -> bool) -> f64 {
    if is_possible(wanted) {
        return wanted;
    }
    let (mut impossible, mut possible) = (wanted, end);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (impossible + possible);
        if is_possible(middle) { possible = middle } else { impossible = middle }
    }
    possible
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::group_trajectory::{GroupTrajectory, ProfileStore};
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
        fn whatever_is_asked_for_the_clamped_course_passes_the_guard_and_stays_inside(
            targets in prop::collection::vec(prop_oneof![-5.0f64..5.0, Just(f64::NAN), Just(1e300)], 1..400),
        ) {
            let mut sent = [0.0; 3];
            for target in targets.into_iter().flat_map(|target| [target; 5]) {
                let next = clamp(&LIMITS, &SetPointSteps { sent, next: target, period_s: PERIOD_S });
                let passed = guard::check(&LIMITS, PERIOD_S, sent[1], sent[0], &next);
                prop_assert!(passed.is_ok(), "{passed:?}");
                prop_assert!(LIMITS.contain(next.position), "{next:?}");
                sent = [next.position, sent[0], sent[1]];
            }
        }

        #[test]
        fn a_clamped_course_can_be_stopped_at_the_limit_of_the_jerk_within_those_of_the_position(
            targets in prop::collection::vec((-5.0f64..5.0, 1usize..60), 1..40),
        ) {
            let limits = AxisLimits { jerk: 150.0, ..LIMITS };
            let mut sent = [0.0; 3];
            for target in targets.into_iter().flat_map(|(target, times)| core::iter::repeat_n(target, times)) {
                let steps = SetPointSteps { sent, next: target, period_s: PERIOD_S };
                let next = clamp(&limits, &steps);
                prop_assert!(guard::check(&limits, PERIOD_S, sent[1], sent[0], &next).is_ok());
                sent = [next.position, sent[0], sent[1]];
            }
            let last = SetPointSteps { sent: [sent[1], sent[2], sent[2]], next: sent[0], period_s: PERIOD_S };
            let (mut store, mut motion) = (ProfileStore::<4>::default(), GroupTrajectory::default());
            let mut profiles = store.of(0..1).unwrap();
            motion.stop(&mut profiles, [(last.state(&limits), &limits)].into_iter()).unwrap();
            while !motion.is_finished() {
                motion.advance(PERIOD_S);
                let position = motion.states(&profiles).next().unwrap().position;
                prop_assert!((-1.000_001..=2.000_001).contains(&position), "{position}");
            }
        }

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
            let (mut store, mut motion) = (ProfileStore::<4>::default(), GroupTrajectory::default());
            let mut profiles = store.of(0..1).unwrap();
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
