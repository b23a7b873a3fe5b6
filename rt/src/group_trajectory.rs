//! The motion of the whole group: one trajectory for every axis, with one time.

use arrayvec::ArrayVec;

use crate::guard::AxisLimits;
use crate::places::Places;
use crate::plan::{self, Limits, PlanError, PlanOptions, Problem, Profile, Return, State, Synchronisation};

/// A joint that must not turn round keeps this share of its velocity, so that no rounding turns it.
const KEPT_VELOCITY: f64 = 1e-3;

/// The planned motions of the axes of every group.
///
/// There is room for two of each axis: the next one is planned beside the present one and takes its place only when that of
/// the whole group is there, without being copied.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct ProfileStore<const AXES: usize> {
    first: [Profile; AXES],
    second: [Profile; AXES],
}

impl<const AXES: usize> Default for ProfileStore<AXES> {
    fn default() -> Self {
        let hold = [Profile::hold(0.0); AXES];
        Self { first: hold, second: hold }
    }
}

/// The trajectory that a group is on: the time on the motions of its axes, which are in a [`ProfileStore`].
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct GroupTrajectory {
    /// Where the axes of the group stand in the store, beside each other.
    places: Places,
    is_second_present: bool,
    duration_s: f64,
    time_s: f64,
}

/// What a move is made of, an axis each.
#[derive(Clone, Copy, Debug)]
pub struct Leg<'a> {
    /// From where.
    pub start: State,
    /// To where.
    pub target: State,
    /// Within what.
    pub limits: &'a AxisLimits,
}

impl<'a> Leg<'a> {
    /// One that stays where it is.
    pub fn standing(position: f64, limits: &'a AxisLimits) -> Self {
        let rest = State { position, ..State::default() };
        Self { start: rest, target: rest, limits }
    }
}

impl GroupTrajectory {
    /// None yet, of a group whose axes stand here among those of the store.
    pub const fn new(places: Places) -> Self {
        Self { places, is_second_present: false, duration_s: 0.0, time_s: 0.0 }
    }

    /// Plans a coordinated move within fractions of the limits: on a straight line from rest to rest, and otherwise where
    /// that takes no longer. On error the present motion goes on.
    pub fn move_to<'a, const AXES: usize>(
        &mut self,
        profiles: &mut ProfileStore<AXES>,
        legs: impl Iterator<Item = Leg<'a>>,
        velocity_scale: f64,
        acceleration_scale: f64,
        minimum_duration_s: f64,
    ) -> Result<(), PlanError> {
        let mut problems: ArrayVec<Problem, AXES> = ArrayVec::new();
        problems.extend(legs.take(AXES).map(|leg| Problem {
            start: leg.start,
            target: leg.target,
            limits: move_limits(&leg, velocity_scale, acceleration_scale),
        }));
        let is_at_rest = |state: &State| state.velocity == 0.0 && state.acceleration == 0.0;
        let is_from_rest_to_rest =
            problems.iter().all(|problem| is_at_rest(&problem.start) && is_at_rest(&problem.target));
        let synchronisation =
            if is_from_rest_to_rest { Synchronisation::Straight } else { Synchronisation::Phase };
        // Where a limit has just been lowered, slow down to it and no further.
        let return_to_limits = Return::Settled;
        let timing =
            PlanOptions { synchronisation, minimum_duration_s, return_to_limits, ..PlanOptions::default() };
        let duration_s = plan::synchronised(&problems, self.free(profiles), timing)?;
        self.begin(duration_s);
        Ok(())
    }

    /// Plans the fastest coordinated stop. On error the present motion goes on.
    pub fn stop<'a, const AXES: usize>(
        &mut self,
        profiles: &mut ProfileStore<AXES>,
        axes: impl Iterator<Item = (State, &'a AxisLimits)>,
    ) -> Result<(), PlanError> {
        let mut starts: ArrayVec<State, AXES> = ArrayVec::new();
        let mut limits: ArrayVec<Limits, AXES> = ArrayVec::new();
        for (start, axis) in axes.take(AXES) {
            starts.push(start);
            limits.push(stop_limits(&start, axis));
        }
        let duration_s = plan::stop(&starts, &limits, self.free(profiles))?;
        self.begin(duration_s);
        Ok(())
    }

    /// Where the next trajectory is planned.
    fn free<'a, const AXES: usize>(&self, profiles: &'a mut ProfileStore<AXES>) -> &'a mut [Profile] {
        let free = if self.is_second_present { &mut profiles.first } else { &mut profiles.second };
        free.get_mut(self.places.range()).unwrap_or_default()
    }

    /// The trajectory that was planned last becomes the present one.
    fn begin(&mut self, duration_s: f64) {
        self.is_second_present = !self.is_second_present;
        self.duration_s = duration_s;
        self.time_s = 0.0;
    }

    /// Gives the present trajectory up: there is nothing left to follow.
    pub fn cancel(&mut self) {
        self.time_s = self.duration_s;
    }

    /// Goes on by one period.
    pub fn advance(&mut self, period_s: f64) {
        self.time_s += period_s;
    }

    /// Where the axes are to be now, in their order. Targets that are passed at speed are passed between two cycles: in the
    /// one after it the axes have gone on at that speed.
    pub fn states<const AXES: usize>(&self, profiles: &ProfileStore<AXES>) -> impl Iterator<Item = State> {
        let (time_s, since_end_s) = (self.time_s, self.time_s - self.duration_s);
        let present = if self.is_second_present { &profiles.second } else { &profiles.first };
        present.get(self.places.range()).unwrap_or_default().iter().map(move |profile| {
            // By the end of all, so that none is a rounding short of its own.
            let time_s = if since_end_s < 0.0 { time_s } else { profile.duration_s() + since_end_s };
            profile.sample(time_s)
        })
    }

    /// Returns `true` if the end has been reached.
    pub fn is_finished(&self) -> bool {
        self.time_s >= self.duration_s
    }

    /// Time since the end, in seconds; 0 before it.
    pub fn overrun_s(&self) -> f64 {
        (self.time_s - self.duration_s).max(0.0)
    }

    /// Time left, in seconds.
    pub fn remaining_s(&self) -> f64 {
        (self.duration_s - self.time_s).max(0.0)
    }
}

