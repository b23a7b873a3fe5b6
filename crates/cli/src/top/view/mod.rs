//! Draws a model. What it says, it says in words and signs: colours only repeat it.

mod axes;
mod buses;
mod help;
mod palette;
mod times;
mod timing;

use ratatui::Frame;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Widget, Wrap};
use takt_rt::{Nanoseconds, StreamState, TimingLevel};

use super::jog::Jog;
use super::model::Model;
pub use palette::Palette;
use takt::telemetry::words;
use times::{age, duration};

/// The columns from which on timing and buses stand beside each other.
const WIDE: u16 = 110;
/// The rows that events have at least.
const EVENTS_AT_LEAST: u16 = 2;
/// The rows that axes have at least: the heading and three of them.
const AXES_AT_LEAST: u16 = 4;

/// Draws the model as it is at a time.
pub fn draw(frame: &mut Frame<'_>, model: &Model, now_ns: Nanoseconds, palette: Palette) {
    let area = frame.area();
    let buffer = frame.buffer_mut();
    let status = status(model, now_ns, palette);
    let footer = footer(model, palette);
    let [status_rows, footer_rows] =
        [&status, &footer].map(|lines| rows(lines, area.width).min(area.height / 3).max(1));
    let [status_area, body, footer_area] = Layout::vertical([
        Constraint::Length(status_rows),
        Constraint::Min(0),
        Constraint::Length(footer_rows),
    ])
    .areas(area);
    paragraph(status).render(status_area, buffer);
    if model.is_help_shown {
        help::draw(body, buffer, palette);
    } else {
        draw_body(body, buffer, model, now_ns, palette);
    }
    paragraph(footer).render(footer_area, buffer);
}

fn paragraph(lines: Vec<Line<'_>>) -> Paragraph<'_> {
    Paragraph::new(lines).wrap(Wrap { trim: false })
}

/// The rows that lines need when they are broken between words.
fn rows(lines: &[Line<'_>], width: u16) -> u16 {
    let width = usize::from(width.max(1));
    let rows = lines.iter().map(|line| textwrap::wrap(&line.to_string(), width).len().max(1)).sum::<usize>();
    u16::try_from(rows).unwrap_or(u16::MAX)
}

fn draw_body(area: Rect, buffer: &mut Buffer, model: &Model, now_ns: Nanoseconds, palette: Palette) {
    let timing = timing::lines(model, palette);
    let buses = buses::lines(model, area.width, palette);
    let [timing_rows, bus_rows] = [timing.len(), buses.len()].map(|rows| rows as u16);
    let is_wide = area.width >= WIDE;
    let mut below = if is_wide { timing_rows.max(bus_rows) } else { timing_rows + bus_rows };
    let (mut has_timing, mut has_buses) = (true, true);
    if area.height < below + EVENTS_AT_LEAST + 1 + AXES_AT_LEAST && !is_wide {
        (has_timing, below) = (false, bus_rows);
    }
    if area.height < below + EVENTS_AT_LEAST + 1 + AXES_AT_LEAST {
        (has_timing, has_buses, below) = (false, false, 0);
    }
    let left = area.height.saturating_sub(below);
    let wanted = model.machine.axes.len() as u16 + 1;
    let axes_rows = wanted.min(left.saturating_sub(EVENTS_AT_LEAST + 1)).max(AXES_AT_LEAST.min(left));
    let [axes_area, below_area, events_area] =
        Layout::vertical([Constraint::Length(axes_rows), Constraint::Length(below), Constraint::Min(0)])
            .areas(area);
    axes::draw(axes_area, buffer, model, now_ns, palette);
    match (has_timing, has_buses) {
        (true, true) if is_wide => {
            let [left, _, right] = Layout::horizontal([
                Constraint::Length(timing::COLUMNS),
                Constraint::Length(2),
                Constraint::Min(0),
            ])
            .areas(below_area);
            Paragraph::new(timing).render(left, buffer);
            Paragraph::new(buses).render(right, buffer);
        }
        (true, _) => Paragraph::new([timing, buses].concat()).render(below_area, buffer),
        (false, true) => Paragraph::new(buses).render(below_area, buffer),
        (false, false) => {}
    }
    draw_events(events_area, buffer, model, now_ns, palette);
}

/// What there is to know of the controller as a whole.
fn status<'a>(model: &'a Model, now_ns: Nanoseconds, palette: Palette) -> Vec<Line<'a>> {
    let snapshot = &model.seen.snapshot;
    let mut first = vec![
        Span::styled(format!("{} ", model.machine.name), palette.heading()),
        Span::raw(format!("({})  ", model.name)),
    ];
    let shown_ns = model.seen.silent_for.as_nanos() as u64 + now_ns.saturating_sub(model.seen_ns);
    if model.seen.has_ended {
        first.push(Span::styled("ENDED: the last state is shown, and nothing changes it", palette.bad()));
    } else if model.is_silent() {
        let words =
            format!("SILENT for {}: paused or overloaded; the last state is shown", duration(shown_ns));
        first.push(Span::styled(words, palette.bad()));
    } else {
        let missed = snapshot.missed_slots;
        let (word, style) = match snapshot.timing {
            TimingLevel::Normal => ("punctual", palette.good()),
            TimingLevel::Warning => ("LATE: many slots missed", palette.notable()),
            TimingLevel::Degraded => ("LATE: too many slots missed to begin a stream", palette.bad()),
            TimingLevel::Unfit => ("LATE: too many slots missed to go on", palette.bad()),
        };
        first.push(Span::styled(word, style));
        first.push(Span::raw(format!("  missed slots {missed}")));
        if snapshot.dropped > 0 {
            first.push(Span::styled(format!("  dropped records {}", snapshot.dropped), palette.notable()));
        }
    }
    let mut lines = vec![Line::from(first)];
    for (number, group) in snapshot.groups().iter().enumerate() {
        let mut spans = vec![];
        if model.machine.groups.len() > 1 {
            let name = model.machine.group_name(u8::try_from(number).unwrap_or(u8::MAX));
            spans.push(Span::raw(format!("{name}: ")));
        }
        spans.push(Span::styled(words::phase(group.phase).to_uppercase(), palette.heading()));
        if group.remaining_s > 0.0 {
            spans.push(Span::raw(format!(", {:.1} s left", group.remaining_s)));
        }
        match group.stream.state {
            StreamState::Idle => {}
            StreamState::Awaited => spans.push(Span::raw(", stream awaited")),
            StreamState::Following => spans.push(Span::raw(", stream followed")),
            StreamState::Dry => spans.push(Span::raw(", stream dry: at rest")),
            StreamState::Callback => spans.push(Span::raw(", led by a callback")),
        }
        if let Some(stop) = &group.stop {
            let words = words::stop(stop, &model.machine);
            let style = if stop.is_requested() { palette.notable() } else { palette.bad() };
            spans.push(Span::styled(format!("  STOPPED: {words}"), style));
        }
        lines.push(Line::from(spans));
    }
    lines
}

