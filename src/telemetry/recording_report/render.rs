//! Renders the report of a recording as text for people.

use takt_rt::Rule;

use super::{AxisCycle, BusLoadSummary, GroupSummary, RecordingReport};
use crate::telemetry::render::{self, Emphasis, cycle_latencies, line, missed_slots, paragraph, wrap};
use crate::telemetry::report::SetPointParts;
use crate::telemetry::words;

/// The numbers of events that are shown before the cause, and after it.
const EVENTS: (usize, usize) = (24, 12);

impl RecordingReport {
    /// The report as text of at most 80 columns. Paths are not broken and may be longer.
    pub fn render(&self, emphasis: Emphasis) -> String {
        let mut text = String::new();
        let kind = if self.is_black_box { "black box" } else { "recording" };
        let cycle_ms = self.cycle_ns as f64 * 1e-6;
        let begins = self.begins.as_ref().map_or_else(String::new, |begins| format!(" from {begins}"));
        let heading = emphasis.heading(&self.machine);
        let cycles = format!("{heading}  {kind} of {} cycles of {cycle_ms} ms{begins}", self.cycles);
        line(&mut text, &cycles);
        let (from_s, to_s) = self.span_s;
        if from_s > 0.0 {
            line(&mut text, &format!("from {from_s:.3} s to {to_s:.3} s of it"));
        }
        for warning in &self.warnings {
            wrap(&mut text, &emphasis.bad("file"), 4, std::slice::from_ref(warning));
        }
        match &self.cause {
            Some(cause) if cause.rule == words::rule_key(Rule::Requested) => {
                wrap(&mut text, "stop", 4, &[format!("{} (slot {})", cause.reason, cause.slot)]);
            }
            Some(cause) => {
                wrap(
                    &mut text,
                    &emphasis.bad("why"),
                    3,
                    &[format!("{} (slot {})", cause.reason, cause.slot)],
                );
            }
            None => wrap(&mut text, "stop", 4, &["none".to_owned()]),
        }
        self.group_lines(&mut text, emphasis);
        self.event_table(&mut text, emphasis);
        self.axis_table(&mut text, emphasis);
        self.load_lines(&mut text, emphasis);
        self.axis_cycles(&mut text, emphasis);
        line(&mut text, "");
        let cycle = [&self.wake_ns, &self.sync_ns, &self.compute_ns, &self.sent_ns];
        let groups = self.groups.iter().map(|group| (group.name.as_str(), group.callback_ns.as_ref()));
        cycle_latencies(&mut text, emphasis, cycle, self.callback_ns.as_ref(), groups);
        missed_slots(&mut text, emphasis, self.missed_slots, self.cycles);
        self.bus_table(&mut text, emphasis);
        text
    }

    /// Why each of several groups stopped first, and what it was doing in the end.
    fn group_lines(&self, text: &mut String, emphasis: Emphasis) {
        let group = |group: &GroupSummary| {
            let stop = group
                .stop
                .as_ref()
                .map_or_else(|| "no stop".to_owned(), |stop| format!("{} (slot {})", stop.reason, stop.slot));
            let end = group.phase.map_or_else(String::new, |phase| format!("; {phase} at the end"));
            format!("{}: {stop}{end}", group.name)
        };
        if !self.groups.is_empty() {
            let lines: Vec<String> = self.groups.iter().map(group).collect();
            wrap(text, &emphasis.heading("groups"), 6, &lines);
        }
    }

    fn axis_cycles(&self, text: &mut String, emphasis: Emphasis) {
        let Some(axis) = self.axis.as_ref().filter(|axis| !axis.cycles.is_empty()) else { return };
        let milli = if axis.unit == "m" { "mm" } else { "mrad" };
        let until = if self.cause.is_some() { "up to the stop" } else { "at the end" };
        line(text, "");
        line(
            text,
            &emphasis.heading(&format!("{}, the last {} cycles {until}", axis.name, axis.cycles.len())),
        );
        let units =
            [axis.unit.to_owned(), axis.unit.to_owned(), format!("{}/s", axis.unit), milli.to_owned()];
        let [set, actual, velocity, error] = units;
        line(
            text,
            &emphasis.heading(&format!(
                "{:>8} {:<9}{:>10}{:>10}{:>9}{:>9}{:>6}{:>6}{:>4}",
                "slot", "phase", "set", "actual", "velocity", "error", "6041", "6040", "age"
            )),
        );
        line(text, &format!("{:>8} {:<9}{set:>10}{actual:>10}{velocity:>9}{error:>9}", "", ""));
        let mut state = "";
        for cycle in &axis.cycles {
            if cycle.state != state {
                state = cycle.state;
                line(text, &format!("{:>8} the drive: {state}", ""));
            }
            line(text, &cycle.row());
        }
    }

