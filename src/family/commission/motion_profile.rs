//! Motion profile of a commissioning move, and the stopping distance before a limit.

use takt_rt::Nanoseconds;

use super::failure::Failure;
use super::target::{CommandValue, TargetDrive};
use crate::procedure::AxisReading;

/// The requested profile in SI or drive units; missing values are [`DEFAULT_SHARE`] of the limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionProfile {
    /// Profile velocity.
    pub velocity: Option<CommandValue>,
    /// Profile acceleration.
    pub acceleration: Option<CommandValue>,
    /// Profile deceleration.
    pub deceleration: Option<CommandValue>,
}

/// Default profile as a share of the axis' limits. It is small, because a drive under commissioning is not known yet.
pub const DEFAULT_SHARE: f64 = 0.1;

/// A profile in drive units. `None` keeps the drive's own value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveProfile {
    /// Velocity, more than zero.
    pub velocity: Option<i64>,
    /// Acceleration.
    pub acceleration: Option<i64>,
    /// Deceleration.
    pub deceleration: Option<i64>,
}

/// Reaction time to a reading: the polling interval and the SDO transfers.
const REACTION_S: f64 = 0.05;

impl TargetDrive {
    /// Converts a motion profile to drive units and checks it.
    ///
    /// # Errors
    /// [`Failure::OutsideLimits`], [`Failure::Unsuitable`]
    pub fn drive_profile(&self, profile: &MotionProfile) -> Result<DriveProfile, Failure> {
        let limits = self.limits;
        let gentle = |limit: Option<f64>| limit.map(|limit| CommandValue::Joint(DEFAULT_SHARE * limit));
        let velocity = profile.velocity.or(gentle(limits.map(|limits| limits.velocity)));
        let velocity = velocity.map(|velocity| self.velocity_raw(velocity));
        if velocity.is_some_and(|velocity| velocity == 0) {
            return Err(Failure::Unsuitable("a move needs a velocity other than zero".to_owned()));
        }
        let acceleration = profile.acceleration.or(gentle(limits.map(|limits| limits.acceleration)));
        let deceleration = profile.deceleration.or(gentle(limits.map(|limits| limits.deceleration)));
        let profile = DriveProfile {
            velocity: velocity.map(i64::abs),
            acceleration: acceleration.map(|acceleration| self.acceleration_raw(acceleration)),
            deceleration: deceleration.map(|deceleration| self.acceleration_raw(deceleration)),
        };
        profile.velocity.map_or(Ok(()), |velocity| self.check_velocity(velocity))?;
        profile.acceleration.map_or(Ok(()), |raw| self.check_acceleration(raw, false))?;
        profile.deceleration.map_or(Ok(()), |raw| self.check_acceleration(raw, true))?;
        Ok(profile)
    }

    /// The deceleration limit in drive units, used for stops.
    pub fn stopping_deceleration(&self) -> Option<i64> {
        self.limits.map(|limits| self.acceleration_raw(CommandValue::Joint(limits.deceleration)))
    }

    /// Checks that the axis can still stop before a position limit. The deceleration is in drive units; `None` is that
    /// of the limits.
    ///
    /// # Errors
    /// [`Failure::AtLimit`]
    pub fn check_stopping_distance(
        &self,
        reading: &AxisReading,
        deceleration: Option<i64>,
    ) -> Result<(), Failure> {
        let Some(limits) = self.limits else { return Ok(()) };
        let deceleration = deceleration.map_or(limits.deceleration, |raw| self.acceleration(raw as f64));
        let speed = reading.velocity.abs();
        let way = speed * speed / (2.0 * deceleration) + speed * REACTION_S;
        let rest = reading.position + way.copysign(reading.velocity);
        let is_leaving = (rest > limits.position_max && reading.velocity > 0.0)
            || (rest < limits.position_min && reading.velocity < 0.0);
        if !is_leaving {
            return Ok(());
        }
        let (low, high) = (limits.position_min, limits.position_max);
        Err(Failure::AtLimit { quantity: self.position_quantity(), value: reading.position, low, high })
    }

    /// Checks that a resting axis may move in the direction of `velocity` (drive units). At a limit it may only move
    /// away.
    ///
    /// # Errors
    /// [`Failure::AtLimit`]
    pub fn check_direction(&self, counts: i64, velocity: i64) -> Result<(), Failure> {
        let hardly = self.velocity(velocity as f64).signum() * f64::MIN_POSITIVE;
        let reading =
            AxisReading { position: self.position(counts), velocity: hardly, ..AxisReading::default() };
        self.check_stopping_distance(&reading, None)
    }

    /// Timeout of a move: 1.5 times its profile plus 5 s for the drive.
    pub(crate) fn longest_ns(&self, distance: i64, velocity: i64, acceleration: i64) -> Nanoseconds {
        let (velocity, acceleration) =
            (self.velocity(velocity as f64).abs(), self.acceleration(acceleration as f64));
        let distance = distance as f64 / self.scale.resolution();
        let profile_s = distance.abs() / velocity + velocity / acceleration;
        let longest_s = 1.5 * profile_s + 5.0;
        // A profile that never ends gets a timeout of an hour.
        (longest_s.min(3600.0) * 1e9) as Nanoseconds
    }

    /// Timeout of a stop: the ramp from `velocity` (drive units) plus 2 s.
    pub(crate) fn stopping_ns(&self, velocity: i64, deceleration: i64) -> Nanoseconds {
        let stopping_s = self.velocity(velocity as f64).abs() / self.acceleration(deceleration as f64);
        (stopping_s.min(60.0) * 1e9) as Nanoseconds + 2_000_000_000
    }
}
