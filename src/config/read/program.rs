//! `[program]`

use super::axis::{ReadAxis, contains, show_range};
use super::entry::{Bounds, Entry};
use super::section::Section;
use crate::config::defaults;
use crate::config::error::ProblemKind;
use crate::config::model::{Program, ProgramMove};
use crate::config::quantity::Quantity;

/// Moves and rests longer than this are slips of the unit.
const LONGEST_S: f64 = 3600.0;

pub fn program(mut section: Section<'_>, axes: &[ReadAxis]) -> Program {
    let repeat = section.get("repeat").and_then(|entry| entry.integer(1..1_000_001));
    let moves =
        section.sections("move").into_iter().filter_map(|section| program_move(section, axes)).collect();
    section.finish();
    Program {
        repeat: repeat.and_then(|repeat| u32::try_from(repeat).ok()).unwrap_or(defaults::REPEAT),
        moves,
    }
}

fn program_move(mut section: Section<'_>, axes: &[ReadAxis]) -> Option<ProgramMove> {
    let target = section
        .require("to", "a target for every axis, to = [\"30 deg\", …], or one for all of them")
        .and_then(|entry| target(&entry, axes));
    let mut share =
        |key| section.get(key).and_then(|entry: Entry<'_>| entry.quantity(Quantity::FRACTION, Bounds::Share));
    let (velocity_scale, acceleration_scale) = (share("velocity"), share("acceleration"));
    let mut seconds = |key| {
        section
            .get(key)
            .and_then(|entry: Entry<'_>| entry.quantity(Quantity::DURATION, Bounds::Between(0.0, LONGEST_S)))
    };
    let (minimum_duration_s, dwell_s) = (seconds("minimum_duration"), seconds("dwell"));
    section.finish();
    Some(ProgramMove {
        target: target?,
        velocity_scale: velocity_scale.unwrap_or(1.0),
        acceleration_scale: acceleration_scale.unwrap_or(1.0),
        minimum_duration_s: minimum_duration_s.unwrap_or(0.0),
        dwell_s: dwell_s.unwrap_or(0.0),
    })
}

fn target(entry: &Entry<'_>, axes: &[ReadAxis]) -> Option<Vec<f64>> {
    let entries = if entry.is_list() { entry.list()? } else { vec![entry.clone(); axes.len()] };
    if entries.len() != axes.len() {
        entry.report(ProblemKind::TargetCount { given: entries.len(), axes: axes.len() });
        return None;
    }
    let targets: Vec<_> = entries.iter().zip(axes).map(|(entry, axis)| axis_target(entry, axis)).collect();
    targets.into_iter().collect()
}

fn axis_target(entry: &Entry<'_>, axis: &ReadAxis) -> Option<f64> {
    let quantity = axis.quantities.position;
    let target = entry.quantity(quantity, Bounds::Finite)?;
    if let Some(limits) = axis.limits.as_ref().filter(|limits| !contains(limits, target)) {
        entry.report(ProblemKind::TargetOutsideLimits {
            axis: axis.name.clone().unwrap_or_default(),
            value: quantity.show(target),
            allowed: show_range(limits, axis.quantities),
        });
    }
    Some(target)
}
