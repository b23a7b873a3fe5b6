//! The cycle, and the slots that it misses.

use super::Fields;
use crate::config::bounds::Bounds;
use crate::config::keys::COMMAND_PHASE;
use crate::config::keys::cycle::PERIOD;
use crate::config::keys::missed_slots::{DEGRADED, LEAK_SLOTS, STOP, WARNING};
use crate::config::model::{Cycle, MissedSlots};
use crate::config::quantity::Quantity;
use crate::config::spot::Spot;

pub fn validate(cycle: &Cycle, missed_slots: &MissedSlots, fields: &Fields<'_>) {
    if period(&fields.at("period"), cycle.period_ns).is_some() {
        command_phase(&fields.at("command_phase"), cycle.command_phase_ns as f64 / 1e9, cycle.period_ns);
    }
    let fields = fields.within("missed_slots");
    let mut earlier = 0;
    for (key, slots) in
        [(&WARNING, missed_slots.warning), (&DEGRADED, missed_slots.degraded), (&STOP, missed_slots.stop)]
    {
        self::missed_slots(&fields.at(key.name), slots, earlier);
        earlier = earlier.max(slots);
    }
    fields.integer(&LEAK_SLOTS, missed_slots.leak_slots);
}

/// Object 1006 of the drives is in whole microseconds.
pub fn period(spot: &Spot<'_>, period_ns: u64) -> Option<u64> {
    spot.duration_of(&PERIOD, period_ns)?;
    if !period_ns.is_multiple_of(1000) {
        spot.report_range(Quantity::DURATION.show(period_ns as f64 / 1e9), "whole microseconds".to_owned());
    }
    Some(period_ns)
}

/// The cycle must leave room on both sides of the command phase.
pub fn command_phase(spot: &Spot<'_>, command_phase_s: f64, period_ns: u64) -> Option<u64> {
    let Bounds::Between(low, high) = COMMAND_PHASE else { return None };
    let period_s = period_ns as f64 / 1e9;
    let show = |seconds: f64| Quantity::DURATION.show(seconds);
    // A share of the period is rounded to nanoseconds.
    const ROUNDING_S: f64 = 1e-9;
    let allowed = (low * period_s - ROUNDING_S)..=(high * period_s + ROUNDING_S);
    if allowed.contains(&command_phase_s) {
        return Some((command_phase_s * 1e9).round() as u64);
    }
    let allowed = format!("{} to {}", show(low * period_s), show(high * period_s));
    spot.report_range(show(command_phase_s), allowed);
    None
}

/// One step of the ladder, which is at least as high as the one before it.
pub fn missed_slots(spot: &Spot<'_>, slots: u32, earlier: u32) {
    let allowed = STOP.integers();
    let lowest = i64::from(earlier).max(allowed.start);
    spot.integer(slots, &(lowest..allowed.end.max(lowest + 1)));
}
