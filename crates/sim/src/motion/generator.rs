//! Ramps, trapezoidal profiles, and the interpolation between cyclic targets.

use super::Actual;

/// Time constant of the low-pass for the velocity feed-forward of cyclic targets, because they are whole counts.
const FORWARD_FILTER_S: f64 = 1e-3;
/// Number of periods for which the velocity is fed forward, so that a SYNC up to one period late does not disturb the
/// joint.
const FORWARD_PERIODS: f64 = 2.0;
/// Tolerance in counts within which a profile has reached its target.
const ARRIVED: f64 = 0.01;

/// The demanded position and velocity of one axis, and the way to its target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Generator {
    /// Demanded position: counts.
    pub position: f64,
    /// Demanded velocity: counts/s.
    pub velocity: f64,
    /// The last target: counts.
    pub target: f64,
    /// The velocity that is fed forward with cyclic targets: counts/s.
    pub forward: f64,
    /// Until the interpolation reaches the target.
    left_s: f64,
    /// Velocity from the difference of the last two cyclic targets, and how long it is still fed forward.
    wanted_forward: f64,
    forward_s: f64,
}

impl Generator {
    /// Starts with the actual motion, and with the actual position as the target.
    pub fn starting(actual: Actual) -> Self {
        let Actual { position, velocity } = actual;
        Self { position, velocity, target: position, ..Self::default() }
    }

    /// Demands the actual motion.
    pub fn follow(&mut self, actual: Actual) {
        (self.position, self.velocity) = (actual.position, actual.velocity);
    }

    /// Shifts the positions, when the joint has another position from now on.
    pub fn shift(&mut self, by: f64) {
        self.position += by;
        self.target += by;
    }

    /// Ramps the velocity towards `wanted` (counts/s) at `rate` (counts/s²), and moves.
    pub fn ramp(&mut self, wanted: f64, rate: f64, duration_s: f64) {
        let most = rate * duration_s;
        self.velocity += (wanted - self.velocity).clamp(-most, most);
        self.position += self.velocity * duration_s;
    }

    /// Ramps the velocity towards `wanted` with one rate away from standstill and another one towards it.
    pub fn ramp_between(&mut self, wanted: f64, acceleration: f64, deceleration: f64, duration_s: f64) {
        let is_faster = wanted * self.velocity >= 0.0 && wanted.abs() > self.velocity.abs();
        self.ramp(wanted, if is_faster { acceleration } else { deceleration }, duration_s);
    }

    /// One step of a trapezoidal profile to a target. Infinite rates mean no ramps. Returns whether it has arrived.
    pub fn step_profile(
        &mut self,
        target: f64,
        velocity: f64,
        acceleration: f64,
        deceleration: f64,
        duration_s: f64,
    ) -> bool {
        let distance = target - self.position;
        let step = deceleration * duration_s;
        // The highest velocity from which whole steps of the deceleration end exactly at the target.
        let highest = if step.is_finite() {
            step * ((0.25 + 2.0 * distance.abs() / (step * duration_s)).sqrt() - 0.5)
        } else {
            distance.abs() / duration_s
        };
        let wanted = highest.min(velocity).copysign(distance);
        self.ramp_between(wanted, acceleration, deceleration, duration_s);
        let has_arrived = (target - self.position).abs() < ARRIVED && self.velocity.abs() <= 2.0 * step;
        if has_arrived {
            (self.position, self.velocity) = (target, 0.0);
        }
        has_arrived
    }

    /// Takes a cyclic target, which the interpolation reaches after `period_s`.
    pub fn interpolate_to(&mut self, target: f64, period_s: f64, velocity_limit: f64) {
        let velocity = (target - self.target) / period_s;
        self.wanted_forward = velocity.clamp(-velocity_limit, velocity_limit);
        self.forward_s = FORWARD_PERIODS * period_s;
        self.left_s = period_s;
        self.target = target;
    }

    /// Returns `true` if the interpolation is on the way to this target.
    pub fn interpolates_to(&self, target: f64) -> bool {
        target == self.target && self.left_s > 0.0
    }

    /// Forgets the cyclic targets: the next one starts from the demanded position.
    pub fn end_interpolation(&mut self) {
        self.target = self.position;
        (self.left_s, self.wanted_forward, self.forward_s) = (0.0, 0.0, 0.0);
    }

    /// One step of the interpolation. Returns whether it needs more than `velocity_limit`.
    #[inline]
    pub fn step_interpolation(&mut self, velocity_limit: f64, duration_s: f64) -> bool {
        let most = velocity_limit * duration_s;
        // Without a new target, the last one is reached and held.
        let share = if self.left_s > duration_s { duration_s / self.left_s } else { 1.0 };
        let wanted = (self.target - self.position) * share;
        let step = wanted.clamp(-most, most);
        self.position += step;
        self.velocity = step / duration_s;
        let forward = if self.forward_s > 0.0 { self.wanted_forward } else { 0.0 };
        self.forward += (forward - self.forward) * duration_s / (FORWARD_FILTER_S + duration_s);
        self.left_s = (self.left_s - duration_s).max(0.0);
        self.forward_s = (self.forward_s - duration_s).max(0.0);
        step != wanted
    }
}
