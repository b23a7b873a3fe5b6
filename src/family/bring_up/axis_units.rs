//! Distances and times of an axis in the units of its drive.

use takt_rt::Nanoseconds;

use crate::config::quantities::{Counting, Quantities};
use crate::config::quantity::Quantity;
use crate::config::{Axis, Travel};

/// The unit of a number of a drive, for people: its size in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SiUnit {
    quantity: &'static Quantity,
    /// rad, m or their rates for one unit.
    size: f64,
    /// The number of zero.
    zero: f64,
}

impl SiUnit {
    /// Counts of the position of an axis.
    pub fn position(axis: &Axis) -> Self {
        let counting = Counting::of(axis);
        let direction = if axis.reversed { -1.0 } else { 1.0 };
        let quantity = &quantities(axis).position;
        Self { quantity, size: direction / counting.counts_per_unit(), zero: axis.zero_counts.into() }
    }

    /// The drive's units of profile velocities (6081).
    pub fn profile_velocity(axis: &Axis) -> Self {
        let per_velocity_unit = axis.drive.profile_velocity_units_per_velocity_unit(axis.counts_per_turn);
        Self::rate(axis, &quantities(axis).velocity, per_velocity_unit)
    }

    /// The drive's units of the speed of its motor (6080).
    pub fn motor_speed(axis: &Axis) -> Self {
        let per_velocity_unit = axis.drive.motor_speed_units_per_velocity_unit(axis.counts_per_turn);
        Self::rate(axis, &quantities(axis).velocity, per_velocity_unit)
    }

    /// The drive's units of accelerations (6083).
    pub fn acceleration(axis: &Axis) -> Self {
        let per_velocity_unit = axis.drive.acceleration_units_per_velocity_unit(axis.counts_per_turn);
        Self::rate(axis, &quantities(axis).acceleration, per_velocity_unit)
    }

    /// The drive's units of jerks (60A4): those of accelerations in a second.
    pub fn jerk(axis: &Axis) -> Self {
        Self { quantity: &quantities(axis).jerk, ..Self::acceleration(axis) }
    }

    fn rate(axis: &Axis, quantity: &'static Quantity, per_velocity_unit: f64) -> Self {
        let per_turn = axis.drive.velocity_units_per_turn(axis.counts_per_turn) * per_velocity_unit;
        Self { quantity, size: 1.0 / (turns(axis, 1.0) * per_turn), zero: 0.0 }
    }

    /// The number with its meaning: `1000 = 0.5 rad/s²`.
    pub fn show(self, number: i64) -> String {
        let value = (number as f64 - self.zero) * self.size;
        format!("{number} = {}", self.quantity.show(value))
    }
}

const fn quantities(axis: &Axis) -> &'static Quantities {
    match axis.travel {
        Travel::Rotary => &Quantities::ROTARY,
        Travel::Linear { .. } => &Quantities::LINEAR,
    }
}

/// Turns of the drive's encoder for a distance (rad, m), or turns per second for a velocity.
pub fn turns(axis: &Axis, distance: f64) -> f64 {
    (distance / axis.travel.per_turn() * axis.gear_ratio).abs()
}

/// Counts for a distance (rad, m), a velocity or an acceleration: at least 1, at most the range of 32 bits.
pub fn counts(axis: &Axis, distance: f64) -> i64 {
    (turns(axis, distance) * axis.counts_per_turn).round().clamp(1.0, u32::MAX.into()) as i64
}

/// A velocity in the drive's units of velocities (60FF).
pub fn velocity_units(axis: &Axis, velocity: f64) -> i64 {
    motion_units(axis, velocity, 1.0)
}

/// A velocity in the drive's units of profile velocities (6081).
pub fn profile_velocity_units(axis: &Axis, velocity: f64) -> i64 {
    motion_units(axis, velocity, axis.drive.profile_velocity_units_per_velocity_unit(axis.counts_per_turn))
}

/// A velocity in the drive's units of the speed of its motor (6080).
pub fn motor_speed_units(axis: &Axis, velocity: f64) -> i64 {
    motion_units(axis, velocity, axis.drive.motor_speed_units_per_velocity_unit(axis.counts_per_turn))
}

/// An acceleration in the drive's units (6083).
pub fn acceleration_units(axis: &Axis, acceleration: f64) -> i64 {
    motion_units(axis, acceleration, axis.drive.acceleration_units_per_velocity_unit(axis.counts_per_turn))
}

/// A jerk in the drive's units (60A4): those of accelerations in a second.
pub fn jerk_units(axis: &Axis, jerk: f64) -> i64 {
    acceleration_units(axis, jerk)
}

/// The count of a position, not rounded.
pub fn position_counts(axis: &Axis, position: f64) -> f64 {
    Counting::of(axis).position(position)
}

/// A velocity or an acceleration in units, of which so many are one unit of velocity (in a second): at least 1.
fn motion_units(axis: &Axis, value: f64, per_velocity_unit: f64) -> i64 {
    let per_count = axis.drive.velocity_units_per_turn(axis.counts_per_turn) / axis.counts_per_turn;
    ((counts(axis, value) as f64 * per_count * per_velocity_unit).round() as i64).max(1)
}

/// A time in this unit, rounded up.
pub fn rounded_up(ns: Nanoseconds, unit_ns: Nanoseconds) -> i64 {
    i64::try_from(ns.div_ceil(unit_ns)).unwrap_or(i64::MAX)
}

/// The period in the form of object 60C2: `mantissa · 10^exponent` seconds with a mantissa of one byte, if possible in
/// whole milliseconds. `None` if there is no such form: the drive then keeps its value.
pub fn interpolation_time(period_ns: Nanoseconds) -> Option<(i64, i64)> {
    let (mut mantissa, mut exponent) = (period_ns, -9);
    while mantissa % 10 == 0 && exponent < -3 {
        mantissa /= 10;
        exponent += 1;
    }
    Some((u8::try_from(mantissa).ok()?.into(), exponent))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_periods_have_a_mantissa_of_one_byte_and_a_power_of_ten() {
        assert_eq!(interpolation_time(1_000_000), Some((1, -3)));
        assert_eq!(interpolation_time(2_000_000), Some((2, -3)));
        assert_eq!(interpolation_time(20_000_000), Some((20, -3)));
        assert_eq!(interpolation_time(500_000), Some((5, -4)));
        assert_eq!(interpolation_time(1_250_000), Some((125, -5)));
        assert_eq!(interpolation_time(1_234_567), None);
    }
}
