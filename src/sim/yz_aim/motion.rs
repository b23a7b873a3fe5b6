//! The set-points of the control loops. Units: counts, counts/s.

/// Time in which an interpolated target is reached (manual 5.10.3).
const INTERPOLATION_S: f64 = 2e-3;
/// Time constant of the low-pass for the velocity feed-forward, because targets are whole counts.
const FORWARD_FILTER_S: f64 = 1e-3;
/// How long the velocity is fed forward, so that a slightly late SYNC does not disturb the joint.
const FORWARD_S: f64 = 2.0 * INTERPOLATION_S;
/// Tolerance in counts within which a profile has reached its target.
const ARRIVED: f64 = 0.01;

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

/// The set-point of the loops for one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YzAimDemand {
    /// counts; `None` for velocity control.
    pub position: Option<f64>,
    /// counts/s
    pub velocity: f64,
}

/// The measured motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YzAimActual {
    /// counts
    pub position: f64,
    /// counts/s
    pub velocity: f64,
}

/// Generates the set-points of the loops.
#[derive(Clone, Copy, Debug)]
pub struct YzAimMotion {
    highest_speed: f64,
    position: f64,
    velocity: f64,
    /// The last target; without one, the position of the last stop.
    target: f64,
    is_moving: bool,
    left_s: f64,
    /// Velocity from the difference of the last two interpolated targets, and how long it is still fed forward.
    wanted_forward: f64,
    forward_s: f64,
    forward: f64,
    is_limited: bool,
}

impl YzAimMotion {
    /// A generator at standstill.
    pub fn new(highest_speed: f64) -> Self {
        Self {
            highest_speed,
            position: 0.0,
            velocity: 0.0,
            target: 0.0,
            is_moving: false,
            left_s: 0.0,
            wanted_forward: 0.0,
            forward_s: 0.0,
            forward: 0.0,
            is_limited: false,
        }
    }

    /// Restarts at the actual position without a target.
    pub fn engage(&mut self, actual: YzAimActual) {
        let YzAimActual { position, velocity } = actual;
        *self = Self { position, velocity, target: position, ..Self::new(self.highest_speed) };
    }

    /// Changes the zero of the counts.
    pub fn shift(&mut self, counts: f64) {
        self.position += counts;
        self.target += counts;
    }

    /// Sets the target of a profile. The current position as target starts no move.
    pub fn move_to(&mut self, target: f64) {
        self.target = target;
        self.is_moving = self.position != target || self.velocity != 0.0;
    }

    /// Sets a target that SYNC activates and that is reached in 2 ms.
    pub fn interpolate_to(&mut self, target: f64) {
        let velocity = (target - self.target) / INTERPOLATION_S;
        self.wanted_forward = velocity.clamp(-self.highest_speed, self.highest_speed);
        self.forward_s = FORWARD_S;
        self.left_s = INTERPOLATION_S;
        self.target = target;
    }

    /// The last target.
    pub fn target(&self) -> f64 {
        self.target
    }

    /// Whether a profile is running.
    pub fn is_moving(&self) -> bool {
        self.is_moving
    }

    /// The demanded velocity.
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// Whether the targets need more than the highest speed.
    pub fn is_limited(&self) -> bool {
        self.is_limited
    }

    /// Advances by `duration_s` and returns the set-point. A position is that of the beginning of the step, when the
    /// actual position was measured. `acceleration` is infinite without a ramp.
    pub fn step(
        &mut self,
        command: MotionCommand,
        acceleration: f64,
        actual: YzAimActual,
        duration_s: f64,
    ) -> YzAimDemand {
        let position = self.position;
        self.is_limited = false;
        match command {
            MotionCommand::Stop => {
                self.ramp(0.0, acceleration, duration_s);
                YzAimDemand { position: Some(position), velocity: self.velocity }
            }
            MotionCommand::Profile(speed) => {
                self.step_profile(speed.min(self.highest_speed), acceleration, duration_s);
                YzAimDemand { position: Some(position), velocity: self.velocity }
            }
            MotionCommand::Velocity(velocity) => {
                self.position = actual.position;
                let wanted = velocity.clamp(-self.highest_speed, self.highest_speed);
                self.ramp(wanted, acceleration, duration_s);
                YzAimDemand { position: None, velocity: self.velocity }
            }
            MotionCommand::Interpolate => {
                self.step_interpolation(duration_s);
                YzAimDemand { position: Some(position), velocity: self.forward }
            }
        }
    }

