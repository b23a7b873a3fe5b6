//! The output of a procedure: progress, frames, and the result.

use std::io::{BufRead, IsTerminal, Read, stderr, stdin, stdout};

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde_json::json;

use takt::config::Quantity;
use takt_rt::{Frame, Nanoseconds};
use takt_tools::commission::bus_session::SessionEvent;
use takt_tools::commission::{
    AxisReading, Failure, ProcedureError, ProcedureEvent, Report, ReportItem, TargetDrive,
};

use super::super::columns::{columns, paragraph};
use super::super::exit::Exit;
use super::super::print;
use super::options::Options;

/// Bytes of an answer to a question.
const LONGEST_ANSWER: u64 = 100;

/// Shows a procedure and its result.
pub struct Output {
    target: TargetDrive,
    action: &'static str,
    options: Options,
    line: ProgressBar,
    step: &'static str,
    notes: Vec<String>,
    /// Describes a frame.
    words: Box<dyn FnMut(&Frame) -> String>,
    /// The exit code if readings can no longer be printed.
    unshown: Option<Exit>,
}

#[derive(Serialize)]
struct Printed<'a> {
    axis: &'a str,
    node: u8,
    family: &'static str,
    action: &'static str,
    /// `done`, `interrupted`, `refused` or `failed`.
    ended: &'static str,
    /// The step that failed.
    step: Option<&'static str>,
    failure: Option<String>,
    advice: Option<&'static str>,
    notes: &'a [String],
    result: Option<&'a Report>,
}

impl Output {
    /// For one action on one drive.
    pub fn new(target: &TargetDrive, action: &'static str, options: Options) -> Self {
        let line = if stderr().is_terminal() && !options.verbose {
            let line = ProgressBar::new_spinner();
            if let Ok(style) = ProgressStyle::with_template("{prefix}  {wide_msg}") {
                line.set_style(style);
            }
            line.set_prefix(target.name.clone());
            line
        } else {
            ProgressBar::hidden()
        };
        let words = Box::new(|_: &Frame| String::new());
        Self { target: target.clone(), action, options, line, step: "", notes: vec![], words, unshown: None }
    }

    /// Describes frames from now on like this.
    pub fn describe_frames(&mut self, words: Box<dyn FnMut(&Frame) -> String>) {
        self.words = words;
    }

    /// Asks the user whether to do what has this consequence. Without a terminal there is nobody to ask.
    pub fn asks_for(&self, consequence: &str) -> bool {
        if self.options.json || !stdin().is_terminal() || !stderr().is_terminal() {
            return false;
        }
        self.line.suspend(|| {
            say!("{consequence}\nDo it? [y/N]");
            let mut answer = String::new();
            let is_read = stdin().lock().take(LONGEST_ANSWER).read_line(&mut answer).is_ok();
            is_read && matches!(answer.trim().to_lowercase().as_str(), "y" | "yes")
        })
    }

    /// Shows what has just happened. Returns whether readings can still be printed.
    pub fn see(&mut self, at_ns: Nanoseconds, seen: SessionEvent) -> bool {
        match seen {
            SessionEvent::Procedure(ProcedureEvent::Step(name)) => {
                self.step = name;
                self.line.set_message(name);
                if self.options.verbose {
                    say!("{} ── {name}", seconds(at_ns));
                }
            }
            SessionEvent::Procedure(ProcedureEvent::Note(text)) => self.hint(&text),
            SessionEvent::Procedure(ProcedureEvent::Progress { .. }) => {}
            SessionEvent::Procedure(ProcedureEvent::Reading(reading)) => self.read(at_ns, &reading),
            SessionEvent::Sent(frame) => self.frame(at_ns, '>', &frame),
            SessionEvent::Received(frame) => self.frame(at_ns, '<', &frame),
        }
        self.unshown.is_none()
    }

    /// Prints a note.
    pub fn hint(&mut self, text: &str) {
        self.notes.push(text.to_owned());
        if !self.options.json {
            self.line.suspend(|| say!("note: {text}"));
        }
    }

    fn frame(&mut self, at_ns: Nanoseconds, direction: char, frame: &Frame) {
        if self.options.verbose {
            let (frame, words) = (format!("{frame:?}"), (self.words)(frame));
            say!("{} {direction} {frame:<21}  {words}", seconds(at_ns));
        }
    }

    fn read(&mut self, at_ns: Nanoseconds, reading: &AxisReading) {
        let is_watched = self.action == "watch";
        // Into a file or a pipe, all readings are printed, whatever the terminal shows meanwhile.
        let has_lines = self.line.is_hidden() || !stdout().is_terminal();
        if is_watched && self.options.json {
            self.print(&format!("{}\n", self.reading_json(at_ns, reading)));
        } else if is_watched && has_lines {
            self.print(&format!("{}  {}\n", seconds(at_ns), self.reading_words(reading)));
        } else {
            self.line.set_message(self.live_words(reading));
        }
    }

    /// A reading for the line that is overwritten: as much as the terminal has room for.
    fn live_words(&self, reading: &AxisReading) -> String {
        let whole = format!("{}: {}", self.step, self.reading_words(reading));
        let used = self.target.name.chars().count() + 2;
        match columns().map(usize::from) {
            Some(columns) if used + whole.chars().count() > columns => self.short_words(reading),
            _ => whole,
        }
    }

    fn print(&mut self, reading: &str) {
        self.unshown = self.unshown.or_else(|| match print::write(reading) {
            Ok(true) => None,
            Ok(false) => Some(Exit::Done),
            Err(error) => Some(print::unwritten(&error, Exit::Done)),
        });
    }

