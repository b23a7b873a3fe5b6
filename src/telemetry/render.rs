//! Renders the report of a run as text for people, in at most 80 columns. Histograms consist of block characters. Colours
//! are optional. Other reports use parts of it.

use std::fmt::Write;

use takt_wire::printable::{printable, printable_path};

use super::report::{
    AxisReport, BusReport, DECADES, GroupReport, LatencyReport, RANGES_PER_DECADE, RealtimeReport, RunEnd,
    RunReport, SetPointParts, StopReport,
};

/// Rows of the bars of a histogram.
const ROWS: usize = 3;
const EIGHTHS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
const DECADE_LABELS: [&str; DECADES + 1] = ["100ns", "1µs", "10µs", "100µs", "1ms", "10ms", "100ms"];
/// The width of a report: that of the smallest usual terminal.
pub(crate) const COLUMNS: usize = 80;
/// Units that no other word begins with.
const UNITS: [&str; 2] = ["µs", "%"];
/// The column at which the text of a paragraph begins.
const INDENT: usize = 13;

/// How text may be emphasised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Emphasis {
    /// Plain text, for outputs other than a terminal.
    None,
    /// ANSI escape sequences.
    Ansi,
}

impl Emphasis {
    fn apply(self, code: &str, text: &str) -> String {
        match self {
            Self::None => text.to_owned(),
            Self::Ansi => format!("\x1b[{code}m{text}\x1b[0m"),
        }
    }

    pub fn heading(self, text: &str) -> String {
        self.apply("1", text)
    }

    pub fn faint(self, text: &str) -> String {
        self.apply("2", text)
    }

    pub fn accent(self, text: &str) -> String {
        self.apply("36", text)
    }

    pub fn good(self, text: &str) -> String {
        self.apply("32", text)
    }

    pub fn bad(self, text: &str) -> String {
        self.apply("1;31", text)
    }
}

impl RunReport {
    /// The report as text of at most 80 columns. Paths and commands are not broken and may be longer.
    pub fn render(&self, emphasis: Emphasis) -> String {
        let mut text = String::new();
        self.headline(&mut text, emphasis);
        self.latencies(&mut text, emphasis);
        self.axis_table(&mut text, emphasis);
        self.bus_table(&mut text, emphasis);
        self.paragraphs(&mut text, emphasis);
        text
    }

    fn headline(&self, text: &mut String, emphasis: Emphasis) {
        let cycle_ms = self.cycle_ns as f64 * 1e-6;
        let (seconds, cycles) = (self.duration_s, self.cycles);
        let run = format!("{cycles} cycles of {cycle_ms} ms, {seconds:.2} s");
        match &self.stop {
            None => {
                let verdict = match self.ended {
                    RunEnd::Finished => emphasis.good("✓ program finished"),
                    RunEnd::Interrupted => emphasis.bad("✗ interrupted before the axes were enabled"),
                    RunEnd::TakenOver => emphasis.bad("✗ taken over before the axes were enabled"),
                    RunEnd::Stopped | RunEnd::Failed => emphasis.bad("✗ failed"),
                };
                line(text, &format!("{}  {verdict}, {run}", emphasis.heading(&self.machine)));
            }
            Some(stop) => {
                let verdict = emphasis.bad(&format!("✗ category {} stop", stop.category));
                line(text, &format!("{}  {verdict} after {run}", emphasis.heading(&self.machine)));
                let group = stop.group.as_ref().map_or_else(String::new, |group| format!("{group}: "));
                wrap(text, &emphasis.bad("why"), 3, &[group + &stop_words(stop)]);
                if let Some(cure) = stop.cure {
                    wrap(text, "try", 3, &[cure.to_owned()]);
                }
            }
        }
        self.group_lines(text, emphasis);
        if self.is_power_off {
            wrap(text, "power", 5, &["off: every drive has confirmed that it has no torque".to_owned()]);
        }
    }

    /// Returns `true` if each of several groups has stopped, and why.
    fn group_lines(&self, text: &mut String, emphasis: Emphasis) {
        let group = |group: &GroupReport| {
            let stop = group.stop.as_ref().map_or_else(
                || "no stop".to_owned(),
                |stop| format!("category {} stop: {}", stop.category, stop_words(stop)),
            );
            format!("{}: {stop}", group.name)
        };
        if !self.groups.is_empty() {
            let lines: Vec<String> = self.groups.iter().map(group).collect();
            wrap(text, &emphasis.heading("groups"), 6, &lines);
        }
    }