    fn step_interpolation(&mut self, duration_s: f64) {
        let most = self.highest_speed * duration_s;
        // Without a new target, the last one is reached and held.
        let share = if self.left_s > duration_s { duration_s / self.left_s } else { 1.0 };
        let wanted = (self.target - self.position) * share;
        let step = wanted.clamp(-most, most);
        self.is_limited = step != wanted;
        self.position += step;
        self.velocity = step / duration_s;
        let forward = if self.forward_s > 0.0 { self.wanted_forward } else { 0.0 };
        self.forward += (forward - self.forward) * duration_s / (FORWARD_FILTER_S + duration_s);
        self.left_s = (self.left_s - duration_s).max(0.0);
        self.forward_s = (self.forward_s - duration_s).max(0.0);
    }

    fn step_profile(&mut self, speed: f64, acceleration: f64, duration_s: f64) {
        if !self.is_moving {
            self.ramp(0.0, acceleration, duration_s);
            return;
        }
        let distance = self.target - self.position;
        let step = acceleration * duration_s;
        // The highest velocity from which whole steps of the deceleration end exactly at the target.
        let highest = if step.is_finite() {
            step * ((0.25 + 2.0 * distance.abs() / (step * duration_s)).sqrt() - 0.5)
        } else {
            distance.abs() / duration_s
        };
        self.ramp(highest.min(speed).copysign(distance), acceleration, duration_s);
        if (self.target - self.position).abs() < ARRIVED && self.velocity.abs() <= 2.0 * step {
            self.position = self.target;
            self.velocity = 0.0;
            self.is_moving = false;
        }
    }

    fn ramp(&mut self, wanted: f64, acceleration: f64, duration_s: f64) {
        let most = acceleration * duration_s;
        self.velocity += (wanted - self.velocity).clamp(-most, most);
        self.position += self.velocity * duration_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 125e-6;
    const AT_REST: YzAimActual = YzAimActual { position: 0.0, velocity: 0.0 };

    #[test]
    fn an_interpolated_target_is_reached_in_2_ms_on_a_straight_line() {
        let mut motion = YzAimMotion::new(1e6);
        motion.interpolate_to(160.0);
        for k in 0..16 {
            let demand = motion.step(MotionCommand::Interpolate, f64::INFINITY, AT_REST, STEP_S);
            assert!((demand.position.unwrap() - 10.0 * f64::from(k)).abs() < 1e-9);
        }
        let demand = motion.step(MotionCommand::Interpolate, f64::INFINITY, AT_REST, STEP_S);
        assert_eq!(demand.position, Some(160.0));
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
                    axis.step(MotionCommand::Interpolate, f64::INFINITY, AT_REST, STEP_S).position.unwrap()
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
            assert!((demand.position.unwrap() - 1.25 * f64::from(k)).abs() < 1e-9);
        }
        motion.step(MotionCommand::Interpolate, f64::INFINITY, AT_REST, STEP_S);
        assert_eq!((motion.position, motion.is_limited()), (50.0, false));
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
            assert_eq!((motion.position, motion.velocity(), fastest), (-1_000.0, 0.0, 1_000.0));
            let expected_s = if acceleration.is_finite() { 1.25 } else { 1.0 };
            assert!((f64::from(steps) * STEP_S - expected_s).abs() < 0.01);
        }
    }
}
