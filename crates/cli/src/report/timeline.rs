//! The phases of the groups, and the events, on one line each.

use std::fmt::Write as _;

use takt_rt::Phase;

use super::curves::Curves;
use crate::chart::ticks;
use crate::svg::escaped;
use takt::telemetry::{Recorded, RecordedEvent, Severity, phase_words};

/// Events that lie closer together than this part of the line are one mark, that of the most serious one.
const PLACES: f64 = 500.0;
/// The most times below the lines.
const TIMES: usize = 5;
/// The most spans of phases on a line.
const SPANS: usize = 2_000;

/// The lines, as a part of a page.
pub fn draw(page: &mut String, recorded: &Recorded, curves: &Curves) {
    let (from_s, to_s) = curves.span_s;
    let length_s = if to_s > from_s { to_s - from_s } else { 1.0 };
    let percent = |at_s: f64| (100.0 * (at_s - from_s) / length_s).clamp(0.0, 100.0);
    let mut seen: Vec<Phase> = Vec::new();
    for (number, spans) in curves.phases.iter().enumerate() {
        let name = recorded.machine.groups.get(number).map_or("phase", String::as_str);
        // Writing to a string cannot fail.
        let _ = write!(page, "<div class=\"lane\"><span>{0}</span><div class=\"track\">", escaped(name));
        for span in spans.iter().take(SPANS) {
            let (left, right, word) = (percent(span.from_s), percent(span.to_s), phase_words(span.phase));
            let _ = write!(
                page,
                "<i style=\"left:{left:.2}%;width:{:.2}%;background:var(--{word})\" title=\"{word}, {:.3} s to {:.3} s\"></i>",
                right - left,
                span.from_s,
                span.to_s
            );
            if !seen.contains(&span.phase) {
                seen.push(span.phase);
            }
        }
        page.push_str("</div></div>\n");
    }
    let _ = write!(page, "<div class=\"lane\"><span>events</span><div class=\"track\">");
    for event in marks(recorded, &percent) {
        let _ = write!(
            page,
            "<i class=\"{}\" style=\"left:{:.2}%\" title=\"{:.3} s: {}\"></i>",
            severity_word(event),
            percent(recorded.seconds(event.at_ns)).min(99.7),
            recorded.seconds(event.at_ns),
            escaped(&event.text)
        );
    }
    page.push_str("</div></div>\n<div class=\"lane\"><span></span><div class=\"track times\">");
    for tick in ticks(from_s, to_s, TIMES) {
        let _ = write!(page, "<b style=\"left:{:.2}%\">{} s</b>", percent(tick.value), tick.label);
    }
    page.push_str("</div></div>\n<p class=\"legend\">");
    for word in seen.into_iter().map(phase_words) {
        let _ = write!(page, "<span><i style=\"background:var(--{word})\"></i>{word}</span>");
    }
    for (colour, word) in [("error", "stop for a fault"), ("warning", "warning"), ("info", "other event")] {
        let _ = write!(page, "<span><i style=\"background:var(--{colour})\"></i>{word}</span>");
    }
    page.push_str("</p>\n");
}

/// The events that are marked: of those at one place, the most serious.
fn marks<'a>(recorded: &'a Recorded, percent: &impl Fn(f64) -> f64) -> Vec<&'a RecordedEvent> {
    let place = |event: &RecordedEvent| (percent(recorded.seconds(event.at_ns)) * PLACES / 100.0) as u32;
    let mut marks: Vec<&RecordedEvent> = Vec::new();
    for event in &recorded.events {
        match marks.last_mut().filter(|last| place(last) == place(event)) {
            Some(last) if severity(last) < severity(event) => *last = event,
            Some(_) => {}
            None => marks.push(event),
        }
    }
    marks
}

fn severity(event: &RecordedEvent) -> Severity {
    event.kind.map_or(Severity::Info, |kind| Severity::of(&kind))
}

/// The severity of an event as the style of the page knows it.
pub fn severity_word(event: &RecordedEvent) -> &'static str {
    match severity(event) {
        Severity::Debug => "debug",
        Severity::Info => "info",
        Severity::Warning => "warning",
        Severity::Error => "error",
    }
}
