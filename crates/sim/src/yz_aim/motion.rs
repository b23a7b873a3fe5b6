//! The set-points of the control loops. Units: counts, counts/s.

use crate::motion::{Actual, Demand, Generator};

/// Time in which an interpolated target is reached (manual 5.10.3).
const INTERPOLATION_S: f64 = 2e-3;

/// The command to the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionCommand {
    /// Decelerate, then hold.
    Stop,
    /// Move to the target at this speed at most (counts/s).
    Profile(f64),
    /// Run at this velocity (counts/s).
    Velocity(f64),
    /// Follow the targets that SYNC activates.
    Interpolate,
}

/// Generates the set-points of the loops.
#[derive(Clone, Copy, Debug)]
pub struct YzAimMotion {
    highest_speed: f64,
    /// Its target without a command is the position of the last stop.
    generator: Generator,
    is_moving: bool,
    is_limited: bool,
}

impl YzAimMotion {
    /// A generator at standstill.
    pub fn new(highest_speed: f64) -> Self {
        Self { highest_speed, generator: Generator::default(), is_moving: false, is_limited: false }
    }

    /// Restarts at the actual position without a target.
    pub fn engage(&mut self, actual: Actual) {
        *self = Self { generator: Generator::starting(actual), ..Self::new(self.highest_speed) };
    }

    /// Changes the zero of the counts.
    pub fn shift(&mut self, counts: f64) {
        self.generator.shift(counts);
    }

    /// Sets the target of a profile. The current position as target starts no move.
    pub fn move_to(&mut self, target: f64) {
        self.generator.target = target;
        self.is_moving = self.generator.position != target || self.generator.velocity != 0.0;
    }

    /// Sets a target that SYNC activates and that is reached in 2 ms.
    pub fn interpolate_to(&mut self, target: f64) {
        self.generator.interpolate_to(target, INTERPOLATION_S, self.highest_speed);
    }

    /// The last target.
    pub fn target(&self) -> f64 {
        self.generator.target
    }

    /// Returns `true` if a profile is running.
    pub fn is_moving(&self) -> bool {
        self.is_moving
    }

    /// The demanded velocity.
    pub fn velocity(&self) -> f64 {
        self.generator.velocity
    }

    /// Returns `true` if the targets need more than the highest speed.
    pub fn is_limited(&self) -> bool {
        self.is_limited
    }

    /// Advances by `duration_s` and returns the set-point. A position is that of the beginning of the step, when the
    /// actual position was measured. `acceleration` is infinite without a ramp.
    pub fn step(
        &mut self,
        command: MotionCommand,
        acceleration: f64,
        actual: Actual,
        duration_s: f64,
    ) -> Demand {
        let generator = &mut self.generator;
        let position = generator.position;
        self.is_limited = false;
        match command {
            MotionCommand::Stop => generator.ramp(0.0, acceleration, duration_s),
            MotionCommand::Profile(_) if !self.is_moving => generator.ramp(0.0, acceleration, duration_s),
            MotionCommand::Profile(speed) => {
                let (target, speed) = (generator.target, speed.min(self.highest_speed));
                let has_arrived =
                    generator.step_profile(target, speed, acceleration, acceleration, duration_s);
                self.is_moving = !has_arrived;
            }
            MotionCommand::Velocity(velocity) => {
                generator.position = actual.position;
                let wanted = velocity.clamp(-self.highest_speed, self.highest_speed);
                generator.ramp(wanted, acceleration, duration_s);
                return Demand::Velocity { velocity: generator.velocity, torque: 0.0 };
            }
            MotionCommand::Interpolate => {
                self.is_limited = generator.step_interpolation(self.highest_speed, duration_s);
                return Demand::Position { position, velocity: generator.forward, torque: 0.0 };
            }
        }
        Demand::Position { position, velocity: generator.velocity, torque: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 125e-6;
    const AT_REST: Actual = Actual { position: 0.0, velocity: 0.0 };

    fn position_of(demand: Demand) -> f64 {
        let Demand::Position { position, .. } = demand else { panic!("{demand:?}") };
        position
    }

    #[test]
    fn an_interpolated_target_is_reached_in_2_ms_on_a_straight_line() {
        let mut motion = YzAimMotion::new(1e6);
        motion.interpolate_to(160.0);
        for k in 0..16 {
            let demand = motion.step(MotionCommand::Interpolate, f64::INFINITY, AT_REST, STEP_S);
            assert!((position_of(demand) - 10.0 * f64::from(k)).abs() < 1e-9);
        }
        let demand = motion.step(MotionCommand::Interpolate, f64::INFINITY, AT_REST, STEP_S);
        assert_eq!(position_of(demand), 160.0);
        assert!(!motion.is_limited());
    }

    #[test]
    fn two_axes_stay_on_their_straight_line_within_one_count() {
        const SHARE: f64 = -0.37;
        let mut axes = [YzAimMotion::new(1e6); 2];
        for cycle in 0..400 {
            let travelled = 3.3 * f64::from(cycle) * f64::from(cycle.min(150));
            for (axis, share) in axes.iter_mut().zip([1.0, SHARE]) {
                axis.interpolate_to((travelled * share).round());
            }
            for _ in 0..16 {
                let [first, second] = axes.each_mut().map(|axis| {
                    position_of(axis.step(MotionCommand::Interpolate, f64::INFINITY, AT_REST, STEP_S))
                });
                assert!((first * SHARE - second).abs() <= 1.0, "{first} {second}");
            }
        }
    }

    #[test]
    fn targets_beyond_the_highest_speed_are_followed_at_the_highest_speed() {
        let mut motion = YzAimMotion::new(10_000.0);
        motion.interpolate_to(50.0);
        for k in 0..40 {
            let demand = motion.step(MotionCommand::Interpolate, f64::INFINITY, AT_REST, STEP_S);
            assert!((position_of(demand) - 1.25 * f64::from(k)).abs() < 1e-9);
        }
        motion.step(MotionCommand::Interpolate, f64::INFINITY, AT_REST, STEP_S);
        assert_eq!((motion.generator.position, motion.is_limited()), (50.0, false));
    }

    #[test]
    fn a_profile_accelerates_cruises_and_arrives_exactly() {
        for acceleration in [4_000.0, f64::INFINITY] {
            let mut motion = YzAimMotion::new(1e6);
            motion.move_to(-1_000.0);
            let (mut fastest, mut steps) = (0f64, 0);
            while motion.is_moving() {
                let before = motion.velocity();
                motion.step(MotionCommand::Profile(1_000.0), acceleration, AT_REST, STEP_S);
                assert!((motion.velocity() - before).abs() <= 2.1 * acceleration * STEP_S);
                fastest = fastest.max(motion.velocity().abs());
                steps += 1;
            }
            assert_eq!((motion.generator.position, motion.velocity(), fastest), (-1_000.0, 0.0, 1_000.0));
            let expected_s = if acceleration.is_finite() { 1.25 } else { 1.0 };
            assert!((f64::from(steps) * STEP_S - expected_s).abs() < 0.01);
        }
    }
}
