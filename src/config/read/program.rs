//! `[program]`

use super::axis::ReadAxis;
use super::entry::{Bounds, Entry};
use super::limits::{contains, show_range};
use super::section::Section;
use crate::config::defaults;
use crate::config::model::{Control, Limits, Program, ProgramMove, ProgramTarget};
use crate::config::problem_kind::ProblemKind;
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
    let target = program_target(&mut section, axes);
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

/// One of `to`, `speed` and `torque`; the latter two last for a time.
fn program_target(section: &mut Section<'_>, axes: &[ReadAxis]) -> Option<ProgramTarget> {
    let (speed, torque) = (section.get("speed"), section.get("torque"));
    let duration = section.get("for");
    let duration_s = |section: &mut Section<'_>| match &duration {
        Some(entry) => entry.quantity(Quantity::DURATION, Bounds::Between(0.0, LONGEST_S)),
        None => {
            section.require("for", "how long to go on: for = \"2 s\"");
            None
        }
    };
    match (speed, torque) {
        (Some(entry), _) => {
            let velocity =
                target(&entry, axes, driven_at_speed).filter(|all| some_axis_is_driven(&entry, all));
            let duration_s = duration_s(section);
            Some(ProgramTarget::Velocity { velocity: velocity?, duration_s: duration_s? })
        }
        (None, Some(entry)) => {
            let torque =
                target(&entry, axes, driven_with_torque).filter(|all| some_axis_is_driven(&entry, all));
            let duration_s = duration_s(section);
            Some(ProgramTarget::Torque { torque: torque?, duration_s: duration_s? })
        }
        (None, None) => section
            .require("to", "a target for every axis, to = [\"30 deg\", …], or one for all of them")
            .and_then(|entry| target(&entry, axes, axis_target))
            .map(ProgramTarget::Position),
    }
}

fn target(
    entry: &Entry<'_>,
    axes: &[ReadAxis],
    read: fn(&Entry<'_>, &ReadAxis) -> Option<f64>,
) -> Option<Vec<f64>> {
    let entries = if entry.is_list() { entry.list()? } else { vec![entry.clone(); axes.len()] };
    if entries.len() != axes.len() {
        entry.report(ProblemKind::TargetCount { given: entries.len(), axes: axes.len() });
        return None;
    }
    let targets: Vec<_> = entries.iter().zip(axes).map(|(entry, axis)| read(entry, axis)).collect();
    targets.into_iter().collect()
}

/// Zero is where such a step ends by itself.
fn some_axis_is_driven(entry: &Entry<'_>, values: &[f64]) -> bool {
    let is_any = values.iter().any(|value| *value != 0.0);
    if !is_any {
        entry.report_range("0 for every axis".to_owned(), "more or less than 0 for one of them".to_owned());
    }
    is_any
}

fn driven_at_speed(entry: &Entry<'_>, axis: &ReadAxis) -> Option<f64> {
    driven(entry, axis, axis.quantities.velocity, Control::ProfileVelocity, |limits| limits.velocity)
}

fn driven_with_torque(entry: &Entry<'_>, axis: &ReadAxis) -> Option<f64> {
    driven(entry, axis, axis.quantities.effort, Control::ProfileTorque, |limits| limits.torque)
}

/// A speed or a torque within the limit of an axis, whose mode must take one unless it is 0.
fn driven(
    entry: &Entry<'_>,
    axis: &ReadAxis,
    quantity: Quantity,
    mode: Control,
    limit: fn(&Limits) -> f64,
) -> Option<f64> {
    let value = entry.quantity(quantity, Bounds::Finite)?;
    let name = axis.name.as_deref().unwrap_or_default();
    if value != 0.0 && axis.axis.as_ref().is_some_and(|axis| axis.control != mode) {
        let word = if mode == Control::ProfileTorque { "pt" } else { "pv" };
        entry.report_range(quantity.show(value), format!("0, since {name} is not in mode = \"{word}\""));
    }
    if let Some(limit) = axis.limits.as_ref().map(limit).filter(|limit| value.abs() > *limit) {
        entry.report_range(
            quantity.show(value),
            format!("at most {}, the limit of {name}", quantity.show(limit)),
        );
    }
    Some(value)
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
