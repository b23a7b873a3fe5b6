//! SI on our side, drive units on the wire.
//!
//! A position becomes counts by one multiplication and one rounding of the absolute value. Rounded steps are never added up,
//! so the error stays within half a count. At a limit a set-point is rounded to the inside.

use crate::guard::AxisLimits;

/// What a drive counts in, against what the joint does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleParameters {
    /// Counts of one turn of the drive's position (the side that it reports).
    pub counts_per_turn: f64,
    /// What the drive calls one turn of its position in a second: [`ScaleParameters::counts_per_turn`] where it counts
    /// velocities in counts per second, 60 where it counts in r/min.
    pub velocity_units_per_turn: f64,
    /// Turns of the drive's position for one turn of the joint; 1 where the drive reports the output side.
    pub gear_ratio: f64,
    /// What the joint moves in one turn: 2π rad, or metres for a linear axis.
    pub travel_per_turn: f64,
    /// True if positive counts are negative travel.
    pub reversed: bool,
    /// The count at which the joint's position is zero.
    pub zero_counts: f64,
    /// The joint torque (N·m, or N for a linear axis) that the drive calls 1000 per mille (object 6076).
    pub rated_torque: f64,
}

/// Compiled conversion between SI and drive units.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Scale {
    counts_per_unit: f64,
    units_per_count: f64,
    drive_velocity_per_velocity: f64,
    velocity_per_drive_velocity: f64,
    zero_counts: f64,
    direction: f64,
    per_mille_per_torque: f64,
    torque_per_per_mille: f64,
}

/// A parameter of a scale that is not a positive, finite number (or, for the zero, not finite), or parameters that do not
/// go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScaleError {
    /// [`ScaleParameters::counts_per_turn`]
    CountsPerTurn,
    /// [`ScaleParameters::velocity_units_per_turn`]
    VelocityUnitsPerTurn,
    /// [`ScaleParameters::gear_ratio`]
    GearRatio,
    /// [`ScaleParameters::travel_per_turn`]
    TravelPerTurn,
    /// [`ScaleParameters::zero_counts`]
    ZeroCounts,
    /// [`ScaleParameters::rated_torque`]
    RatedTorque,
    /// Counts, gear ratio and travel together give a resolution that no number can hold.
    Resolution,
}

impl core::error::Error for ScaleError {}

impl core::fmt::Display for ScaleError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let name = match self {
            Self::CountsPerTurn => "the counts of one turn",
            Self::VelocityUnitsPerTurn => "the velocity units of one turn",
            Self::GearRatio => "the gear ratio",
            Self::TravelPerTurn => "the travel of one turn",
            Self::ZeroCounts => return f.write_str("the zero position in counts must be a finite number"),
            Self::RatedTorque => "the rated torque",
            Self::Resolution => {
                return f.write_str("counts, gear ratio and travel give a resolution beyond all numbers");
            }
        };
        write!(f, "{name} must be a positive, finite number")
    }
}

impl Scale {
    /// Checks and compiles.
    pub fn new(parameters: ScaleParameters) -> Result<Self, ScaleError> {
        let positive =
            |value: f64, error| if value.is_finite() && value > 0.0 { Ok(value) } else { Err(error) };
        let counts = positive(parameters.counts_per_turn, ScaleError::CountsPerTurn)?;
        let velocity_units = positive(parameters.velocity_units_per_turn, ScaleError::VelocityUnitsPerTurn)?;
        let gear = positive(parameters.gear_ratio, ScaleError::GearRatio)?;
        let travel = positive(parameters.travel_per_turn, ScaleError::TravelPerTurn)?;
        if !parameters.zero_counts.is_finite() {
            return Err(ScaleError::ZeroCounts);
        }
        let direction = if parameters.reversed { -1.0 } else { 1.0 };
        let scale = Self {
            counts_per_unit: direction * counts * gear / travel,
            units_per_count: direction * travel / (counts * gear),
            drive_velocity_per_velocity: direction * velocity_units * gear / travel,
            velocity_per_drive_velocity: direction * travel / (velocity_units * gear),
            zero_counts: parameters.zero_counts,
            direction,
            per_mille_per_torque: 0.0,
            torque_per_per_mille: 0.0,
        };
        let is_held = |value: f64| value.is_normal();
        let factors = [
            scale.counts_per_unit,
            scale.units_per_count,
            scale.drive_velocity_per_velocity,
            scale.velocity_per_drive_velocity,
        ];
        if !factors.into_iter().all(is_held) {
            return Err(ScaleError::Resolution);
        }
        scale.with_rated_torque(parameters.rated_torque)
    }