    fn latencies(&self, text: &mut String, emphasis: Emphasis) {
        line(text, "");
        histograms(text, emphasis, &self.wake_ns, &self.sync_ns);
        line(text, "");
        let cycle = [&self.wake_ns, &self.sync_ns, &self.compute_ns, &self.sent_ns];
        let groups = self.groups.iter().map(|group| (group.name.as_str(), group.callback_ns.as_ref()));
        cycle_latencies(text, emphasis, cycle, self.callback_ns.as_ref(), groups);
        missed_slots(text, emphasis, self.missed_slots, self.cycles);
    }

    fn axis_table(&self, text: &mut String, emphasis: Emphasis) {
        if self.axes.is_empty() {
            return;
        }
        line(text, "");
        line(
            text,
            &emphasis.heading(&format!("{:<16}{:>16}   {}", "axis", "following error", "at its largest")),
        );
        for axis in &self.axes {
            line(text, &axis_row(axis));
        }
        line(text, "");
        line(
            text,
            &emphasis.heading(&format!(
                "{:<16}{:>11}{:>14}{:>11}{:>16}{:>12}",
                "of the limits", "velocity", "acceleration", "jerk", "final position", "counts off"
            )),
        );
        for axis in &self.axes {
            line(text, &end_row(axis));
        }
    }

    fn bus_table(&self, text: &mut String, emphasis: Emphasis) {
        if self.buses.is_empty() {
            return;
        }
        line(text, "");
        line(
            text,
            &emphasis.heading(&format!(
                "{:<12}{:<9}{:>8}{:>10}{:>10}{:>9}{:>7}  {}",
                "bus", "interface", "load", "sent", "received", "overruns", "errors", "state"
            )),
        );
        for bus in &self.buses {
            let row = bus_row(bus);
            let is_sound = bus.tx_overruns + bus.rx_overruns + bus.errors == 0 && bus.state == "error active";
            line(text, &if is_sound { row } else { emphasis.bad(&row) });
        }
    }

    fn paragraphs(&self, text: &mut String, emphasis: Emphasis) {
        line(text, "");
        let telemetry = &self.telemetry;
        let mut lines = vec![format!("{} records, {} dropped", telemetry.records, telemetry.dropped)];
        if telemetry.frames_dropped > 0 {
            lines.push(format!("{} frames dropped", telemetry.frames_dropped));
        }
        if let Some(path) = &telemetry.recording {
            let size =
                telemetry.recording_bytes.map_or_else(String::new, |size| format!(" ({})", bytes(size)));
            lines.push(format!("{}{size}", printable_path(path)));
        }
        if let Some(first) = telemetry.earlier_recordings.first() {
            let (kept, removed) = (telemetry.earlier_recordings.len(), telemetry.recordings_removed);
            lines.push(format!(
                "{kept} files before it, from {}; {removed} older ones were removed",
                printable_path(first)
            ));
        }
        lines.extend(telemetry.candump.iter().map(|path| printable_path(path)));
        lines.extend(telemetry.not_written.iter().map(|text| printable(text)));
        wrap(text, &emphasis.heading("telemetry"), 9, &lines);
        if !telemetry.black_boxes.is_empty() {
            let mut lines: Vec<String> =
                telemetry.black_boxes.iter().map(|path| printable_path(path)).collect();
            if telemetry.black_boxes_replaced > 0 {
                lines.push(format!(
                    "{} older files were replaced by the last one",
                    telemetry.black_boxes_replaced
                ));
            }
            lines.push("show it with `takt report FILE`".to_owned());
            wrap(text, &emphasis.heading("black box"), 9, &lines);
        }
        realtime(text, emphasis, &self.realtime);
    }
}

/// The histograms of wake-up latency and SYNC release error, one above the other on one axis of time. All axes are logarithmic, so that a
/// single late cycle among millions is visible.
pub fn histograms(text: &mut String, emphasis: Emphasis, wake: &LatencyReport, sync: &LatencyReport) {
    for (title, latency) in [("wake-up latency (cycles, logarithmic)", wake), ("SYNC release error", sync)] {
        line(text, &emphasis.heading(&format!("       {title}")));
        bars(latency).iter().for_each(|row| line(text, row));
    }
    let decade = format!("┬{:─<width$}", "", width = RANGES_PER_DECADE - 1);
    line(text, &format!("{:>6}└{}┬", "", decade.repeat(DECADES)));
    let labels: String =
        DECADE_LABELS.iter().map(|label| format!("{label:<width$}", width = RANGES_PER_DECADE)).collect();
    line(text, &format!("{:>6} {labels}", ""));
}

