//! From orders to what the loops are to follow. Counts and counts/s.

/// The time over which an interpolated target is reached (manual 5.10.3).
const INTERPOLATION_S: f64 = 2e-3;
/// The feed-forward of the velocity passes a low-pass of this time, since targets are whole counts.
const FORWARD_FILTER_S: f64 = 1e-3;
/// The velocity is fed forward this long, so that a SYNC that is a little late does not shake the joint.
const FORWARD_S: f64 = 2.0 * INTERPOLATION_S;
/// Closer than this (counts) a profile has arrived.
const ARRIVED: f64 = 0.01;

/// What the motor is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// Decelerate, then hold.
    Stop,
    /// Go to the target at most at this speed (counts/s).
    Profile(f64),
    /// Turn at this velocity (counts/s).
    Velocity(f64),
    /// Follow the targets that come with SYNC.
    Interpolate,
}

/// What the loops are to follow in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// counts; `None` where only the velocity matters.
    pub position: Option<f64>,
    /// counts/s
    pub velocity: f64,
}

/// What the joint really does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actual {
    /// counts
    pub position: f64,
    /// counts/s
    pub velocity: f64,
}

/// The reference generator.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    highest_speed: f64,
    position: f64,
    velocity: f64,
    /// The last target, which is where a stop left it when there is none.
    target: f64,
    is_moving: bool,
    left_s: f64,
    /// The velocity that the last two interpolated targets make, and how long it counts.
    wanted_forward: f64,
    forward_s: f64,
    forward: f64,
    is_limited: bool,
}

impl Motion {
    /// A generator at rest.
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

    /// Everything begins anew where the joint is; no target is left.
    pub fn engage(&mut self, actual: Actual) {
        let Actual { position, velocity } = actual;
        *self = Self { position, velocity, target: position, ..Self::new(self.highest_speed) };
    }

    /// The drive counts from another zero.
    pub fn shift(&mut self, counts: f64) {
        self.position += counts;
        self.target += counts;
    }

    /// A target for a profile. Where it is already it stays, so the same target again serves as a question.
    pub fn move_to(&mut self, target: f64) {
        self.target = target;
        self.is_moving = self.position != target || self.velocity != 0.0;
    }

    /// A target that SYNC has made valid, to be reached in 2 ms.
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

    /// Whether a profile is under way.
    pub fn is_moving(&self) -> bool {
        self.is_moving
    }

    /// Demanded velocity.
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// Whether the targets want more than the highest speed.
    pub fn is_limited(&self) -> bool {
        self.is_limited
    }

    /// Moves on by `duration_s` and says what the loops are to follow: a position is that of the beginning of the
    /// step, which is when the actual one was measured. `acceleration` is infinite without a ramp.
    pub fn step(&mut self, order: Order, acceleration: f64, actual: Actual, duration_s: f64) -> Demand {
        let position = self.position;
        self.is_limited = false;
        match order {
            Order::Stop => {
                self.ramp(0.0, acceleration, duration_s);
                Demand { position: Some(position), velocity: self.velocity }
            }
            Order::Profile(speed) => {
                self.step_profile(speed.min(self.highest_speed), acceleration, duration_s);
                Demand { position: Some(position), velocity: self.velocity }
            }
            Order::Velocity(velocity) => {
                self.position = actual.position;
                let wanted = velocity.clamp(-self.highest_speed, self.highest_speed);
                self.ramp(wanted, acceleration, duration_s);
                Demand { position: None, velocity: self.velocity }
            }
            Order::Interpolate => {
                self.step_interpolation(duration_s);
                Demand { position: Some(position), velocity: self.forward }
            }
        }
    }

    fn step_interpolation(&mut self, duration_s: f64) {
        let most = self.highest_speed * duration_s;
        // Without a new target the last one is reached and held.
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
        // The highest velocity from which whole steps of the deceleration lead exactly to the target.
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
    const AT_REST: Actual = Actual { position: 0.0, velocity: 0.0 };

    #[test]
    fn an_interpolated_target_is_reached_in_2_ms_on_a_straight_line() {
        let mut motion = Motion::new(1e6);
        motion.interpolate_to(160.0);
        for k in 0..16 {
            let demand = motion.step(Order::Interpolate, f64::INFINITY, AT_REST, STEP_S);
            assert!((demand.position.unwrap() - 10.0 * f64::from(k)).abs() < 1e-9);
        }
        let demand = motion.step(Order::Interpolate, f64::INFINITY, AT_REST, STEP_S);
        assert_eq!(demand.position, Some(160.0));
        assert!(!motion.is_limited());
    }

    #[test]
    fn two_axes_stay_on_their_straight_line_within_one_count() {
        const SHARE: f64 = -0.37;
        let mut axes = [Motion::new(1e6); 2];
        for cycle in 0..400 {
            let travelled = 3.3 * f64::from(cycle) * f64::from(cycle.min(150));
            for (axis, share) in axes.iter_mut().zip([1.0, SHARE]) {
                axis.interpolate_to((travelled * share).round());
            }
            for _ in 0..16 {
                let [first, second] = axes.each_mut().map(|axis| {
                    axis.step(Order::Interpolate, f64::INFINITY, AT_REST, STEP_S).position.unwrap()
                });
                assert!((first * SHARE - second).abs() <= 1.0, "{first} {second}");
            }
        }
    }

    #[test]
    fn too_long_a_step_is_followed_at_the_highest_speed() {
        let mut motion = Motion::new(10_000.0);
        motion.interpolate_to(50.0);
        for k in 0..40 {
            let demand = motion.step(Order::Interpolate, f64::INFINITY, AT_REST, STEP_S);
            assert!((demand.position.unwrap() - 1.25 * f64::from(k)).abs() < 1e-9);
        }
        motion.step(Order::Interpolate, f64::INFINITY, AT_REST, STEP_S);
        assert_eq!((motion.position, motion.is_limited()), (50.0, false));
    }

    #[test]
    fn a_profile_accelerates_cruises_and_arrives_exactly() {
        for acceleration in [4_000.0, f64::INFINITY] {
            let mut motion = Motion::new(1e6);
            motion.move_to(-1_000.0);
            let (mut fastest, mut steps) = (0f64, 0);
            while motion.is_moving() {
                let before = motion.velocity();
                motion.step(Order::Profile(1_000.0), acceleration, AT_REST, STEP_S);
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
