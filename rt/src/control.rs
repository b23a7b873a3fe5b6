//! From a set-point to the number on the wire, by mode: in CSP and IP the drive closes every loop, in CSV the position
//! loop is closed here, in CST the velocity loop too. In the profile modes the drive makes its own way as well, see
//! [`crate::profile`].

use crate::cia402::OperationMode;
use crate::guard::AxisLimits;
use crate::pdo::CommandSlot;
use crate::plan::State;
use crate::units::Scale;

/// How an axis is commanded, with the gains of the loops that are closed here. N·m and rad, or N and m.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
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
    /// Interpolated position: as cyclic synchronous position, with the drive's own interpolation between targets.
    Interpolated,
    /// Profile position: the drive moves to a target by its own profile.
    ProfilePosition,
    /// Profile velocity: the drive ramps to a velocity by its own profile.
    ProfileVelocity,
    /// Profile torque: the drive ramps to a torque.
    ProfileTorque,
}

/// A gain of a [`ControlLaw`] that is not finite, or is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainError {
    /// Which.
    pub gain: Gain,
    /// What it is.
    pub value: f64,
}

/// A gain of a [`ControlLaw`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gain {
    /// The position gain of cyclic synchronous velocity.
    Position,
    /// The stiffness of cyclic synchronous torque.
    Stiffness,
    /// Its damping.
    Damping,
    /// Its feed-forward inertia.
    Inertia,
    /// Its feed-forward viscous friction.
    ViscousFriction,
    /// Its feed-forward Coulomb friction.
    CoulombFriction,
}

impl core::error::Error for GainError {}

impl core::fmt::Display for GainError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let name = match self.gain {
            Gain::Position => "position gain",
            Gain::Stiffness => "stiffness",
            Gain::Damping => "damping",
            Gain::Inertia => "inertia",
            Gain::ViscousFriction => "viscous friction",
            Gain::CoulombFriction => "Coulomb friction",
        };
        write!(f, "the {name} must be a finite number, and not negative: {}", self.value)
    }
}

/// Below this speed (rad/s or m/s) the Coulomb feed-forward fades out in proportion, so that it does not switch
/// sign with every rounding of a standstill.
const COULOMB_FADE: f64 = 1e-3;

/// What the loops that are closed here act on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopInput {
    /// The newest set-point; it takes effect at the next SYNC.
    pub set: State,
    /// How far the joint is behind its set-point.
    pub error: TrackingError,
}

/// How far a joint is behind the set-point that it should have reached when its feedback was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct TrackingError {
    /// rad (m)
    pub position: f64,
    /// rad/s (m/s)
    pub velocity: f64,
}

/// What makes the torque of an axis. rad and N·m, or m and N.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum TorqueDemand {
    /// The loop of the control law, or that of the drive.
    Law {
        /// What is fed forward beside it.
        torque: f64,
    },
    /// The loop of the control law with another spring and damper.
    Impedance {
        /// N·m/rad
        stiffness: f64,
        /// N·m·s/rad
        damping: f64,
        /// What is fed forward beside it.
        torque: f64,
    },
    /// No loop: this torque.
    Torque(f64),
}

impl Default for TorqueDemand {
    fn default() -> Self {
        Self::Law { torque: 0.0 }
    }
}

impl ControlLaw {
    /// Checks that every gain is a finite number, and not negative.
    pub fn validate(&self) -> Result<(), GainError> {
        let gains: &[(Gain, f64)] = match *self {
            Self::Velocity { position_gain } => &[(Gain::Position, position_gain)],
            Self::Torque { stiffness, damping, inertia, viscous_friction, coulomb_friction } => &[
                (Gain::Stiffness, stiffness),
                (Gain::Damping, damping),
                (Gain::Inertia, inertia),
                (Gain::ViscousFriction, viscous_friction),
                (Gain::CoulombFriction, coulomb_friction),
            ],
            _ => &[],
        };
        let is_wrong = |(_, value): &&(Gain, f64)| !(value.is_finite() && *value >= 0.0);
        match gains.iter().find(is_wrong) {
            Some(&(gain, value)) => Err(GainError { gain, value }),
            None => Ok(()),
        }
    }

    /// The mode of operation that this needs in the drive.
    pub const fn operation_mode(&self) -> OperationMode {
        match self {
            Self::Position => OperationMode::CyclicSynchronousPosition,
            Self::Velocity { .. } => OperationMode::CyclicSynchronousVelocity,
            Self::Torque { .. } => OperationMode::CyclicSynchronousTorque,
            Self::Interpolated => OperationMode::InterpolatedPosition,
            Self::ProfilePosition => OperationMode::ProfilePosition,
            Self::ProfileVelocity => OperationMode::ProfileVelocity,
            Self::ProfileTorque => OperationMode::ProfileTorque,
        }
    }

