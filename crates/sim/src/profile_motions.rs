//! The motions of an eRob by the vendor's own protocols (eRunner manual 7.4.1 to 7.4.3, and 4.2; Modbus-RTU manual 5.1 to 5.4), as a
//! demand for the loops of position control: counts and seconds.

use takt_rt::Nanoseconds;

use super::motion::{Actual, Generator};

/// What shapes the motions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionProfile {
    /// counts/s; its sign is the direction of a continuous motion
    pub velocity: f64,
    /// counts/s²
    pub acceleration: f64,
    /// counts/s²
    pub deceleration: f64,
    /// counts/s², at a position limit
    pub quick_stop: f64,
    /// How long a reciprocating motion rests at each reversal.
    pub dwell_ns: Nanoseconds,
    /// The position limits: counts. They are none if the first one is not less than the second one.
    pub positions: (f64, f64),
}

/// What the joint is led through.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Course {
    /// Nothing: it rests where the demand is.
    Rest(Rest),
    /// To a position.
    To { target: f64 },
    /// To and fro between two positions, with a dwell at each reversal.
    Reciprocating { target: f64, other: f64, dwell_until_ns: Nanoseconds },
    /// At the profile velocity without end.
    Continuous,
    /// To the next end of a reciprocating motion, and no further.
    LastLeg { target: f64 },
    /// To rest.
    Stopping { deceleration: f64, was_reciprocating: bool },
}

/// Why the demand is at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rest {
    /// It was stopped, or has not begun.
    Stopped,
    /// It is at its target.
    AtTarget,
    /// A reciprocating motion has come to its last end.
    AfterReciprocation,
}

/// The demand of position control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    course: Course,
    demand: Generator,
}

impl Motion {
    /// At rest at a position.
    pub fn resting_at(position: f64) -> Self {
        let demand = Generator::starting(Actual { position, velocity: 0.0 });
        Self { course: Course::Rest(Rest::Stopped), demand }
    }

    /// The demanded position.
    pub const fn position(&self) -> f64 {
        self.demand.position
    }

    /// The demanded velocity.
    pub const fn velocity(&self) -> f64 {
        self.demand.velocity
    }

    /// Returns `true` if it is not at rest.
    pub const fn is_moving(&self) -> bool {
        !matches!(self.course, Course::Rest(_))
    }

    /// Returns `true` if it rests at a target, and not where it was stopped.
    pub const fn is_target_reached(&self) -> bool {
        matches!(self.course, Course::Rest(Rest::AtTarget))
    }

    /// Returns `true` if a reciprocating motion is coming to rest.
    pub const fn is_stopping_reciprocation(&self) -> bool {
        matches!(self.course, Course::Stopping { was_reciprocating: true, .. })
    }

    /// Returns `true` if it rests because a reciprocating motion was ended.
    pub const fn has_ended_reciprocation(&self) -> bool {
        matches!(self.course, Course::Rest(Rest::AfterReciprocation))
    }

    /// Begins to move to a position.
    pub fn move_to(&mut self, target: f64) {
        self.course = Course::To { target };
    }

    /// Begins to move to a position, back to where it is, and so on.
    pub fn reciprocate_to(&mut self, target: f64) {
        self.course = Course::Reciprocating { target, other: self.demand.position, dwell_until_ns: 0 };
    }

    /// Begins to move without end.
    pub fn run(&mut self) {
        self.course = Course::Continuous;
    }

    /// Ends a reciprocating motion at its next end.
    pub fn end_reciprocation(&mut self) {
        if let Course::Reciprocating { target, other, .. } = self.course {
            // It rests at the end that it has come from.
            let is_at_end = self.demand.velocity == 0.0 && self.demand.position == other;
            self.course =
                if is_at_end { Course::Rest(Rest::AfterReciprocation) } else { Course::LastLeg { target } };
        }
    }

    /// Begins to stop with a deceleration: counts/s².
    pub fn stop_with(&mut self, deceleration: f64) {
        if self.is_moving() {
            let was_reciprocating = matches!(self.course, Course::Reciprocating { .. });
            self.course = Course::Stopping { deceleration, was_reciprocating };
        }
    }

    /// Goes on for a step.
    pub fn step(&mut self, now_ns: Nanoseconds, profile: &MotionProfile, duration_s: f64) {
        let MotionProfile { velocity, acceleration: faster, deceleration: slower, dwell_ns, .. } = *profile;
        match self.course {
            Course::Rest(_) => {}
            Course::To { target } => {
                if self.demand.step_profile(target, velocity.abs(), faster, slower, duration_s) {
                    self.course = Course::Rest(Rest::AtTarget);
                }
            }
            Course::Reciprocating { dwell_until_ns, .. } if now_ns < dwell_until_ns => {}
            Course::Reciprocating { target, other, .. } => {
                if self.demand.step_profile(target, velocity.abs(), faster, slower, duration_s) {
                    let dwell_until_ns = now_ns.saturating_add(dwell_ns);
                    self.course = Course::Reciprocating { target: other, other: target, dwell_until_ns };
                }
            }
            Course::LastLeg { target } => {
                if self.demand.step_profile(target, velocity.abs(), faster, slower, duration_s) {
                    self.course = Course::Rest(Rest::AfterReciprocation);
                }
            }
            Course::Continuous => self.demand.ramp_between(velocity, faster, slower, duration_s),
            Course::Stopping { deceleration, .. } => {
                self.demand.ramp(0.0, deceleration, duration_s);
                if self.demand.velocity == 0.0 {
                    self.course = Course::Rest(Rest::Stopped);
                }
            }
        }
        self.keep_position_limits(profile);
    }

