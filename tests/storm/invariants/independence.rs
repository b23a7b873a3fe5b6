//! Groups have nothing to do with each other, unless the configuration couples their stops: a group stops for what concerns it or a
//! group with which it stops, and goes on otherwise; and where a group stops, those that stop with it do so in the same cycle, or in
//! the next one.

use std::collections::BTreeSet;

use takt::config::Config;
use takt::controller::assemble::slot_plan;
use takt_rt::{Event, EventKind, GroupSnapshot, Origin, Phase, StopCategory, StopReason};

use super::Seen;

/// Cycles after the last one that was not punctual for which steps may still have to leave.
const BEHIND_CYCLES: u32 = 8;

pub struct Independence {
    /// The groups that a stop of each group may be for: itself, and those with which it stops, directly or not.
    sources: Vec<BTreeSet<usize>>,
    /// The groups with which each one stops directly.
    stops_with: Vec<Vec<usize>>,
    /// What the groups that stop with others have still to take part in: which of them, and in how hard a stop.
    pending: Vec<(usize, StopCategory)>,
    /// Each group before the cycle.
    before: Vec<GroupSnapshot>,
    /// Punctual cycles in a row.
    punctual: u32,
}

impl Independence {
    pub fn new(config: &Config) -> Self {
        let count = config.groups.len().max(1);
        let stops_with: Vec<Vec<usize>> = match config.groups.is_empty() {
            true => vec![vec![]],
            false => config.groups.iter().map(|group| group.stops_with.clone()).collect(),
        };
        let sources = (0..count).map(|group| {
            let (mut all, mut open) = (BTreeSet::new(), vec![group]);
            while let Some(next) = open.pop() {
                if all.insert(next) {
                    open.extend(&stops_with[next]);
                }
            }
            all
        });
        Self {
            sources: sources.collect(),
            stops_with,
            pending: vec![],
            before: vec![GroupSnapshot::default(); count],
            punctual: 0,
        }
    }

    pub fn check(&mut self, seen: &Seen<'_>) -> Result<(), String> {
        let result = self
            .check_coupled(seen)
            .and_then(|()| self.check_origins(seen))
            .and_then(|()| self.check_progress(seen));
        self.before.copy_from_slice(seen.snapshot.groups());
        result
    }

    /// A stop concerns its group, or one with which that stops.
    fn check_origins(&self, seen: &Seen<'_>) -> Result<(), String> {
        for (group, sources) in self.sources.iter().enumerate() {
            for stop in stops(seen, group) {
                let is_own = match stop.origin {
                    Origin::Group => true,
                    Origin::Axis(axis) => sources.contains(&seen.groups[usize::from(axis)]),
                    Origin::Bus(bus) => {
                        let is_on_it = |axis: &usize| seen.config.axes[*axis].bus == usize::from(bus);
                        let mut on_it = (0..seen.groups.len()).filter(is_on_it).peekable();
                        // A bus without any axis concerns every group.
                        on_it.peek().is_none() || on_it.any(|axis| sources.contains(&seen.groups[axis]))
                    }
                };
                if !is_own {
                    return Err(format!("group {group} stops for what does not concern it: {stop:?}"));
                }
            }
        }
        Ok(())
    }

    /// Groups that are coupled stop together. One that has stopped may be commanded or reset in the same cycle.
    fn check_coupled(&mut self, seen: &Seen<'_>) -> Result<(), String> {
        let takes_part = |group: usize, category: StopCategory, place: usize| {
            let shown = &seen.snapshot.groups()[group];
            let is_stopped = shown.stop.is_some_and(|stop| stop.category <= category);
            let (before, after) = seen.events.split_at(place);
            let stops = |event: &Event| has_stopped(event, group, category);
            let begins = |event: &Event| has_begun(event, group);
            is_stopped
                || matches!(shown.phase, Phase::Passive | Phase::Disabled)
                || seen.asked[group].has_reset
                || before.iter().rev().find(|event| stops(event) || begins(event)).is_some_and(stops)
                || after.iter().any(|event| stops(event) || begins(event))
        };
        for (group, category) in self.pending.drain(..) {
            if !takes_part(group, category, 0) {
                let shown = &seen.snapshot.groups()[group];
                return Err(format!("group {group} does not stop with the other one: {shown:?}"));
            }
        }
        for (place, event) in seen.events.iter().enumerate() {
            let (Some(other), EventKind::Stop(stop)) = (event.group, event.kind) else { continue };
            let coupled = (0..self.sources.len())
                .filter(|group| self.stops_with[*group].contains(&usize::from(other)))
                .filter(|group| !takes_part(*group, stop.category, place));
            self.pending.extend(coupled.map(|group| (group, stop.category)));
        }
        Ok(())
    }

    /// On a punctual machine, an enabled group on buses with which nothing is wrong goes on in every cycle, whatever the
    /// others do.
    fn check_progress(&mut self, seen: &Seen<'_>) -> Result<(), String> {
        let timing = &seen.record.timing;
        let is_punctual =
            timing.missed_slots == 0 && timing.sent_ns <= slot_plan(seen.config).latest_set_points_ns;
        self.punctual = if is_punctual { self.punctual + 1 } else { 0 };
        if self.punctual <= BEHIND_CYCLES {
            return Ok(());
        }
        for (number, (before, now)) in self.before.iter().zip(seen.snapshot.groups()).enumerate() {
            let is_sound = |axis: usize| {
                let bus = seen.config.axes[axis].bus;
                !seen.troubled_buses[bus] && !seen.overloaded_buses[bus] && !seen.concerns[axis].is_crowded
            };
            let mut own = (0..seen.groups.len()).filter(|axis| seen.groups[*axis] == number);
            let leads = |phase: Phase| {
                matches!(phase, Phase::Holding | Phase::Moving | Phase::Streaming | Phase::Stopping)
            };
            if leads(before.phase) && leads(now.phase) && own.all(is_sound) && now.steps != before.steps + 1 {
                let steps = now.steps - before.steps;
                return Err(format!("group {number}: {steps} steps in a cycle, {:?}", now.phase));
            }
        }
        Ok(())
    }
}

/// The stops that have begun in a group.
fn stops<'a>(seen: &'a Seen<'_>, group: usize) -> impl Iterator<Item = StopReason> + 'a {
    seen.events_of(group).filter_map(|event| match event.kind {
        EventKind::Stop(reason) => Some(reason),
        _ => None,
    })
}

/// Returns `true` if a group begins a stop of this category, or a harder one.
fn has_stopped(event: &Event, group: usize, category: StopCategory) -> bool {
    event.group == Some(group as u8)
        && matches!(event.kind, EventKind::Stop(stop) if stop.category <= category)
}

/// Returns `true` if a group leaves rest, which only a request makes it do.
fn has_begun(event: &Event, group: usize) -> bool {
    event.group == Some(group as u8)
        && matches!(
            event.kind,
            EventKind::PhaseChanged {
                from: Phase::Disabled | Phase::Holding,
                to: Phase::Enabling | Phase::Moving | Phase::Streaming,
            }
        )
}
