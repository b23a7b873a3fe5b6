//! `[[group]]`

use std::ops::Range;

use takt_rt::MAX_GROUPS;

use super::axis::ReadAxis;
use super::entry::Entry;
use super::section::Section;
use crate::config::model::Group;
use crate::config::problem_kind::ProblemKind;
use crate::config::rules::group as rules;
use crate::config::spot::Problems;

/// A group as far as it could be read.
pub struct ReadGroup {
    pub name: Option<String>,
    /// The axes that were found, indices into those of the file.
    pub axes: Vec<usize>,
    stops_with: Vec<usize>,
    header: Range<usize>,
    /// True if its name and all of its axes could be read.
    pub is_whole: bool,
}

impl ReadGroup {
    pub fn group(self) -> Option<Group> {
        Some(Group { name: self.name?, axes: self.axes, stops_with: self.stops_with })
    }
}

/// The groups, but no more than one beyond those that a controller can have: the rest are only counted.
pub fn groups(sections: Vec<Section<'_>>, axes: &[ReadAxis], problems: &Problems) -> Vec<ReadGroup> {
    let count = sections.len();
    let mut groups: Vec<ReadGroup> = Vec::with_capacity(MAX_GROUPS + 1);
    let mut couplings = Vec::new();
    for section in sections.into_iter().take(MAX_GROUPS + 1) {
        let spot = section.header_spot();
        let (read, stops_with) = group(section, axes, &groups);
        groups.push(read);
        couplings.push(stops_with);
        if groups.len() > MAX_GROUPS {
            spot.report(rules::too_many(count));
        }
    }
    // A group may name one that comes later.
    for (index, entry) in couplings.into_iter().enumerate() {
        let with = entry.map_or(vec![], |entry| stops_with(&entry, index, &groups));
        if let Some(group) = groups.get_mut(index) {
            group.stops_with = with;
        }
    }
    if groups.iter().any(|group| !group.is_whole) || groups.is_empty() {
        return groups;
    }
    for (index, axis) in axes.iter().enumerate() {
        let is_in_group = groups.iter().any(|group| group.axes.contains(&index));
        if let Some(name) = axis.name.clone().filter(|_| !is_in_group) {
            problems.report(ProblemKind::InNoGroup { axis: name }, axis.header());
        }
    }
    groups
}

/// A group, and with which others it stops.
fn group<'a>(
    mut section: Section<'a>,
    axes: &[ReadAxis],
    earlier: &[ReadGroup],
) -> (ReadGroup, Option<Entry<'a>>) {
    let header = section.header();
    let name = section.require("name", "the name of the group: name = \"gripper\"").and_then(|entry| {
        let name = entry.name()?;
        if let Some(first) = earlier.iter().find(|group| group.name.as_deref() == Some(name)) {
            entry.spot.report_against(rules::duplicate_name(name), &first.header);
        }
        Some(name.to_owned())
    });
    let says = "the axes of the group by their names: axes = [\"finger\"]";
    let found = section.require("axes", says).and_then(|entry| axes_of(&entry, axes, earlier));
    let stops_with = section.get("stops_with");
    section.finish();
    let is_whole = name.is_some() && found.is_some();
    let group = ReadGroup { name, axes: found.unwrap_or_default(), stops_with: vec![], header, is_whole };
    (group, stops_with)
}

/// The axes of a list of names; `None` if something is wrong with one of them.
fn axes_of(entry: &Entry<'_>, axes: &[ReadAxis], earlier: &[ReadGroup]) -> Option<Vec<usize>> {
    let names = entry.list()?;
    if names.is_empty() {
        entry.report(rules::no_axis(&entry.spot.key));
        return None;
    }
    let known: Vec<&str> = axes.iter().filter_map(|axis| axis.name.as_deref()).collect();
    let mut found = Vec::with_capacity(names.len());
    let mut is_whole = true;
    for name in &names {
        let Some(given) = name.text() else {
            is_whole = false;
            continue;
        };
        let index = axes.iter().position(|axis| axis.name.as_deref() == Some(given));
        let owner = index.and_then(|index| earlier.iter().find(|group| group.axes.contains(&index)));
        match (index, owner) {
            // An axis whose name could not be read may be the one that is meant.
            (None, _) if known.len() < axes.len() => is_whole = false,
            (None, _) => {
                name.report(rules::unknown("axis", given, &known));
                is_whole = false;
            }
            (Some(index), _) if found.contains(&index) => {
                name.report(ProblemKind::Repeated { key: entry.spot.key.clone(), given: given.to_owned() });
            }
            (Some(_), Some(owner)) => {
                let group = owner.name.as_deref().unwrap_or_default();
                name.spot.report_against(rules::in_two_groups(given, group), &owner.header);
            }
            (Some(index), None) => found.push(index),
        }
    }
    is_whole.then_some(found)
}

/// The other groups of a list of names.
fn stops_with(entry: &Entry<'_>, own: usize, groups: &[ReadGroup]) -> Vec<usize> {
    let known: Vec<&str> = groups.iter().filter_map(|group| group.name.as_deref()).collect();
    let mut found = Vec::new();
    for name in entry.list().unwrap_or_default() {
        let Some(given) = name.text() else { continue };
        match groups.iter().position(|group| group.name.as_deref() == Some(given)) {
            None if known.len() < groups.len() => {}
            None => name.report(rules::unknown("group", given, &known)),
            Some(index) if index == own => {
                name.report(ProblemKind::StopsWithItself { name: given.to_owned() });
            }
            Some(index) if found.contains(&index) => {
                name.report(ProblemKind::Repeated { key: entry.spot.key.clone(), given: given.to_owned() });
            }
            Some(index) => found.push(index),
        }
    }
    found
}

/// The group that a move names. Where there are several, it must; where there is none, it must not.
pub fn group_of(section: &mut Section<'_>, groups: &[ReadGroup]) -> Option<usize> {
    let entry = match groups {
        [] | [_] => section.get("group"),
        _ => section.require("group", "the group that moves: group = \"arm\""),
    };
    let Some(entry) = entry else { return (groups.len() < 2).then_some(0) };
    let given = entry.text()?;
    let found = groups.iter().position(|group| group.name.as_deref() == Some(given));
    let known: Vec<&str> = groups.iter().filter_map(|group| group.name.as_deref()).collect();
    if found.is_none() && known.len() == groups.len() {
        entry.report(rules::unknown("group", given, &known));
    }
    found
}
