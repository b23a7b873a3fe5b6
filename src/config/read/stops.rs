//! `[stops]` and `[cycle.missed_slots]`: what stops the group, and how.

use takt_rt::{Rule, StopCategory};

use super::section::Section;
use crate::config::key::Key;
use crate::config::keys::missed_slots::{DEGRADED, LEAK_SLOTS, STOP, WARNING};
use crate::config::model::{MissedSlots, StopCategories};
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
    let default = MissedSlots::default();
    let mut slots = |key: &'static Key, default: u32| {
        let value = section.keyed(key).map_or(Some(default), |entry| entry.integer());
        if let Some(value) = value {
            rules::cycle::missed_slots(&section.spot(key.name), value, earlier);
            earlier = earlier.max(value);
        }
        value.unwrap_or(default)
    };
    let warning = slots(&WARNING, default.warning);
    let degraded = slots(&DEGRADED, default.degraded);
    let stop = slots(&STOP, default.stop);
    let leak_slots = section.integer(&LEAK_SLOTS).unwrap_or(default.leak_slots);
    section.finish();
    MissedSlots { warning, degraded, stop, leak_slots }
}
