//! The demanded motion of a simulated drive: what the modes of operation of every drive have in common. Units: position units
//! (counts), counts/s, per mille of the rated torque.

mod generator;
mod set_points;

use super::servo::Servo;

pub use generator::Generator;
pub use set_points::SetPoints;

/// The measured motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actual {
    /// counts
    pub position: f64,
    /// counts/s
    pub velocity: f64,
}

/// The set-point of the loops for one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demand {
    /// A position (counts) with its velocity (counts/s) and a torque fed forward (per mille).
    Position {
        /// counts
        position: f64,
        /// counts/s
        velocity: f64,
        /// per mille
        torque: f64,
    },
    /// A velocity (counts/s) with a torque fed forward (per mille).
    Velocity {
        /// counts/s
        velocity: f64,
        /// per mille
        torque: f64,
    },
    /// A torque (per mille).
    Torque(f64),
}

/// The units of a demand at the joint, and the measured motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// One count, without its sign: rad (m).
    pub count: f64,
    /// One per mille of the rated torque: N·m (N).
    pub per_mille: f64,
    /// counts
    pub position: f64,
    /// rad/s (m/s), in the direction of the drive.
    pub velocity: f64,
}

impl Demand {
    /// The torque of the loops after this demand: N·m (N), in the direction of the drive.
    #[inline]
    pub fn torque(self, servo: &mut Servo, measured: Measured, duration_s: f64) -> f64 {
        let Measured { count, per_mille, position: actual, velocity } = measured;
        match self {
            Self::Position { position, velocity: forward, torque } => {
                let error = (position - actual) * count;
                servo.position(error, forward * count, velocity, torque * per_mille, duration_s)
            }
            Self::Velocity { velocity: wanted, torque } => {
                servo.velocity(wanted * count, velocity, torque * per_mille, duration_s)
            }
            Self::Torque(torque) => servo.torque(torque * per_mille, velocity),
        }
    }
}

/// What no demand exceeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits {
    /// counts/s
    pub velocity: f64,
    /// The software limits: counts.
    pub positions: (f64, f64),
}

impl MotionLimits {
    /// The nearest position within the software limits.
    pub fn position(&self, wanted: f64) -> f64 {
        let (lowest, highest) = self.positions;
        wanted.min(highest).max(lowest)
    }

    /// The nearest velocity that does not lead beyond the software limits.
    pub fn velocity_at(&self, position: f64, wanted: f64) -> f64 {
        let (lowest, highest) = self.positions;
        let is_beyond = wanted > 0.0 && position >= highest || wanted < 0.0 && position <= lowest;
        if is_beyond { 0.0 } else { wanted.clamp(-self.velocity, self.velocity) }
    }
}