/// Speeding up and slowing down have limits of their own, the planner's have signs. From rest the direction of
/// the way tells which is which; in motion the smaller one holds for both.
fn move_limits(leg: &Leg<'_>, velocity_scale: f64, acceleration_scale: f64) -> Limits {
    let axis = leg.limits;
    let (acceleration, deceleration) =
        (axis.acceleration * acceleration_scale, axis.deceleration * acceleration_scale);
    let (rising, falling) = if leg.start.velocity != 0.0 || leg.target.velocity != 0.0 {
        (acceleration.min(deceleration), acceleration.min(deceleration))
    } else if leg.target.position >= leg.start.position {
        (acceleration, deceleration)
    } else {
        (deceleration, acceleration)
    };
    let velocity = axis.velocity * velocity_scale;
    // Who stands outside the position limits may move, as long as the way leads back.
    let lowest = axis.position_min.min(leg.start.position);
    let highest = axis.position_max.max(leg.start.position);
    Limits::asymmetric(velocity, -velocity, rising, -falling, move_jerk(leg, acceleration_scale))
        .with_position(lowest, highest)
}

/// A fraction of the jerk limit, or more where the present acceleration would lead too far before so little had taken it back:
/// beyond the velocity limit, or out again where the joint comes back from beyond a position limit.
fn move_jerk(leg: &Leg<'_>, acceleration_scale: f64) -> f64 {
    let (axis, State { position, velocity, acceleration }) = (leg.limits, leg.start);
    let wanted = axis.jerk * acceleration_scale;
    // In the direction of the acceleration, whether the joint moves there already or is about to turn round.
    let along = velocity * acceleration.signum();
    let is_leading_out = position < axis.position_min && acceleration < 0.0
        || position > axis.position_max && acceleration > 0.0;
    let highest = if is_leading_out { -KEPT_VELOCITY * velocity.abs() } else { axis.velocity };
    let room = (highest - along).max(0.0);
    let gain = acceleration * acceleration / 2.0;
    if gain > room * wanted { axis.jerk.min(gain / room) } else { wanted }
}

/// A stop in coordination must not lead an axis that could stop sooner by itself beyond its position limits.
pub(crate) fn stop_limits(start: &State, axis: &AxisLimits) -> Limits {
    let (rising, falling) = axis.rising_and_falling(start.velocity);
    Limits::asymmetric(axis.velocity, -axis.velocity, rising, -falling, axis.jerk)
        .with_position(axis.position_min.min(start.position), axis.position_max.max(start.position))
}

