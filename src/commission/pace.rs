//! How fast a commissioning move is, and how much room is left before a limit.

use takt_rt::Nanoseconds;

use super::event::Reading;
use super::failure::Failure;
use super::subject::{Amount, Subject};

/// What was asked for; what was not is [`GENTLE`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pace {
    /// Profile velocity.
    pub velocity: Option<Amount>,
    /// Profile acceleration.
    pub acceleration: Option<Amount>,
    /// Profile deceleration.
    pub deceleration: Option<Amount>,
}

/// The part of the axis' limits that a move takes when nothing else is asked for: a drive that is commissioned is not
/// known yet.
pub const GENTLE: f64 = 0.1;

/// A profile in the drive's units. `None` leaves what the drive has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// Velocity, more than zero.
    pub velocity: Option<i64>,
    /// Acceleration.
    pub acceleration: Option<i64>,
    /// Deceleration.
    pub deceleration: Option<i64>,
}

/// How long a look at the axis and the answer to it may take.
const REACTION_S: f64 = 0.05;

impl Subject {
    /// The profile of a pace.
    ///
    /// # Errors
    /// [`Failure::OutsideLimits`], [`Failure::Unsuitable`]
    pub fn profile(&self, pace: &Pace) -> Result<Profile, Failure> {
        let limits = self.limits;
        let gentle = |limit: Option<f64>| limit.map(|limit| Amount::Joint(GENTLE * limit));
        let velocity = pace.velocity.or(gentle(limits.map(|limits| limits.velocity)));
        let velocity = velocity.map(|velocity| self.velocity_raw(velocity));
        if velocity.is_some_and(|velocity| velocity == 0) {
            return Err(Failure::Unsuitable("a move needs a velocity other than zero".to_owned()));
        }
        let acceleration = pace.acceleration.or(gentle(limits.map(|limits| limits.acceleration)));
        let deceleration = pace.deceleration.or(gentle(limits.map(|limits| limits.deceleration)));
        let profile = Profile {
            velocity: velocity.map(i64::abs),
            acceleration: acceleration.map(|acceleration| self.acceleration_raw(acceleration)),
            deceleration: deceleration.map(|deceleration| self.acceleration_raw(deceleration)),
        };
        profile.velocity.map_or(Ok(()), |velocity| self.check_velocity(velocity))?;
        profile.acceleration.map_or(Ok(()), |raw| self.check_acceleration(raw, false))?;
        profile.deceleration.map_or(Ok(()), |raw| self.check_acceleration(raw, true))?;
        Ok(profile)
    }

    /// The deceleration of a stop that cannot wait, in drive units: that of the limits.
    pub fn stopping_deceleration(&self) -> Option<i64> {
        self.limits.map(|limits| self.acceleration_raw(Amount::Joint(limits.deceleration)))
    }

    /// Checks that the axis can still be stopped within its limits, by a deceleration in drive units, or by that of the
    /// limits.
    ///
    /// # Errors
    /// [`Failure::AtLimit`]
    pub fn check_room(&self, reading: &Reading, deceleration: Option<i64>) -> Result<(), Failure> {
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

    /// Checks that an axis that rests at `counts` may go in the direction of a velocity in drive units: at a limit, only
    /// away from it.
    ///
    /// # Errors
    /// [`Failure::AtLimit`]
    pub fn check_way(&self, counts: i64, velocity: i64) -> Result<(), Failure> {
        let hardly = self.velocity(velocity as f64).signum() * f64::MIN_POSITIVE;
        let reading = Reading { position: self.position(counts), velocity: hardly, ..Reading::default() };
        self.check_room(&reading, None)
    }

    /// How long a move may take at most: half as long again as its profile, and then some for the drive.
    pub(super) fn longest_ns(&self, distance: i64, velocity: i64, acceleration: i64) -> Nanoseconds {
        let (velocity, acceleration) =
            (self.velocity(velocity as f64).abs(), self.acceleration(acceleration as f64));
        let distance = distance as f64 / self.scale.resolution();
        let profile_s = distance.abs() / velocity + velocity / acceleration;
        let longest_s = 1.5 * profile_s + 5.0;
        // A profile that never ends is given an hour.
        (longest_s.min(3600.0) * 1e9) as Nanoseconds
    }

    /// How long it takes to come to rest from a velocity in drive units, and then some.
    pub(super) fn stopping_ns(&self, velocity: i64, deceleration: i64) -> Nanoseconds {
        let stopping_s = self.velocity(velocity as f64).abs() / self.acceleration(deceleration as f64);
        (stopping_s.min(60.0) * 1e9) as Nanoseconds + 2_000_000_000
    }
}
