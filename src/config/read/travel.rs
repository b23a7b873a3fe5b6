//! How an axis moves, rotary or linear, and how its drive counts that.

use std::f64::consts::TAU;

use super::entry::Bounds;
use super::machine::boolean;
use super::section::Section;
use crate::config::defaults;
use crate::config::model::{DriveFamily, Travel};
use crate::config::quantity::Quantity;

/// The quantities of an axis by what it does: turn or slide.
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
    };

    pub fn of(travel: Travel) -> Self {
        match travel {
            Travel::Rotary => Self::ROTARY,
            Travel::Linear { .. } => Self::LINEAR,
        }
    }
}

pub fn travel(section: &mut Section<'_>) -> Option<Travel> {
    let lead = section.get("lead");
    let is_linear = match section.get("travel") {
        None => false,
        Some(entry) => entry.choice(&[("rotary", false), ("linear", true)])?,
    };
    if !is_linear {
        return Some(Travel::Rotary);
    }
    let Some(lead) = lead else {
        section.require("lead", "what a linear axis moves in one turn: lead = \"5 mm\"");
        return None;
    };
    lead.quantity(Quantity::LENGTH, Bounds::Positive).map(|lead_m| Travel::Linear { lead_m })
}

/// How positions are counted.
pub struct Counting {
    pub counts_per_turn: f64,
    pub gear_ratio: f64,
    pub reversed: bool,
    pub zero_counts: i32,
}

impl Counting {
    /// Counts per rad (m). An axis whose travel could not be read counts nothing.
    pub fn counts_per_unit(&self, travel: Option<Travel>) -> f64 {
        let counts = self.counts_per_turn * self.gear_ratio;
        match travel {
            Some(Travel::Rotary) => counts / TAU,
            Some(Travel::Linear { lead_m }) => counts / lead_m,
            None => 0.0,
        }
    }

    /// The counts of a position.
    pub fn position(&self, position: f64, travel: Option<Travel>) -> f64 {
        let direction = if self.reversed { -1.0 } else { 1.0 };
        direction * position * self.counts_per_unit(travel) + f64::from(self.zero_counts)
    }
}

pub fn counting(section: &mut Section<'_>, drive: Option<DriveFamily>) -> Counting {
    let counts_per_turn =
        section.get("counts_per_turn").and_then(|entry| entry.number(Bounds::Between(1.0, 1e12)));
    let gear_ratio = section.get("gear_ratio").and_then(|entry| entry.number(Bounds::Between(1e-6, 1e6)));
    let zero =
        section.get("zero_counts").and_then(|entry| entry.integer(i32::MIN.into()..1 + i64::from(i32::MAX)));
    Counting {
        counts_per_turn: counts_per_turn
            .unwrap_or(drive.unwrap_or(DriveFamily::ErobCanopen).counts_per_turn()),
        gear_ratio: gear_ratio.unwrap_or(defaults::GEAR_RATIO),
        reversed: boolean(section, "reversed", false),
        zero_counts: zero.and_then(|zero| i32::try_from(zero).ok()).unwrap_or(0),
    }
}