/// A table of the latencies of a cycle: wake-up, SYNC, computing, and set-points; then the callbacks, where one was called. Where
/// several groups have called some, each of these has a row.
pub(crate) fn cycle_latencies<'a>(
    text: &mut String,
    emphasis: Emphasis,
    [wake, sync, compute, sent]: [&LatencyReport; 4],
    callback: Option<&'a LatencyReport>,
    groups: impl Iterator<Item = (&'a str, Option<&'a LatencyReport>)>,
) {
    let groups: Vec<(String, &LatencyReport)> = groups
        .filter_map(|(name, callback)| Some((shortened(&format!("callback, {name}"), 20), callback?)))
        .collect();
    let mut rows =
        vec![("wake-up", wake), ("SYNC release", sync), ("computing", compute), ("set-points out at", sent)];
    match &groups[..] {
        [] | [_] => rows.extend(callback.map(|callback| ("callback", callback))),
        several => rows.extend(several.iter().map(|(name, callback)| (name.as_str(), *callback))),
    }
    latency_table(text, emphasis, &rows);
}

/// Why a group stopped, what it was doing, and when.
fn stop_words(stop: &StopReport) -> String {
    format!("{} while {} (slot {})", stop.reason, stop.phase, stop.slot)
}

/// A table with one row for each latency.
pub fn latency_table(text: &mut String, emphasis: Emphasis, rows: &[(&str, &LatencyReport)]) {
    let titles = ["latency", "min", "median", "99 %", "99.9 %", "max"].map(str::to_owned);
    line(text, &emphasis.heading(&latency_row(titles)));
    for (name, latency) in rows {
        let times = [latency.min, latency.p50, latency.p99, latency.p999, latency.max].map(duration);
        let [min, p50, p99, p999, max] = times;
        line(text, &latency_row([(*name).to_owned(), min, p50, p99, p999, max]));
    }
}

/// The number of missed slots, out of all slots, and whether that is good.
pub fn missed_slots(text: &mut String, emphasis: Emphasis, missed: u64, cycles: u64) {
    let words = format!("{missed} of {}", cycles + missed);
    let words = format!("{:<20}{words:>12}", "missed slots");
    if missed == 0 {
        line(text, &words);
        // Without a cycle there is nothing to judge.
        if cycles > 0 {
            wrap(text, "timing", 6, &["good: no slot was missed".to_owned()]);
        }
        return;
    }
    line(text, &emphasis.bad(&words));
    let cure = "not good: slots were missed; `takt doctor` says what this computer lacks for real time";
    wrap(text, &emphasis.bad("timing"), 6, &[cure.to_owned()]);
}

/// The real-time set-up that the operating system granted, and the commands that grant the rest.
pub fn realtime(text: &mut String, emphasis: Emphasis, realtime: &RealtimeReport) {
    wrap(text, &emphasis.heading("real-time"), 9, &realtime_lines(realtime));
    for command in &realtime.grant_with {
        line(text, &format!("{:INDENT$}  {command}", ""));
    }
}

fn realtime_lines(realtime: &RealtimeReport) -> Vec<String> {
    let mut thread = realtime.policy.clone();
    if let Some(priority) = realtime.priority {
        let _ = write!(thread, " {priority}");
    }
    if let Some(cpu) = realtime.cpu {
        let _ = write!(thread, " on CPU {cpu}");
    }
    let memory = if realtime.memory_locked { "memory locked" } else { "memory not locked" };
    let kernel = if realtime.preempt_rt { "PREEMPT_RT kernel" } else { "kernel without PREEMPT_RT" };
    let mut lines = vec![format!("{thread}, {memory}, {kernel}, {} page faults", realtime.page_faults)];
    lines.extend(realtime.refused.iter().map(|step| format!("refused: {step}")));
    if !realtime.grant_with.is_empty() {
        lines.push("to grant it:".to_owned());
    }
    lines
}