    /// The same scale with the rated torque that the drive has reported.
    pub fn with_rated_torque(self, rated_torque: f64) -> Result<Self, ScaleError> {
        if !(rated_torque.is_finite() && rated_torque > 0.0) {
            return Err(ScaleError::RatedTorque);
        }
        Ok(Self {
            per_mille_per_torque: self.direction * 1000.0 / rated_torque,
            torque_per_per_mille: self.direction * rated_torque / 1000.0,
            ..self
        })
    }

    /// Counts per radian (or metre), without the sign of the direction.
    pub fn resolution(&self) -> f64 {
        self.counts_per_unit.abs()
    }

    /// The way of one count: rad (m), negative where the joint counts backwards.
    #[inline]
    pub const fn way_per_count(&self) -> f64 {
        self.units_per_count
    }

    /// Position (rad or m) to counts, to the nearest; beyond 32 bits the nearest end.
    #[inline]
    pub fn position_to_counts(&self, position: f64) -> i32 {
        nearest(self.counts_at(position))
    }

    /// The set-point of a position (rad or m) in counts: to the nearest, at a limit to the inside.
    #[inline]
    pub fn position_command(&self, position: f64, limits: &AxisLimits) -> i32 {
        let AxisLimits { position_min, position_max, .. } = *limits;
        self.position_to_counts(inward(position, position_min, position_max, self.units_per_count))
    }

    /// The set-point of a velocity (rad/s or m/s) in the drive's unit: to the nearest, at the limit to the inside.
    #[inline]
    pub fn velocity_command(&self, velocity: f64, limits: &AxisLimits) -> i32 {
        let (limit, unit) = (limits.velocity, self.velocity_per_drive_velocity);
        self.velocity_to_drive(inward(velocity, -limit, limit, unit))
    }

    /// The set-point of a torque (N·m or N) in per mille of the rated torque: to the nearest, at the limit to the inside.
    #[inline]
    pub fn torque_command(&self, torque: f64, limits: &AxisLimits) -> i32 {
        let (limit, unit) = (limits.torque, self.torque_per_per_mille);
        self.torque_to_per_mille(inward(torque, -limit, limit, unit))
    }

    /// Counts to position (rad or m); those of a counter that has wrapped may be beyond 32 bits.
    pub fn position_from_counts(&self, counts: impl Into<i64>) -> f64 {
        (counts.into() as f64 - self.zero_counts) * self.units_per_count
    }

    /// Position (rad or m) to counts, with their fraction, however many.
    pub(crate) fn counts_at(&self, position: f64) -> f64 {
        position * self.counts_per_unit + self.zero_counts
    }

    /// Velocity (rad/s or m/s) to the drive's unit.
    pub fn velocity_to_drive(&self, velocity: f64) -> i32 {
        nearest(velocity * self.drive_velocity_per_velocity)
    }

    /// A velocity in the drive's unit to rad/s or m/s.
    pub fn velocity_from_drive(&self, units: i32) -> f64 {
        f64::from(units) * self.velocity_per_drive_velocity
    }

    /// One unit of the drive's velocity: rad/s or m/s.
    pub(crate) fn velocity_resolution(&self) -> f64 {
        self.velocity_per_drive_velocity.abs()
    }

    /// Torque (N·m or N) to per mille of the rated torque, as far as 16 bits go.
    pub fn torque_to_per_mille(&self, torque: f64) -> i32 {
        nearest(torque * self.per_mille_per_torque).clamp(i16::MIN.into(), i16::MAX.into())
    }

