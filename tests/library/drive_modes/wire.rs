//! What is on the wire, in numbers.

use std::f64::consts::TAU;

use takt::config::{Axis, Travel};
use takt_rt::Id;

pub const MILLISECOND_NS: u64 = 1_000_000;

/// Counts for one rad (m) of an axis.
pub fn counts_per_unit(axis: &Axis) -> f64 {
    let travel_per_turn = match axis.travel {
        Travel::Rotary => TAU,
        Travel::Linear { lead_m } => lead_m,
    };
    axis.counts_per_turn * axis.gear_ratio / travel_per_turn
}

pub fn id(function: u16, node: u8) -> u32 {
    Id::canopen(function, node).value()
}

pub fn word(payload: &[u8]) -> u16 {
    u16::from_le_bytes([payload[0], payload[1]])
}

pub fn counts(payload: &[u8]) -> i32 {
    i32::from_le_bytes(payload.try_into().unwrap())
}
