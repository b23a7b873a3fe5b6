//! From a set-point to the number on the wire, by mode: in CSP the drive closes every loop, in CSV the position
//! loop is closed here, in CST the velocity loop too.

use crate::cia402::OperationMode;
use crate::guard::AxisLimits;
use crate::pdo::{CommandSlot, ProcessImage};
use crate::plan::State;
use crate::units::Scale;

/// How an axis is commanded, with the gains of the loops that are closed here. N·m and rad, or N and m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ControlLaw {
    /// Cyclic synchronous position.
    Position,
    /// Cyclic synchronous velocity: velocity feed-forward and a proportional position loop.
    Velocity {
        /// 1/s
        position_gain: f64,
    },
    /// Cyclic synchronous torque: PD on position and velocity, feed-forward of inertia and friction.
    Torque {
        /// N·m/rad
        stiffness: f64,
        /// N·m·s/rad
        damping: f64,
        /// kg·m²
        inertia: f64,
        /// N·m·s/rad
        viscous_friction: f64,
        /// N·m
        coulomb_friction: f64,
    },
}

/// Below this speed (rad/s or m/s) the Coulomb feed-forward fades out in proportion, so that it does not switch
/// sign with every rounding of a standstill.
const COULOMB_FADE: f64 = 1e-3;

/// What the loops that are closed here compare.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopInput {
    /// The newest set-point; it takes effect at the next SYNC.
    pub set: State,
    /// The set-point that the joint should have reached when the feedback was taken.
    pub due: State,
    /// The position then.
    pub position: f64,
    /// The velocity then.
    pub velocity: f64,
}

impl ControlLaw {
    /// The mode of operation that this needs in the drive.
    pub const fn operation_mode(&self) -> OperationMode {
        match self {
            Self::Position => OperationMode::CyclicSynchronousPosition,
            Self::Velocity { .. } => OperationMode::CyclicSynchronousVelocity,
            Self::Torque { .. } => OperationMode::CyclicSynchronousTorque,
        }
    }

    /// Writes the target of this cycle into the image. Returns the number on the wire and the torque (N·m, N)
    /// that is commanded with it, 0 where none is.
    pub fn command(
        &self,
        input: &LoopInput,
        scale: &Scale,
        limits: &AxisLimits,
        image: &mut ProcessImage,
    ) -> (i32, f64) {
        let (slot, raw, torque) = match *self {
            Self::Position => {
                (CommandSlot::TargetPosition, scale.position_to_counts(input.set.position), 0.0)
            }
            Self::Velocity { position_gain } => {
                let velocity = input.set.velocity + position_gain * (input.due.position - input.position);
                let velocity = velocity.clamp(-limits.velocity, limits.velocity);
                (CommandSlot::TargetVelocity, scale.velocity_to_counts(velocity), 0.0)
            }
            Self::Torque { stiffness, damping, inertia, viscous_friction, coulomb_friction } => {
                let direction = (input.set.velocity / COULOMB_FADE).clamp(-1.0, 1.0);
                let torque = stiffness * (input.due.position - input.position)
                    + damping * (input.due.velocity - input.velocity)
                    + inertia * input.set.acceleration
                    + viscous_friction * input.set.velocity
                    + coulomb_friction * direction;
                let torque = torque.clamp(-limits.torque, limits.torque);
                (CommandSlot::TargetTorque, scale.torque_to_per_mille(torque), torque)
            }
        };
        image.set(slot, raw);
        (raw, torque)
    }

    /// Writes the target of an axis that gets no torque: the actual position, no velocity, no torque. A drive that
    /// is enabled on it stays where it is.
    pub fn idle(&self, position_counts: i32, image: &mut ProcessImage) -> i32 {
        let (slot, raw) = match self {
            Self::Position => (CommandSlot::TargetPosition, position_counts),
            Self::Velocity { .. } => (CommandSlot::TargetVelocity, 0),
            Self::Torque { .. } => (CommandSlot::TargetTorque, 0),
        };
        image.set(slot, raw);
        raw
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::ScaleParameters;
    use core::f64::consts::TAU;

    const LIMITS: AxisLimits = AxisLimits {
        position_min: -3.0,
        position_max: 3.0,
        velocity: 2.0,
        acceleration: 10.0,
        deceleration: 10.0,
        jerk: f64::INFINITY,
        torque: 40.0,
    };

    fn scale() -> Scale {
        Scale::new(ScaleParameters {
            counts_per_turn: 524_288.0,
            gear_ratio: 1.0,
            travel_per_turn: TAU,
            reversed: false,
            zero_counts: 0.0,
            rated_torque: 31.0,
        })
        .unwrap()
    }

    fn input(error: f64, velocity: f64) -> LoopInput {
        let set = State { position: 1.0, velocity, acceleration: 2.0 };
        LoopInput {
            set,
            due: State { position: error, velocity, acceleration: 0.0 },
            position: 0.0,
            velocity: 0.0,
        }
    }

    #[test]
    fn the_velocity_loop_adds_the_position_error_to_the_feed_forward() {
        let mut image = ProcessImage::default();
        let law = ControlLaw::Velocity { position_gain: 10.0 };
        let (raw, _) = law.command(&input(0.01, 0.5), &scale(), &LIMITS, &mut image);
        assert_eq!(raw, scale().velocity_to_counts(0.6));
        assert_eq!(image.command(CommandSlot::TargetVelocity), raw);
    }

    #[test]
    fn velocity_and_torque_are_held_inside_their_limits() {
        let mut image = ProcessImage::default();
        let law = ControlLaw::Velocity { position_gain: 10.0 };
        let (raw, _) = law.command(&input(-5.0, 0.0), &scale(), &LIMITS, &mut image);
        assert_eq!(raw, scale().velocity_to_counts(-2.0));
        let law = ControlLaw::Torque {
            stiffness: 1000.0,
            damping: 10.0,
            inertia: 0.3,
            viscous_friction: 1.0,
            coulomb_friction: 2.0,
        };
        let (_, torque) = law.command(&input(1.0, 0.5), &scale(), &LIMITS, &mut image);
        assert_eq!(torque, 40.0);
        let (raw, torque) = law.command(&input(0.01, 0.5), &scale(), &LIMITS, &mut image);
        assert!((torque - (10.0 + 5.0 + 0.6 + 0.5 + 2.0)).abs() < 1e-12);
        assert_eq!(raw, scale().torque_to_per_mille(torque));
    }

    #[test]
    fn an_idle_axis_is_commanded_to_stay_where_it_is() {
        let mut image = ProcessImage::default();
        assert_eq!(ControlLaw::Position.idle(1234, &mut image), 1234);
        assert_eq!(image.command(CommandSlot::TargetPosition), 1234);
        assert_eq!(ControlLaw::Velocity { position_gain: 1.0 }.idle(1234, &mut image), 0);
    }
}
