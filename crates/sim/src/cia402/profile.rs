//! What the objects of one axis say about its motion, in position units: limits, ramps, periods.

use crate::motion::MotionLimits;
use crate::object_dictionary::SimulatedDictionary;

use super::device::Ramp;
use super::places::Places;
use super::units::Units;

/// The time in which the axis reaches its highest velocity, where the data sheet has no acceleration, or it is 0.
const USUAL_RAMP_S: f64 = 0.1;
/// The time in which it stops from its highest velocity as fast as current and voltage allow.
const STEEP_RAMP_S: f64 = 0.03;

/// The objects of one axis with their units.
#[derive(Clone, Copy, Debug)]
pub struct Profile<'a> {
    /// Where its objects stand.
    pub places: &'a Places,
    /// Their units.
    pub units: &'a Units,
    /// Their values.
    pub dictionary: &'a SimulatedDictionary,
    /// The highest velocity of the motor: position units/s.
    pub highest_velocity: f64,
    /// True if the SYNC period comes before 60C2.
    pub interpolates_over_sync: bool,
}

impl Profile<'_> {
    /// A number; 0 for an object that the data sheet lacks.
    pub fn real(&self, place: Option<usize>) -> f64 {
        self.dictionary.real_at(place).unwrap_or(0.0)
    }

    /// A positive number, if the object is there and not 0.
    fn positive(&self, place: Option<usize>) -> Option<f64> {
        self.dictionary.real_at(place).filter(|value| *value > 0.0)
    }

    /// The velocity that no mode exceeds: objects 607F and 6080, and the motor.
    pub fn velocity_limit(&self) -> f64 {
        let profile = self.positive(self.places.max_profile_velocity);
        let motor = self.positive(self.places.max_motor_speed);
        let profile = profile.map_or(f64::INFINITY, |limit| limit * self.units.profile_velocity);
        let motor = motor.map_or(f64::INFINITY, |limit| limit * self.units.motor_speed);
        self.highest_velocity.min(profile).min(motor)
    }

    /// Object 6081. Without it, the limit.
    pub fn profile_velocity(&self) -> f64 {
        match self.dictionary.real_at(self.places.profile_velocity) {
            Some(velocity) => (velocity * self.units.profile_velocity).min(self.velocity_limit()),
            None => self.velocity_limit(),
        }
    }

    /// Object 6083 within 60C5.
    pub fn acceleration(&self) -> f64 {
        self.ramp(self.places.profile_acceleration, self.places.max_acceleration)
    }

    /// Object 6084 within 60C6.
    pub fn deceleration(&self) -> f64 {
        match self.places.profile_deceleration {
            Some(_) => self.ramp(self.places.profile_deceleration, self.places.max_deceleration),
            None => self.acceleration(),
        }
    }

    /// Object 609A.
    pub fn homing_acceleration(&self) -> f64 {
        self.ramp(self.places.homing_acceleration, None)
    }

    fn ramp(&self, place: Option<usize>, most: Option<usize>) -> f64 {
        let usual = self.highest_velocity / USUAL_RAMP_S;
        let value = self.positive(place).map_or(usual, |value| value * self.units.acceleration);
        let most = self.positive(most).map_or(f64::INFINITY, |most| most * self.units.acceleration);
        value.min(most)
    }

    /// The deceleration of a ramp.
    pub fn deceleration_of(&self, ramp: Ramp) -> f64 {
        match ramp {
            Ramp::SlowDown => self.deceleration(),
            Ramp::QuickStop if self.positive(self.places.quick_stop_deceleration).is_some() => {
                self.ramp(self.places.quick_stop_deceleration, self.places.max_deceleration)
            }
            Ramp::QuickStop | Ramp::AtLimit => self.highest_velocity / STEEP_RAMP_S,
        }
    }

    /// Object 605D: the ramp of a halt.
    pub fn halt_ramp(&self) -> Ramp {
        match self.dictionary.number_at(self.places.halt_option).unwrap_or(1) {
            2 => Ramp::QuickStop,
            3 | 4 => Ramp::AtLimit,
            _ => Ramp::SlowDown,
        }
    }

    /// The velocity limit, and object 607D; software limits that leave no room are off.
    pub fn limits(&self) -> MotionLimits {
        let low = self.dictionary.real_at(self.places.software_limit_low);
        let high = self.dictionary.real_at(self.places.software_limit_high);
        let positions = match (low, high) {
            (Some(low), Some(high)) if low < high => (low, high),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        };
        MotionLimits { velocity: self.velocity_limit(), positions }
    }

    /// The period over which the cyclic modes interpolate: 60C2, otherwise the SYNC period 1006, otherwise 1 ms;
    /// with a quirk, 1006 before 60C2.
    pub fn interpolation_period_s(&self) -> f64 {
        let exponent =
            self.dictionary.number_at(self.places.interpolation_exponent).unwrap_or(-3).clamp(-6, 0);
        let by_object = self.positive(self.places.interpolation_period);
        let by_object = by_object.map(|period| period * 10f64.powi(exponent as i32));
        let by_sync = || self.positive(self.dictionary.place(0x1006, 0)).map(|period_us| period_us * 1e-6);
        let period_s = match self.interpolates_over_sync {
            true => by_sync().or(by_object),
            false => by_object.or_else(by_sync),
        };
        period_s.unwrap_or(1e-3)
    }

    /// Object 6065; `None` when it is absent or all ones, which means no window.
    pub fn following_error_window(&self) -> Option<f64> {
        let window = self.dictionary.number_at(self.places.following_error_window)?;
        (window >= 0 && window < i64::from(u32::MAX)).then_some(window as f64)
    }

    /// A time in milliseconds: s.
    pub fn milliseconds(&self, place: Option<usize>) -> f64 {
        1e-3 * self.real(place)
    }
}
