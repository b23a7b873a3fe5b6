//! Distances and times of an axis in the units of its drive.

use std::f64::consts::TAU;

use takt_rt::Nanoseconds;

use crate::config::{Axis, Travel};

/// Turns of the drive's encoder for a distance (rad, m), or turns per second for a velocity.
pub fn turns(axis: &Axis, distance: f64) -> f64 {
    let travel_per_turn = match axis.travel {
        Travel::Rotary => TAU,
        Travel::Linear { lead_m } => lead_m,
    };
    (distance / travel_per_turn * axis.gear_ratio).abs()
}

/// Counts for a distance (rad, m), a velocity or an acceleration: at least 1, at most the range of 32 bits.
pub fn counts(axis: &Axis, distance: f64) -> i64 {
    (turns(axis, distance) * axis.counts_per_turn).round().clamp(1.0, u32::MAX.into()) as i64
}

/// A time in this unit, rounded up.
pub fn rounded_up(ns: Nanoseconds, unit_ns: Nanoseconds) -> i64 {
    i64::try_from(ns.div_ceil(unit_ns)).unwrap_or(i64::MAX)
}
