//! The cycles before and after a stop as SVG.

use crate::telemetry::{Recorded, RecordedCycle, RecordedError};
use takt_rt::{AxisRecord, CycleTiming, NANOSECONDS_PER_SECOND};

use crate::cli::chart::{COLOURS, Chart, Curve, Panel};

/// The time that is shown before the stop, and after it.
const BEFORE_NS: u64 = NANOSECONDS_PER_SECOND;
const AFTER_NS: u64 = NANOSECONDS_PER_SECOND / 2;

/// Position, velocity, following error of an axis, and the timing.
pub fn render(recorded: &Recorded, axis: Option<usize>) -> Result<String, RecordedError> {
    let cycle_ns = recorded.machine.cycle_ns.max(1);
    let slots = recorded.slots_around_cause(BEFORE_NS / cycle_ns, AFTER_NS / cycle_ns);
    let cycles = recorded.cycles(&slots)?;
    let cause = recorded.cause();
    // The time axis counts from the stop.
    let zero = cause.as_ref().map_or(*slots.end(), |cause| cause.slot);
    let period_s = cycle_ns as f64 / NANOSECONDS_PER_SECOND as f64;
    let time_s = |slot: u64| (slot as f64 - zero as f64) * period_s;
    let points = |value: &dyn Fn(&RecordedCycle) -> Option<f64>| -> Vec<(f64, f64)> {
        cycles.iter().filter_map(|record| Some((time_s(record.timing.slot), value(record)?))).collect()
    };
    let of_axis = |value: fn(&AxisRecord) -> f64| points(&|record| record.axes.get(axis?).map(value));
    // In a cycle without feedback there is no point, and the curve has a gap.
    let reported = |value: fn(&AxisRecord) -> f64| {
        let if_fresh = |axis: &AxisRecord| if axis.feedback_age == 0 { value(axis) } else { f64::NAN };
        points(&|record| record.axes.get(axis?).map(if_fresh))
    };
    let silences = silences(&cycles, axis, &time_s);
    let of_timing =
        |value: fn(&CycleTiming) -> u64| points(&|record| Some(value(&record.timing) as f64 * 1e-3));
    let panel = |name: String, curves: Vec<(&str, Vec<(f64, f64)>)>| {
        let coloured = || COLOURS.into_iter().zip(&curves);
        Panel {
            name,
            legend: coloured().map(|(colour, (name, _))| ((*name).to_owned(), colour)).collect(),
            curves: coloured()
                .map(|(colour, (_, points))| Curve { colour, points: points.clone() })
                .collect(),
            limits: Vec::new(),
            shaded: Vec::new(),
        }
    };
    let mut panels = Vec::new();
    if let Some(description) = axis.and_then(|axis| recorded.machine.axes.get(axis)) {
        let (name, unit) = (&description.name, description.unit.symbol());
        panels.push(panel(
            format!("{name}: position, {unit}"),
            vec![("set", of_axis(|axis| axis.position_set)), ("actual", reported(|axis| axis.position))],
        ));
        panels.push(panel(
            format!("{name}: velocity, {unit}/s"),
            vec![
                ("set", of_axis(|axis| axis.velocity_set.into())),
                ("actual", reported(|axis| axis.velocity.into())),
            ],
        ));
        let mut following = panel(
            format!("{name}: following error, {}", description.unit.milli_symbol()),
            vec![("", reported(|axis| f64::from(axis.following_error) * 1e3))],
        );
        if let Some(limit) =
            cause.as_ref().filter(|cause| cause.rule == "following_error").and_then(|cause| cause.limit)
        {
            following.limits = [limit, -limit].map(|limit| (limit * 1e3, COLOURS[1])).to_vec();
        }
        panels.push(following);
        panels.iter_mut().for_each(|panel: &mut Panel| panel.shaded.clone_from(&silences));
        if let Some(first) = panels.first_mut().filter(|_| !silences.is_empty()) {
            first.legend.push(("grey: no feedback".to_owned(), NO_FEEDBACK));
        }
    }
    panels.push(panel(
        "timing, µs".to_owned(),
        vec![
            ("wake-up", of_timing(|timing| timing.wake_ns)),
            ("SYNC", of_timing(|timing| timing.sync_ns)),
            ("computing", of_timing(|timing| timing.compute_ns)),
        ],
    ));
    let title = cause.as_ref().map_or_else(|| recorded.machine.name.clone(), |cause| cause.reason.clone());
    let span_s = (time_s(*slots.start()), time_s(*slots.end()));
    let chart = Chart { title, span_s, mark_s: cause.is_some().then_some(0.0), panels };
    Ok(chart.draw())
}

/// The colour of the words for the shaded times.
const NO_FEEDBACK: &str = "#888";

/// The times in which the drive of an axis has not reported, each from the first cycle without feedback to the next one with.
fn silences(cycles: &[RecordedCycle], axis: Option<usize>, time_s: &impl Fn(u64) -> f64) -> Vec<(f64, f64)> {
    let mut silences: Vec<(f64, f64)> = Vec::new();
    let mut was_silent = false;
    for cycle in cycles {
        let Some(axis) = axis.and_then(|axis| cycle.axes.get(axis)) else { continue };
        let (is_silent, at_s) = (axis.feedback_age > 0, time_s(cycle.timing.slot));
        match silences.last_mut().filter(|_| was_silent) {
            Some(silence) => silence.1 = at_s,
            None if is_silent => silences.push((at_s, at_s)),
            None => {}
        }
        was_silent = is_silent;
    }
    silences
}
