//! A recording as one page, which needs nothing beside itself.

use std::fmt::Write as _;

use takt_rt::Rule;

use super::charts::{axis_panels, load_panel, timing_panel};
use super::curves::Curves;
use super::histogram;
use super::timeline::{self, severity_word};
use crate::chart::{Chart, Panel};
use crate::svg::escaped;
use takt::telemetry::missed_slots::counted_once;
use takt::telemetry::words::rule_key;
use takt::telemetry::{
    AxisSummary, LatencyReport, Recorded, RecordedError, RecordedEvent, RecordingReport, Severity,
};

const STYLE: &str = include_str!("page.css");
/// The columns of a curve on the page, and of all curves of all axes: a page of many axes stays below some megabytes.
const COLUMNS: usize = 600;
const COLUMNS_OF_ALL_AXES: usize = 9_600;
/// The most events of the table.
const EVENTS: usize = 2_000;

/// Makes the page.
pub fn render(recorded: &Recorded, report: &RecordingReport) -> Result<String, RecordedError> {
    let (first, last) = recorded.slots.unwrap_or((0, 0));
    let axes = recorded.machine.axes.len().max(1);
    let columns = COLUMNS.min(COLUMNS_OF_ALL_AXES / axes).max(100);
    let curves = Curves::read(recorded, &(first..=last), recorded.first_slot(), columns)?;
    let mut page = String::new();
    head(&mut page, report);
    events(&mut page, recorded, &curves);
    summary(&mut page, report);
    // Writing to a string cannot fail.
    let mark_s = report.cause.as_ref().map(|cause| {
        (cause.slot as f64 - recorded.first_slot() as f64) * recorded.machine.cycle_ns as f64 * 1e-9
    });
    let mark_s = mark_s.filter(|mark_s| (curves.span_s.0..=curves.span_s.1).contains(mark_s));
    let chart = |panel| Chart { span_s: curves.span_s, mark_s, panels: vec![panel], ..Chart::default() };
    for (number, (description, of_axis)) in recorded.machine.axes.iter().zip(&curves.axes).enumerate() {
        let _ = writeln!(
            page,
            "<section id=\"axis{number}\"><h2>{}</h2><div class=\"grid\">",
            escaped(&description.name)
        );
        let limit = report.cause.as_ref().filter(|cause| {
            cause.rule == "following_error" && cause.axis.as_ref() == Some(&description.name)
        });
        let limit = limit.and_then(|cause| cause.limit);
        for panel in axis_panels("", description, of_axis, limit) {
            figure(&mut page, &description.name, &chart, panel);
        }
        page.push_str("</div></section>\n");
    }
    page.push_str("<section id=\"timing\"><h2>Timing and buses</h2><div class=\"grid\">\n");
    figure(&mut page, "all", &chart, timing_panel(&curves));
    if !recorded.loads.is_empty() {
        figure(&mut page, "all", &chart, load_panel(recorded, curves.span_s, columns));
    }
    histograms(&mut page, report);
    page.push_str("</div>\n");
    loads_and_buses(&mut page, report);
    foot(&mut page, report);
    Ok(page)
}

