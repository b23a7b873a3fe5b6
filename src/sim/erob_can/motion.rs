//! The motions of position control (eRunner manual 7.4.1 to 7.4.3, and 4.2), as a demand for the loops: counts and seconds.

use takt_rt::Nanoseconds;

use super::settings::{
    ACCELERATION, DECELERATION, DWELL_TIME, LIMITS_APPLY, MAXIMUM_VELOCITY, POSITION_MAXIMUM,
    POSITION_MINIMUM, QUICK_STOP, Settings, VELOCITY,
};
use crate::sim::motion::{Actual, Generator};

/// What the joint is led through.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Course {
    /// Nothing: it rests where the demand is.
    Rest { is_target_reached: bool },
    /// To a position.
    To { target: f64 },
    /// To and fro between two positions, with a dwell at each reversal.
    Reciprocating { target: f64, other: f64, dwell_until_ns: Nanoseconds },
    /// At the profile velocity without end.
    Continuous,
    /// To rest.
    Stopping { deceleration: f64, was_reciprocating: bool },
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
        Self { course: Course::Rest { is_target_reached: false }, demand }
    }

    /// The demanded position.
    pub const fn position(&self) -> f64 {
        self.demand.position
    }

    /// The demanded velocity.
    pub const fn velocity(&self) -> f64 {
        self.demand.velocity
    }

    /// Whether it is not at rest.
    pub const fn is_moving(&self) -> bool {
        !matches!(self.course, Course::Rest { .. })
    }

    /// Whether it rests at a target, and not where it was stopped.
    pub const fn is_target_reached(&self) -> bool {
        matches!(self.course, Course::Rest { is_target_reached: true })
    }

    /// Whether a reciprocating motion is coming to rest.
    pub const fn is_stopping_reciprocation(&self) -> bool {
        matches!(self.course, Course::Stopping { was_reciprocating: true, .. })
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

    /// Begins to stop with the profile deceleration.
    pub fn stop(&mut self, settings: &Settings) {
        self.stop_with(deceleration(settings));
    }

    fn stop_with(&mut self, deceleration: f64) {
        if self.is_moving() {
            let was_reciprocating = matches!(self.course, Course::Reciprocating { .. });
            self.course = Course::Stopping { deceleration, was_reciprocating };
        }
    }

    /// Goes on for a step.
    pub fn step(&mut self, now_ns: Nanoseconds, settings: &Settings, duration_s: f64) {
        let most = settings.get(MAXIMUM_VELOCITY);
        let profile = settings.get(VELOCITY).clamp(-most, most);
        let (faster, slower) = (acceleration(settings), deceleration(settings));
        match self.course {
            Course::Rest { .. } => {}
            Course::To { target } => {
                if self.demand.step_profile(target, profile.abs(), faster, slower, duration_s) {
                    self.course = Course::Rest { is_target_reached: true };
                }
            }
            Course::Reciprocating { dwell_until_ns, .. } if now_ns < dwell_until_ns => {}
            Course::Reciprocating { target, other, .. } => {
                if self.demand.step_profile(target, profile.abs(), faster, slower, duration_s) {
                    let dwell_ns = settings.value(DWELL_TIME).and_then(|ms| u64::try_from(ms).ok());
                    let dwell_until_ns =
                        now_ns.saturating_add(dwell_ns.unwrap_or(0).saturating_mul(1_000_000));
                    self.course = Course::Reciprocating { target: other, other: target, dwell_until_ns };
                }
            }
            Course::Continuous => self.demand.ramp_between(profile, faster, slower, duration_s),
            Course::Stopping { deceleration, .. } => {
                self.demand.ramp(0.0, deceleration, duration_s);
                if self.demand.velocity == 0.0 {
                    self.course = Course::Rest { is_target_reached: false };
                }
            }
        }
        self.keep_position_limits(settings);
    }

    /// At a position limit it stops with the quick-stop deceleration; the demand never leaves the limits.
    fn keep_position_limits(&mut self, settings: &Settings) {
        let (lowest, highest) = (settings.get(POSITION_MINIMUM), settings.get(POSITION_MAXIMUM));
        if lowest >= highest {
            return;
        }
        let Generator { position, velocity, .. } = self.demand;
        if position > highest && velocity > 0.0 || position < lowest && velocity < 0.0 {
            self.demand.follow(Actual { position: position.clamp(lowest, highest), velocity: 0.0 });
            self.stop_with(settings.get(QUICK_STOP).max(1.0));
        }
    }
}

/// The rate at which the velocity grows; without limits of their own, motions change it at once.
pub fn acceleration(settings: &Settings) -> f64 {
    rate(settings, ACCELERATION)
}

/// The rate at which the velocity goes down. At least 1 count/s²: with 0 no motion would end.
pub fn deceleration(settings: &Settings) -> f64 {
    rate(settings, DECELERATION)
}

fn rate(settings: &Settings, index: u16) -> f64 {
    /// The loops of the drive do not follow steeper ramps: count/s².
    const STEEPEST: f64 = 1e8;
    match settings.value(LIMITS_APPLY) {
        Some(0) => STEEPEST,
        _ => settings.get(index).clamp(1.0, STEEPEST),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const STEP_S: f64 = 250e-6;

    fn settings(velocity: i32, rate: i32) -> Settings {
        let mut settings = Settings::new(1, false);
        settings.set(VELOCITY, velocity);
        settings.set(ACCELERATION, rate);
        settings.set(DECELERATION, rate);
        settings
    }

    proptest! {
        #[test]
        fn a_target_is_reached_exactly_and_within_the_profile(
            target in -200_000i32..200_000,
            velocity in 100i32..200_000,
            rate in 1_000i32..2_000_000,
        ) {
            let settings = settings(velocity, rate);
            let mut motion = Motion::resting_at(0.0);
            motion.move_to(target.into());
            let ideal_s = f64::from(target.abs()) / f64::from(velocity) + f64::from(velocity) / f64::from(rate)
                + 2.0 * (f64::from(target.abs()) / f64::from(rate)).sqrt();
            let (mut last, mut steps) = (0.0, 0.0);
            while motion.is_moving() {
                motion.step(0, &settings, STEP_S);
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
        let mut settings = settings(100_000, 1_000_000);
        settings.set(DWELL_TIME, 100);
        let mut motion = Motion::resting_at(50.0);
        motion.reciprocate_to(10_050.0);
        let (mut ends, mut now_ns) = (vec![], 0);
        for _ in 0..8_000 {
            let before = motion.position();
            motion.step(now_ns, &settings, STEP_S);
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
        motion.stop(&settings);
        (0..1_000).for_each(|_| motion.step(now_ns, &settings, STEP_S));
        assert!(!motion.is_moving() && !motion.is_target_reached());
    }

    #[test]
    fn a_continuous_motion_follows_a_new_velocity_and_stops_at_a_position_limit() {
        let mut settings = settings(1_000, 10_000);
        settings.set(POSITION_MAXIMUM, 3_000);
        let mut motion = Motion::resting_at(0.0);
        motion.run();
        (0..4_000).for_each(|_| motion.step(0, &settings, STEP_S));
        assert_eq!(motion.velocity(), 1_000.0);
        settings.set(VELOCITY, 2_000);
        (0..800).for_each(|_| motion.step(0, &settings, STEP_S));
        assert_eq!(motion.velocity(), 2_000.0);
        (0..8_000).for_each(|_| motion.step(0, &settings, STEP_S));
        assert_eq!((motion.position(), motion.is_moving()), (3_000.0, false));
    }
}
