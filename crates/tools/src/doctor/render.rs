//! The result of all checks as text.

use super::examination::Examination;
use super::finding::{Finding, Group, Verdict};
use super::self_test::{Grade, SelfTest};
use takt::telemetry::Emphasis;
use takt::telemetry::render::{self, duration, line};

/// Where the text of a check begins: mark, title.
const INDENT: usize = 24;

impl Examination {
    /// The findings as text of at most 80 columns (but for commands, which are not broken).
    pub fn render(&self, emphasis: Emphasis) -> String {
        let mut text = String::new();
        let class =
            self.priority.map_or("the normal class".to_owned(), |priority| format!("SCHED_FIFO {priority}"));
        let what = format!("a loop of {} at {class} on CPU {}", duration(self.cycle_ns), self.cpu);
        line(&mut text, &format!("{}  is this machine fit for {what}?", emphasis.heading("doctor")));
        let mut seen: Vec<&str> = vec![];
        let mut section = String::new();
        for check in &self.checks {
            let title = section_of(check);
            if title != section {
                line(&mut text, "");
                line(&mut text, &emphasis.heading(&title));
                section = title;
            }
            show(&mut text, emphasis, check, &mut seen);
        }
        if let Some(self_test) = &self.self_test {
            line(&mut text, "");
            line(&mut text, &emphasis.heading("self-test"));
            show_self_test(&mut text, emphasis, self_test);
        }
        line(&mut text, "");
        line(&mut text, &self.conclusion(emphasis));
        text
    }

    fn conclusion(&self, emphasis: Emphasis) -> String {
        let count = |verdict| self.checks.iter().filter(|check| check.verdict == verdict).count();
        let (bad, better) = (count(Verdict::ForbidsRealTime), count(Verdict::CouldBeBetter));
        let things = |count: usize| if count == 1 { "1 thing".to_owned() } else { format!("{count} things") };
        let better = match better {
            0 => String::new(),
            better => format!("; {} could be better", things(better)),
        };
        match (self.verdict, bad) {
            (Verdict::ForbidsRealTime, 0) => emphasis.bad(&format!("✗ the self-test missed slots{better}")),
            (Verdict::ForbidsRealTime, bad) => {
                let verb = if bad == 1 { "forbids" } else { "forbid" };
                emphasis.bad(&format!("✗ {} {verb} real time{better}", things(bad)))
            }
            _ => emphasis.good(&format!("✓ nothing forbids real time{better}")),
        }
    }
}

fn section_of(check: &Finding) -> String {
    match (&check.interface, check.group) {
        (Some(interface), _) => interface.clone(),
        (None, Group::Kernel) => "kernel".to_owned(),
        (None, Group::Rights) => "rights of this process".to_owned(),
        (None, Group::Processor) => "processor".to_owned(),
        (None, Group::Isolation) => "a CPU for the loop alone".to_owned(),
        (None, Group::Memory) => "memory".to_owned(),
        (None, Group::Can) => "CAN".to_owned(),
        (None, Group::Serial) => "serial adapters".to_owned(),
    }
}

fn mark(emphasis: Emphasis, verdict: Verdict) -> String {
    match verdict {
        Verdict::Good => emphasis.good("✓"),
        Verdict::CouldBeBetter => emphasis.heading("!"),
        Verdict::ForbidsRealTime => emphasis.bad("✗"),
        Verdict::NotKnown => "–".to_owned(),
    }
}

/// One check: what was read, and where it is not good, why that matters and what mends it. A command that has been
/// shown before is not shown again.
fn show<'a>(text: &mut String, emphasis: Emphasis, check: &'a Finding, seen: &mut Vec<&'a str>) {
    let label = format!("{} {:<width$}", mark(emphasis, check.verdict), check.title, width = INDENT - 4);
    paragraph(text, &format!("  {label}"), &check.read);
    if check.verdict == Verdict::Good {
        return;
    }
    let space = " ".repeat(INDENT);
    if check.verdict != Verdict::NotKnown {
        paragraph(text, &space, check.why);
    }
    for command in &check.mend {
        if seen.contains(&command.as_str()) {
            line(text, &format!("{space}→ the same command as above"));
        } else {
            line(text, &format!("{space}→ {command}"));
            seen.push(command);
        }
    }
}

fn show_self_test(text: &mut String, emphasis: Emphasis, test: &SelfTest) {
    let (verdict, grade) = match test.grade {
        Grade::Excellent => (Verdict::Good, "excellent"),
        Grade::Good => (Verdict::Good, "good"),
        Grade::Fair => (Verdict::CouldBeBetter, "fair"),
        Grade::Poor => (Verdict::ForbidsRealTime, "poor"),
    };
    let sync = &test.pass.sync_ns;
    let [median, p999, max] = [sync.p50, sync.p999, sync.max].map(duration);
    let label = format!("  {} {grade:<width$}", mark(emphasis, verdict), width = INDENT - 4);
    let cut = if test.is_whole { "" } else { " (interrupted)" };
    let read = format!("SYNC off its grid by {median} (median), {p999} (99.9 %), {max} (at most){cut}");
    paragraph(text, &label, &read);
    let missed = test.pass.missed_slots;
    let slots = test.pass.cycles + missed;
    paragraph(
        text,
        &" ".repeat(INDENT),
        &format!(
            "{missed} of {slots} slots missed; the timer woke the loop within {}",
            duration(test.pass.wake_ns.max)
        ),
    );
    if verdict != Verdict::Good {
        line(text, &format!("{}→ takt jitter --svg jitter.svg   # draws the histograms", " ".repeat(INDENT)));
    }
}

/// Writes words behind a label that is as wide as the indent.
fn paragraph(text: &mut String, label: &str, words: &str) {
    render::paragraph(text, label, words, INDENT, INDENT);
}