fn head(page: &mut String, report: &RecordingReport) {
    let machine = escaped(&report.machine);
    let kind = if report.is_black_box { "black box" } else { "recording" };
    let (from_s, to_s) = report.span_s;
    // Writing to a string cannot fail.
    let _ = writeln!(
        page,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width, \
         initial-scale=1\"><title>{machine}: {kind}</title><style>\n{STYLE}</style></head><body><main>\n<h1>{machine}</h1>"
    );
    let begins = report.begins.as_deref().unwrap_or("an unknown time");
    let _ = writeln!(
        page,
        "<p class=\"faint\">{kind} of {} cycles of {} ms, {:.3} s from {begins}{}</p>",
        report.cycles,
        report.cycle_ns as f64 * 1e-6,
        to_s - from_s,
        if from_s > 0.0 { format!(", {from_s:.3} s after its beginning") } else { String::new() }
    );
    let (class, verdict) = match &report.cause {
        None => ("", "No group has stopped before the end.".to_owned()),
        Some(cause) if cause.rule == rule_key(Rule::Requested) => {
            ("", format!("Stop on request: {} (slot {})", cause.reason, cause.slot))
        }
        Some(cause) => (" error", format!("Stop: {} (slot {})", cause.reason, cause.slot)),
    };
    let _ = writeln!(page, "<p class=\"verdict{class}\">{}</p>", escaped(&verdict));
    for warning in &report.warnings {
        let _ = writeln!(page, "<p class=\"verdict error\">{}</p>", escaped(warning));
    }
    for group in &report.groups {
        let stop = group.stop.as_ref().map_or("no stop", |stop| &stop.reason);
        let end = group.phase.map_or(String::new(), |phase| format!("; {phase} at the end"));
        let _ = writeln!(page, "<p><b>{}</b>: {}{end}</p>", escaped(&group.name), escaped(stop));
    }
    page.push_str("<nav>");
    for (number, axis) in report.axes.iter().enumerate() {
        let _ = write!(page, "<a href=\"#axis{number}\">{}</a> ", escaped(&axis.name));
    }
    page.push_str("<a href=\"#timing\">timing and buses</a></nav>\n");
}

fn events(page: &mut String, recorded: &Recorded, curves: &Curves) {
    page.push_str("<section><h2>Events</h2>\n");
    timeline::draw(page, recorded, curves);
    let all = &counted_once(&recorded.events);
    let is_serious =
        |event: &&RecordedEvent| event.kind.is_some_and(|kind| Severity::of(&kind) >= Severity::Warning);
    let shown: Vec<&RecordedEvent> = match all.len() {
        0..=EVENTS => all.iter().collect(),
        _ => all.iter().filter(is_serious).take(EVENTS).collect(),
    };
    // Writing to a string cannot fail.
    if shown.len() < all.len() {
        let _ = writeln!(
            page,
            "<p class=\"faint\">{} of {} events: the first of those that are warnings or errors; --from and --to show a part.</p>",
            shown.len(),
            all.len()
        );
    }
    if !shown.is_empty() {
        page.push_str("<div class=\"scroll\" tabindex=\"0\"><table class=\"events\"><thead><tr><th class=\"number\">s</th><th class=\"number\">slot</th><th>event</th></tr></thead><tbody>\n");
        for event in shown {
            let _ = writeln!(
                page,
                "<tr class=\"{}\"><td class=\"number\">{:.3}</td><td class=\"number\">{}</td><td>{}</td></tr>",
                severity_word(event),
                recorded.seconds(event.at_ns),
                event.slot,
                escaped(&event.text)
            );
        }
        page.push_str("</tbody></table></div>\n");
    }
    page.push_str("</section>\n");
}

/// All axes over the whole run.
fn summary(page: &mut String, report: &RecordingReport) {
    page.push_str(
        "<section><h2>Axes</h2><div class=\"scroll\" tabindex=\"0\"><table><thead><tr><th>axis</th><th class=\"number\">position</th>\
         <th class=\"number\">following error</th><th class=\"number\">at</th><th class=\"number\">velocity</th>\
         <th class=\"number\">acceleration</th><th class=\"number\">jerk</th><th class=\"number\">torque</th></tr></thead><tbody>\n",
    );
    for (number, axis) in report.axes.iter().enumerate() {
        let AxisSummary { unit, set_point_max, set_point_part, .. } = axis;
        let (milli, torque) = if *unit == "m" { ("mm", "N") } else { ("mrad", "N·m") };
        let position = axis.position_min.zip(axis.position_max);
        let position = position.map_or("never reported".to_owned(), |(low, high)| {
            format!("{:.4} to {:.4} {unit}", unsigned(low), unsigned(high))
        });
        let error = axis
            .following_error_max
            .map_or("never enabled".to_owned(), |error| format!("{:.3} {milli}", error * 1e3));
        let at = axis.following_error_max_at_s.map_or(String::new(), |at_s| format!("{at_s:.3} s"));
        let part = |value: f64, unit: &str, part: Option<f64>| {
            let part = part.map_or(String::new(), |part| format!(" ({:.0} %)", part * 100.0));
            format!("{value:.3} {unit}{part}")
        };
        let velocity = part(set_point_max.velocity, &format!("{unit}/s"), set_point_part.velocity);
        let acceleration =
            part(set_point_max.acceleration, &format!("{unit}/s²"), set_point_part.acceleration);
        let jerk = part(set_point_max.jerk, &format!("{unit}/s³"), set_point_part.jerk);
        // A recording has 0 for a drive that tells no torque.
        let torque = match axis.torque_max {
            0.0 => "–".to_owned(),
            largest => format!("{largest:.2} {torque}"),
        };
        let cells = [position, error, at, velocity, acceleration, jerk, torque];
        // Writing to a string cannot fail.
        let _ = write!(page, "<tr><td><a href=\"#axis{number}\">{}</a></td>", escaped(&axis.name));
        for cell in cells {
            let _ = write!(page, "<td class=\"number\">{cell}</td>");
        }
        page.push_str("</tr>\n");
    }
    page.push_str(
        "</tbody></table></div><p class=\"faint\">The largest of each; velocity, acceleration and jerk of the set-points, with their part of \
         the limit. –: no torque but 0 was reported.</p></section>\n",
    );
}