/// The bars of a histogram, with their counts.
fn bars(latency: &LatencyReport) -> Vec<String> {
    let most = latency.histogram.iter().copied().max().unwrap_or(0);
    let height = |count: u64| match (count, most) {
        (0, _) => 0,
        (_, 1) => ROWS * 8,
        _ => {
            let share = (count as f64).ln() / (most as f64).ln();
            1 + (share * (ROWS * 8 - 1) as f64).round() as usize
        }
    };
    let heights: Vec<usize> = latency.histogram.iter().copied().map(height).collect();
    let row = |row: usize| {
        let label = match row {
            _ if row == ROWS - 1 && most > 1 => short_count(most),
            0 if most > 0 => "1".to_owned(),
            _ => String::new(),
        };
        let bar = |height: &usize| EIGHTHS[height.saturating_sub(row * 8).min(8)];
        format!("{label:>6}┤{}", heights.iter().map(bar).collect::<String>())
    };
    (0..ROWS).rev().map(row).collect()
}

fn latency_row([name, min, p50, p99, p999, max]: [String; 6]) -> String {
    format!("{name:<20}{min:>12}{p50:>12}{p99:>12}{p999:>12}{max:>12}")
}

fn axis_row(axis: &AxisReport) -> String {
    let milli = if axis.unit == "m" { "mm" } else { "mrad" };
    let (largest, circumstances) =
        match (axis.following_error_max, axis.following_error_at_s, axis.following_error_velocity) {
            (Some(error), Some(at_s), Some(velocity)) => {
                let decimals = if at_s < 1000.0 { 2 } else { 0 };
                let mut circumstances = format!("{at_s:.decimals$} s, {velocity:+.2} {}/s", axis.unit);
                // A following error that is proportional to the velocity is a delay.
                let behind_ms = 1e3 * error / velocity.abs();
                if velocity.abs() > 1e-3 && behind_ms < 1000.0 {
                    let _ = write!(circumstances, " = {behind_ms:.1} ms late");
                }
                (format!("{:.3} {milli}", error * 1e3), circumstances)
            }
            _ => ("never enabled".to_owned(), String::new()),
        };
    format!("{:<16}{largest:>16}   {circumstances}", shortened(&axis.name, 16))
}

/// The final position and the counts that it is off its target, if the drive has reported it.
fn final_columns(axis: &AxisReport) -> String {
    let (Some(position), Some(off)) = (axis.final_position, axis.final_error_counts) else {
        return axis
            .final_report_slot
            .map_or_else(|| "  never reported".to_owned(), |slot| format!("  none since slot {slot}"));
    };
    // Rounding first and then adding 0 avoids "-0".
    let rounded = (position * 1e5).round() / 1e5 + 0.0;
    let (position, off) = (format!("{rounded:.5} {}", axis.unit), format!("{off:+.1}"));
    format!("{position:>16}{off:>12}")
}

/// A fraction of a limit, as text.
pub(super) fn part(part: Option<f64>) -> String {
    part.map_or_else(|| "no limit".to_owned(), |part| format!("{:.2} %", 100.0 * part))
}

/// The largest set-points as parts of the limits, and where the axis ended.
fn end_row(axis: &AxisReport) -> String {
    let SetPointParts { velocity, acceleration, jerk } = axis.set_point_part;
    let [velocity, acceleration, jerk] = [velocity, acceleration, jerk].map(part);
    let (name, end) = (shortened(&axis.name, 16), final_columns(axis));
    format!("{name:<16}{velocity:>11}{acceleration:>14}{jerk:>11}{end}")
}

fn bus_row(bus: &BusReport) -> String {
    let (name, interface) = (shortened(&bus.name, 12), shortened(&bus.interface, 9));
    let (load, overruns) = (format!("{:.1} %", bus.load_percent), bus.tx_overruns + bus.rx_overruns);
    format!(
        "{name:<12}{interface:<9}{load:>8}{:>10}{:>10}{overruns:>9}{:>7}  {}",
        bus.tx_frames, bus.rx_frames, bus.errors, bus.state
    )
}

/// A name that is shortened so that a space remains in its column.
pub(super) fn shortened(name: &str, columns: usize) -> String {
    if name.chars().count() < columns {
        return name.to_owned();
    }
    name.chars().take(columns - 2).chain(['…']).collect()
}

/// A count in at most five characters.
fn short_count(count: u64) -> String {
    match count {
        0..=99_999 => count.to_string(),
        100_000..=999_999 => format!("{}k", count / 1_000),
        1_000_000..=999_999_999 => format!("{}M", count / 1_000_000),
        _ => format!("{}G", count / 1_000_000_000),
    }
}

