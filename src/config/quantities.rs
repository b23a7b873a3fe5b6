//! The quantities and ranges of an axis by what it does: turn or slide.

use takt_rt::PositionCounter;

use super::axis_ranges::AxisRanges;
use super::model::{Axis, Limits, Travel};
use super::quantity::Quantity;

/// The quantities of an axis, and their ranges.
#[derive(Clone, Copy)]
pub struct Quantities {
    pub position: Quantity,
    pub velocity: Quantity,
    pub acceleration: Quantity,
    pub jerk: Quantity,
    pub effort: Quantity,
    pub inertia: Quantity,
    pub stiffness: Quantity,
    pub damping: Quantity,
    pub ranges: &'static AxisRanges,
}

impl Quantities {
    pub const ROTARY: Self = Self {
        position: Quantity::ANGLE,
        velocity: Quantity::ANGULAR_VELOCITY,
        acceleration: Quantity::ANGULAR_ACCELERATION,
        jerk: Quantity::ANGULAR_JERK,
        effort: Quantity::TORQUE,
        inertia: Quantity::MOMENT_OF_INERTIA,
        stiffness: Quantity::ANGULAR_STIFFNESS,
        damping: Quantity::ANGULAR_DAMPING,
        ranges: &AxisRanges::ROTARY,
    };
    pub const LINEAR: Self = Self {
        position: Quantity::LENGTH,
        velocity: Quantity::VELOCITY,
        acceleration: Quantity::ACCELERATION,
        jerk: Quantity::JERK,
        effort: Quantity::FORCE,
        inertia: Quantity::MASS,
        stiffness: Quantity::STIFFNESS,
        damping: Quantity::DAMPING,
        ranges: &AxisRanges::LINEAR,
    };

    pub fn of(travel: Travel) -> Self {
        match travel {
            Travel::Rotary => Self::ROTARY,
            Travel::Linear { .. } => Self::LINEAR,
        }
    }

    /// The position limits for people.
    pub fn show_range(self, limits: &Limits) -> String {
        format!("{} to {}", self.position.show(limits.position_min), self.position.show(limits.position_max))
    }
}

/// How positions are counted.
#[derive(Clone, Copy)]
pub struct Counting {
    pub travel: Travel,
    pub counts_per_turn: f64,
    pub gear_ratio: f64,
    pub reversed: bool,
    pub zero_counts: i32,
    /// The counts that the drive reports.
    pub counter: PositionCounter,
}

impl Counting {
    pub fn of(axis: &Axis) -> Self {
        let Axis { travel, counts_per_turn, gear_ratio, reversed, zero_counts, .. } = *axis;
        Self { travel, counts_per_turn, gear_ratio, reversed, zero_counts, counter: axis.drive.counter }
    }

    /// Turns of the reported position per rad (m).
    pub fn turns_per_unit(&self) -> f64 {
        self.gear_ratio / self.travel.per_turn()
    }

    /// Counts per rad (m).
    pub fn counts_per_unit(&self) -> f64 {
        self.counts_per_turn * self.turns_per_unit()
    }

    /// The counts of a position.
    pub fn position(&self, position: f64) -> f64 {
        let direction = if self.reversed { -1.0 } else { 1.0 };
        direction * position * self.counts_per_unit() + f64::from(self.zero_counts)
    }

    /// The position at a count.
    pub fn joint(&self, count: i32) -> f64 {
        let direction = if self.reversed { -1.0 } else { 1.0 };
        direction * (f64::from(count) - f64::from(self.zero_counts)) / self.counts_per_unit()
    }
}
