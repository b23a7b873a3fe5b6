//! The control loops of a drive: position (P), velocity (PI) and torque, at the rate of the plant. The gains are scaled
//! by the inertia, as in a commissioned unit.

/// Gains as rates, independent of the inertia.
const POSITION_RATE: f64 = 120.0; // 1/s
const VELOCITY_RATE: f64 = 800.0; // 1/s
const INTEGRAL_RATE: f64 = 100.0; // 1/s

/// The control loops, in SI units and in the drive's direction: rad (m), N·m (N).
#[derive(Clone, Copy, Debug)]
pub struct Servo {
    inertia: f64,
    torque_limit: f64,
    velocity_limit: f64,
    integral: f64,
    factors: LoopFactors,
}

/// What the gains of the inner loops are multiplied by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopFactors {
    /// Proportional gain of the velocity loop.
    pub velocity_kp: f64,
    /// Integral gain of the velocity loop.
    pub velocity_ki: f64,
}

impl LoopFactors {
    /// The gains as they were preset.
    pub const PRESET: Self = Self { velocity_kp: 1.0, velocity_ki: 1.0 };
}

impl Servo {
    /// Loops at rest. The torque limit is the peak torque; the velocity limit applies in every mode.
    pub fn new(inertia: f64, torque_limit: f64, velocity_limit: f64) -> Self {
        Self { inertia, torque_limit, velocity_limit, integral: 0.0, factors: LoopFactors::PRESET }
    }

    /// Multiplies the preset gains.
    pub fn set_factors(&mut self, factors: LoopFactors) {
        self.factors = factors;
    }

    /// Changes the torque limit.
    pub fn set_torque_limit(&mut self, torque_limit: f64) {
        self.torque_limit = torque_limit;
    }

    /// Resets the integrator, as at every enabling.
    pub fn reset(&mut self) {
        self.integral = 0.0;
    }

    /// Torque for a position error (set-point minus actual), with velocity and torque feed-forward.
    #[inline]
    pub fn position(
        &mut self,
        error: f64,
        velocity_forward: f64,
        velocity: f64,
        torque_forward: f64,
        duration_s: f64,
    ) -> f64 {
        self.velocity(velocity_forward + POSITION_RATE * error, velocity, torque_forward, duration_s)
    }

    /// Torque for a velocity set-point, with torque feed-forward.
    #[inline]
    pub fn velocity(&mut self, demand: f64, velocity: f64, torque_forward: f64, duration_s: f64) -> f64 {
        let error = demand.clamp(-self.velocity_limit, self.velocity_limit) - velocity;
        let preset = self.inertia * VELOCITY_RATE;
        let gain = preset * self.factors.velocity_kp;
        let torque = torque_forward + gain * error + self.integral;
        let limited = torque.clamp(-self.torque_limit, self.torque_limit);
        // Anti-windup: at the torque limit, the integrator may only decrease.
        if torque == limited || (torque - limited) * error < 0.0 {
            self.integral += preset * INTEGRAL_RATE * self.factors.velocity_ki * error * duration_s;
        }
        limited
    }

    /// Torque for a torque set-point, limited so that the velocity stays within its limit.
    pub fn torque(&mut self, demand: f64, velocity: f64) -> f64 {
        self.torque_within(demand, velocity, self.velocity_limit)
    }

    /// As [`Servo::torque`], with another limit of the velocity, if it is a lower one.
    pub fn torque_within(&mut self, demand: f64, velocity: f64, velocity_limit: f64) -> f64 {
        let velocity_limit = velocity_limit.min(self.velocity_limit);
        let gain = self.inertia * VELOCITY_RATE;
        let highest = (gain * (velocity_limit - velocity)).min(self.torque_limit);
        let lowest = (gain * (-velocity_limit - velocity)).max(-self.torque_limit);
        demand.min(highest).max(lowest).clamp(-self.torque_limit, self.torque_limit)
    }
}
