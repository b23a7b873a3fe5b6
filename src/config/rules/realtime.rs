//! What is asked of the operating system.

use std::ops::RangeInclusive;

use nix::unistd::{SysconfVar, sysconf};

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

/// A CPU that the kernel knows, whether it is switched on or not.
pub fn cpu_is_present(realtime: &Realtime, fields: &Fields<'_>) {
    let count =
        sysconf(SysconfVar::_NPROCESSORS_CONF).ok().flatten().and_then(|count| usize::try_from(count).ok());
    if let (Some(cpu), Some(count)) = (realtime.cpu, count)
        && cpu >= count
    {
        let allowed = format!("0 to {}, the CPUs of this machine, or \"last\"", count.saturating_sub(1));
        fields.at("cpu").report_range(cpu.to_string(), allowed);
    }
}

/// The range of the spin guard, in seconds. A loop that spins for most of its period leaves no time to other
/// threads of its CPU.
pub fn spin_guard(period_ns: u64) -> RangeInclusive<f64> {
    0.0..=period_ns as f64 / 1e9 * ranges::SPIN_GUARD_AT_MOST
}