    /// Per mille of the rated torque to torque (N·m or N).
    pub fn torque_from_per_mille(&self, per_mille: i32) -> f64 {
        f64::from(per_mille) * self.torque_per_per_mille
    }
}

/// A sum with this number has no bits for a fraction: it is rounded to the nearest whole number, ties to even.
const NO_FRACTION: f64 = 1.5 / f64::EPSILON;

/// The nearest 32-bit integer. The cast saturates and takes NaN to 0, so no value can panic or wrap.
#[inline]
fn nearest(value: f64) -> i32 {
    (value + NO_FRACTION - NO_FRACTION) as i32
}

/// A millionth less than half: a limit that is a whole number of units is reached, whatever the last digits say.
const NEARLY_HALF: f64 = 0.499_999;

/// A set-point that becomes a whole number of units, moved so that rounding leads to the inside of a limit: within half a unit of the
/// limit to there, beyond the limit by half a unit. It grows with the set-point everywhere; what is no number stays none.
#[inline]
pub(crate) fn inward(value: f64, min: f64, max: f64, unit: f64) -> f64 {
    let half = NEARLY_HALF * unit.abs();
    if value > max - half {
        (value - half).max(max - half)
    } else if value < min + half {
        (value + half).min(min + half)
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use proptest::prelude::*;

    const DRIVE: ScaleParameters = ScaleParameters {
        counts_per_turn: 524_288.0,
        velocity_units_per_turn: 524_288.0,
        gear_ratio: 1.0,
        travel_per_turn: TAU,
        reversed: false,
        zero_counts: 0.0,
        rated_torque: 31.0,
    };

    #[test]
    fn a_turn_of_524288_counts_has_83443_027_a_radian() {
        let scale = Scale::new(DRIVE).unwrap();
        assert_eq!(libm::rint(scale.resolution() * 1000.0) as i64, 83_443_027);
        assert_eq!(scale.position_to_counts(1.0), 83_443);
        assert_eq!(scale.position_to_counts(TAU), 524_288);
    }

    #[test]
    fn the_nearest_integer_is_that_of_rint() {
        let halves =
            [0.0, 0.5, 1.5, 2.5, 0.499_999_999_999_999_94, 2_147_483_646.5, 2_147_483_647.5, 2_147_483_648.5];
        let large = [1e10, 2f64.powi(51), 2f64.powi(52) + 1.0, 1e300, f64::MAX, f64::INFINITY, f64::NAN];
        for value in halves.into_iter().chain(large).flat_map(|value| [value, -value]) {
            assert_eq!(nearest(value), libm::rint(value) as i32, "{value}");
        }
    }

    #[test]
    fn a_reversed_joint_turns_position_velocity_and_torque_round() {
        let scale = Scale::new(ScaleParameters { reversed: true, ..DRIVE }).unwrap();
        assert_eq!(scale.position_to_counts(TAU), -524_288);
        assert_eq!(scale.velocity_to_drive(TAU), -524_288);
        assert_eq!(scale.torque_to_per_mille(31.0), -1000);
        assert_eq!(scale.torque_from_per_mille(-1000), 31.0);
    }

    #[test]
    fn torque_beyond_16_bits_and_positions_beyond_32_saturate() {
        let scale = Scale::new(DRIVE).unwrap();
        assert_eq!(scale.torque_to_per_mille(1e9), 32_767);
        assert_eq!(scale.position_to_counts(-1e9), i32::MIN);
    }

    #[test]
    fn impossible_parameters_are_named() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(Scale::new(ScaleParameters { gear_ratio: bad, ..DRIVE }), Err(ScaleError::GearRatio));
            assert_eq!(
                Scale::new(ScaleParameters { rated_torque: bad, ..DRIVE }),
                Err(ScaleError::RatedTorque)
            );
        }
        let fine = ScaleParameters { counts_per_turn: 1e300, gear_ratio: 1e300, ..DRIVE };
        assert_eq!(Scale::new(fine), Err(ScaleError::Resolution));
        assert_eq!(
            Scale::new(ScaleParameters { zero_counts: f64::NAN, ..DRIVE }),
            Err(ScaleError::ZeroCounts)
        );
    }

    proptest! {
        #[test]
        fn counts_survive_the_way_to_si_and_back(
            counts: i32, turns in 1.0f64..1e7, gear in 0.01f64..200.0, zero in -1_000_000i32..1_000_000, reversed: bool,
        ) {
            let scale = Scale::new(ScaleParameters {
                counts_per_turn: turns, gear_ratio: gear, reversed, zero_counts: zero.into(), ..DRIVE
            }).unwrap();
            prop_assert_eq!(scale.position_to_counts(scale.position_from_counts(counts)), counts);
            prop_assert_eq!(nearest(turns * gear), libm::rint(turns * gear) as i32);
            prop_assert_eq!(scale.velocity_to_drive(scale.velocity_from_drive(counts)), counts);
        }

        #[test]
        fn what_is_within_a_limit_is_so_as_a_whole_number_too(
            min in -20.0f64..0.0, range in 0.01f64..20.0, share in 0.0f64..1.0, near in -3.0f64..3.0, reversed: bool,
            velocity in 0.01f64..10.0, torque in 1.0f64..100.0,
        ) {
            let scale = Scale::new(ScaleParameters { reversed, ..DRIVE }).unwrap();
            let limits = AxisLimits { position_min: min, position_max: min + range, velocity, torque, ..AxisLimits::NONE };
            let (count, unit) = (1.0 / scale.resolution(), 0.031);
            // Anywhere, and within some counts of each limit.
            for position in [min + share * range, min + near.abs() * count, limits.position_max - near.abs() * count] {
                let counts = scale.position_command(position, &limits);
                let back = scale.position_from_counts(counts);
                prop_assert!((back - position).abs() <= 1.000_01 * count, "{} from {}", back, position);
                let excess = (back - limits.position_max).max(min - back);
                prop_assert!(excess <= 2e-6 * count, "{} beyond", excess);
            }
            for velocity in [near, velocity, -velocity, velocity - near.abs() * count] {
                let back = scale.velocity_from_drive(scale.velocity_command(velocity, &limits));
                let excess = back.abs() - velocity.abs().max(limits.velocity);
                prop_assert!(excess <= 2e-6 * count, "{} from {}", back, velocity);
            }
            for torque in [torque, -torque, torque - near.abs() * unit] {
                let back = scale.torque_from_per_mille(scale.torque_command(torque, &limits));
                prop_assert!(back.abs() <= limits.torque + 2e-6 * unit, "{} from {}", back, torque);
            }
        }

        #[test]
        fn a_set_point_beyond_a_limit_comes_back_without_a_jump(
            max in 0.5f64..3.0, beyond in -3.0f64..3.0, step in 0.0f64..1e-3, reversed: bool,
        ) {
            let scale = Scale::new(ScaleParameters { reversed, ..DRIVE }).unwrap();
            let limits = AxisLimits { position_min: -max, position_max: max, ..AxisLimits::NONE };
            let at = |position: f64| f64::from(scale.position_command(position, &limits)) / scale.resolution();
            let sign = if reversed { -1.0 } else { 1.0 };
            let from = max + beyond / scale.resolution();
            let moved = sign * (at(from) - at(from - step));
            prop_assert!(moved >= 0.0 && moved <= step + 2.0 / scale.resolution(), "{} for {}", moved, step);
            prop_assert!(at(f64::NAN) == 0.0);
        }

        #[test]
        fn a_sum_of_small_steps_never_leaves_the_nearest_count(step in 1e-9f64..1e-4, steps in 1usize..20_000) {
            let scale = Scale::new(DRIVE).unwrap();
            let position = step * steps as f64;
            let exact = position * scale.resolution();
            prop_assert!((f64::from(scale.position_to_counts(position)) - exact).abs() <= 0.5);
        }
    }
}
