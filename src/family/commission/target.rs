//! The target drive of commissioning: node ID, family, units and limits of its axis.

use std::f64::consts::TAU;

use takt_rt::{Nanoseconds, OperationMode, Scale, ScaleError, ScaleParameters};
use takt_wire::canopen::object::{DataType, Object, ObjectAddress};

use super::failure::Failure;
use crate::config::{Axis, DriveFamily, Limits, Quantity, Travel};
use crate::family::{self, DataSheet, Family, is_rounded};
use crate::words::Words;

/// A value as the user wrote it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CommandValue {
    /// A joint value in SI units.
    Joint(f64),
    /// A drive value in drive units.
    Drive(i64),
}

/// The target drive and its axis.
#[derive(Clone, Debug)]
pub struct TargetDrive {
    /// The name for people.
    pub name: String,
    /// The node ID.
    pub node: u8,
    /// The drive, by its family.
    pub drive: DriveFamily,
    /// Rotary or linear.
    pub travel: Travel,
    /// Counts per turn of the reported position.
    pub counts_per_turn: f64,
    /// Conversion between joint and drive units.
    pub scale: Scale,
    /// The rated torque in N·m (N) by the configuration, if it says one.
    pub rated_torque: Option<f64>,
    /// The axis of the configuration, if there is one.
    pub axis: Option<Box<Axis>>,
    /// The limits of the axis, if known.
    pub limits: Option<Limits>,
    /// How long to wait for the first answer.
    pub patience_ns: Nanoseconds,
}

/// How long a drive may take to answer when its boot time is not known.
const PATIENCE_NS: Nanoseconds = 1_000_000_000;

impl TargetDrive {
    /// The drive of a configured axis.
    ///
    /// # Errors
    /// The units cannot be converted. A checked configuration always has valid units.
    pub fn of(axis: &Axis) -> Result<Self, ScaleError> {
        Ok(Self {
            name: axis.name.clone(),
            node: axis.node,
            drive: axis.drive.clone(),
            travel: axis.travel,
            counts_per_turn: axis.counts_per_turn,
            scale: axis.scale()?,
            rated_torque: axis.joint.rated_torque,
            axis: Some(Box::new(axis.clone())),
            limits: Some(axis.limits),
            patience_ns: PATIENCE_NS.saturating_add(axis.power_up_ns),
        })
    }

    /// A drive without a configuration: only its family is known, the axis is its encoder, and there are no limits.
    ///
    /// # Errors
    /// None in practice: the family's own units are valid.
    pub fn unconfigured(node: u8, drive: DriveFamily) -> Result<Self, ScaleError> {
        let counts_per_turn = drive.counts_per_turn.unwrap_or(1.0);
        let velocity_units_per_turn = drive.velocity_units_per_turn(counts_per_turn);
        Ok(Self {
            name: format!("node {node}"),
            node,
            drive,
            travel: Travel::Rotary,
            counts_per_turn,
            scale: Scale::new(ScaleParameters {
                counts_per_turn,
                velocity_units_per_turn,
                gear_ratio: 1.0,
                travel_per_turn: TAU,
                reversed: false,
                zero_counts: 0.0,
                rated_torque: 1.0,
            })?,
            rated_torque: None,
            axis: None,
            limits: None,
            patience_ns: PATIENCE_NS,
        })
    }