/// A value that rounds to 0 has no sign.
fn unsigned(value: f64) -> f64 {
    if value.abs() < 5e-5 { 0.0 } else { value }
}

fn figure(page: &mut String, of: &str, chart: &impl Fn(Panel) -> Chart, panel: Panel) {
    let label = escaped(&format!("{of}: {}", panel.name));
    let svg = chart(panel).draw_on_page();
    // Writing to a string cannot fail.
    let _ = writeln!(page, "<figure role=\"img\" aria-label=\"{label}\">{svg}</figure>");
}

fn histograms(page: &mut String, report: &RecordingReport) {
    let times = [
        ("wake-up", Some(&report.wake_ns)),
        ("SYNC release", Some(&report.sync_ns)),
        ("computing", Some(&report.compute_ns)),
        ("set-points handed over", Some(&report.sent_ns)),
        ("callbacks", report.callback_ns.as_ref()),
    ];
    for (name, latency) in times.into_iter().filter_map(|(name, latency)| Some((name, latency?))) {
        let LatencyReport { p50, p99, p999, max, .. } = latency;
        let us = |ns: &u64| format!("{:.1} µs", *ns as f64 * 1e-3);
        let drawing =
            histogram::draw(latency).unwrap_or_else(|| "<p class=\"faint\">always 0</p>".to_owned());
        // Writing to a string cannot fail.
        let _ = writeln!(
            page,
            "<figure>{drawing}<figcaption><b>{name}</b>, cycles by time (logarithmic): median {}, 99 % {}, 99.9 % {}, longest {}</figcaption></figure>",
            us(p50),
            us(p99),
            us(p999),
            us(max)
        );
    }
}

fn loads_and_buses(page: &mut String, report: &RecordingReport) {
    // Writing to a string cannot fail.
    let _ = writeln!(
        page,
        "<p>{} slots of {} passed unused.</p>",
        report.missed_slots,
        report.cycles + report.missed_slots
    );
    for bus in &report.bus_loads {
        let (mean, most) = (100.0 * bus.mean, 100.0 * bus.max);
        let _ = writeln!(
            page,
            "<p>{}: {mean:.1} % occupied on average, {most:.1} % in the busiest 100 ms.</p>",
            escaped(&bus.name)
        );
    }
    for bus in &report.buses {
        let _ = writeln!(
            page,
            "<p>{:.3} s: {} {}, {} errors, {} sending and {} receiving overruns</p>",
            bus.at_s,
            escaped(&bus.name),
            bus.state,
            bus.errors,
            bus.tx_overruns,
            bus.rx_overruns
        );
    }
    page.push_str("</section>\n");
}

fn foot(page: &mut String, report: &RecordingReport) {
    let file = report.recording.file_name().unwrap_or_default().to_string_lossy();
    // Writing to a string cannot fail.
    let _ = writeln!(
        page,
        "<p class=\"faint\">{}, written by takt {}. Of many cycles in one column of a curve, the lowest and the highest are drawn; --from \
         and --to show a part.</p>\n</main></body></html>",
        escaped(&file),
        escaped(&report.version)
    );
}