    fn reading_json(&self, at_ns: Nanoseconds, reading: &AxisReading) -> serde_json::Value {
        json!({
            "time_s": at_ns as f64 / 1e9, "position": reading.position,
            "position_counts": reading.position_counts, "velocity": reading.velocity,
            "torque": reading.torque, "current_a": reading.current_a, "temperature_c": reading.temperature_c,
            "statusword": reading.statusword, "state": reading.state,
        })
    }

    fn reading_words(&self, reading: &AxisReading) -> String {
        let position = in_column(self.target.position_quantity(), reading.position);
        let velocity = in_column(self.target.velocity_quantity(), reading.velocity);
        let mut words = format!("{position}  {velocity}");
        if let Some(torque) = reading.torque {
            words = format!("{words}  {}", in_column(self.target.effort_quantity(), torque));
        }
        if let Some(current) = reading.current_a {
            words = format!("{words}  {current:>8.3} A");
        }
        if let Some(temperature) = reading.temperature_c {
            words = format!("{words}  {temperature:>4.0} °C");
        }
        let statusword = reading.statusword.map_or_else(String::new, |word| format!("0x{word:04X} "));
        format!("{words}  {statusword}{}", reading.state)
    }

    /// In one unit each, what matters most first.
    fn short_words(&self, reading: &AxisReading) -> String {
        let position = in_short_column(self.target.position_quantity(), reading.position);
        let velocity = in_short_column(self.target.velocity_quantity(), reading.velocity);
        let mut words = format!("{position}  {velocity}");
        if let Some(torque) = reading.torque {
            words = format!("{words}  {torque:>7.2} {}", self.target.effort_quantity().unit);
        } else if let Some(current) = reading.current_a {
            words = format!("{words}  {current:>7.2} A");
        }
        words = format!("{words}  {}", reading.state);
        match reading.temperature_c {
            Some(temperature) => format!("{words}  {temperature:.0} °C"),
            None => words,
        }
    }

    /// Reports that the procedure was not begun.
    pub fn refuse(&mut self, failure: &Failure) -> Exit {
        self.finish(&Err(ProcedureError { step: "command line", failure: failure.clone() }))
    }

    /// Shows the result.
    pub fn finish(&mut self, outcome: &Result<Report, ProcedureError>) -> Exit {
        self.line.finish_and_clear();
        let (ended, exit) = match outcome {
            Ok(_) => ("done", Exit::Done),
            Err(ProcedureError { failure: Failure::Interrupted, .. }) => {
                ("interrupted", self.unshown.unwrap_or(Exit::Interrupted))
            }
            Err(failed) if failed.failure.is_refusal() => ("refused", Exit::Usage),
            Err(_) => ("failed", Exit::Stopped),
        };
        if self.options.json {
            return self.finish_json(outcome, ended, exit);
        }
        match outcome {
            Ok(report) => print::text(&render(report), exit),
            Err(failed) => {
                self.say_failed(failed);
                exit
            }
        }
    }

    fn finish_json(&self, outcome: &Result<Report, ProcedureError>, ended: &'static str, exit: Exit) -> Exit {
        let failed = outcome.as_ref().err();
        // A watch has printed its readings, one object each; only what went wrong is left to say.
        if self.action == "watch" && failed.is_none_or(|failed| failed.failure == Failure::Interrupted) {
            return exit;
        }
        let printed = Printed {
            axis: &self.target.name,
            node: self.target.node,
            family: self.target.drive.word,
            action: self.action,
            ended,
            step: failed.map(|failed| failed.step),
            failure: failed.map(|failed| failed.failure.to_string()),
            advice: failed.and_then(|failed| failed.failure.advice()),
            notes: &self.notes,
            result: outcome.as_ref().ok(),
        };
        print::json(&printed, exit)
    }

    fn say_failed(&self, failed: &ProcedureError) {
        let name = &self.target.name;
        match &failed.failure {
            Failure::Interrupted if self.action == "watch" => {}
            Failure::Interrupted => say!("takt: {name}: interrupted in `{}`", failed.step),
            failure => {
                // A request that is refused before the first frame has no step.
                let step = if failure.is_refusal() { String::new() } else { format!(", {}", failed.step) };
                say!("takt: {name}{step}: {failure}");
                if let Some(advice) = failure.advice() {
                    say!("  try: {advice}");
                }
            }
        }
    }
}

/// A value with as many letters as others of its quantity have, so that readings can be compared line by line.
fn in_column(quantity: Quantity, value: f64) -> String {
    let unit = quantity.unit;
    if unit.starts_with("rad") {
        let degrees = unit.replace("rad", "deg");
        format!("{value:>9.4} {unit} ({:>9.2} {degrees})", value.to_degrees())
    } else {
        format!("{value:>9.4} {unit}")
    }
}

/// The same in one unit, for narrow terminals.
fn in_short_column(quantity: Quantity, value: f64) -> String {
    let unit = quantity.unit;
    match unit.starts_with("rad") {
        true => format!("{:>8.2} {}", value.to_degrees(), unit.replace("rad", "deg")),
        false => format!("{value:>8.4} {unit}"),
    }
}

fn seconds(at_ns: Nanoseconds) -> String {
    format!("{:11.6}", at_ns as f64 / 1e9)
}

/// A report in aligned lines.
pub fn render(report: &Report) -> String {
    let findings = report.items();
    let width = findings.iter().map(|finding| finding.label.chars().count()).max().unwrap_or(0);
    let line = |finding: &ReportItem| {
        let line = format!("  {:<width$}  {}", finding.label, finding.text);
        paragraph(&line, width + 4) + "\n"
    };
    findings.iter().map(line).collect()
}
