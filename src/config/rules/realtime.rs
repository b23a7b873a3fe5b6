//! What is asked of the operating system.

use std::ops::RangeInclusive;

use super::Fields;
use crate::config::keys::SPIN_GUARD_AT_MOST;
use crate::config::keys::realtime::{CPU, PRIORITY};
use crate::config::model::Realtime;

pub fn validate(realtime: &Realtime, period_ns: u64, fields: &Fields<'_>) {
    if let Some(priority) = realtime.priority {
        fields.integer(&PRIORITY, priority);
    }
    if let Some(cpu) = realtime.cpu {
        fields.integer(&CPU, cpu);
    }
    if let Some(spin_guard_ns) = realtime.spin_guard_ns {
        fields.at("spin_guard").duration(spin_guard_ns, spin_guard(period_ns));
    }
}

/// The range of the spin guard, in seconds. A loop that spins for most of its period leaves no time to other
/// threads of its CPU.
pub fn spin_guard(period_ns: u64) -> RangeInclusive<f64> {
    0.0..=period_ns as f64 / 1e9 * SPIN_GUARD_AT_MOST
}