/// Who commands, the jog, the question or the message, and the keys.
fn footer<'a>(model: &'a Model, palette: Palette) -> Vec<Line<'a>> {
    let mut first = vec![match (model.commands(), model.seen.lease) {
        (true, _) => Span::styled("COMMANDING (r gives the lease back)", palette.notable()),
        (false, Some(holder)) => {
            Span::raw(format!("observing; process {} has the lease (T takes over)", holder.process))
        }
        (false, None) => Span::raw("observing; the lease is free (t takes it)"),
    }];
    if model.commands() {
        let (speed, part) = model.speed();
        let axis = u8::try_from(model.axis).unwrap_or(u8::MAX);
        let unit = model.machine.axis_unit(axis).symbol();
        let words = format!("jog at {:.0} % = {speed:.3} {unit}/s", part * 100.0);
        first.push(Span::raw(format!("  {words}  commands are for {}", model.target_words())));
    }
    let keys = Line::styled("SPACE stops all  ? help  q quits, and the axes go on", palette.faint());
    let mut lines = vec![keys, Line::from(first)];
    if let Some(wish) = model.jog.moving() {
        let axis = u8::try_from(wish.axis).unwrap_or(u8::MAX);
        let sign = if wish.is_positive { '+' } else { '-' };
        let words = format!("JOGGING {} {sign}: let the key go to stop", model.machine.axis_name(axis));
        lines.push(Line::styled(words, palette.notable()));
    } else if let Some(question) = &model.question {
        lines.push(Line::styled(
            format!("{}? y does it, any other key does not", question.words),
            palette.notable(),
        ));
    } else if let Some((message, is_failure)) = &model.message {
        let style = if *is_failure { palette.bad() } else { Style::new() };
        let sign = if *is_failure { "! " } else { "" };
        lines.push(Line::styled(format!("{sign}{message}"), style));
    } else if matches!(model.jog, Jog::Resting { .. }) {
        lines.push(Line::raw("coming to rest"));
    } else {
        lines.push(Line::raw(""));
    }
    lines
}

fn draw_events(area: Rect, buffer: &mut Buffer, model: &Model, now_ns: Nanoseconds, palette: Palette) {
    let Some(room) = usize::from(area.height).checked_sub(1) else { return };
    let missed = match model.missed_events {
        0 => String::new(),
        missed => format!(" ({missed} came too fast to be shown)"),
    };
    let mut lines = vec![Line::styled(format!("EVENTS{missed}"), palette.heading())];
    let width = usize::from(area.width.max(20));
    let mut newest_first = vec![];
    for event in model.events.iter().rev() {
        let begin = format!("{:>8}  ", age(now_ns.saturating_sub(event.at_ns)));
        let sign = if event.is_urgent { "! " } else { "  " };
        let first = format!("{begin}{sign}");
        let times = if event.times > 1 { format!(" ({} times)", event.times) } else { String::new() };
        let text = format!("{first}{}{times}", event.words);
        let indent = " ".repeat(first.chars().count());
        let options = textwrap::Options::new(width).subsequent_indent(&indent);
        let style = if event.is_urgent { palette.bad() } else { Style::new() };
        let wrapped: Vec<Line<'_>> =
            textwrap::wrap(&text, options).iter().map(|row| Line::styled(row.to_string(), style)).collect();
        if newest_first.len() + wrapped.len() > room && !newest_first.is_empty() {
            break;
        }
        newest_first.extend(wrapped);
    }
    if newest_first.is_empty() {
        newest_first.push(Line::styled("none since this view began", palette.faint()));
    }
    lines.extend(newest_first);
    Paragraph::new(lines).render(area, buffer);
}
