//! What is asked of the operating system.

use std::ops::RangeInclusive;

use super::Fields;
use crate::config::model::Realtime;
use crate::config::ranges;

pub fn validate(realtime: &Realtime, period_ns: u64, fields: &Fields<'_>) {
    if let Some(priority) = realtime.priority {
        fields.at("priority").integer(priority, &ranges::PRIORITY);
    }
    if let Some(cpu) = realtime.cpu {
        fields.at("cpu").integer(cpu, &ranges::CPU);
    }
    if let Some(spin_guard_ns) = realtime.spin_guard_ns {
        fields.at("spin_guard").duration(spin_guard_ns, spin_guard(period_ns));
    }
}

/// The range of the spin guard, in seconds. A loop that spins for most of its period leaves no time to other
/// threads of its CPU.
pub fn spin_guard(period_ns: u64) -> RangeInclusive<f64> {
    0.0..=period_ns as f64 / 1e9 * ranges::SPIN_GUARD_AT_MOST
}
