//! The units of the drive's objects, by objects 608F, 6091, 6092, 6096 and 60A9 as far as the data sheet has them, and by
//! its quirks.

use takt_wire::quirks::{MotionUnit, Quirks};

use crate::object_dictionary::SimulatedDictionary;

use super::places::Places;

/// How many position units one unit of a velocity or an acceleration is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Position units per rad (m); negative when the count decreases with the position.
    pub position: f64,
    /// Target, actual and demanded velocity: position units/s.
    pub velocity: f64,
    /// Profile and homing velocity: position units/s.
    pub profile_velocity: f64,
    /// Accelerations: position units/s².
    pub acceleration: f64,
    /// Object 6080: position units/s. CiA 402: revolutions of the motor per minute.
    pub motor_speed: f64,
}

/// The scale that a drive was commissioned with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommissionedScale {
    /// Position units per rad (m).
    pub counts_per_unit: f64,
    /// Position units for one turn of the motor.
    pub counts_per_turn: f64,
    /// What [`units_per_turn`] said when it was commissioned.
    pub by_objects: Option<f64>,
}

/// Position units for one turn of the motor, by objects 608F, 6091 and 6092, when the data sheet has 608F or 6092.
pub fn units_per_turn(dictionary: &SimulatedDictionary, places: &Places) -> Option<f64> {
    let ratio = |above, below| {
        let above = dictionary.real_at(above)?;
        let below = dictionary.real_at(below).filter(|below| *below > 0.0).unwrap_or(1.0);
        (above > 0.0).then_some(above / below)
    };
    let gear = ratio(places.gear_motor, places.gear_shaft).unwrap_or(1.0);
    match ratio(places.feed, places.feed_shaft) {
        Some(feed) => Some(feed / gear),
        None => ratio(places.encoder_increments, places.encoder_revolutions),
    }
}

impl Units {
    /// The units now. A new value of 608F, 6091 or 6092 changes the position unit in proportion.
    pub fn of(
        dictionary: &SimulatedDictionary,
        places: &Places,
        quirks: &Quirks,
        scale: CommissionedScale,
    ) -> Self {
        let change = match (units_per_turn(dictionary, places), scale.by_objects) {
            (Some(now), Some(then)) if then > 0.0 => now / then,
            _ => 1.0,
        };
        let per_turn = (scale.counts_per_turn * change).abs();
        let in_units = |unit| match unit {
            MotionUnit::PositionUnits(factor) => factor,
            MotionUnit::RevolutionsPerMinute(factor) => factor * per_turn / 60.0,
        };
        let quirk = |index| quirks.unit(index).map(in_units);
        let by_objects = si_velocity(dictionary.number_at(places.velocity_unit), per_turn)
            .or_else(|| velocity_factor(dictionary, places));
        let velocity = quirk(0x60FF).or(quirk(0x606C)).or(by_objects).unwrap_or(1.0);
        let profile_velocity = quirk(0x6081).unwrap_or(velocity);
        Self {
            position: scale.counts_per_unit * change,
            velocity,
            profile_velocity,
            acceleration: quirk(0x6083).unwrap_or(profile_velocity),
            motor_speed: quirk(0x6080).unwrap_or(per_turn / 60.0),
        }
    }
}

/// Object 6096: user velocity = position units/s × numerator / divisor.
fn velocity_factor(dictionary: &SimulatedDictionary, places: &Places) -> Option<f64> {
    let numerator = dictionary.real_at(places.velocity_numerator).filter(|value| *value > 0.0)?;
    let divisor = dictionary.real_at(places.velocity_divisor).filter(|value| *value > 0.0)?;
    Some(divisor / numerator)
}

/// Object 60A9 by CiA 303-2: power of ten, numerator and denominator. Position units/s for one unit.
fn si_velocity(unit: Option<i64>, per_turn: f64) -> Option<f64> {
    let [_, denominator, numerator, prefix] = (unit? as u32).to_le_bytes();
    let way = match numerator {
        0xB4 => per_turn,
        0xB5 => 1.0,
        0x10 => per_turn / std::f64::consts::TAU,
        0x41 => per_turn / 360.0,
        _ => return None,
    };
    let time_s = match denominator {
        0x03 => 1.0,
        0x47 => 60.0,
        _ => return None,
    };
    Some(10f64.powi((prefix as i8).into()) * way / time_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_of_the_velocity_objects_is_read_as_cia_303_2_says() {
        assert_eq!(si_velocity(Some(0x00B4_4700), 6000.0), Some(100.0)); // r/min
        assert_eq!(si_velocity(Some(0xFDB4_4700), 6000.0), Some(0.1)); // 10⁻³ r/min
        assert_eq!(si_velocity(Some(0x00B5_0300), 6000.0), Some(1.0)); // increments per second
        assert_eq!(si_velocity(Some(0x0001_0300), 6000.0), None); // metres per second of a turn: not known
        assert_eq!(si_velocity(None, 6000.0), None);
    }
}
