//! The groups.

use takt_rt::MAX_GROUPS;
use takt_wire::printable::excerpt;

use super::{Fields, name};
use crate::config::model::Config;
use crate::config::problem_kind::ProblemKind;
use crate::config::spelling;

pub fn validate(config: &Config, whole: &Fields<'_>) {
    let groups = &config.groups;
    if groups.len() > MAX_GROUPS {
        whole.at("group").report(too_many(groups.len()));
        return;
    }
    for (index, group) in groups.iter().enumerate() {
        let fields = whole.element("group", "groups", index, &group.name);
        let earlier = groups.get(..index).unwrap_or_default();
        name(&fields.at("name"), &group.name);
        if earlier.iter().any(|other| other.name == group.name) {
            fields.at("name").report(duplicate_name(&group.name));
        }
        validate_axes(config, index, &fields);
        let known: Vec<&str> = groups.iter().map(|group| group.name.as_str()).collect();
        for with in &group.stops_with {
            if *with >= groups.len() {
                fields.at("stops_with").report(unknown("group", &with.to_string(), &known));
            } else if *with == index {
                fields.at("stops_with").report(ProblemKind::StopsWithItself { name: group.name.clone() });
            }
        }
    }
    for (index, axis) in config.axes.iter().enumerate() {
        if !groups.is_empty() && !groups.iter().any(|group| group.axes.contains(&index)) {
            whole.at("group").report(ProblemKind::InNoGroup { axis: axis.name.clone() });
        }
    }
}

fn validate_axes(config: &Config, index: usize, fields: &Fields<'_>) {
    let Some(group) = config.groups.get(index) else { return };
    let spot = fields.at("axes");
    if group.axes.is_empty() {
        spot.report(no_axis(&spot.key));
    }
    for (place, number) in group.axes.iter().enumerate() {
        let Some(axis) = config.axes.get(*number) else {
            let known: Vec<&str> = config.axes.iter().map(|axis| axis.name.as_str()).collect();
            spot.report(unknown("axis", &number.to_string(), &known));
            continue;
        };
        if group.axes.iter().take(place).any(|other| other == number) {
            spot.report(ProblemKind::Repeated { key: spot.key.clone(), given: axis.name.clone() });
        } else if let Some(first) = config.groups.iter().take(index).find(|other| other.axes.contains(number))
        {
            spot.report(in_two_groups(&axis.name, &first.name));
        }
    }
}

pub fn too_many(given: usize) -> ProblemKind {
    ProblemKind::TooMany { what: "groups", given, limit: MAX_GROUPS }
}

pub fn duplicate_name(name: &str) -> ProblemKind {
    ProblemKind::DuplicateName { what: "group", name: name.to_owned() }
}

pub fn no_axis(key: &str) -> ProblemKind {
    ProblemKind::OutOfRange {
        key: key.to_owned(),
        value: "an empty list".to_owned(),
        allowed: "the names of one axis or more".to_owned(),
    }
}

pub fn in_two_groups(axis: &str, group: &str) -> ProblemKind {
    ProblemKind::InTwoGroups { axis: axis.to_owned(), group: group.to_owned() }
}

/// An axis or a group that is not there.
pub fn unknown(what: &'static str, given: &str, known: &[&str]) -> ProblemKind {
    let nearest = spelling::nearest(given, known.iter().copied()).map(str::to_owned);
    let known = known.iter().map(|name| (*name).to_owned()).collect();
    ProblemKind::UnknownName { what, name: excerpt(given), nearest, known }
}
