//! The curves of an axis, and the timing, as panels of a chart.

use takt_rt::NANOSECONDS_PER_SECOND;

use super::curves::{AxisCurves, Curves, Envelope};
use crate::chart::{COLOURS, Chart, Curve, Panel, SHADED_WORDS};
use takt::telemetry::{AxisDescription, Recorded, RecordedError, Unit};

/// The time that is shown before the stop, and after it.
const BEFORE_NS: u64 = NANOSECONDS_PER_SECOND;
const AFTER_NS: u64 = NANOSECONDS_PER_SECOND / 2;
/// The most columns of a drawing: all cycles around a stop, and enough for a long run.
const COLUMNS: usize = 1600;

/// An axis and the timing: around the stop, or of everything that is read.
pub fn render(recorded: &Recorded, axis: Option<usize>, is_whole: bool) -> Result<String, RecordedError> {
    let cause = recorded.cause().filter(|_| !is_whole);
    let cycle_ns = recorded.machine.cycle_ns.max(1);
    let (slots, zero) = match (&cause, recorded.slots) {
        (_, Some((first, last))) if is_whole => (first..=last, recorded.first_slot()),
        // The time axis counts from the stop.
        (cause, _) => {
            let slots = recorded.slots_around_cause(BEFORE_NS / cycle_ns, AFTER_NS / cycle_ns);
            let zero = cause.as_ref().map_or(*slots.end(), |cause| cause.slot);
            (slots, zero)
        }
    };
    let curves = Curves::read(recorded, &slots, zero, COLUMNS)?;
    let following_limit = cause.as_ref().filter(|cause| cause.rule == "following_error");
    let following_limit = following_limit.and_then(|cause| cause.limit);
    let mut panels = Vec::new();
    if let Some(axis) = axis {
        let description = recorded.machine.axes.get(axis).zip(curves.axes.get(axis));
        panels.extend(description.into_iter().flat_map(|(description, curves)| {
            let prefix = format!("{}: ", description.name);
            axis_panels(&prefix, description, curves, following_limit)
        }));
    }
    panels.push(timing_panel(&curves));
    let title = cause.as_ref().map_or_else(|| recorded.machine.name.clone(), |cause| cause.reason.clone());
    let mark_s = cause.is_some().then_some(0.0);
    Ok(Chart { title, span_s: curves.span_s, mark_s, panels }.draw())
}

/// Position, velocity, acceleration, torque and following error of an axis.
pub fn axis_panels(
    prefix: &str,
    description: &AxisDescription,
    curves: &AxisCurves,
    following_limit: Option<f64>,
) -> Vec<Panel> {
    let AxisDescription { unit, limits, .. } = description;
    let (symbol, silences) = (unit.symbol(), curves.silences());
    let (torque, torque_unit) = match unit {
        Unit::Radian => ("torque", "N·m"),
        Unit::Metre => ("force", "N"),
    };
    let set_and_actual =
        |set: &Envelope, actual: &Envelope| vec![("set", set.points(1.0)), ("actual", actual.points(1.0))];
    let mut panels = vec![
        panel(format!("{prefix}position, {symbol}"), set_and_actual(&curves.position_set, &curves.position)),
        panel(
            format!("{prefix}velocity, {symbol}/s"),
            set_and_actual(&curves.velocity_set, &curves.velocity),
        ),
        panel(
            format!("{prefix}acceleration, {symbol}/s²"),
            vec![("set", curves.acceleration_set.points(1.0))],
        ),
        panel(format!("{prefix}{torque}, {torque_unit}"), set_and_actual(&curves.torque_set, &curves.torque)),
        panel(
            format!("{prefix}following error, {}", unit.milli_symbol()),
            vec![("", curves.following_error.points(1e3))],
        ),
    ];
    // A limit is drawn where the curve comes near it: elsewhere it would flatten the curve.
    for (panel, limit) in panels.iter_mut().skip(1).zip([limits.velocity, limits.acceleration]) {
        let values = panel.curves.iter().flat_map(|curve| curve.points.iter().map(|(_, value)| value.abs()));
        if values.fold(0.0, f64::max) >= 0.5 * limit {
            panel.limits = [limit, -limit].map(|limit| (limit, COLOURS[1])).to_vec();
        }
    }
    if let (Some(limit), Some(panel)) = (following_limit, panels.last_mut()) {
        panel.limits = [limit, -limit].map(|limit| (limit * 1e3, COLOURS[1])).to_vec();
    }
    panels.iter_mut().for_each(|panel| panel.shaded.clone_from(&silences));
    if let Some(first) = panels.first_mut().filter(|_| !silences.is_empty()) {
        first.legend.push(("grey: no feedback".to_owned(), SHADED_WORDS));
    }
    panels
}

/// The times of each cycle.
pub fn timing_panel(curves: &Curves) -> Panel {
    let us = |envelope: &Envelope| envelope.points(1e-3);
    let times =
        vec![("wake-up", us(&curves.wake)), ("SYNC", us(&curves.sync)), ("computing", us(&curves.compute))];
    panel("timing, µs".to_owned(), times)
}

/// The loads of the buses.
pub fn load_panel(recorded: &Recorded, span_s: (f64, f64), columns: usize) -> Panel {
    let of_bus = |bus: usize| {
        let loads = recorded.loads.iter().filter(move |load| load.bus == bus);
        let points = loads.map(|load| (recorded.seconds(load.at_ns), 100.0 * load.load));
        Envelope::of(points, span_s, columns).points(1.0)
    };
    let buses = recorded.machine.buses.iter().enumerate();
    let curves = buses.map(|(number, bus)| (bus.name.as_str(), of_bus(number))).collect();
    panel("bus load, %".to_owned(), curves)
}

fn panel(name: String, curves: Vec<(&str, Vec<(f64, f64)>)>) -> Panel {
    let coloured = || COLOURS.into_iter().cycle().zip(&curves);
    Panel {
        name,
        legend: coloured().map(|(colour, (name, _))| ((*name).to_owned(), colour)).collect(),
        curves: coloured().map(|(colour, (_, points))| Curve { colour, points: points.clone() }).collect(),
        limits: Vec::new(),
        shaded: Vec::new(),
    }
}
