//! Why the group stopped, according to a recording, and which slots and axis show it.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use serde::Serialize;
use takt_rt::{EventKind, Rule, StopReason};

use super::{Recorded, RecordedEvent};
use crate::telemetry::words;

/// Why the group stopped.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Cause {
    /// The reason as a sentence.
    pub reason: String,
    /// The key of the rule.
    pub rule: String,
    /// IEC 60204-1: 0, 1 or 2; `None` if the group did not move.
    pub category: Option<u8>,
    /// The group that stopped; absent where all axes are one group.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// The axis concerned.
    pub axis: Option<String>,
    /// The bus concerned.
    pub bus: Option<String>,
    /// The value that was seen, in the unit of the rule.
    pub value: Option<f64>,
    /// The value that is allowed.
    pub limit: Option<f64>,
    /// The slot in which it was seen.
    pub slot: u64,
    /// The phase of the group.
    pub phase: Option<String>,
}

impl Recorded {
    /// Why the group stopped: the incident of a black box, or else the first stop for a fault, or else the first stop on
    /// request.
    pub fn cause(&self) -> Option<Cause> {
        let slot_of = |incident: &BTreeMap<String, String>| incident.get("slot")?.parse::<u64>().ok();
        let is_read = |slot: u64| self.slots.is_none_or(|(first, last)| (first..=last).contains(&slot));
        let mut incidents = self.incidents.iter();
        let is_shown = |incident: &&BTreeMap<String, String>| {
            self.span_s.is_none() || slot_of(incident).is_some_and(is_read)
        };
        if let Some(incident) = incidents.find(is_shown) {
            let text = |key: &str| incident.get(key).cloned();
            let number = |key: &str| incident.get(key)?.parse::<f64>().ok();
            return Some(Cause {
                reason: text("reason").unwrap_or_default(),
                rule: text("rule").unwrap_or_default(),
                category: number("category").map(|category| category as u8),
                group: text("group"),
                axis: text("axis"),
                bus: text("bus"),
                value: number("value"),
                limit: number("limit"),
                slot: incident.get("slot").and_then(|slot| slot.parse().ok()).unwrap_or(0),
                phase: text("phase"),
            });
        }
        self.first_stop(|_| true)
    }

    /// Why a group stopped: its first stop for a fault, or else its first one on request.
    pub fn cause_of_group(&self, group: usize) -> Option<Cause> {
        self.first_stop(|event| event.group.map(usize::from) == Some(group))
    }

    /// The first stop for a fault of these events, or else the first one on request.
    fn first_stop(&self, is_meant: impl Fn(&RecordedEvent) -> bool) -> Option<Cause> {
        let stops = || {
            self.events.iter().filter(|event| is_meant(event)).filter_map(|event| match event.kind {
                Some(EventKind::Stop(stop)) => Some((event, stop)),
                _ => None,
            })
        };
        let unrequested = stops().find(|(_, stop)| stop.rule() != Rule::Requested);
        unrequested.or_else(|| stops().next()).map(|(event, stop)| self.cause_of(event, &stop))
    }

    fn cause_of(&self, event: &RecordedEvent, stop: &StopReason) -> Cause {
        let group = event.group.filter(|_| self.machine.groups.len() > 1);
        Cause {
            group: group.map(|group| self.machine.group_name(group)),
            reason: words::stop(stop, &self.machine).to_string(),
            rule: words::rule_key(stop.rule()).to_owned(),
            category: Some(stop.category as u8),
            axis: stop.axis().map(|axis| self.machine.axis_name(axis)),
            bus: stop.origin.bus().map(|bus| self.machine.bus_name(bus)),
            value: Some(stop.cause.numbers().0),
            limit: Some(stop.cause.numbers().1),
            slot: event.slot,
            phase: Some(words::phase(stop.phase).to_owned()),
        }
    }

    /// The slots from `before` slots before the cause to `after` slots after it. Without a cause, those before the end.
    pub fn slots_around_cause(&self, before: u64, after: u64) -> RangeInclusive<u64> {
        let (first, last) = self.slots.unwrap_or((0, 0));
        let slot = self.cause().map_or(last, |cause| cause.slot).clamp(first, last);
        slot.saturating_sub(before).max(first)..=slot.saturating_add(after).min(last)
    }

    /// The number of the axis with this name. Without a name: the axis of the cause, or else the axis with the largest
    /// following error. If the cause is a bus, only the axes of this bus count, if the recording names them.
    pub fn axis(&self, name: Option<&str>) -> Option<usize> {
        let position = |name: &str| self.machine.axes.iter().position(|axis| axis.name == name);
        if let Some(name) = name {
            return position(name);
        }
        let error = |axis: &usize| {
            let largest = self.statistics.axes.get(*axis).and_then(|axis| axis.following_error_max);
            largest.map_or(0.0, |largest| largest.error)
        };
        let cause = self.cause();
        let bus = cause.as_ref().and_then(|cause| cause.bus.as_ref());
        let is_on_bus = |axis: &usize| {
            bus.is_some() && self.machine.axes.get(*axis).is_some_and(|axis| axis.bus.as_ref() == bus)
        };
        let largest_error = || {
            let axes = || 0..self.machine.axes.len();
            let by_error = |a: &usize, b: &usize| error(a).total_cmp(&error(b)).then(b.cmp(a));
            axes().filter(is_on_bus).max_by(by_error).or_else(|| axes().max_by(by_error))
        };
        cause.as_ref().and_then(|cause| position(cause.axis.as_ref()?)).or_else(largest_error)
    }

    /// Seconds after the first cycle of the file.
    pub fn seconds(&self, at_ns: u64) -> f64 {
        let begin_ns = self.begin.map_or(self.statistics.first_ns, |(_, begin_ns)| begin_ns);
        (at_ns as f64 - begin_ns as f64) * 1e-9
    }

    /// The first slot of the file.
    pub fn first_slot(&self) -> u64 {
        self.begin.map_or(0, |(slot, _)| slot)
    }
}
