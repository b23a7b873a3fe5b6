//! The drive that is commissioned: where it is, of which family, how its units relate to those of its joint, and what
//! it may never exceed.

use std::f64::consts::TAU;

use takt_rt::{Nanoseconds, Scale, ScaleError, ScaleParameters};

use super::failure::Failure;
use super::family::Family;
use crate::config::{Axis, Limits, Quantity, Travel};
use crate::controller::assemble;

/// A value as it was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// Of the joint, in SI units.
    Joint(f64),
    /// Of the drive, in its own unit.
    Drive(i64),
}

/// One drive, and the joint that it moves.
#[derive(Clone, Debug)]
pub struct Subject {
    /// What people call it.
    pub name: String,
    /// Its node number.
    pub node: u8,
    /// Its family.
    pub family: Family,
    /// Rotary or linear.
    pub travel: Travel,
    /// Counts of one turn of the position that the drive reports.
    pub counts_per_turn: f64,
    /// From the joint's units to the drive's.
    pub scale: Scale,
    /// What the axis may not exceed, where that is known.
    pub limits: Option<Limits>,
    /// For how long to wait for its first answer.
    pub patience_ns: Nanoseconds,
}

/// How long a drive without anything known of its supply may take to answer.
const PATIENCE_NS: Nanoseconds = 1_000_000_000;

impl Subject {
    /// The drive of a configured axis.
    ///
    /// # Errors
    /// Units that cannot be converted; a configuration that passed its checks has none.
    pub fn of(axis: &Axis) -> Result<Self, ScaleError> {
        Ok(Self {
            name: axis.name.clone(),
            node: axis.node,
            family: axis.drive,
            travel: axis.travel,
            counts_per_turn: axis.counts_per_turn,
            scale: assemble::scale(axis)?,
            limits: Some(axis.limits),
            patience_ns: PATIENCE_NS.saturating_add(axis.simulated.power_up_ns),
        })
    }

    /// A drive of which nothing but its family is known: its joint is what its encoder turns with, without limits.
    ///
    /// # Errors
    /// None: the family's own units can be converted.
    pub fn unconfigured(node: u8, family: Family) -> Result<Self, ScaleError> {
        let counts_per_turn = family.counts_per_turn();
        Ok(Self {
            name: format!("node {node}"),
            node,
            family,
            travel: Travel::Rotary,
            counts_per_turn,
            scale: Scale::new(ScaleParameters {
                counts_per_turn,
                velocity_units_per_turn: family.velocity_units_per_turn(counts_per_turn),
                gear_ratio: 1.0,
                travel_per_turn: TAU,
                reversed: false,
                zero_counts: 0.0,
                rated_torque: 1.0,
            })?,
            limits: None,
            patience_ns: PATIENCE_NS,
        })
    }

    /// What a position of this axis is: an angle or a length.
    pub const fn position_quantity(&self) -> Quantity {
        match self.travel {
            Travel::Rotary => Quantity::ANGLE,
            Travel::Linear { .. } => Quantity::LENGTH,
        }
    }

    /// What a velocity of this axis is.
    pub const fn velocity_quantity(&self) -> Quantity {
        match self.travel {
            Travel::Rotary => Quantity::ANGULAR_VELOCITY,
            Travel::Linear { .. } => Quantity::VELOCITY,
        }
    }

    /// What an acceleration of this axis is.
    pub const fn acceleration_quantity(&self) -> Quantity {
        match self.travel {
            Travel::Rotary => Quantity::ANGULAR_ACCELERATION,
            Travel::Linear { .. } => Quantity::ACCELERATION,
        }
    }

    /// What the effort of this axis is: a torque or a force.
    pub const fn effort_quantity(&self) -> Quantity {
        match self.travel {
            Travel::Rotary => Quantity::TORQUE,
            Travel::Linear { .. } => Quantity::FORCE,
        }
    }

    /// rad (m) of a position in counts.
    pub fn position(&self, counts: i64) -> f64 {
        self.scale.position_from_counts(clamped(counts))
    }

    /// rad/s (m/s) of a velocity in drive units.
    pub fn velocity(&self, raw: f64) -> f64 {
        raw * self.scale.velocity_from_drive(1)
    }

    /// rad/s² (m/s²) of an acceleration in drive units.
    pub fn acceleration(&self, raw: f64) -> f64 {
        self.velocity(raw).abs()
    }

    /// Counts of a position.
    pub fn position_counts(&self, position: Amount) -> i64 {
        match position {
            Amount::Joint(position) => self.scale.position_to_counts(position).into(),
            Amount::Drive(counts) => counts,
        }
    }