    /// Returns `true` if the drive makes its own way to a target, instead of following a set-point of every cycle.
    pub const fn is_profile(&self) -> bool {
        matches!(self, Self::ProfilePosition | Self::ProfileVelocity | Self::ProfileTorque)
    }

    /// Returns `true` if it is for one of the cyclic synchronous modes: CSP, CSV or CST.
    pub const fn is_cyclic_synchronous(&self) -> bool {
        matches!(self, Self::Position | Self::Velocity { .. } | Self::Torque { .. })
    }

    /// The number on the wire that is the target.
    pub const fn target_slot(&self) -> CommandSlot {
        match self {
            Self::Position | Self::Interpolated | Self::ProfilePosition => CommandSlot::TargetPosition,
            Self::Velocity { .. } | Self::ProfileVelocity => CommandSlot::TargetVelocity,
            Self::Torque { .. } | Self::ProfileTorque => CommandSlot::TargetTorque,
        }
    }

    /// Stiffness and damping of the loop that makes a torque: those of the demand, or its own.
    pub const fn gains(&self, demand: &TorqueDemand) -> (f64, f64) {
        match (self, demand) {
            (_, TorqueDemand::Impedance { stiffness, damping, .. })
            | (Self::Torque { stiffness, damping, .. }, TorqueDemand::Law { .. }) => (*stiffness, *damping),
            _ => (0.0, 0.0),
        }
    }

    /// The velocity (rad/s, m/s) of a set-point: for a drive that follows velocities with what its position loop adds.
    pub fn velocity(&self, input: &LoopInput, limits: &AxisLimits) -> f64 {
        let Self::Velocity { position_gain } = *self else { return input.set.velocity };
        let velocity = input.set.velocity + position_gain * input.error.position;
        velocity.clamp(-limits.velocity, limits.velocity)
    }

    /// The torque (N·m, N) that is commanded beside the loops of the drive: where it closes them all, what is fed forward.
    pub fn torque(&self, input: &LoopInput, demand: &TorqueDemand) -> f64 {
        let fed_forward = match *demand {
            TorqueDemand::Torque(torque) => return torque,
            TorqueDemand::Impedance { torque, .. } | TorqueDemand::Law { torque } => torque,
        };
        let (stiffness, damping) = self.gains(demand);
        let Self::Torque { inertia, viscous_friction, coulomb_friction, .. } = *self else {
            return fed_forward;
        };
        let direction = (input.set.velocity / COULOMB_FADE).clamp(-1.0, 1.0);
        stiffness * input.error.position
            + damping * input.error.velocity
            + inertia * input.set.acceleration
            + viscous_friction * input.set.velocity
            + coulomb_friction * direction
            + fed_forward
    }

    /// The target of this cycle in drive units, with the torque that is commanded.
    /// In a profile mode the set-point itself is not for the wire: see `profile`.
    #[inline]
    pub fn target(&self, input: &LoopInput, torque: f64, scale: &Scale, limits: &AxisLimits) -> i32 {
        match *self {
            Self::Position | Self::Interpolated | Self::ProfilePosition => {
                scale.position_command(input.set.position, limits)
            }
            Self::ProfileVelocity => scale.velocity_command(input.set.velocity, limits),
            Self::ProfileTorque => 0,
            Self::Velocity { .. } => scale.velocity_command(self.velocity(input, limits), limits),
            Self::Torque { .. } => scale.torque_command(torque, limits),
        }
    }

    /// The error after a cycle without feedback. A joint that follows velocities is taken to do what it was told: the correction
    /// makes its error smaller. One that follows torques is taken to move as its set-point does: a load is held on.
    #[inline]
    pub fn error_without_feedback(&self, error: TrackingError, cycle_s: f64) -> TrackingError {
        match *self {
            Self::Velocity { position_gain } => {
                let corrected = (position_gain * cycle_s).clamp(0.0, 1.0);
                TrackingError { position: error.position * (1.0 - corrected), ..error }
            }
            _ => error,
        }
    }

    /// The error on which the loops go on once a drive is silent for longer than it may be. A correction of the velocity would
    /// turn the joint for as long as nobody sees it: there is none. A torque still holds the load.
    pub const fn error_of_silent_drive(&self, error: TrackingError) -> TrackingError {
        match self {
            Self::Velocity { .. } => TrackingError { position: 0.0, velocity: 0.0 },
            _ => error,
        }
    }