/// A time with three digits and its unit.
pub fn duration(ns: u64) -> String {
    let (value, unit) = match ns {
        0..=999 => return format!("{ns} ns"),
        1_000..=999_999 => (ns as f64 * 1e-3, "µs"),
        1_000_000..=999_999_999 => (ns as f64 * 1e-6, "ms"),
        _ => (ns as f64 * 1e-9, "s"),
    };
    let decimals = if value < 9.995 { 2 } else { usize::from(value < 99.95) };
    format!("{value:.decimals$} {unit}")
}

/// A size with its unit.
fn bytes(count: u64) -> String {
    match count {
        0..=999 => format!("{count} bytes"),
        1_000..=999_999 => format!("{:.1} kB", count as f64 * 1e-3),
        1_000_000..=999_999_999 => format!("{:.1} MB", count as f64 * 1e-6),
        _ => format!("{:.2} GB", count as f64 * 1e-9),
    }
}

pub fn line(text: &mut String, line: &str) {
    text.push_str(line.trim_end());
    text.push('\n');
}

/// Writes lines behind a label, which has `label_columns` visible characters. A long line is broken between words.
pub(crate) fn wrap(text: &mut String, label: &str, label_columns: usize, lines: &[String]) {
    let mut label = format!("{label}{:width$}", "", width = INDENT - label_columns);
    for words in lines {
        paragraph(text, &label, words, INDENT, INDENT + 2);
        label = " ".repeat(INDENT);
    }
}

/// Writes words behind a label of `indent` visible characters, broken between words where a line gets too long; the lines after the first
/// begin at `hanging`.
pub fn paragraph(text: &mut String, label: &str, words: &str, indent: usize, hanging: usize) {
    let mut current = label.to_owned();
    let (mut begin, mut columns) = (indent, indent);
    // A number stays with its unit: the space between them is no place for a break.
    let whole = UNITS
        .iter()
        .fold(words.to_owned(), |words, unit| words.replace(&format!(" {unit}"), &format!("\u{a0}{unit}")));
    for word in whole.split(' ') {
        let length = word.chars().count();
        if columns > begin && columns + 1 + length > COLUMNS {
            line(text, &current);
            current = " ".repeat(hanging);
            (begin, columns) = (hanging, hanging);
        } else if columns > begin {
            current.push(' ');
            columns += 1;
        }
        current.extend(word.chars().map(|letter| if letter == '\u{a0}' { ' ' } else { letter }));
        columns += length;
    }
    line(text, &current);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_three_digits_and_a_unit() {
        let cases = [
            (0, "0 ns"),
            (999, "999 ns"),
            (1_234, "1.23 µs"),
            (9_996, "10.0 µs"),
            (99_960, "100 µs"),
            (999_400, "999 µs"),
            (28_013_505, "28.0 ms"),
            (3_000_000_000, "3.00 s"),
        ];
        for (ns, text) in cases {
            assert_eq!(duration(ns), text);
        }
    }

    #[test]
    fn a_single_late_cycle_among_millions_shows_in_the_histogram() {
        let mut latency =
            LatencyReport { histogram: vec![0; RANGES_PER_DECADE * DECADES], ..Default::default() };
        latency.histogram[8] = 5_000_000;
        latency.histogram[9] = 2_000;
        latency.histogram[32] = 1;
        let rows = bars(&latency);
        assert_eq!(rows[0], format!("    5M┤{:36}", "        █"));
        assert_eq!(rows[1], format!("      ┤{:36}", "        █▄"));
        assert_eq!(rows[2], format!("     1┤{:36}", "        ██                      ▁"));
    }

    #[test]
    fn long_lines_are_broken_between_words_and_commands_are_not_broken() {
        let mut text = String::new();
        wrap(&mut text, "why", 3, &["word ".repeat(40), "x".repeat(120)]);
        let lines: Vec<_> = text.lines().collect();
        assert!(lines[..lines.len() - 1].iter().all(|line| line.chars().count() <= COLUMNS), "{text}");
        assert_eq!(text.matches("word").count(), 40);
        assert_eq!(lines.last().unwrap().trim(), "x".repeat(120));
    }

    #[test]
    fn long_names_are_cut_with_an_ellipsis() {
        assert_eq!(shortened("joint", 6), "joint");
        assert_eq!(shortened("joint1", 6), "join…");
    }
}
