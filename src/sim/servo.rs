//! The control loops of the drive: position (P) over velocity (PI) over torque, at the rate of the plant. The unit has
//! been commissioned: its gains are scaled with the inertia it turns.

/// Gains as rates, so that they are the same for any inertia.
const POSITION_RATE: f64 = 120.0; // 1/s
const VELOCITY_RATE: f64 = 800.0; // 1/s
const INTEGRAL_RATE: f64 = 100.0; // 1/s

/// The loops. SI units in the drive's direction: rad (m), N·m (N).
#[derive(Clone, Copy, Debug)]
pub struct Servo {
    inertia: f64,
    torque_limit: f64,
    velocity_limit: f64,
    integral: f64,
}

impl Servo {
    /// Loops at rest. The torque limit is the peak torque; the velocity limit holds in every mode.
    pub fn new(inertia: f64, torque_limit: f64, velocity_limit: f64) -> Self {
        Self { inertia, torque_limit, velocity_limit, integral: 0.0 }
    }

    /// Sets another torque limit.
    pub fn set_torque_limit(&mut self, torque_limit: f64) {
        self.torque_limit = torque_limit;
    }

    /// Forgets the past, as at every enabling.
    pub fn reset(&mut self) {
        self.integral = 0.0;
    }

    /// Torque for a position error (set-point minus actual) with feed-forward of velocity and torque.
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

    /// Torque for a velocity set-point with feed-forward of torque.
    pub fn velocity(&mut self, demand: f64, velocity: f64, torque_forward: f64, duration_s: f64) -> f64 {
        let error = demand.clamp(-self.velocity_limit, self.velocity_limit) - velocity;
        let gain = self.inertia * VELOCITY_RATE;
        let torque = torque_forward + gain * error + self.integral;
        let limited = torque.clamp(-self.torque_limit, self.torque_limit);
        // At the limit the integral may only come back.
        if torque == limited || (torque - limited) * error < 0.0 {
            self.integral += gain * INTEGRAL_RATE * error * duration_s;
        }
        limited
    }

    /// Torque for a torque set-point: followed, but not beyond the velocity limit.
    pub fn torque(&mut self, demand: f64, velocity: f64) -> f64 {
        let gain = self.inertia * VELOCITY_RATE;
        let highest = (gain * (self.velocity_limit - velocity)).min(self.torque_limit);
        let lowest = (gain * (-self.velocity_limit - velocity)).max(-self.torque_limit);
        demand.min(highest).max(lowest).clamp(-self.torque_limit, self.torque_limit)
    }
}
