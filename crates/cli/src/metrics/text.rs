//! The text exposition format of Prometheus, version 0.0.4.

use std::fmt::{Display, Write};

use takt_rt::Nanoseconds;

use takt::telemetry::{TIME_BOUNDS_NS, TimeCounts};

/// The kinds of families that are used here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Goes up and down.
    Gauge,
    /// Only goes up, from the start of the run.
    Counter,
}

/// Labels and their values.
pub type Labels<'a> = &'a [(&'a str, &'a str)];

/// A text that is being made.
#[derive(Debug, Default)]
pub struct Exposition(String);

impl Exposition {
    /// Begins a family: what follows until the next one belongs to it. All samples of a family stand together.
    pub fn family(&mut self, name: &str, kind: Kind, help: &str) -> Family<'_> {
        let kind = match kind {
            Kind::Gauge => "gauge",
            Kind::Counter => "counter",
        };
        self.heading(name, kind, help);
        Family { text: &mut self.0, name: name.to_owned() }
    }

    /// A histogram of times, in seconds.
    pub fn histogram(&mut self, name: &str, help: &str, times: &TimeCounts) {
        self.heading(name, "histogram", help);
        let text = &mut self.0;
        let mut up_to_here = 0;
        for (bound_ns, count) in TIME_BOUNDS_NS.iter().zip(times.counts) {
            up_to_here += count;
            let bound = seconds(*bound_ns);
            let _ = writeln!(text, "{name}_bucket{{le=\"{bound}\"}} {up_to_here}");
        }
        let (all, sum) = (times.count(), seconds(times.sum_ns));
        let _ = writeln!(text, "{name}_bucket{{le=\"+Inf\"}} {all}\n{name}_sum {sum}\n{name}_count {all}");
    }

    fn heading(&mut self, name: &str, kind: &str, help: &str) {
        let _ = writeln!(self.0, "# HELP {name} {help}\n# TYPE {name} {kind}");
    }

    /// The text.
    pub fn into_text(self) -> String {
        self.0
    }
}

/// A family that is being written.
pub struct Family<'a> {
    text: &'a mut String,
    name: String,
}

impl Family<'_> {
    /// Adds a sample.
    pub fn sample(&mut self, labels: Labels<'_>, value: impl Display) -> &mut Self {
        self.text.push_str(&self.name);
        for (number, (name, value)) in labels.iter().enumerate() {
            let sign = if number == 0 { '{' } else { ',' };
            let _ = write!(self.text, "{sign}{name}=\"{}\"", escaped(value));
        }
        let close = if labels.is_empty() { "" } else { "}" };
        let _ = writeln!(self.text, "{close} {value}");
        self
    }

    /// Adds a sample for each of several states, of which one is: that has 1, the others 0.
    pub fn states<'s>(&mut self, labels: Labels<'_>, states: impl Iterator<Item = &'s str>, present: &str) {
        for state in states {
            let labels = [labels, &[("state", state)]].concat();
            self.sample(&labels, u8::from(state == present));
        }
    }
}

/// Seconds, as the shortest number that says it.
pub fn seconds(ns: Nanoseconds) -> f64 {
    ns as f64 / 1e9
}

/// The value of a label as it stands between quotation marks.
fn escaped(value: &str) -> String {
    value.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_labels_and_values_stand_as_the_format_has_them() {
        let mut text = Exposition::default();
        text.family("takt_x_total", Kind::Counter, "Something.").sample(&[], 3);
        text.family("takt_y", Kind::Gauge, "More.").sample(&[("axis", "a\"b\\c\nd"), ("unit", "rad")], -0.5);
        text.family("takt_s", Kind::Gauge, "State.").states(
            &[("bus", "left")],
            ["up", "down"].into_iter(),
            "down",
        );
        let expected = "# HELP takt_x_total Something.\n# TYPE takt_x_total counter\ntakt_x_total 3\n\
                        # HELP takt_y More.\n# TYPE takt_y gauge\ntakt_y{axis=\"a\\\"b\\\\c\\nd\",unit=\"rad\"} -0.5\n\
                        # HELP takt_s State.\n# TYPE takt_s gauge\n\
                        takt_s{bus=\"left\",state=\"up\"} 0\ntakt_s{bus=\"left\",state=\"down\"} 1\n";
        assert_eq!(text.into_text(), expected);
    }

    #[test]
    fn a_histogram_counts_up_and_ends_with_all() {
        let mut times = TimeCounts::default();
        [400, 1_500, 1_600, 50_000_000].into_iter().for_each(|ns| times.add(ns));
        let mut text = Exposition::default();
        text.histogram("takt_wake_seconds", "Late.", &times);
        let text = text.into_text();
        for line in [
            "takt_wake_seconds_bucket{le=\"0.0000005\"} 1\n",
            "takt_wake_seconds_bucket{le=\"0.000002\"} 3\n",
            "takt_wake_seconds_bucket{le=\"0.01\"} 3\n",
            "takt_wake_seconds_bucket{le=\"+Inf\"} 4\n",
            "takt_wake_seconds_sum 0.0500035\n",
            "takt_wake_seconds_count 4\n",
        ] {
            assert!(text.contains(line), "{line}{text}");
        }
    }
}
