//! The program of moves.

use super::{Fields, group};
use crate::config::bounds::Bounds;
use crate::config::keys::program::REPEAT;
use crate::config::keys::program_move::{ACCELERATION, DWELL, FOR, MINIMUM_DURATION, VELOCITY};
use crate::config::model::{Axis, Config, Control, Limits, ProgramMove, ProgramTarget};
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::Quantities;
use crate::config::quantity::Quantity;
use crate::config::spot::Spot;

use super::limits::contains;

pub fn validate(config: &Config, whole: &Fields<'_>) {
    let (program, fields) = (&config.program, whole.within("program"));
    // `Program::default()` is no program; it repeats nothing.
    if !program.moves.is_empty() || program.repeat != 0 {
        fields.integer(&REPEAT, program.repeat);
    }
    for (index, present) in program.moves.iter().enumerate() {
        let fields = fields.element("move", "program.moves", index, "");
        if present.group > 0 && present.group >= config.groups.len() {
            let known: Vec<&str> = config.groups.iter().map(|group| group.name.as_str()).collect();
            fields.at("group").report(group::unknown("group", &present.group.to_string(), &known));
            continue;
        }
        validate_target(present, config, &fields);
        for (key, value) in [
            (&VELOCITY, present.velocity_scale),
            (&ACCELERATION, present.acceleration_scale),
            (&MINIMUM_DURATION, present.minimum_duration_s),
            (&DWELL, present.dwell_s),
        ] {
            fields.quantity(key, Quantities::ROTARY, value);
        }
    }
}

fn validate_target(present: &ProgramMove, config: &Config, fields: &Fields<'_>) {
    let numbers = config.axes_of_group(present.group);
    let axes: Vec<&Axis> = numbers.iter().filter_map(|axis| config.axes.get(*axis)).collect();
    let group = config.groups.get(present.group).map(|group| group.name.as_str());
    let of_axes = |key, values: &[f64], check: &dyn Fn(&Spot<'_>, f64, &AxisView<'_>)| {
        let spot = fields.at(key);
        let is_sound = count(&spot, values.len(), axes.len(), group);
        if is_sound {
            axes.iter().zip(values).for_each(|(axis, value)| check(&spot, *value, &AxisView::of(axis)));
        }
        is_sound.then_some(spot)
    };
    match &present.target {
        ProgramTarget::Position(positions) => {
            of_axes("to", positions, &|spot, value, axis| position(spot, value, axis));
        }
        ProgramTarget::Velocity { velocity, duration_s } => {
            if let Some(spot) = of_axes("speed", velocity, &|spot, value, axis| speed(spot, value, axis)) {
                some_axis_is_driven(&spot, velocity);
            }
            fields.quantity(&FOR, Quantities::ROTARY, *duration_s);
        }
        ProgramTarget::Torque { torque, duration_s } => {
            if let Some(spot) =
                of_axes("torque", torque, &|spot, value, axis| self::torque(spot, value, axis))
            {
                some_axis_is_driven(&spot, torque);
            }
            fields.quantity(&FOR, Quantities::ROTARY, *duration_s);
        }
    }
}

/// What a target of a move needs to know of its axis, as far as it is known.
pub struct AxisView<'a> {
    pub name: &'a str,
    pub quantities: Quantities,
    pub limits: Option<&'a Limits>,
    pub control: Option<Control>,
}

impl<'a> AxisView<'a> {
    fn of(axis: &'a Axis) -> Self {
        Self {
            name: &axis.name,
            quantities: Quantities::of(axis.travel),
            limits: Some(&axis.limits),
            control: Some(axis.control),
        }
    }
}

/// A target for every axis of the group that moves, which is named where there are several.
pub fn count(spot: &Spot<'_>, given: usize, axes: usize, group: Option<&str>) -> bool {
    if given != axes {
        spot.report(ProblemKind::TargetCount { given, axes, group: group.map(str::to_owned) });
    }
    given == axes
}

/// A position within the limits of an axis.
pub fn position(spot: &Spot<'_>, target: f64, axis: &AxisView<'_>) {
    let quantity = axis.quantities.position;
    if spot.quantity(target, quantity, Bounds::Finite).is_none() {
        return;
    }
    if let Some(limits) = axis.limits.filter(|limits| !contains(limits, target)) {
        spot.report(ProblemKind::TargetOutsideLimits {
            axis: axis.name.to_owned(),
            value: quantity.show(target),
            allowed: axis.quantities.show_range(limits),
        });
    }
}

/// A speed within the limit of an axis in profile velocity.
pub fn speed(spot: &Spot<'_>, value: f64, axis: &AxisView<'_>) {
    driven(spot, value, axis, axis.quantities.velocity, Control::ProfileVelocity, |limits| limits.velocity);
}

/// A torque within the limit of an axis in profile torque.
pub fn torque(spot: &Spot<'_>, value: f64, axis: &AxisView<'_>) {
    driven(spot, value, axis, axis.quantities.effort, Control::ProfileTorque, |limits| limits.torque);
}

/// A speed or a torque within the limit of an axis, whose mode must take one unless it is 0.
fn driven(
    spot: &Spot<'_>,
    value: f64,
    axis: &AxisView<'_>,
    quantity: Quantity,
    mode: Control,
    limit: fn(&Limits) -> f64,
) {
    if spot.quantity(value, quantity, Bounds::Finite).is_none() {
        return;
    }
    let name = axis.name;
    if value != 0.0 && axis.control.is_some_and(|control| control != mode) {
        let word = if mode == Control::ProfileTorque { "pt" } else { "pv" };
        spot.report_range(quantity.show(value), format!("0, since {name} is not in mode = \"{word}\""));
    }
    if let Some(limit) = axis.limits.map(limit).filter(|limit| value.abs() > *limit) {
        let allowed = format!("at most {}, the limit of {name}", quantity.show(limit));
        spot.report_range(quantity.show(value), allowed);
    }
}

/// Such a step ends at 0 by itself.
pub fn some_axis_is_driven(spot: &Spot<'_>, values: &[f64]) -> bool {
    let is_any = values.iter().any(|value| *value != 0.0);
    if !is_any {
        spot.report_range("0 for every axis".to_owned(), "more or less than 0 for one of them".to_owned());
    }
    is_any
}