    fn event_table(&self, text: &mut String, emphasis: Emphasis) {
        if !self.events.is_empty() {
            line(text, "");
            line(text, &emphasis.heading(&format!("{:>8} {:>10}  event", "slot", "s")));
        }
        // Those around the cause, or the last ones.
        let end = match &self.cause {
            Some(cause) => self.events.partition_point(|event| event.slot <= cause.slot) + EVENTS.1,
            None => self.events.len(),
        };
        let end = end.min(self.events.len());
        let begin = end.saturating_sub(EVENTS.0 + EVENTS.1);
        if begin > 0 {
            line(text, &format!("{begin:>8} events before these (--html and --json have all)"));
        }
        for event in self.events.get(begin..end).unwrap_or_default() {
            let is_of_cause = self.cause.as_ref().is_some_and(|cause| cause.slot == event.slot);
            let mut row = String::new();
            let time = format!("{:>8} {:>10.3}  ", event.slot, event.at_s);
            paragraph(&mut row, &time, &event.text, 21, 23);
            let is_shown_above = is_of_cause && event.text.starts_with("stop: ");
            text.push_str(&if is_shown_above { emphasis.bad(&row) } else { row });
        }
        if end < self.events.len() {
            line(
                text,
                &format!("{:>8} events after these (--html and --json have all)", self.events.len() - end),
            );
        }
        if !self.emergencies.is_empty() {
            let lines: Vec<String> =
                self.emergencies.iter().map(|event| format!("{:.3} s: {}", event.at_s, event.text)).collect();
            line(text, "");
            wrap(text, &emphasis.heading("emergencies"), 11, &lines);
        }
    }

    fn axis_table(&self, text: &mut String, emphasis: Emphasis) {
        line(text, "");
        let titles = format!(
            "{:<16}{:>18}{:>14}{:>14}{:>12}",
            "largest", "following error", "velocity", "acceleration", "jerk"
        );
        line(text, &emphasis.heading(&titles));
        for axis in &self.axes {
            let milli = if axis.unit == "m" { "mm" } else { "mrad" };
            let error = axis.following_error_max;
            let error = error
                .map_or_else(|| "never enabled".to_owned(), |error| format!("{:.3} {milli}", error * 1e3));
            let SetPointParts { velocity, acceleration, jerk } = axis.set_point_part;
            let [velocity, acceleration, jerk] = [velocity, acceleration, jerk].map(render::part);
            let name = render::shortened(&axis.name, 16);
            line(text, &format!("{name:<16}{error:>18}{velocity:>14}{acceleration:>14}{jerk:>12}"));
        }
    }

    fn load_lines(&self, text: &mut String, emphasis: Emphasis) {
        if !self.bus_loads.is_empty() {
            let load = |bus: &BusLoadSummary| {
                let name = render::shortened(&bus.name, 16);
                format!("{name}: {:.1} % on average, {:.1} % at most", 100.0 * bus.mean, 100.0 * bus.max)
            };
            let lines: Vec<String> = self.bus_loads.iter().map(load).collect();
            line(text, "");
            wrap(text, &emphasis.heading("bus load"), 8, &lines);
        }
    }

    fn bus_table(&self, text: &mut String, emphasis: Emphasis) {
        if self.buses.is_empty() {
            return;
        }
        line(text, "");
        let titles = format!(
            "{:<14}{:>10}  {:<14}{:>7}{:>15}{:>18}",
            "bus", "s", "state", "errors", "send overruns", "receive overruns"
        );
        line(text, &emphasis.heading(&titles));
        for bus in &self.buses {
            let name = render::shortened(&bus.name, 14);
            let row = format!(
                "{name:<14}{:>10.3}  {:<14}{:>7}{:>15}{:>18}",
                bus.at_s, bus.state, bus.errors, bus.tx_overruns, bus.rx_overruns
            );
            line(text, &row);
        }
    }
}

impl AxisCycle {
    fn row(&self) -> String {
        let reported = match (self.position, self.velocity, self.following_error) {
            (Some(position), Some(velocity), Some(error)) => {
                format!("{position:>10.5}{velocity:>+9.3}{:>+9.3}{:>6}", error * 1e3, hex(self.statusword))
            }
            // What was reported last is in an earlier row.
            _ => format!("{:>28}{:>6}", "no feedback", "–"),
        };
        format!(
            "{:>8} {:<9}{:>10.5}{reported}{:>6}{:>4}",
            self.slot,
            self.phase,
            self.position_set,
            hex(self.controlword),
            self.feedback_age
        )
    }
}

fn hex(word: u16) -> String {
    format!("{word:04X}")
}
