//! `[stops]` and `[cycle.missed_slots]`: what stops the group, and how.

use takt_rt::{Rule, StopCategory};

use super::section::Section;
use crate::config::defaults;
use crate::config::model::{MissedSlots, StopCategories};

/// A category for each rule, by its key.
pub fn stops(mut section: Section<'_>) -> StopCategories {
    let mut categories = StopCategories::default();
    for rule in Rule::ALL.into_iter().filter(|rule| *rule != Rule::Requested) {
        let category = section.get(rule.key()).and_then(|entry| entry.integer(0..3));
        match category {
            Some(0) => categories.set(rule, StopCategory::Zero),
            Some(1) => categories.set(rule, StopCategory::One),
            Some(_) => categories.set(rule, StopCategory::Two),
            None => {}
        }
    }
    section.finish();
    categories
}

/// The steps of the ladder, each at least as high as the one before.
pub fn missed_slots(mut section: Section<'_>) -> MissedSlots {
    let mut lowest = 1;
    let mut slots = |section: &mut Section<'_>, key, default: u32| {
        let entry = section.get(key);
        let read = entry.as_ref().and_then(|entry| entry.integer(lowest..1_000_001));
        let value = read.and_then(|value| u32::try_from(value).ok()).unwrap_or(default);
        if entry.is_none() && i64::from(value) < lowest {
            section.report_default_out_of_range(key, value.to_string(), format!("at least {lowest}"));
        }
        lowest = lowest.max(value.into());
        value
    };
    let warning = slots(&mut section, "warning", defaults::MISSED_SLOTS_WARNING);
    let degraded = slots(&mut section, "degraded", defaults::MISSED_SLOTS_DEGRADED);
    let stop = slots(&mut section, "stop", defaults::MISSED_SLOTS_STOP);
    let leak_ns = section.get("leak").and_then(|entry| entry.nanoseconds(250e-6, 60.0));
    section.finish();
    MissedSlots { warning, degraded, stop, leak_ns: leak_ns.unwrap_or(defaults::MISSED_SLOTS_LEAK_NS) }
}
