//! Distances and times of an axis in the units of its drive.

use takt_rt::Nanoseconds;

use crate::config::Axis;

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

/// An acceleration in the drive's units (6083).
pub fn acceleration_units(axis: &Axis, acceleration: f64) -> i64 {
    motion_units(axis, acceleration, axis.drive.acceleration_units_per_velocity_unit(axis.counts_per_turn))
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