    /// What takt knows of its family.
    pub fn family(&self) -> &'static dyn Family {
        family::of(&self.drive)
    }

    /// Returns `true` if its counts mean a position: by a configuration, or by what its family says of its encoder.
    pub fn has_units(&self) -> bool {
        self.limits.is_some() || self.drive.counts_per_turn.is_some()
    }

    fn data_sheet(&self) -> Option<&dyn DataSheet> {
        self.family().data_sheet(&self.drive)
    }

    /// Returns `true` if the drive has an object, as far as its data sheet tells.
    pub fn has(&self, address: ObjectAddress) -> bool {
        self.data_sheet().is_none_or(|sheet| sheet.has(address))
    }

    /// The type that the data sheet of the drive gives an object.
    pub(in crate::family) fn data_type(&self, address: ObjectAddress) -> Option<DataType> {
        self.data_sheet()?.data_type(address)
    }

    /// The object with the temperature of the drive in °C, if it is known.
    pub(super) fn temperature(&self) -> Option<Object> {
        self.data_sheet()?.temperature()
    }

    /// The name that the data sheet of the drive gives an object.
    pub(super) fn name_by_sheet(&self, address: ObjectAddress) -> Option<&str> {
        self.data_sheet()?.name(address)
    }

    /// Returns `true` if the drive lets an object be written, as far as its data sheet tells.
    pub fn is_writable(&self, address: ObjectAddress) -> bool {
        self.data_sheet().is_none_or(|sheet| sheet.is_writable(address))
    }

    /// Returns `true` if the drive has a mode that its object 6502 may leave out.
    pub(super) fn adds_mode(&self, mode: OperationMode) -> bool {
        self.data_sheet().is_some_and(|sheet| sheet.adds_mode(mode))
    }

    /// Returns `true` if the drive is known to have no inputs for the switches of homing.
    pub(super) fn lacks_switches(&self) -> bool {
        self.data_sheet().is_some_and(DataSheet::lacks_switches)
    }

    /// How long the drive takes to store its parameters, if it is known.
    pub(super) fn storing_ns(&self) -> Option<Nanoseconds> {
        self.data_sheet()?.storing_ns()
    }

    /// An error code of the drive in words.
    pub fn error_words(&self, code: u16) -> Words {
        family::drive_error_words(&self.drive, code)
    }

    /// What clears an error of the drive, and its cause.
    pub fn error_cure(&self, code: u16) -> &'static str {
        family::drive_error_cure(&self.drive, code)
    }

    /// The quantity of a position: an angle or a length.
    pub const fn position_quantity(&self) -> Quantity {
        match self.travel {
            Travel::Rotary => Quantity::ANGLE,
            Travel::Linear { .. } => Quantity::LENGTH,
        }
    }

    /// The quantity of a velocity.
    pub const fn velocity_quantity(&self) -> Quantity {
        match self.travel {
            Travel::Rotary => Quantity::ANGULAR_VELOCITY,
            Travel::Linear { .. } => Quantity::VELOCITY,
        }
    }

    /// The quantity of an acceleration.
    pub const fn acceleration_quantity(&self) -> Quantity {
        match self.travel {
            Travel::Rotary => Quantity::ANGULAR_ACCELERATION,
            Travel::Linear { .. } => Quantity::ACCELERATION,
        }
    }

    /// The quantity of an effort: a torque or a force.
    pub const fn effort_quantity(&self) -> Quantity {
        match self.travel {
            Travel::Rotary => Quantity::TORQUE,
            Travel::Linear { .. } => Quantity::FORCE,
        }
    }

    /// Position in rad (m) from counts.
    pub fn position(&self, counts: i64) -> f64 {
        self.scale.position_from_counts(clamped(counts))
    }

    /// Velocity in rad/s (m/s) from drive units.
    pub fn velocity(&self, raw: f64) -> f64 {
        raw * self.scale.velocity_from_drive(1)
    }

    /// Acceleration in rad/s² (m/s²) from drive units.
    pub fn acceleration(&self, raw: f64) -> f64 {
        self.velocity(raw / self.drive.acceleration_units_per_velocity_unit(self.counts_per_turn)).abs()
    }

    /// A velocity in the unit of profile velocities (6081) from the unit of target velocities (60FF).
    pub(crate) fn profile_velocity_raw(&self, velocity_raw: i64) -> i64 {
        let units = self.drive.profile_velocity_units_per_velocity_unit(self.counts_per_turn);
        away_from_zero(velocity_raw as f64 * units)
    }

    /// A velocity in the unit of target velocities (60FF) from the unit of profile velocities (6081).
    pub(crate) fn velocity_raw_of_profile(&self, profile_raw: i64) -> i64 {
        let units = self.drive.profile_velocity_units_per_velocity_unit(self.counts_per_turn);
        away_from_zero(profile_raw as f64 / units)
    }

    /// Within these counts a position counts as the same one: a degree of the joint, or of the drive's turn where the axis is
    /// linear.
    pub(crate) fn near_counts(&self) -> i64 {
        let degree = match self.travel {
            Travel::Rotary => self.scale.resolution() * 1_f64.to_radians(),
            Travel::Linear { .. } => self.counts_per_turn / 360.0,
        };
        (degree.abs() as i64).max(1)
    }

    /// Position in counts.
    pub fn position_counts(&self, position: CommandValue) -> i64 {
        match position {
            CommandValue::Joint(position) => self.scale.position_to_counts(position).into(),
            CommandValue::Drive(counts) => counts,
        }
    }

    /// Distance in counts, signed in the drive's direction.
    pub fn distance_counts(&self, distance: CommandValue) -> i64 {
        match distance {
            CommandValue::Joint(distance) => {
                let counts = |position| i64::from(self.scale.position_to_counts(position));
                counts(distance) - counts(0.0)
            }
            CommandValue::Drive(counts) => counts,
        }
    }

    /// Velocity in drive units, signed in the drive's direction. A velocity other than zero is never rounded to zero.
    pub fn velocity_raw(&self, velocity: CommandValue) -> i64 {
        match velocity {
            CommandValue::Joint(velocity) => away_from_zero(velocity / self.scale.velocity_from_drive(1)),
            CommandValue::Drive(raw) => raw,
        }
    }

    /// A remark where the drive cannot have this velocity exactly: it takes whole numbers.
    pub fn rounding(&self, velocity: CommandValue) -> Option<String> {
        let CommandValue::Joint(commanded) = velocity else { return None };
        let rounded = self.velocity(self.velocity_raw(velocity) as f64);
        let shown = |velocity| self.velocity_quantity().show(velocity);
        is_rounded(commanded, rounded).then(|| {
            format!(
                "the drive takes whole numbers only: {} becomes {}, {} in its unit",
                shown(commanded),
                shown(rounded),
                self.velocity_raw(velocity)
            )
        })
    }

    /// Acceleration in drive units, at least 1.
    pub fn acceleration_raw(&self, acceleration: CommandValue) -> i64 {
        let raw = match acceleration {
            CommandValue::Joint(acceleration) => away_from_zero(acceleration / self.acceleration(1.0)),
            CommandValue::Drive(raw) => raw,
        };
        raw.abs().max(1)
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
    fn an_erob_counts_output_turns_and_a_yz_aim_motor_turns() {
        let erob = TargetDrive::unconfigured(1, family::EROB_CANOPEN).unwrap();
        assert_eq!(erob.position_counts(CommandValue::Joint(TAU)), 524_288);
        assert_eq!(erob.velocity_raw(CommandValue::Joint(TAU)), 524_288);
        let yz_aim = TargetDrive::unconfigured(1, family::YZ_AIM).unwrap();
        assert_eq!(yz_aim.position_counts(CommandValue::Joint(TAU)), 32_768);
        assert_eq!(yz_aim.velocity_raw(CommandValue::Joint(TAU)), 60);
        assert_eq!(yz_aim.acceleration_raw(CommandValue::Joint(TAU)), 60);
        assert!((yz_aim.velocity(60.0) - TAU).abs() < 1e-12);
    }

    #[test]
    fn a_slow_velocity_is_not_rounded_to_standstill() {
        let yz_aim = TargetDrive::unconfigured(1, family::YZ_AIM).unwrap();
        assert_eq!(yz_aim.velocity_raw(CommandValue::Joint(-0.001)), -1);
        assert_eq!(yz_aim.velocity_raw(CommandValue::Joint(0.0)), 0);
    }

    #[test]
    fn a_velocity_that_a_drive_rounds_is_remarked_with_both_values() {
        let yz_aim = TargetDrive::unconfigured(1, family::YZ_AIM).unwrap();
        let remark = yz_aim.rounding(CommandValue::Joint(20_f64.to_radians())).unwrap();
        assert!(
            remark.contains("(20 deg/s) becomes") && remark.contains("(18 deg/s), 3 in its unit"),
            "{remark}"
        );
        assert_eq!(yz_aim.rounding(CommandValue::Joint(18_f64.to_radians())), None);
        assert_eq!(yz_aim.rounding(CommandValue::Joint(0.0)), None);
        assert_eq!(yz_aim.rounding(CommandValue::Drive(3)), None);
        let erob = TargetDrive::unconfigured(1, family::EROB_CANOPEN).unwrap();
        assert_eq!(erob.rounding(CommandValue::Joint(20_f64.to_radians())), None);
    }
}