    /// The target of an axis that gets no torque: the actual position, no velocity, no torque. A drive that is enabled
    /// on it stays where it is.
    pub const fn idle(&self, position_counts: i32) -> i32 {
        match self.target_slot() {
            CommandSlot::TargetPosition => position_counts,
            _ => 0,
        }
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
            velocity_units_per_turn: 524_288.0,
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
        LoopInput { set, error: TrackingError { position: error, velocity } }
    }

    #[test]
    fn the_velocity_loop_adds_the_position_error_to_the_feed_forward() {
        let law = ControlLaw::Velocity { position_gain: 10.0 };
        let raw = law.target(&input(0.01, 0.5), 0.0, &scale(), &LIMITS);
        assert_eq!(raw, scale().velocity_to_drive(0.6));
    }

    #[test]
    fn without_feedback_a_correction_of_the_velocity_fades_and_a_torque_stays() {
        let error = TrackingError { position: 0.1, velocity: 0.2 };
        let velocity = ControlLaw::Velocity { position_gain: 10.0 };
        assert!((velocity.error_without_feedback(error, 1e-3).position - 0.099).abs() < 1e-12);
        assert_eq!(velocity.error_without_feedback(error, f64::INFINITY).position, 0.0);
        assert_eq!(velocity.error_of_silent_drive(error).position, 0.0);
        let torque = ControlLaw::Torque {
            stiffness: 1000.0,
            damping: 10.0,
            inertia: 0.0,
            viscous_friction: 0.0,
            coulomb_friction: 0.0,
        };
        assert_eq!(torque.error_without_feedback(error, 1e-3), error);
        assert_eq!(torque.error_of_silent_drive(error), error);
    }

    #[test]
    fn the_velocity_is_held_inside_its_limit() {
        let law = ControlLaw::Velocity { position_gain: 10.0 };
        let raw = law.target(&input(-5.0, 0.0), 0.0, &scale(), &LIMITS);
        assert_eq!(raw, scale().velocity_to_drive(-2.0));
    }

    #[test]
    fn the_torque_loop_takes_its_gains_from_the_law_or_from_the_demand() {
        let law = ControlLaw::Torque {
            stiffness: 1000.0,
            damping: 10.0,
            inertia: 0.3,
            viscous_friction: 1.0,
            coulomb_friction: 2.0,
        };
        let input = input(0.01, 0.5);
        let torque = |demand| law.torque(&input, &demand);
        let fed_forward = 0.6 + 0.5 + 2.0;
        assert!((torque(TorqueDemand::default()) - (10.0 + 5.0 + fed_forward)).abs() < 1e-12);
        assert!((torque(TorqueDemand::Law { torque: -3.0 }) - (12.0 + fed_forward)).abs() < 1e-12);
        let soft = TorqueDemand::Impedance { stiffness: 100.0, damping: 2.0, torque: 4.0 };
        assert!((torque(soft) - (1.0 + 1.0 + 4.0 + fed_forward)).abs() < 1e-12);
        assert_eq!(torque(TorqueDemand::Torque(7.0)), 7.0);
        assert_eq!(law.target(&input, 7.0, &scale(), &LIMITS), scale().torque_to_per_mille(7.0));
    }

    #[test]
    fn where_the_drive_closes_the_loops_only_the_torque_that_is_fed_forward_is_commanded() {
        let demand = TorqueDemand::Law { torque: 3.0 };
        for law in [ControlLaw::Position, ControlLaw::Velocity { position_gain: 10.0 }] {
            assert_eq!(law.torque(&input(0.01, 0.5), &demand), 3.0);
        }
    }

    #[test]
    fn a_gain_that_is_not_finite_or_is_negative_is_named() {
        for value in [f64::NAN, f64::INFINITY, -1.0] {
            let error = ControlLaw::Velocity { position_gain: value }.validate().unwrap_err();
            assert_eq!(error.gain, Gain::Position);
            let law = ControlLaw::Torque {
                stiffness: 1.0,
                damping: 1.0,
                inertia: value,
                viscous_friction: 0.0,
                coulomb_friction: 0.0,
            };
            assert_eq!(law.validate().unwrap_err().gain, Gain::Inertia);
        }
        assert_eq!(ControlLaw::Velocity { position_gain: 0.0 }.validate(), Ok(()));
        assert_eq!(ControlLaw::Position.validate(), Ok(()));
    }

    #[test]
    fn an_idle_axis_is_commanded_to_stay_where_it_is() {
        for law in [ControlLaw::Position, ControlLaw::Interpolated, ControlLaw::ProfilePosition] {
            assert_eq!(law.idle(1234), 1234);
        }
        for law in [ControlLaw::Velocity { position_gain: 1.0 }, ControlLaw::ProfileTorque] {
            assert_eq!(law.idle(1234), 0);
        }
    }
}