/// The fastest stop of one axis within its limits.
///
/// # Errors
/// As [`plan::stop`].
pub(crate) fn fastest_stop(start: &State, axis: &AxisLimits) -> Result<Profile, PlanError> {
    let mut profile = Profile::hold(0.0);
    plan::stop(&[*start], &[stop_limits(start, axis)], core::slice::from_mut(&mut profile))?;
    Ok(profile)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: AxisLimits = AxisLimits {
        position_min: -3.0,
        position_max: 3.0,
        velocity: 2.0,
        acceleration: 8.0,
        deceleration: 8.0,
        jerk: 100.0,
        torque: 50.0,
    };

    #[test]
    fn a_move_that_is_to_be_gentle_leads_back_from_beyond_a_position_limit_without_turning_round() {
        // It slows down there already, so that it would turn round before so little jerk had taken the deceleration back.
        for (side, acceleration_scale) in [(-1.0, 0.1), (1.0, 0.1), (-1.0, 0.8), (1.0, 0.8)] {
            let start = State { position: side * 3.01, velocity: -0.1 * side, acceleration: 4.2 * side };
            let leg = Leg { start, target: State::rest(2.9 * side), limits: &LIMITS };
            let (mut profiles, mut motion) =
                (ProfileStore::<2>::default(), GroupTrajectory::new(Places { first: 0, end: 1 }));
            motion.move_to(&mut profiles, [leg].into_iter(), 1.0, acceleration_scale, 0.0).unwrap();
            let mut last = start.position;
            while !motion.is_finished() {
                motion.advance(0.001);
                let position = motion.states(&profiles).next().unwrap().position;
                assert!(
                    position.abs() <= 3.0 || (last - position) * side >= 0.0,
                    "from {last} to {position}"
                );
                last = position;
            }
            assert!((last - 2.9 * side).abs() < 1e-9);
        }
    }

    #[test]
    fn a_move_that_is_to_be_gentle_takes_a_high_acceleration_back_before_the_velocity_limit() {
        // The second one moves the other way, and is about to turn round.
        for (velocity, acceleration) in [(1.9, 4.0), (-0.1, 8.0)] {
            let start = State { position: -2.5, velocity, acceleration };
            let target = State { position: 2.5, ..State::default() };
            let (mut profiles, mut motion) =
                (ProfileStore::<2>::default(), GroupTrajectory::new(Places { first: 0, end: 1 }));
            motion
                .move_to(&mut profiles, [Leg { start, target, limits: &LIMITS }].into_iter(), 1.0, 0.1, 0.0)
                .unwrap();
            while !motion.is_finished() {
                motion.advance(0.001);
                let velocity = motion.states(&profiles).next().unwrap().velocity;
                assert!(velocity <= LIMITS.velocity * (1.0 + 1e-9), "{velocity}");
            }
        }
    }

    #[test]
    fn an_axis_that_can_stop_before_its_position_limit_is_not_led_beyond_it_by_a_slower_one() {
        let at = |position: f64, velocity: f64| State { position, velocity, acceleration: 0.0 };
        let slow = AxisLimits { deceleration: 1.0, ..LIMITS };
        for jerk in [100.0, f64::INFINITY] {
            let (quick, slow) = (AxisLimits { jerk, ..LIMITS }, AxisLimits { jerk, ..slow });
            let (mut profiles, mut motion) =
                (ProfileStore::<2>::default(), GroupTrajectory::new(Places { first: 0, end: 2 }));
            // 0.5 rad/s at 8 rad/s² take less than 0.06 rad; in the 2 s of the other axis they would take 0.5 rad.
            motion.stop(&mut profiles, [(at(2.9, 0.5), &quick), (at(0.0, 2.0), &slow)].into_iter()).unwrap();
            let mut farthest: f64 = 2.9;
            while !motion.is_finished() {
                motion.advance(0.001);
                farthest = farthest.max(motion.states(&profiles).next().unwrap().position);
            }
            assert!(farthest > 2.9 && farthest <= 3.0, "{farthest} with jerk {jerk}");
        }
    }

    #[test]
    fn a_target_that_is_passed_at_speed_is_passed_without_a_step() {
        for jerk in [100.0, f64::INFINITY] {
            let limits = AxisLimits { jerk, ..LIMITS };
            let start = State::default();
            let target = State { position: 0.333, velocity: 1.1, acceleration: 0.0 };
            let (mut profiles, mut motion) =
                (ProfileStore::<2>::default(), GroupTrajectory::new(Places { first: 0, end: 1 }));
            motion
                .move_to(&mut profiles, [Leg { start, target, limits: &limits }].into_iter(), 0.7, 0.7, 0.0)
                .unwrap();
            let (mut last, mut before) = (start, start);
            while !motion.is_finished() {
                motion.advance(0.001);
                let next = motion.states(&profiles).next().unwrap();
                let acceleration = (next.position - 2.0 * last.position + before.position) / 1e-6;
                assert!(acceleration.abs() <= limits.acceleration, "{acceleration} with jerk {jerk}");
                (last, before) = (next, last);
            }
            assert!(last.position >= target.position && last.velocity == target.velocity);
        }
    }
}
