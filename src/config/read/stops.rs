//! `[stops]` and `[cycle.missed_slots]`: what stops the group, and how.

use takt_rt::{Rule, StopCategory};

use super::section::Section;
use crate::config::defaults;
use crate::config::model::{MissedSlots, StopCategories};
use crate::config::ranges;
use crate::config::rules;

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
    let mut earlier = 0;
    let mut slots = |key, default: u32| {
        let read = section.get(key).map(|entry| entry.integer(ranges::MISSED_SLOTS));
        let value = read.unwrap_or(Some(default.into())).and_then(|value| u32::try_from(value).ok());
        if let Some(value) = value {
            rules::cycle::missed_slots(&section.spot(key), value, earlier);
            earlier = earlier.max(value);
        }
        value.unwrap_or(default)
    };
    let warning = slots("warning", defaults::MISSED_SLOTS_WARNING);
    let degraded = slots("degraded", defaults::MISSED_SLOTS_DEGRADED);
    let stop = slots("stop", defaults::MISSED_SLOTS_STOP);
    let leak_slots = section.get("leak_slots").and_then(|entry| entry.integer(ranges::MISSED_SLOTS));
    let leak_slots = leak_slots.and_then(|slots| u32::try_from(slots).ok());
    section.finish();
    let leak_slots = leak_slots.unwrap_or(defaults::MISSED_SLOTS_LEAK_SLOTS);
    MissedSlots { warning, degraded, stop, leak_slots }
}