    /// Counts of a distance, with its sign in the drive's direction.
    pub fn distance_counts(&self, distance: Amount) -> i64 {
        match distance {
            Amount::Joint(distance) => {
                let counts = |position| i64::from(self.scale.position_to_counts(position));
                counts(distance) - counts(0.0)
            }
            Amount::Drive(counts) => counts,
        }
    }

    /// Drive units of a velocity, with its sign in the drive's direction. A velocity that is not zero never becomes
    /// zero by rounding.
    pub fn velocity_raw(&self, velocity: Amount) -> i64 {
        match velocity {
            Amount::Joint(velocity) => away_from_zero(velocity / self.scale.velocity_from_drive(1)),
            Amount::Drive(raw) => raw,
        }
    }

    /// Drive units of an acceleration: at least 1.
    pub fn acceleration_raw(&self, acceleration: Amount) -> i64 {
        self.velocity_raw(acceleration).abs().max(1)
    }

    /// Checks a position in counts against the limits of the axis.
    ///
    /// # Errors
    /// [`Failure::OutsideLimits`], [`Failure::Unsuitable`]
    pub fn check_position(&self, counts: i64) -> Result<(), Failure> {
        if i32::try_from(counts).is_err() {
            return Err(Failure::Unsuitable(format!("{counts} counts do not fit the drive's 32 bits")));
        }
        let Some(limits) = self.limits else { return Ok(()) };
        let (value, slack) = (self.position(counts), 0.5 / self.scale.resolution());
        let (low, high) = (limits.position_min, limits.position_max);
        if (low - slack..=high + slack).contains(&value) {
            return Ok(());
        }
        Err(Failure::OutsideLimits { quantity: self.position_quantity(), value, low, high })
    }

    /// Checks a velocity in drive units against the limits of the axis.
    ///
    /// # Errors
    /// [`Failure::OutsideLimits`]
    pub fn check_velocity(&self, raw: i64) -> Result<(), Failure> {
        let Some(limits) = self.limits else { return Ok(()) };
        let value = self.velocity(raw as f64);
        self.within(self.velocity_quantity(), value, limits.velocity, self.velocity(0.5).abs())
    }

    /// Checks an acceleration in drive units against the limits of the axis.
    ///
    /// # Errors
    /// [`Failure::OutsideLimits`]
    pub fn check_acceleration(&self, raw: i64, is_deceleration: bool) -> Result<(), Failure> {
        let Some(limits) = self.limits else { return Ok(()) };
        let value = self.acceleration(raw as f64);
        let most = if is_deceleration { limits.deceleration } else { limits.acceleration };
        self.within(self.acceleration_quantity(), value, most, self.acceleration(0.5))
    }

    /// Checks a torque (N·m, N) against the limits of the axis.
    ///
    /// # Errors
    /// [`Failure::OutsideLimits`]
    pub fn check_torque(&self, torque: f64) -> Result<(), Failure> {
        let Some(limits) = self.limits else { return Ok(()) };
        self.within(self.effort_quantity(), torque, limits.torque, 1e-9 * limits.torque)
    }

    fn within(&self, quantity: Quantity, value: f64, most: f64, slack: f64) -> Result<(), Failure> {
        if value.abs() <= most + slack {
            return Ok(());
        }
        Err(Failure::OutsideLimits { quantity, value, low: -most, high: most })
    }
}

fn clamped(counts: i64) -> i32 {
    counts.clamp(i32::MIN.into(), i32::MAX.into()) as i32
}

fn away_from_zero(value: f64) -> i64 {
    let nearest = value.round();
    if nearest == 0.0 && value != 0.0 { value.signum() as i64 } else { nearest as i64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_erob_counts_its_output_and_a_yz_aim_its_motor() {
        let erob = Subject::unconfigured(1, Family::ErobCanopen).unwrap();
        assert_eq!(erob.position_counts(Amount::Joint(TAU)), 524_288);
        assert_eq!(erob.velocity_raw(Amount::Joint(TAU)), 524_288);
        let yz_aim = Subject::unconfigured(1, Family::YzAim).unwrap();
        assert_eq!(yz_aim.position_counts(Amount::Joint(TAU)), 32_768);
        assert_eq!(yz_aim.velocity_raw(Amount::Joint(TAU)), 60);
        assert_eq!(yz_aim.acceleration_raw(Amount::Joint(TAU)), 60);
        assert!((yz_aim.velocity(60.0) - TAU).abs() < 1e-12);
    }

    #[test]
    fn a_slow_velocity_is_not_rounded_to_standstill() {
        let yz_aim = Subject::unconfigured(1, Family::YzAim).unwrap();
        assert_eq!(yz_aim.velocity_raw(Amount::Joint(-0.001)), -1);
        assert_eq!(yz_aim.velocity_raw(Amount::Joint(0.0)), 0);
    }
}
