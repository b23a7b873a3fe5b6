//! `[program]`

use super::axis::ReadAxis;
use super::entry::Entry;
use super::group::{ReadGroup, group_of};
use super::section::Section;
use crate::config::defaults;
use crate::config::keys::program::REPEAT;
use crate::config::keys::program_move::{ACCELERATION, DWELL, FOR, MINIMUM_DURATION, VELOCITY};
use crate::config::model::{Program, ProgramMove, ProgramTarget};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::Quantities;
use crate::config::quantity::Quantity;
use crate::config::rules::program::{self as rules, AxisView};
use crate::config::spot::Spot;

pub fn program(mut section: Section<'_>, axes: &[ReadAxis], groups: &[ReadGroup]) -> Program {
    let repeat = section.integer(&REPEAT);
    let moves = section.sections("move").into_iter();
    let moves = moves.filter_map(|section| program_move(section, axes, groups)).collect();
    section.finish();
    Program { repeat: repeat.unwrap_or(defaults::REPEAT), moves }
}

fn program_move(mut section: Section<'_>, axes: &[ReadAxis], groups: &[ReadGroup]) -> Option<ProgramMove> {
    let group = group_of(&mut section, groups);
    let own = group.and_then(|group| groups.get(group));
    let moved = Moved {
        axes: match own {
            Some(own) => own.axes.iter().filter_map(|axis| axes.get(*axis)).collect(),
            None => axes.iter().collect(),
        },
        group: own.and_then(|own| own.name.as_deref()),
    };
    // How many targets there must be is known only with the group and all of its axes.
    let is_group_known = groups.is_empty() || own.is_some_and(|own| own.is_whole);
    let target = if is_group_known {
        program_target(&mut section, &moved)
    } else {
        ["to", "speed", "torque", "for"].into_iter().for_each(|key| drop(section.get(key)));
        None
    };
    let mut value = |key| section.quantity(key, Quantities::ROTARY);
    let (velocity_scale, acceleration_scale) = (value(&VELOCITY), value(&ACCELERATION));
    let (minimum_duration_s, dwell_s) = (value(&MINIMUM_DURATION), value(&DWELL));
    section.finish();
    Some(ProgramMove {
        group: group?,
        target: target?,
        velocity_scale: velocity_scale.unwrap_or(1.0),
        acceleration_scale: acceleration_scale.unwrap_or(1.0),
        minimum_duration_s: minimum_duration_s.unwrap_or(0.0),
        dwell_s: dwell_s.unwrap_or(0.0),
    })
}

/// The axes that a move moves, in their order, and the name of their group.
struct Moved<'a> {
    axes: Vec<&'a ReadAxis>,
    group: Option<&'a str>,
}

/// One of `to`, `speed` and `torque`; the latter two last for a time.
fn program_target(section: &mut Section<'_>, moved: &Moved<'_>) -> Option<ProgramTarget> {
    let (to, speed, torque) = (section.get("to"), section.get("speed"), section.get("torque"));
    let lasting = section.get(FOR.name);
    let ignored = |entry: &Option<Entry<'_>>, beside, belongs| {
        if let Some(entry) = entry {
            entry.report(ProblemKind::Ignored { key: entry.spot.key.clone(), beside, belongs });
        }
    };
    let one_of = "a move has one of `to`, `speed` and `torque`";
    let duration_s = |section: &mut Section<'_>| match &lasting {
        Some(entry) => entry.quantity(Quantity::DURATION, FOR.bounds()),
        None => {
            section.require("for", "how long to go on: for = \"2 s\"");
            None
        }
    };
    match (speed, torque) {
        (Some(entry), torque) => {
            ignored(&to, "speed", one_of);
            ignored(&torque, "speed", one_of);
            let velocity = target(&entry, moved, |axis| axis.quantities.velocity, rules::speed)
                .filter(|all| rules::some_axis_is_driven(&entry.spot, all));
            let duration_s = duration_s(section);
            Some(ProgramTarget::Velocity { velocity: velocity?, duration_s: duration_s? })
        }
        (None, Some(entry)) => {
            ignored(&to, "torque", one_of);
            let torque = target(&entry, moved, |axis| axis.quantities.effort, rules::torque)
                .filter(|all| rules::some_axis_is_driven(&entry.spot, all));
            let duration_s = duration_s(section);
            Some(ProgramTarget::Torque { torque: torque?, duration_s: duration_s? })
        }
        (None, None) => {
            let says = "a target for every axis, to = [\"30 deg\", …], or one for all of them";
            let entry = section.require("to", says)?;
            ignored(
                &lasting,
                "to",
                "`for` belongs to `speed` or `torque`; `dwell` is standstill after a move",
            );
            target(&entry, moved, |axis| axis.quantities.position, rules::position)
                .map(ProgramTarget::Position)
        }
    }
}

fn target(
    entry: &Entry<'_>,
    moved: &Moved<'_>,
    quantity: fn(&ReadAxis) -> Quantity,
    check: fn(&Spot<'_>, f64, &AxisView<'_>),
) -> Option<Vec<f64>> {
    let entries = if entry.is_list() { entry.list()? } else { vec![entry.clone(); moved.axes.len()] };
    if !rules::count(&entry.spot, entries.len(), moved.axes.len(), moved.group) {
        return None;
    }
    let read = entries.iter().zip(&moved.axes).map(|(entry, axis)| {
        let value = entry.unbounded(quantity(axis))?;
        check(&entry.spot, value, &axis.view());
        Some(value)
    });
    // Every target is read, so that all problems of a list are found.
    read.collect::<Vec<_>>().into_iter().collect()
}