    /// At a position limit it stops with the quick-stop deceleration; the demand never leaves the limits.
    fn keep_position_limits(&mut self, profile: &MotionProfile) {
        let (lowest, highest) = profile.positions;
        if lowest >= highest {
            return;
        }
        let Generator { position, velocity, .. } = self.demand;
        if position > highest && velocity > 0.0 || position < lowest && velocity < 0.0 {
            self.demand.follow(Actual { position: position.clamp(lowest, highest), velocity: 0.0 });
            self.stop_with(profile.quick_stop.max(1.0));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const STEP_S: f64 = 250e-6;

    fn profile(velocity: i32, rate: i32) -> MotionProfile {
        MotionProfile {
            velocity: velocity.into(),
            acceleration: rate.into(),
            deceleration: rate.into(),
            quick_stop: 1e6,
            dwell_ns: 0,
            positions: (0.0, 0.0),
        }
    }

    proptest! {
        #[test]
        fn a_target_is_reached_exactly_and_within_the_profile(
            target in -200_000i32..200_000,
            velocity in 100i32..200_000,
            rate in 1_000i32..2_000_000,
        ) {
            let profile = profile(velocity, rate);
            let mut motion = Motion::resting_at(0.0);
            motion.move_to(target.into());
            let ideal_s = f64::from(target.abs()) / f64::from(velocity) + f64::from(velocity) / f64::from(rate)
                + 2.0 * (f64::from(target.abs()) / f64::from(rate)).sqrt();
            let (mut last, mut steps) = (0.0, 0.0);
            while motion.is_moving() {
                motion.step(0, &profile, STEP_S);
                let change = (motion.velocity() - last).abs() / STEP_S;
                prop_assert!(motion.velocity().abs() <= f64::from(velocity) + 1e-6);
                // The last step ends exactly at the target, with up to twice the rate.
                let most = if motion.is_moving() { 1.001 } else { 3.0 };
                prop_assert!(change <= most * f64::from(rate), "{change}");
                (last, steps) = (motion.velocity(), steps + 1.0);
                prop_assert!(steps * STEP_S <= ideal_s + 0.1, "{ideal_s}");
            }
            prop_assert_eq!(motion.position(), f64::from(target));
            prop_assert!(motion.is_target_reached());
        }
    }

    #[test]
    fn a_reciprocating_motion_turns_at_both_ends_after_its_dwell_and_ends_with_stop() {
        let profile = MotionProfile { dwell_ns: 100_000_000, ..profile(100_000, 1_000_000) };
        let mut motion = Motion::resting_at(50.0);
        motion.reciprocate_to(10_050.0);
        let (mut ends, mut now_ns) = (vec![], 0);
        for _ in 0..8_000 {
            let before = motion.position();
            motion.step(now_ns, &profile, STEP_S);
            now_ns += 250_000;
            if motion.velocity() == 0.0 && motion.position() != before {
                ends.push((now_ns, motion.position()));
            }
        }
        assert!(ends.len() > 4);
        assert!(ends.iter().enumerate().all(|(end, (_, at))| *at == [10_050.0, 50.0][end % 2]));
        assert!(
            ends.windows(2).all(|pair| pair[1].0 - pair[0].0 > 295_000_000),
            "0.2 s of motion and the dwell"
        );
        motion.stop_with(profile.deceleration);
        (0..1_000).for_each(|_| motion.step(now_ns, &profile, STEP_S));
        assert!(!motion.is_moving() && !motion.is_target_reached());
    }

    #[test]
    fn a_continuous_motion_follows_a_new_velocity_and_stops_at_a_position_limit() {
        let mut profile = MotionProfile { positions: (-1e9, 3_000.0), ..profile(1_000, 10_000) };
        let mut motion = Motion::resting_at(0.0);
        motion.run();
        (0..4_000).for_each(|_| motion.step(0, &profile, STEP_S));
        assert_eq!(motion.velocity(), 1_000.0);
        profile.velocity = 2_000.0;
        (0..800).for_each(|_| motion.step(0, &profile, STEP_S));
        assert_eq!(motion.velocity(), 2_000.0);
        (0..8_000).for_each(|_| motion.step(0, &profile, STEP_S));
        assert_eq!((motion.position(), motion.is_moving()), (3_000.0, false));
    }

    #[test]
    fn a_reciprocating_motion_that_is_ended_goes_on_to_its_next_end() {
        let profile = profile(100_000, 1_000_000);
        for steps in [100, 500, 900] {
            let mut motion = Motion::resting_at(0.0);
            motion.reciprocate_to(10_000.0);
            (0..steps).for_each(|_| motion.step(0, &profile, STEP_S));
            let is_going_back = motion.velocity() < 0.0;
            motion.end_reciprocation();
            assert!(motion.is_moving());
            (0..4_000).for_each(|_| motion.step(0, &profile, STEP_S));
            assert!(motion.has_ended_reciprocation() && !motion.is_target_reached());
            assert_eq!(motion.position(), if is_going_back { 0.0 } else { 10_000.0 });
        }
    }
}
